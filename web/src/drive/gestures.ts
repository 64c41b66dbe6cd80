/** Zoom and pan over time by wheel, fingers and keys. A range is the times shown, low and high. */

export type Range = [number, number];

/** The range zoomed about a time by a factor below 1 (closer) or above (farther). */
export function zoomed([low, high]: Range, at: number, factor: number): Range {
  return [at + (low - at) * factor, at + (high - at) * factor];
}

/** The range moved by a share of its length, held inside `whole`. */
export function panned([low, high]: Range, share: number, whole: Range): Range {
  const by = Math.min(Math.max(share * (high - low), whole[0] - low), whole[1] - high);
  return [low + by, high + by];
}

/** The range in which what two fingers held before lies under them now; `before` and `now` are shares of the chart's width. */
export function pinched([low, high]: Range, before: Range, now: Range): Range {
  const length = high - low;
  const held = [low + before[0] * length, low + before[1] * length] as const;
  const apart = now[1] - now[0];
  if (Math.abs(apart) < 0.02) return [low, high];
  const scale = (held[1] - held[0]) / apart;
  const start = held[0] - now[0] * scale;
  return scale > 0 ? [start, start + scale] : [low, high];
}

/** What the gestures move. */
export interface Moved {
  range: Range;
  whole: Range;
  zoom(range: Range): void;
}

/** Ctrl or shift with the wheel zooms, a sideways wheel pans; one finger pans, two zoom. `over` is a chart's drawing area. */
export function listenToPointers(over: HTMLElement, moved: Moved): void {
  over.addEventListener(
    "wheel",
    (event) => {
      const { range, whole } = moved;
      if (event.altKey) return; // the vertical axis
      if (event.ctrlKey || event.shiftKey) {
        event.preventDefault();
        const at = range[0] + (event.offsetX / over.clientWidth) * (range[1] - range[0]);
        moved.zoom(zoomed(range, at, Math.exp((event.deltaY || event.deltaX) * 0.0015)));
      } else if (Math.abs(event.deltaX) > Math.abs(event.deltaY)) {
        event.preventDefault();
        moved.zoom(panned(range, event.deltaX / over.clientWidth, whole));
      }
    },
    { passive: false },
  );
  const fingers = new Map<number, number>();
  over.addEventListener("pointerdown", (event) => {
    if (event.pointerType === "touch") fingers.set(event.pointerId, event.offsetX / over.clientWidth);
  });
  over.addEventListener("pointermove", (event) => {
    const was = fingers.get(event.pointerId);
    if (was === undefined) return;
    const is = event.offsetX / over.clientWidth;
    const before = [...fingers.values()].sort((a, b) => a - b);
    fingers.set(event.pointerId, is);
    const now = [...fingers.values()].sort((a, b) => a - b);
    if (fingers.size === 1) moved.zoom(panned(moved.range, was - is, moved.whole));
    else if (fingers.size === 2) moved.zoom(pinched(moved.range, before as Range, now as Range));
  });
  for (const end of ["pointerup", "pointercancel", "pointerleave"] as const) over.addEventListener(end, (event) => fingers.delete(event.pointerId));
}

/** The wheel on a vertical axis (with alt also over the chart) zooms it, a drag along it moves it, a double click fits it to its values. */
export function listenToUpright(root: HTMLElement, over: HTMLElement, now: () => Range, set: (range: Range | null) => void): void {
  const place = (event: MouseEvent): { share: number; axis: boolean } => {
    const box = over.getBoundingClientRect();
    return { share: 1 - (event.clientY - box.top) / box.height, axis: event.clientX < box.left && event.clientY <= box.bottom };
  };
  root.addEventListener(
    "wheel",
    (event) => {
      const { share, axis } = place(event);
      if (!axis && !event.altKey) return;
      event.preventDefault();
      const [low, high] = now();
      set(zoomed([low, high], low + share * (high - low), Math.exp((event.deltaY || event.deltaX) * 0.0015)));
    },
    { passive: false },
  );
  let held: { share: number; range: Range } | null = null;
  root.addEventListener("pointerdown", (event) => {
    const { share, axis } = place(event);
    if (!axis) return;
    held = { share, range: now() };
    root.setPointerCapture(event.pointerId);
  });
  root.addEventListener("pointermove", (event) => {
    if (!held) return;
    const [low, high] = held.range;
    const by = (place(event).share - held.share) * (high - low);
    if (by) set([low - by, high - by]);
  });
  for (const end of ["pointerup", "pointercancel"] as const) root.addEventListener(end, () => (held = null));
  root.addEventListener("dblclick", (event) => place(event).axis && set(null));
}

/** Arrows pan by a tenth, + and - zoom, Home shows all. */
export function listenToKeys(element: HTMLElement, moved: Moved): void {
  element.tabIndex = 0;
  element.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const { range, whole } = moved;
    const middle = (range[0] + range[1]) / 2;
    const wanted: Record<string, () => Range> = {
      ArrowLeft: () => panned(range, -0.1, whole),
      ArrowRight: () => panned(range, 0.1, whole),
      "+": () => zoomed(range, middle, 0.5),
      "=": () => zoomed(range, middle, 0.5),
      "-": () => zoomed(range, middle, 2),
      Home: () => whole,
    };
    const made = wanted[event.key];
    if (!made) return;
    event.preventDefault();
    moved.zoom(made());
  });
}

/** Redrawing without losing clicks: a click counts only where the pressed element is still there when it is released. */

let pressed: Node | null = null;
const waiting = new Map<HTMLElement, () => void>();

/** Call `redraw` now, or, while a pointer is down in an element, once it is up; of several calls meanwhile only the last. */
export function onceReleased(parent: HTMLElement, redraw: () => void): void {
  if (pressed && parent.contains(pressed)) waiting.set(parent, redraw);
  else redraw();
}

function release(): void {
  pressed = null;
  setTimeout(() => {
    // behind the click that follows at once
    const due = [...waiting.values()];
    waiting.clear();
    for (const redraw of due) redraw();
  });
}

addEventListener("pointerdown", ({ target }) => (pressed = target instanceof Node ? target : null), true);
addEventListener("pointerup", release, true);
addEventListener("pointercancel", release, true);

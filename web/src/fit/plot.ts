/** The plot: three canvases one over the other (pictures, data, curves), so that a moved slider redraws the curves alone. */

import { digits, h } from "../ui/dom";
import { color, onTheme } from "../ui/theme";
import { onUnits, unitFor, withUnit } from "../ui/units";
import { CanvasInk, SvgInk, type Ink } from "../ui/ink";
import { mapOf, type Calibration, type Pixel } from "./picture";
import { Handles } from "./handles";
import { quality, targetOf } from "./quality";
import { drawAxes, drawCurve, drawFit, drawLegend, drawSoil, sameCurve } from "./scene";
import type { Change, State } from "./state";
import { View } from "../ui/view";

export class Plot {
  readonly element: HTMLElement;
  readonly view = new View();
  readonly handles: Handles;
  /** Called with slip and adhesion under a click, and the pixel of the screen. */
  onClick: ((value: Pixel, shift: boolean) => void) | null = null;
  /** Another part of the plane is shown. */
  onView: (() => void) | null = null;
  redraws = 0;
  private layers: HTMLCanvasElement[];
  private stale = new Set<number>([0, 1, 2]);
  private asked = false;
  /** Curves were not known yet when all was to be shown. */
  private unsized = false;
  private readout = h("output", { class: "readout", "aria-hidden": "true" });
  /** A line for the page: how well the active curve goes through the data. */
  readonly quality = h("p", { class: "quality", id: "quality" });
  private forgets: (() => void)[];
  private watcher: ResizeObserver;

  constructor(private state: State) {
    this.layers = [0, 1, 2].map(() => h("canvas", { "aria-hidden": "true" }));
    this.handles = new Handles(state, this.view);
    this.element = h(
      "div",
      { class: "plot", tabindex: "0", role: "group", "aria-label": "Adhesion over slip. Arrow keys move, plus and minus zoom, 0 shows all; Tab goes to the handles of the curve." },
      this.layers,
      this.readout,
      this.handles.element,
    );
    this.watcher = new ResizeObserver(() => this.resize());
    this.watcher.observe(this.element);
    this.forgets = [onTheme(() => this.redraw("all")), onUnits(() => this.redraw("all"))];
    state.on((change) => this.redraw(change));
    this.listen();
  }

  close(): void {
    this.forgets.forEach((forget) => forget());
    this.watcher.disconnect();
  }

  redraw(change: Change): void {
    const layers = { curve: [2], data: [1, 2], pictures: [0], view: [0, 1, 2], all: [0, 1, 2] }[change];
    for (const layer of layers) this.stale.add(layer);
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => this.draw());
  }

  /** Show all points, curves and marked axes, or the usual window where there are none. */
  fit(): void {
    const soils = this.state.soils.filter((soil) => soil.shown);
    const pictures = Object.values(this.state.kept.pictures).filter((picture) => picture.shown);
    const marks = (axis: "slip" | "adhesion"): number[] => pictures.flatMap((p) => p[axis]?.marks.map((mark) => mark.value) ?? []);
    const xs = [...soils.flatMap((s) => [...s.points.slip, ...s.bins.map((b) => b.slip)]), ...marks("slip")];
    const ys = [...soils.flatMap((s) => [...s.points.adhesion, ...s.bins.map((b) => b.mean + b.std)]), ...marks("adhesion")];
    const most = (values: number[], share: number): number => [...values].sort((a, b) => a - b)[Math.floor(values.length * share)] ?? 0;
    this.view.x = { low: Math.min(0, most(xs, 0.002)), high: Math.max(0.7, Math.min(most(xs, 0.998) * 1.05, 1)) };
    const curves = this.state.kept.curves.filter((curve) => curve.shown);
    const drawn = curves.map((curve) => this.state.samples.of(curve.id, curve));
    this.unsized = !curves.every((curve) => this.state.samples.isCurrent(curve.id, curve));
    const { low, high } = this.view.x;
    const values = drawn.flatMap((samples) => samples?.value.filter((_, i) => (samples.slip[i] ?? NaN) >= low && (samples.slip[i] ?? NaN) <= high) ?? []).filter((value) => value !== null);
    this.view.y = { low: Math.min(0, most(ys, 0.002), ...values), high: Math.max(ys.length ? Math.max(0.1, most(ys, 0.998) * 1.12) : 0.8, 1.05 * Math.max(0, ...values)) };
    this.redraw("view");
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.element;
    if (width < 50 || height < 50) return;
    this.view.width = width;
    this.view.height = height;
    for (const layer of this.layers) {
      layer.width = Math.round(width * devicePixelRatio);
      layer.height = Math.round(height * devicePixelRatio);
    }
    for (const layer of [0, 1, 2]) this.stale.add(layer);
    this.draw(); // at once: the new size has emptied the canvases
  }

  private draw(): void {
    this.asked = false;
    if (this.unsized) this.fit();
    this.redraws++;
    const drawers = [this.drawPictures, this.drawData, this.drawCurves];
    if (this.stale.has(0)) this.onView?.();
    for (const layer of this.stale) {
      const canvas = this.layers[layer];
      const pen = canvas?.getContext("2d");
      if (!canvas || !pen) continue;
      pen.setTransform(devicePixelRatio, 0, 0, devicePixelRatio, 0, 0);
      pen.clearRect(0, 0, this.view.width, this.view.height);
      drawers[layer]?.call(this, pen);
    }
    this.stale.clear();
    this.handles.place();
    this.quality.textContent = this.judged();
  }

  /** Of the active curve over the chosen data, also while it moves, beside what its fit reached. */
  private judged(): string {
    const { state } = this;
    const [curve, target] = [state.active, targetOf(state)];
    const samples = curve && state.samples.of(curve.id, curve);
    if (!curve?.shown || !samples) return "";
    const unit = unitFor("share");
    const [slip, value] = samples.peak;
    const end = Math.max(...(target?.bins ?? []).map((bin) => bin.slip));
    const beyond = slip > end && end > 0 ? `, beyond the points (to ${withUnit(digits(unit.scale * end), unit)})` : "";
    const shape = `initial slope ${digits(samples.initial_slope)}, ${slip < 0.999 ? `largest µ ${digits(value + (curve.parameters["intercept"] ?? 0))} at ${withUnit(digits(unit.scale * slip), unit)} slip${beyond}` : "µ rises with slip"}`;
    if (!target?.bins.length) return shape;
    const { r2, rms, count } = quality(target.bins, samples);
    const fitted = curve.fit && !sameCurve(curve) ? ` (fit ${digits(curve.fit.r2)})` : "";
    const pair = curve.name === target.name ? target.name : `${curve.name} over ${target.name}`;
    return `${pair}: R² ${digits(r2)}${fitted}, RMS ${digits(rms, 2)}, ${count} bins; ${shape}`;
  }

  private drawPictures(pen: CanvasRenderingContext2D): void {
    new CanvasInk(pen).clipped(this.view.box, () => {
      for (const [path, calibration] of Object.entries(this.state.kept.pictures)) {
        const image = this.state.images.get(path);
        if (image && calibration.shown) drawPicture(pen, this.view, image, calibration);
      }
    });
  }

  private drawData(pen: CanvasRenderingContext2D): void {
    const ink = new CanvasInk(pen);
    drawAxes(ink, this.view);
    ink.clipped(this.view.box, () => this.inkData(ink));
  }

  private inkData(ink: Ink): void {
    for (const soil of this.state.soils) if (soil.shown) drawSoil(ink, this.view, soil);
    for (const [, calibration] of Object.entries(this.state.kept.pictures)) {
      for (const line of calibration.shown ? calibration.lines : []) {
        ink.dots(line.points.flatMap(([s, mu]) => [this.view.px(s), this.view.py(mu)]), 3.5, color("ink"), 0.9);
      }
    }
  }

  private drawCurves(pen: CanvasRenderingContext2D): void {
    const ink = new CanvasInk(pen);
    ink.clipped(this.view.box, () => this.inkCurves(ink));
    this.inkLegend(ink);
  }

  private inkCurves(ink: Ink): void {
    const { curves, active } = this.state.kept;
    for (const curve of curves) if (curve.shown && curve.fit && !sameCurve(curve)) drawFit(ink, this.view, curve, this.state.samples.of(`fit ${curve.id}`, curve.fit));
    for (const curve of curves) if (curve.shown) drawCurve(ink, this.view, curve, curve.id === active, this.state.samples.of(curve.id, curve));
  }

  private inkLegend(ink: Ink): void {
    drawLegend(
      ink,
      this.view,
      this.state.kept.curves.filter((c) => c.shown),
      this.state.soils.filter((s) => s.shown),
    );
  }

  /** The plot without pictures as an SVG document. */
  svg(): string {
    const ink = new SvgInk();
    drawAxes(ink, this.view);
    ink.clipped(this.view.box, () => {
      this.inkData(ink);
      this.inkCurves(ink);
    });
    this.inkLegend(ink);
    return ink.toString(this.view.width, this.view.height, color("paper"));
  }

  /** The plot as it is seen, as a PNG. */
  png(): Promise<Blob | null> {
    const whole = h("canvas", { width: this.layers[0]?.width ?? 1, height: this.layers[0]?.height ?? 1 });
    const pen = whole.getContext("2d");
    if (!pen) return Promise.resolve(null);
    pen.fillStyle = color("paper");
    pen.fillRect(0, 0, whole.width, whole.height);
    for (const layer of this.layers) pen.drawImage(layer, 0, 0);
    return new Promise((resolve) => whole.toBlob(resolve, "image/png"));
  }

  private listen(): void {
    const held = new Map<number, Pixel>(); // where each pointer is that is down: one pans, two zoom too
    let moved = false;
    const middle = (all: Pixel[]): Pixel => [all.reduce((sum, [x]) => sum + x, 0) / all.length, all.reduce((sum, [, y]) => sum + y, 0) / all.length];
    const apart = ([a, b]: Pixel[]): number => (a && b ? Math.max(Math.hypot(a[0] - b[0], a[1] - b[1]), 1) : 1);
    const at = (event: MouseEvent): Pixel => {
      const box = this.element.getBoundingClientRect();
      return [event.clientX - box.left, event.clientY - box.top];
    };
    this.element.addEventListener("pointerdown", (event) => {
      moved = held.size > 0;
      held.set(event.pointerId, at(event));
      this.element.setPointerCapture(event.pointerId);
    });
    this.element.addEventListener("pointermove", (event) => {
      const [x, y] = at(event);
      const unit = unitFor("share");
      this.readout.value = this.view.inside(x, y) ? `s ${withUnit((this.view.x_of(x) * unit.scale).toFixed(unit.decimals + 1), unit)}   µ ${this.view.y_of(y).toFixed(3)}` : "";
      const was = held.get(event.pointerId);
      if (!was || (!moved && Math.hypot(x - was[0], y - was[1]) < 4)) return;
      moved = true;
      const before = [...held.values()];
      held.set(event.pointerId, [x, y]);
      const now = [...held.values()];
      const [from, to] = [middle(before), middle(now)];
      this.view.pan(to[0] - from[0], to[1] - from[1]);
      this.view.zoom(apart(before) / apart(now), ...to);
      this.redraw("view");
    });
    this.element.addEventListener("pointerup", (event) => {
      const [x, y] = at(event);
      if (held.delete(event.pointerId) && !moved && this.view.inside(x, y)) this.onClick?.([this.view.x_of(x), this.view.y_of(y)], event.shiftKey);
    });
    this.element.addEventListener("pointercancel", (event) => held.delete(event.pointerId));
    this.element.addEventListener(
      "wheel",
      (event) => {
        event.preventDefault();
        const [x, y] = at(event);
        this.view.zoom(Math.exp(event.deltaY * 0.0012), x, y);
        this.redraw("view");
      },
      { passive: false },
    );
    this.element.addEventListener("dblclick", () => this.fit());
    this.element.addEventListener("keydown", (event) => this.key(event));
  }

  private key(event: KeyboardEvent): void {
    const step = 40;
    const middle: Pixel = [this.view.width / 2, this.view.height / 2];
    const moves: Record<string, () => void> = {
      ArrowLeft: () => this.view.pan(step, 0),
      ArrowRight: () => this.view.pan(-step, 0),
      ArrowUp: () => this.view.pan(0, step),
      ArrowDown: () => this.view.pan(0, -step),
      "+": () => this.view.zoom(0.8, ...middle),
      "=": () => this.view.zoom(0.8, ...middle),
      "-": () => this.view.zoom(1.25, ...middle),
      "0": () => this.fit(),
    };
    const move = moves[event.key];
    if (!move || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    move();
    this.redraw("view");
  }
}

/** A picture under the plot: by one affine map where both axes are linear, else column by column of small patches. */
export function drawPicture(pen: CanvasRenderingContext2D, view: View, image: HTMLImageElement, calibration: Calibration): void {
  const map = mapOf(calibration);
  if (typeof map === "string") return;
  const [w, height] = [image.naturalWidth, image.naturalHeight];
  const screen = (pixel: Pixel): Pixel => {
    const [s, mu] = map.toValue(pixel);
    return [view.px(s), view.py(mu)];
  };
  const cells = map.linear ? 1 : 48;
  pen.save();
  pen.globalAlpha = calibration.opacity;
  for (let i = 0; i < cells; i++) {
    for (let j = 0; j < cells; j++) {
      const [x0, y0, dx, dy] = [(w * i) / cells, (height * j) / cells, w / cells, height / cells];
      const o = screen([x0, y0]);
      const a = screen([x0 + dx, y0]);
      const b = screen([x0, y0 + dy]);
      if (![...o, ...a, ...b].every((v) => Number.isFinite(v) && Math.abs(v) < 1e6)) continue;
      pen.save();
      pen.transform((a[0] - o[0]) / dx, (a[1] - o[1]) / dx, (b[0] - o[0]) / dy, (b[1] - o[1]) / dy, o[0], o[1]);
      pen.drawImage(image, x0, y0, dx, dy, 0, 0, dx, dy);
      pen.restore();
    }
  }
  pen.restore();
}

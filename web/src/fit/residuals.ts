/** What the active curve leaves: points and bins of the chosen soil less the curve, over slip, under the plot. */

import { digits, h, onFrame } from "../ui/dom";
import { color, onTheme } from "../ui/theme";
import { CanvasInk } from "../ui/ink";
import { quality, targetOf, type Quality, type Target } from "./quality";
import { at } from "./samples";
import type { State } from "./state";
import { ticks, View } from "../ui/view";

export class Residuals {
  readonly element = h("div", { class: "residuals", role: "img", "aria-label": "Residuals: bins less the active curve, over slip", hidden: true });
  readonly button = h("button", { type: "button", id: "residuals", "aria-pressed": "false" }, "Residuals");
  /** Of the bins shown last; for the tests too. */
  summary: Quality = { count: 0, rms: NaN, largest: NaN, r2: NaN };
  private canvas = h("canvas", { "aria-hidden": "true" });
  private view = new View();
  private forget: () => void;
  private watcher: ResizeObserver;

  constructor(
    private state: State,
    private above: View,
  ) {
    this.element.append(this.canvas);
    this.button.addEventListener("click", () => {
      this.element.hidden = !this.element.hidden;
      this.button.setAttribute("aria-pressed", String(!this.element.hidden));
      this.later();
    });
    state.on(() => this.later());
    this.forget = onTheme(() => this.later());
    this.watcher = new ResizeObserver(() => this.later());
    this.watcher.observe(this.element);
  }

  close(): void {
    this.forget();
    this.watcher.disconnect();
  }

  later = onFrame(() => this.draw());

  private draw(): void {
    const pen = this.canvas.getContext("2d");
    const [width, height] = [this.element.clientWidth, this.element.clientHeight];
    if (!pen || width < 100) return;
    this.canvas.width = width * devicePixelRatio;
    this.canvas.height = height * devicePixelRatio;
    pen.setTransform(devicePixelRatio, 0, 0, devicePixelRatio, 0, 0);
    const ink = new CanvasInk(pen);
    const curve = this.state.active;
    const target = targetOf(this.state);
    const samples = curve && this.state.samples.of(curve.id, curve);
    if (!curve || !target || !samples) {
      ink.text("Residuals need a curve, and a soil or a digitised line.", width / 2, height / 2, color("muted"), "middle");
      return;
    }
    const left = (s: number, mu: number): number => mu - at(samples, s);
    const { bins } = target;
    this.summary = quality(bins, samples);
    const most = Math.max(...bins.map((bin) => Math.abs(left(bin.slip, bin.mean)) + bin.std).filter(Number.isFinite), 0.01) * 1.1;
    Object.assign(this.view, { x: { ...this.above.x }, y: { low: -most, high: most }, width, height, top: 22, bottom: 8 });
    const { view } = this;
    for (const y of ticks(view.y, 4)) {
      ink.line([view.left, view.py(y), width - view.right, view.py(y)], { color: color(y === 0 ? "muted" : "grid") });
      ink.text(digits(y), view.left - 8, view.py(y), color("muted"), "end");
    }
    ink.text(`Residual µ of ${target.name} less ${curve.name}: ${this.summary.count} bins, RMS ${digits(this.summary.rms, 2)}, largest ${digits(this.summary.largest, 2)}`, view.left, 10, color("ink"), "start");
    ink.clipped(view.box, () => this.drawBins(ink, target, left));
  }

  private drawBins(ink: CanvasInk, { bins, cloud, color: name }: Target, left: (s: number, mu: number) => number): void {
    const { view } = this;
    const shade = color(name);
    ink.dots(cloud.slip.flatMap((s, i) => [view.px(s), view.py(left(s, cloud.adhesion[i] ?? NaN))]), 1, shade, 0.25);
    for (const bin of bins) {
      const r = left(bin.slip, bin.mean);
      ink.line([view.px(bin.slip), view.py(r - bin.std), view.px(bin.slip), view.py(r + bin.std)], { color: shade, width: 1.2 });
    }
    ink.dots(bins.flatMap((bin) => [view.px(bin.slip), view.py(left(bin.slip, bin.mean))]), 4, shade, 1);
  }
}

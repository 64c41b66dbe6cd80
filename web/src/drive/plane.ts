/** The mu-s plane of one wheel: the shown time's pairs, the pair under the cursor, the online curve known by then. */

import { CanvasInk } from "../fit/ink";
import type { Samples } from "../fit/samples";
import { View, ticks } from "../fit/view";
import { digits, h } from "../ui/dom";
import { color, onTheme } from "../ui/theme";
import { onUnits, unitFor, withUnit } from "../ui/units";
import { nearestKnown } from "./readout";

export interface Now {
  slip: number;
  adhesion: number;
  slip_std: number;
  adhesion_std: number;
  a: number;
  a_std: number;
}

const USELESS = 1.0;
/** SD of a beyond which the online curve says nothing and is not drawn. */

/** Pairs of one wheel and their times; unknown ones are null. */
export interface Points {
  slip: number[];
  adhesion: number[];
  time: number[];
}

/** Pixels within which the pointer finds a pair. */
const REACH = 12;

export class Plane {
  /** The time of the pair under the pointer; null where it has left. */
  onPoint: ((time: number | null) => void) | null = null;
  readonly element = h("div", { class: "plane", role: "img", "aria-label": "Adhesion over slip of one wheel, with the online curve" });
  private canvas = h("canvas", { "aria-hidden": "true" });
  private view = new View({ low: -0.05, high: 0.7 }, { low: -0.1, high: 0.8 }, 300, 260);
  private points: Points = { slip: [], adhesion: [], time: [] };
  private pointed = -1;
  private readout = h("output", { class: "readout", "aria-live": "off" });
  private now: Now | null = null;
  private shape: Samples | null = null;
  private asked = false;
  private forgets: (() => void)[];
  private watcher: ResizeObserver;

  constructor() {
    this.element.append(this.canvas, this.readout);
    this.canvas.addEventListener("pointermove", (event) => this.hover(event.offsetX, event.offsetY));
    this.canvas.addEventListener("pointerleave", () => {
      this.onPoint?.(null);
      this.point(null);
    });
    this.view.left = 46;
    this.view.bottom = 36;
    this.forgets = [onTheme(() => this.draw()), onUnits(() => this.draw())];
    this.watcher = new ResizeObserver(() => this.resize());
    this.watcher.observe(this.element);
  }

  close(): void {
    this.forgets.forEach((forget) => forget());
    this.watcher.disconnect();
  }

  show(points: Points): void {
    this.points = points;
    this.pointed = -1;
    this.readout.value = "";
    const most = (values: number[], share: number): number => {
      const known = values.filter((v) => v !== null && Number.isFinite(v)).sort((a, b) => a - b);
      return known[Math.floor((known.length - 1) * share)] ?? 0;
    };
    this.view.x = { low: Math.min(-0.02, most(points.slip, 0.01)), high: Math.max(0.3, most(points.slip, 0.99) * 1.1) };
    this.view.y = { low: Math.min(-0.02, most(points.adhesion, 0.01)), high: Math.max(0.3, most(points.adhesion, 0.99) * 1.2) };
    this.later();
  }

  /** The online curve's shape: the curve of scale 1. */
  shaped(shape: Samples): void {
    this.shape = shape;
    this.later();
  }

  at(now: Now | null): void {
    this.now = now;
    this.later();
  }

  /** Ring the pair nearest to a time, where one is known there. */
  point(time: number | null): void {
    const { time: times, slip, adhesion } = this.points;
    const known = (i: number): boolean => typeof slip[i] === "number" && typeof adhesion[i] === "number";
    const apart = times.length > 1 ? ((times[times.length - 1] as number) - (times[0] as number)) / (times.length - 1) : 0;
    this.set(time === null ? -1 : nearestKnown(times, known, time, 2 * apart));
  }

  private hover(x: number, y: number): void {
    const { slip, adhesion, time } = this.points;
    let [best, least] = [-1, REACH];
    slip.forEach((s, i) => {
      if (s === null || adhesion[i] === null) return;
      const away = Math.hypot(this.view.px(s) - x, this.view.py(adhesion[i] as number) - y);
      if (away < least) [best, least] = [i, away];
    });
    if (best < 0) return;
    this.onPoint?.(time[best] ?? null);
    this.set(best);
  }

  private set(i: number): void {
    if (i === this.pointed) return;
    this.pointed = i;
    const unit = unitFor("share");
    this.readout.value = i < 0 ? "" : `s ${withUnit(digits(unit.scale * (this.points.slip[i] as number)), unit)}   µ ${digits(this.points.adhesion[i])}   t ${(this.points.time[i] ?? NaN).toFixed(2)} s`;
    this.later();
  }

  private resize(): void {
    this.view.width = this.element.clientWidth;
    this.view.height = this.element.clientHeight;
    this.canvas.width = this.view.width * devicePixelRatio;
    this.canvas.height = this.view.height * devicePixelRatio;
    this.draw();
  }

  private later(): void {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => {
      this.asked = false;
      this.draw();
    });
  }

  private draw(): void {
    const pen = this.canvas.getContext("2d");
    if (!pen || this.view.width < 50) return;
    const { view } = this;
    pen.setTransform(devicePixelRatio, 0, 0, devicePixelRatio, 0, 0);
    pen.clearRect(0, 0, view.width, view.height);
    const ink = new CanvasInk(pen);
    const share = unitFor("share");
    for (const x of ticks(view.x, 5)) {
      ink.line([view.px(x), view.top, view.px(x), view.height - view.bottom], { color: color("grid") });
      ink.text(digits(share.scale * x), view.px(x), view.height - view.bottom + 12, color("muted"), "middle");
    }
    for (const y of ticks(view.y, 5)) {
      ink.line([view.left, view.py(y), view.width - view.right, view.py(y)], { color: color("grid") });
      ink.text(digits(y), view.left - 6, view.py(y), color("muted"), "end");
    }
    ink.text(`slip [${share.name}]`, (view.left + view.width - view.right) / 2, view.height - 8, color("ink"), "middle");
    ink.text("adhesion µ [–]", 10, view.height / 2, color("ink"), "middle", true);
    pen.save();
    pen.beginPath();
    pen.rect(view.left, view.top, view.width - view.left - view.right, view.height - view.top - view.bottom);
    pen.clip();
    const points: number[] = [];
    this.points.slip.forEach((s, i) => points.push(view.px(s), view.py(this.points.adhesion[i] as number)));
    ink.dots(points, 1.1, color("muted"), 0.45);
    const [s, mu] = [this.points.slip[this.pointed], this.points.adhesion[this.pointed]];
    if (typeof s === "number" && typeof mu === "number") ink.dots([view.px(s), view.py(mu)], 5, color("accent"), 1);
    if (this.now) this.drawNow(ink, this.now);
    pen.restore();
  }

  private drawNow(ink: CanvasInk, now: Now): void {
    const { view } = this;
    const { shape } = this;
    if (shape && now.a_std < USELESS) {
      const curve = (a: number): number[] => shape.slip.flatMap((s, i) => [view.px(s), view.py(a * (shape.value[i] ?? NaN))]);
      const high = curve(now.a + 1.96 * now.a_std);
      const low = curve(now.a - 1.96 * now.a_std);
      const back: number[] = [];
      for (let i = low.length - 2; i >= 0; i -= 2) back.push(low[i] as number, low[i + 1] as number);
      ink.area([...high, ...back], color("green"), 0.2);
      ink.line(curve(now.a), { color: color("green"), width: 2 });
    }
    const [x, y] = [view.px(now.slip), view.py(now.adhesion)];
    const [dx, dy] = [view.px(now.slip + 1.96 * now.slip_std) - x, view.py(now.adhesion + 1.96 * now.adhesion_std) - y];
    ink.line([x - dx, y, x + dx, y], { color: color("vermillion"), width: 1.6 });
    ink.line([x, y - dy, x, y + dy], { color: color("vermillion"), width: 1.6 });
    ink.dots([x, y], 4.5, color("vermillion"), 1);
  }
}

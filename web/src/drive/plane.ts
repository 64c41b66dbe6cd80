/** One quantity over another: the pairs of what the charts show, the pair under the cursor; of the mu-s plane the online curve too. */

import { CanvasInk, type Ink } from "../ui/ink";
import type { Samples } from "../fit/samples";
import { View, ticks, type Range } from "../ui/view";
import { timeOfDay, type Timed } from "../ui/clock";
import { digits, h, onFrame } from "../ui/dom";
import { color, onTheme } from "../ui/theme";
import { withUnit } from "../ui/units";
import { nearestKnown } from "./readout";

export interface Now {
  slip: number;
  adhesion: number;
  slip_std: number;
  adhesion_std: number;
  a: number;
  a_std: number;
}

/** SD of a beyond which the online curve is too uncertain to be drawn. */
const USELESS = 1.0;

/** A quantity as it is shown: its column, title and unit, and the factor from the column to that unit. */
export interface Quantity {
  column: string;
  title: string;
  unit: string;
  scale: number;
}

/** Pairs of one run and their times, out of so many. */
export interface Pairs {
  run: Timed;
  time: ArrayLike<number>;
  x: ArrayLike<number>;
  y: ArrayLike<number>;
  of: number;
  color: string;
  label: string;
}

/** What the axes are; `curve`: they are slip and adhesion, over which the online curve can be drawn. */
export interface Axes {
  x: Quantity;
  y: Quantity;
  curve: boolean;
}

/** Pixels within which the pointer finds a pair. */
const REACH = 12;

export class Plane {
  /** The time of the pair under the pointer; null where it has left. */
  onPoint: ((time: number | null) => void) | null = null;
  readonly element = h("div", { class: "plane", role: "img", "aria-label": "One quantity over another" });
  private canvas = h("canvas", { "aria-hidden": "true" });
  private view = new View({ low: -0.05, high: 0.7 }, { low: -0.1, high: 0.8 }, 300, 260);
  private all: Pairs[] = [];
  private axes: Axes | null = null;
  private pointed = -1;
  private readout = h("output", { class: "readout", "aria-live": "off" });
  private now: Now | null = null;
  private shape: Samples | null = null;
  private forget: () => void;
  private watcher: ResizeObserver;

  constructor() {
    this.element.append(this.canvas, this.readout);
    this.canvas.addEventListener("pointermove", (event) => this.hover(event.offsetX, event.offsetY));
    this.canvas.addEventListener("pointerleave", () => {
      this.onPoint?.(null);
      this.point(null);
    });
    this.view.left = 52;
    this.view.bottom = 36;
    this.forget = onTheme(() => this.draw());
    this.watcher = new ResizeObserver(() => this.resize());
    this.watcher.observe(this.element);
  }

  close(): void {
    this.forget();
    this.watcher.disconnect();
  }

  /** Draw pairs of runs, the main one first; gives how many of them lie beyond the axes. */
  show(all: Pairs[], axes: Axes | null): number {
    [this.all, this.axes] = [all, axes];
    this.pointed = -1;
    this.readout.value = "";
    this.element.setAttribute("aria-label", axes ? `${axes.y.title} over ${axes.x.title}` : "One quantity over another");
    const sorted = (of: "x" | "y"): Float64Array => Float64Array.from(all.flatMap((one) => Array.from(one[of]))).sort();
    const [xs, ys] = [sorted("x"), sorted("y")];
    const at = (values: Float64Array, share: number): number => values[Math.round((values.length - 1) * share)] ?? 0;
    const free = (values: Float64Array): { low: number; high: number } => {
      const [low, high] = [at(values, 0.005), at(values, 0.995)];
      const room = 0.08 * (high - low) || 0.1 * Math.abs(high) || 0.5;
      return { low: low - room, high: high + room };
    };
    const custom = (values: Float64Array, room: number): { low: number; high: number } => ({ low: Math.min(-0.02, at(values, 0.01)), high: Math.max(0.3, at(values, 0.99) * room) });
    [this.view.x, this.view.y] = axes?.curve ? [custom(xs, 1.1), custom(ys, 1.2)] : [free(xs), free(ys)];
    this.later();
    const { x, y } = this.view;
    return all.reduce((sum, one) => sum + Array.from(one.x).filter((v, i) => v < x.low || v > x.high || (one.y[i] as number) < y.low || (one.y[i] as number) > y.high).length, 0);
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

  /** Ring the main run's pair nearest to a time, where one is known there. */
  point(time: number | null): void {
    const times = this.all[0]?.time ?? [];
    const apart = times.length > 1 ? ((times[times.length - 1] as number) - (times[0] as number)) / (times.length - 1) : 0;
    this.set(time === null ? -1 : nearestKnown(times, () => true, time, 2 * apart));
  }

  private hover(px: number, py: number): void {
    const { x, y, time } = this.all[0] ?? { x: [], y: [], time: [] };
    let [best, least] = [-1, REACH];
    for (let i = 0; i < x.length; i++) {
      const away = Math.hypot(this.view.px(x[i] as number) - px, this.view.py(y[i] as number) - py);
      if (away < least) [best, least] = [i, away];
    }
    if (best < 0) return;
    this.onPoint?.(time[best] ?? null);
    this.set(best);
  }

  private set(i: number): void {
    if (i === this.pointed) return;
    this.pointed = i;
    const { axes } = this;
    const [one] = this.all;
    const said = (short: string, { scale, unit }: Quantity, value: number | undefined): string => `${short} ${withUnit(digits((value ?? NaN) * scale), { name: unit })}`;
    this.readout.value = i < 0 || !one || !axes ? "" : [said(axes.curve ? "s" : "→", axes.x, one.x[i]), said(axes.curve ? "µ" : "↑", axes.y, one.y[i]), `t ${timeOfDay(one.run, one.time[i] ?? NaN, 2)}`].join("   ");
    this.later();
  }

  private resize(): void {
    this.view.width = this.element.clientWidth;
    this.view.height = this.element.clientHeight;
    this.canvas.width = this.view.width * devicePixelRatio;
    this.canvas.height = this.view.height * devicePixelRatio;
    this.draw();
  }

  private later = onFrame(() => this.draw());

  private draw(): void {
    const pen = this.canvas.getContext("2d");
    if (!pen || this.view.width < 50) return;
    const { view } = this;
    pen.setTransform(devicePixelRatio, 0, 0, devicePixelRatio, 0, 0);
    pen.clearRect(0, 0, view.width, view.height);
    this.ink(new CanvasInk(pen));
  }

  /** Draw the plot where its view lies; `at`: another place, of a sheet. */
  ink(ink: Ink, at?: View): void {
    const { axes } = this;
    const view = at ? Object.assign(at, { x: this.view.x, y: this.view.y }) : this.view;
    if (!axes) return;
    const [right, foot] = [view.width - view.right, view.height - view.bottom];
    const scaled = ({ low, high }: Range, scale: number): Range => ({ low: low * scale, high: high * scale });
    for (const x of ticks(scaled(view.x, axes.x.scale), 4)) {
      const px = view.px(x / axes.x.scale);
      ink.line([px, view.top, px, foot], { color: color("grid") });
      ink.text(digits(x), px, foot + 12, color("muted"), "middle");
    }
    for (const y of ticks(scaled(view.y, axes.y.scale), 5)) {
      const py = view.py(y / axes.y.scale);
      ink.line([view.left, py, right, py], { color: color("grid") });
      ink.text(digits(y), view.left - 6, py, color("muted"), "end");
    }
    const named = ({ title, unit }: Quantity): string => `${title} [${unit}]`;
    ink.text(named(axes.x), (view.left + right) / 2, foot + 28, color("ink"), "middle");
    ink.text(named(axes.y), view.left - 42, (view.top + foot) / 2, color("ink"), "middle", { turn: true });
    ink.clipped(view.box, () => {
      for (const one of [...this.all].reverse()) {
        const points = new Float64Array(2 * one.x.length);
        for (let i = 0; i < one.x.length; i++) [points[2 * i], points[2 * i + 1]] = [view.px(one.x[i] as number), view.py(one.y[i] as number)];
        ink.dots(points, 1.1, color(one.color), 0.45);
      }
      const [main] = this.all;
      if (main && this.pointed >= 0) ink.dots([view.px(main.x[this.pointed] as number), view.py(main.y[this.pointed] as number)], 5, color("accent"), 1);
      if (this.now && axes.curve) this.drawNow(ink, view, this.now);
    });
  }

  private drawNow(ink: Ink, view: View, now: Now): void {
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

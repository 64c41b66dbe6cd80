/** Six traces of the last half minute, drawn straight from the ring on one canvas each frame that brought rows. */

import { EVENT_COLORS } from "../drive/run";
import { ticks } from "../ui/view";
import { digits, h, onFrame } from "../ui/dom";
import { color, onTheme } from "../ui/theme";
import { Columns, type Window } from "./columns";
import type { Ring } from "./feed";

export interface Trace {
  title: string;
  unit: string;
  scale: number;
  /** Columns drawn together, each with its colour. */
  lines: { column: string; color: string; label: string }[];
  low: number;
  high: number;
  /** What the axis spans at least: a standstill's noise is none of the driver's concern. */
  least: number;
}

/** Pixels under which the charts stand below each other (as in the style sheet). */
const NARROW = 560;
/** Seconds between the marks of the time axis. */
const STEPS = [5, 10, 15, 30, 60, 120, 300];
/** Pixels of a dot of what is predicted. */
const DOTS = 2;
const [LEFT, RIGHT, GAP, FOOT] = [50, 10, 24, 24];

export class Traces {
  readonly element = h("div", { class: "traces", role: "img", "aria-label": "The last seconds of slip, adhesion, speeds and resistance" });
  /** Seconds shown. */
  span = 30;
  /** The time at the right edge while paused; null follows. */
  held: number | null = null;
  /** The time at the right edge while looking back; null follows. */
  back: number | null = null;
  /** Dragged to another time. */
  onBack: (() => void) | null = null;
  /** Seconds by which the last row lies back, where none comes: the lines then move away from the right edge. */
  late = 0;
  redraws = 0;
  private canvas = h("canvas", { "aria-hidden": "true" });
  private traces: Trace[] = [];
  private pool: Columns[] = [];
  private ranges = new Map<string, [number, number]>();
  private forget: () => void;
  private watcher: ResizeObserver;

  constructor(
    private ring: Ring,
    private events: () => string[],
  ) {
    this.element.append(this.canvas);
    this.forget = onTheme(() => this.redraw());
    this.watcher = new ResizeObserver(() => {
      this.canvas.width = this.element.clientWidth * devicePixelRatio;
      this.canvas.height = this.element.clientHeight * devicePixelRatio;
      this.draw(); // at once: the new size has emptied the canvas
    });
    this.watcher.observe(this.element);
    let grip: { x: number; end: number } | null = null;
    this.element.addEventListener("pointerdown", (event) => {
      if (event.pointerType === "touch") return; // a finger scrolls the page
      grip = { x: event.clientX, end: this.end };
      this.element.setPointerCapture(event.pointerId);
    });
    this.element.addEventListener("pointermove", (event) => {
      if (grip && Math.abs(event.clientX - grip.x) > 3) this.lookBack(grip.end - ((event.clientX - grip.x) / this.wide()) * this.span);
    });
    for (const end of ["pointerup", "pointercancel"] as const) this.element.addEventListener(end, () => (grip = null));
  }

  /** The time at the right edge. */
  get end(): number {
    return this.held ?? this.back ?? this.ring.now + this.late;
  }

  /** Put a time at the right edge while rows go on coming; null, or the newest, follows again. */
  lookBack(time: number | null): void {
    const least = Math.min(this.ring.oldest + this.span, this.ring.now);
    this.back = time === null || !(time < this.ring.now) ? null : Math.max(time, least);
    this.onBack?.();
    this.redraw();
  }

  /** Pixels of one chart's time axis. */
  private wide(): number {
    const width = this.element.clientWidth;
    return (width < NARROW ? width : (width - GAP) / 2) - LEFT - RIGHT;
  }

  close(): void {
    this.forget();
    this.watcher.disconnect();
  }

  show(traces: Trace[]): void {
    this.traces = traces;
    this.ranges.clear();
    this.redraw();
  }

  redraw = onFrame(() => this.draw());

  private draw(): void {
    const pen = this.canvas.getContext("2d");
    const [width, height] = [this.element.clientWidth, this.element.clientHeight];
    if (!pen || width < 100 || !this.traces.length) return;
    this.redraws++;
    pen.setTransform(devicePixelRatio, 0, 0, devicePixelRatio, 0, 0);
    pen.clearRect(0, 0, width, height);
    const { end } = this;
    if (Number.isNaN(end)) return;
    const first = this.firstSince(end - this.span);
    const across = width < NARROW ? 1 : 2;
    const rows = Math.ceil(this.traces.length / across);
    const wide = (width - GAP * (across - 1)) / across;
    const tall = (height - FOOT) / rows;
    this.traces.forEach((trace, i) => {
      const x0 = (i % across) * (wide + GAP);
      const y0 = Math.floor(i / across) * tall;
      this.drawOne(pen, trace, x0, y0, wide, tall, first, end, Math.floor(i / across) === rows - 1);
    });
  }

  private firstSince(time: number): number {
    let [low, high] = [0, this.ring.count];
    while (low < high) {
      const middle = (low + high) >> 1;
      if ((this.ring.time[this.ring.place(middle)] as number) < time) low = middle + 1;
      else high = middle;
    }
    return Math.max(low - 1, 0);
  }

  private drawOne(pen: CanvasRenderingContext2D, trace: Trace, x0: number, y0: number, width: number, height: number, first: number, end: number, last: boolean): void {
    const [left, right, top, bottom] = [x0 + LEFT, x0 + width - RIGHT, y0 + 24, y0 + height - 6];
    const window = { first, begin: end - this.span, end, pixels: Math.round((right - left) * devicePixelRatio) };
    const lines = this.gather(trace, window);
    const [low, high] = this.range(trace, lines.map(({ columns }) => columns));
    const px = (time: number): number => right - ((end - time) / this.span) * (right - left);
    const py = (v: number): number => bottom - ((v - low) / (high - low)) * (bottom - top);
    this.drawHead(pen, trace, left, right, y0);
    pen.lineWidth = 1;
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    for (const v of ticks({ low, high }, 4)) {
      pen.strokeStyle = color("grid");
      pen.beginPath();
      pen.moveTo(left, py(v));
      pen.lineTo(right, py(v));
      pen.stroke();
      pen.fillStyle = color("muted");
      pen.fillText(digits(v), left - 6, py(v));
    }
    if (last) {
      pen.textAlign = "center";
      const step = STEPS.find((one) => one * 4 >= this.span) ?? 300;
      const edge = this.back === null ? "now" : `${end.toFixed(0)} s`;
      for (let back = 0; back < this.span; back += step) pen.fillText(back ? `−${back} s` : edge, px(end - back) - (back ? 0 : 10), bottom + 14);
    }
    pen.save();
    pen.beginPath();
    pen.rect(left, top - 2, right - left, bottom - top + 4);
    pen.clip();
    this.drawEvents(pen, first, end, px, bottom);
    for (const { columns, values, shade, predicted } of lines) {
      if (columns.rows > window.pixels) {
        pen.fillStyle = shade;
        pen.setTransform(1, 0, 0, 1, 0, 0); // whole pixels: plain fills
        columns.draw(pen, Math.round(left * devicePixelRatio), (v) => py(v * trace.scale) * devicePixelRatio, 1.6 * devicePixelRatio, predicted * DOTS);
        pen.setTransform(devicePixelRatio, 0, 0, devicePixelRatio, 0, 0);
        continue;
      }
      pen.strokeStyle = shade;
      pen.lineWidth = predicted ? 1.2 : 1.6;
      pen.setLineDash(predicted ? [2, 4] : []);
      this.path(pen, values, predicted, first, end, px, (v) => py(v * trace.scale));
    }
    pen.restore();
  }

  /** The lines of a chart, by columns of pixels; those predicted after those measured, where there are any. */
  private gather(trace: Trace, window: Window): { columns: Columns; values: Float64Array; shade: string; predicted: 0 | 1 }[] {
    const { ring } = this;
    let used = 0;
    return trace.lines.flatMap((line) => {
      const values = ring.columns[ring.names.indexOf(line.column)];
      if (!values) return [];
      return ([0, 1] as const).flatMap((predicted) => {
        const columns = (this.pool[used] ??= new Columns());
        columns.take(ring, values, predicted, window);
        if (columns.least > columns.most) return [];
        used++;
        return [{ columns, values, shade: color(predicted ? "muted" : line.color), predicted }];
      });
    });
  }

  private drawHead(pen: CanvasRenderingContext2D, trace: Trace, left: number, right: number, y0: number): void {
    const title = `${trace.title} [${trace.unit}]`;
    pen.font = "600 13px system-ui, sans-serif";
    pen.fillStyle = color("ink");
    pen.textBaseline = "alphabetic";
    pen.textAlign = "left";
    pen.fillText(title, left, y0 + 16);
    let x = left + pen.measureText(title).width + 12;
    pen.font = "12px system-ui, sans-serif";
    const labelled = trace.lines.length > 1 ? trace.lines : [];
    const widths = labelled.map((line) => pen.measureText(line.label).width);
    // On a narrow screen the lines of the legend become shorter, down to a dot, before a wheel is cut off.
    const room = (right - x - widths.reduce((sum, one) => sum + one, 0)) / labelled.length;
    const dash = Math.max(3, Math.min(12, room - 12));
    labelled.forEach((line, k) => {
      pen.fillStyle = color(line.color);
      pen.fillRect(x, y0 + 10, dash, 3);
      pen.fillText(line.label, x + dash + 3, y0 + 16);
      x += dash + Math.max(6, Math.min(14, room - dash)) + (widths[k] as number);
    });
  }

  /** Events at the foot, one mark a pixel. */
  private drawEvents(pen: CanvasRenderingContext2D, first: number, end: number, px: (time: number) => number, bottom: number): void {
    const { ring } = this;
    const names = this.events();
    let [before, kind] = [NaN, 0];
    for (let i = first; i < ring.count; i++) {
      const at = ring.place(i);
      const code = ring.event[at] as number;
      const time = ring.time[at] as number;
      if (time > end) break;
      if (!code) continue;
      const x = Math.round(px(time));
      if (x === before && code === kind) continue;
      [before, kind] = [x, code];
      pen.fillStyle = color(EVENT_COLORS[names[code] ?? ""] ?? "ink");
      pen.fillRect(x - 1, bottom - 3, 2, 5);
    }
  }

  /** One line's rows, where there are fewer than pixels: those measured or those predicted, from `first` to the time `end`. */
  private path(pen: CanvasRenderingContext2D, values: Float64Array, predicted: number, first: number, end: number, px: (time: number) => number, py: (v: number) => number): void {
    const { ring } = this;
    pen.beginPath();
    let on = false;
    for (let i = first; i < ring.count; i++) {
      const at = ring.place(i);
      const time = ring.time[at] as number;
      if (time > end) break;
      const v = values[at] as number;
      if (Number.isNaN(v) || ring.predicted[at] !== predicted) {
        on = false;
        continue;
      }
      if (on) pen.lineTo(px(time), py(v));
      else pen.moveTo(px(time), py(v));
      on = true;
    }
    pen.stroke();
  }

  /** A range that grows at once and shrinks slowly, so that the lines do not dance. */
  private range(trace: Trace, lines: Columns[]): [number, number] {
    let low = Math.min(...lines.map(({ least }) => least)) * trace.scale;
    let high = Math.max(...lines.map(({ most }) => most)) * trace.scale;
    low = Math.max(Math.min(low, trace.low === 0 ? 0 : low), trace.low);
    high = Math.min(high, trace.high);
    if (low > high) [low, high] = [Math.max(trace.low, 0), Math.min(trace.high, Math.max(trace.low, 0) + 1)]; // nothing is known
    else if (high - low < trace.least) [low, high] = trace.low === 0 ? [low, low + trace.least] : [(low + high - trace.least) / 2, (low + high + trace.least) / 2];
    const room = 0.08 * (high - low);
    const before = this.ranges.get(trace.title);
    const now: [number, number] = [low - (trace.low === 0 ? 0 : room), high + room];
    if (before) {
      now[0] = now[0] < before[0] ? now[0] : before[0] + 0.03 * (now[0] - before[0]);
      now[1] = now[1] > before[1] ? now[1] : before[1] + 0.03 * (now[1] - before[1]);
    }
    this.ranges.set(trace.title, now);
    return now;
  }
}

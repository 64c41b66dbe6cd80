/** A stack of charts over one time axis: intervals as bands, soils and events as coloured spans, one cursor, one zoom. */

import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { brush, brushed, onBrush } from "../ui/brush";
import { columns } from "../ui/columns";
import { digits, fill, h } from "../ui/dom";
import { tried } from "../ui/notes";
import { color, onTheme } from "../ui/theme";
import { bands, columnsOfBuckets, isDense } from "./buckets";
import { hearKeys, hearPointers, type Range } from "./gestures";
import { EVENT_COLORS, soilColor, soilsOf, type Panel, type Run } from "./run";

const SYNC = "drive";
const [LOWEST, HEAD] = [116, 26];
/** Rows are fetched for more than is shown, this share of it on either side, so that a pan finds them there. */
const MARGIN = 0.5;
/** Rows fetched for more than so many times what is shown are too coarse. */
const COARSE = 3;
const SOON = 40; // ms
const LINE = uPlot.paths.linear?.() as uPlot.Series.PathBuilder;
const MANY = 300; // points of a line
const MARKS = [0.05, 0.2, 1, 5, 50]; // of a logarithmic axis

interface Fetched {
  range: Range;
  cut: boolean;
  width: number;
}

export class Charts {
  readonly element = h("div", { class: "charts" });
  /** The times shown. */
  range: Range = [0, 1];
  onCursor: ((time: number | null) => void) | null = null;
  onPick: ((time: number) => void) | null = null;
  onRange: ((range: Range) => void) | null = null;
  /** The file was replaced while it was open. */
  onReplaced: (() => void) | null = null;
  private plots: { panel: Panel; plot: uPlot; box: HTMLElement }[] = [];
  private count = 0;
  private run: Run | null = null;
  private path = "";
  private pending: AbortController | null = null;
  private fetched: Fetched | null = null;
  private arrived = new Map<uPlot, uPlot.AlignedData>();
  private frame = 0;
  private timer = 0;
  private forget: () => void;
  private watcher: ResizeObserver;

  constructor() {
    const forgets = [onTheme(() => this.rebuild()), onBrush(() => this.follow())];
    this.forget = () => forgets.forEach((one) => one());
    this.watcher = new ResizeObserver(() => {
      for (const { plot, box } of this.plots) if (box.clientWidth > 80) plot.setSize({ width: box.clientWidth, height: this.height() });
      this.later();
    });
    this.watcher.observe(this.element);
    hearKeys(this.element, this);
  }

  /** All times of the run. */
  get whole(): Range {
    return this.run ? [this.run.start, this.run.end] : [0, 1];
  }

  /** The ends of a chart's upright axis. */
  scale(number: number): Range | null {
    const { min, max } = this.plots[number]?.plot.scales["y"] ?? {};
    return typeof min === "number" && typeof max === "number" ? [min, max] : null;
  }

  close(): void {
    this.forget();
    this.watcher.disconnect();
    this.pending?.abort();
    clearTimeout(this.timer);
    cancelAnimationFrame(this.frame);
    for (const { plot } of this.plots) plot.destroy();
  }

  show(path: string, run: Run, panels: Panel[]): void {
    const same = path === this.path && run.version === this.run?.version;
    this.path = path;
    this.run = run;
    if (!same) this.range = this.whole;
    this.build(panels);
  }

  /** Show no run, but why. */
  clear(why: string): void {
    this.run = null;
    this.path = "";
    this.build([]);
    delete this.element.dataset["rows"];
    fill(this.element, h("p", { class: "hint empty" }, why));
  }

  /** Show the times brushed last, on another page or in another tab, where they are of this run. */
  follow(): void {
    const other = brushed();
    if (other?.path === this.path) this.zoom(other.range);
  }

  /** Show other times, here and wherever this run is shown; the rows come from the server a moment later. */
  zoom(range: Range): void {
    const run = this.run;
    if (!run) return;
    const least = Math.min(0.05, run.end - run.start);
    let [low, high] = range;
    if (high - low < least) [low, high] = [(low + high - least) / 2, (low + high + least) / 2];
    this.range = [Math.max(low, run.start), Math.min(high, run.end)];
    this.redraw();
    brush(this.path, this.range);
    this.onRange?.(this.range);
    this.later();
  }

  /** Once a frame at most, with the rows that have arrived. */
  private redraw(): void {
    this.frame ||= requestAnimationFrame(() => {
      this.frame = 0;
      for (const { plot } of this.plots) {
        const data = this.arrived.get(plot);
        if (data) plot.setData(data, false);
        plot.setScale("x", { min: this.range[0], max: this.range[1] });
      }
      this.arrived.clear();
    });
  }

  private rebuild(): void {
    this.build(this.plots.map(({ panel }) => panel));
  }

  private build(panels: Panel[]): void {
    for (const { plot } of this.plots) plot.destroy();
    fill(this.element);
    this.pending?.abort();
    this.pending = this.fetched = null;
    this.arrived.clear();
    this.count = panels.length;
    this.plots = panels.map((panel, i) => {
      const legend = h("div", { class: "legend" }, panel.traces.map((t) => h("span", {}, h("i", { class: `swatch ${t.color}${t.dash ? " dashed" : ""}` }), t.label)));
      const about = panel.about ? h("span", { class: "hint about", title: panel.about }, panel.about) : null;
      const box = h("div", { class: "chart", role: "img", "aria-label": `${panel.title} over time` }, h("div", { class: "chart-head" }, h("h3", {}, `${panel.title} [${panel.unit}]`), legend, about));
      this.element.append(box);
      const plot = new uPlot(this.options(panel, box.clientWidth || 700, i === panels.length - 1), [[]], box);
      this.hear(plot);
      return { panel, plot, box };
    });
    void this.fetch();
  }

  /** The charts share the room, down to what can be read; then they scroll. */
  private height(): number {
    const many = Math.max(this.plots.length, this.count, 1);
    return Math.max(Math.floor((this.element.clientHeight - 12) / many) - HEAD, LOWEST);
  }

  private later(): void {
    if (!this.timer) this.timer = window.setTimeout(() => void this.fetch(), SOON);
  }

  /** Whether the rows at hand are enough for what is shown. */
  private served(width: number): boolean {
    const has = this.fetched;
    if (!has || has.width !== width) return false;
    const [low, high] = this.range;
    const [start, end] = this.whole;
    const inside = has.range[0] <= Math.max(low, start) && has.range[1] >= Math.min(high, end);
    return inside && (!has.cut || has.range[1] - has.range[0] <= COARSE * (high - low));
  }

  /** Fetch rows where those at hand do not do; again, where the range has moved on meanwhile. */
  private async fetch(): Promise<void> {
    this.timer = 0;
    if (!this.run || !this.plots.length || this.pending) return;
    const width = Math.max(this.plots[0]?.box.clientWidth ?? 700, 100);
    if (this.served(width)) return;
    const names = new Set<string>();
    for (const { panel } of this.plots) {
      for (const t of panel.traces) {
        names.add(t.column);
        if (t.band) names.add(`${t.band}:low`).add(`${t.band}:high`);
      }
    }
    const [low, high] = this.range;
    const [first, last] = this.whole;
    const [start, end] = [Math.max(low - MARGIN * (high - low), first), Math.min(high + MARGIN * (high - low), last)];
    const buckets = Math.min(Math.ceil((width * (end - start)) / (high - low)), 5000);
    const pending = (this.pending = new AbortController());
    const found = await tried(async () => {
      try {
        return await columns("drive/window", { path: this.path, start, end, width: buckets, version: this.run?.version }, [...names], pending.signal);
      } catch (error) {
        if (error instanceof DOMException && error.name === "AbortError") return undefined;
        if (this.onReplaced && error instanceof Error && error.message.includes("was replaced since")) {
          this.onReplaced();
          return undefined;
        }
        throw error;
      }
    });
    if (this.pending !== pending) return; // other charts by now
    this.pending = null;
    if (!found) return;
    this.fetched = { range: [start, end], cut: found.cut, width };
    const at = new Map(found.names.map((name, i) => [name, found.data[i] as Float64Array]));
    const time = found.data[0] as Float64Array;
    for (const { panel, plot } of this.plots) {
      const data: (Float64Array | (number | null)[])[] = [time];
      for (const t of panel.traces) {
        if (t.band) data.push(shown(at.get(`${t.band}:low`), t.scale), shown(at.get(`${t.band}:high`), t.scale));
        data.push(shown(at.get(t.column), t.scale));
      }
      this.arrived.set(plot, data as uPlot.AlignedData);
    }
    this.element.dataset["rows"] = String(found.count);
    this.redraw();
    this.later();
  }

  private isDense(plot: uPlot): boolean {
    return this.fetched?.cut || isDense(plot);
  }

  private options(panel: Panel, width: number, last: boolean): uPlot.Options {
    const series: uPlot.Series[] = [{}];
    const log = panel.log !== undefined;
    for (const t of panel.traces) {
      const shade = color(t.color);
      if (t.band) {
        const unseen = { paths: () => null, points: { show: false } }; // they count for the scale
        series.push({ ...unseen }, { ...unseen });
      }
      series.push({ label: t.label, stroke: shade, width: 1.4, paths: (...of) => (this.isDense(of[0]) ? null : line(...of)), points: { show: false, size: 4, width: 0, fill: shade, filter: (...of) => (this.isDense(of[0]) ? [] : alone(of[0].data[of[1]] as Values)) }, ...(t.dash ? { dash: t.dash } : {}) });
    }
    const axis = { stroke: color("muted"), grid: { stroke: color("grid"), width: 1 }, ticks: { stroke: color("grid"), width: 1 }, font: "11px system-ui, sans-serif" };
    return {
      width,
      height: this.height(),
      padding: [6, 20, 0, 0],
      legend: { show: false },
      cursor: { sync: { key: SYNC }, drag: { x: true, y: false, setScale: false }, points: { show: false }, y: false },
      scales: { x: { time: false, range: () => this.range }, y: log ? { distr: 3, range: () => panel.log as Range } : { range: (plot, low, high) => limits(plot, low, high, panel) } },
      axes: [
        { ...axis, size: 24, ticks: { ...axis.ticks, size: 4 }, gap: 3, values: (_, ticks) => ticks.map((v) => `${digits(v, 6)}${last ? " s" : ""}`) },
        { ...axis, size: 52, space: 24, ...(log ? { splits: () => MARKS, filter: (_: uPlot, at: number[]) => at } : {}), values: (_, ticks) => ticks.map((v) => digits(v, 4)) },
      ],
      series,
      hooks: {
        drawClear: [(plot) => this.spans(plot)],
        drawAxes: [(plot) => (this.isDense(plot) ? columnsOfBuckets(plot, panel.traces, this.fetched?.cut ? 2 : 1) : bands(plot, panel.traces))],
        draw: [(plot) => levels(plot, panel), (plot) => beyond(plot, panel)],
        setCursor: [(plot) => plot.cursor.left !== undefined && this.onCursor?.(plot.cursor.left >= 0 ? plot.posToVal(plot.cursor.left, "x") : null)],
        setSelect: [
          (plot) => {
            if (plot.select.width < 4) return;
            const range: Range = [plot.posToVal(plot.select.left, "x"), plot.posToVal(plot.select.left + plot.select.width, "x")];
            plot.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
            this.zoom(range);
          },
        ],
      },
    };
  }

  private hear(plot: uPlot): void {
    hearPointers(plot.over, this);
    plot.over.addEventListener("dblclick", () => this.zoom(this.whole));
    plot.over.addEventListener("click", (event) => this.onPick?.(plot.posToVal(event.offsetX, "x")));
  }

  /** Soils as a tint behind, events as a strong strip at the foot. */
  private spans(plot: uPlot): void {
    const run = this.run;
    if (!run) return;
    const { ctx, bbox } = plot;
    const x = (time: number): number => Math.min(Math.max(plot.valToPos(time, "x", true), bbox.left), bbox.left + bbox.width);
    ctx.save();
    for (const span of soilsOf(run)) {
      const [from, to] = [x(span.start), x(span.end)];
      if (to <= from) continue;
      ctx.fillStyle = `color-mix(in srgb, ${color(soilColor(span.name))} 12%, transparent)`;
      ctx.fillRect(from, bbox.top, to - from, bbox.height);
    }
    const strip = 5 * devicePixelRatio;
    for (const event of run.events) {
      const [from, to] = [x(event.start), x(event.end)];
      if (to <= bbox.left || from >= bbox.left + bbox.width) continue;
      ctx.fillStyle = color(EVENT_COLORS[event.kind] ?? "ink");
      ctx.fillRect(from, bbox.top + bbox.height - strip, Math.max(to - from, devicePixelRatio), strip);
    }
    ctx.restore();
  }
}

/** A line through all points; of many, a pixel of the screen wide: wider ones cost twenty times as much without a graphics processor. */
function line(...of: Parameters<uPlot.Series.PathBuilder>): uPlot.Series.Paths | null {
  const [plot, number, from, to] = of;
  (plot.series[number] as uPlot.Series).width = to - from > MANY ? 1 / devicePixelRatio : 1.4;
  return LINE(...of);
}

/** Values in the unit that is shown; where one is unknown, an array with null for it, as uPlot has it. */
function shown(values: Float64Array | undefined, scale: number): Float64Array | (number | null)[] {
  if (!values) return [];
  const scaled = scale === 1 ? values : values.map((v) => v * scale);
  return scaled.some(Number.isNaN) ? Array.from(scaled, (v) => (Number.isNaN(v) ? null : v)) : scaled;
}

type Values = ArrayLike<number | null>;

/** Samples with none on either side: no line reaches them, so each is a point. */
export function alone(values: Values): number[] {
  const found: number[] = [];
  const known = (i: number): boolean => typeof values[i] === "number";
  for (let i = 0; i < values.length; i++) if (known(i) && !known(i - 1) && !known(i + 1)) found.push(i);
  return found;
}

/** Smallest and largest value of the shown traces, and of their intervals, by uPlot's own extremes of each series. */
function extent(plot: uPlot, panel: Panel): { values: Range; bands: Range } {
  const values: Range = [Infinity, -Infinity];
  const bands: Range = [Infinity, -Infinity];
  let at = 1;
  const take = (into: Range): void => {
    const one = plot.series[at++];
    const [low, high] = [one?.min, one?.max];
    if (typeof low === "number" && typeof high === "number" && low <= high) [into[0], into[1]] = [Math.min(into[0], low), Math.max(into[1], high)];
  };
  for (const t of panel.traces) {
    if (t.band) {
      take(bands);
      take(bands);
    }
    take(values);
  }
  return { values, bands };
}

/** The range of the data: intervals inside what the panel shows by custom, values inside the most it can sensibly show. */
function limits(plot: uPlot, low: number | null, high: number | null, panel: Panel): Range {
  const { values, bands } = extent(plot, panel);
  const [soft, hard]: Range[] = [
    [panel.low ?? -Infinity, panel.high ?? Infinity],
    [panel.least ?? panel.low ?? -Infinity, panel.most ?? panel.high ?? Infinity],
  ];
  const within = (v: number, [from, to]: Range): number => Math.min(Math.max(v, from), to);
  const ends = [...values.map((v) => within(v, hard as Range)), ...bands.map((v) => within(v, soft as Range))].filter(Number.isFinite);
  let [from, to] = ends.length && values[0] <= values[1] ? [Math.min(...ends), Math.max(...ends)] : [Math.max(low ?? 0, panel.low ?? -Infinity), Math.min(high ?? 1, panel.high ?? Infinity)];
  if (!(to > from)) [from, to] = [from - 0.5, from + 0.5];
  const room = 0.06 * (to - from);
  return [from - room, to + room];
}

/** Values that lie outside the axis are listed in its corner: nothing is left out in silence. */
function beyond(plot: uPlot, panel: Panel): void {
  const { min, max } = plot.scales["y"] ?? {};
  if (panel.log || typeof min !== "number" || typeof max !== "number") return;
  const { values } = extent(plot, panel);
  const { ctx, bbox } = plot;
  ctx.save();
  ctx.fillStyle = color("bad");
  ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
  ctx.textAlign = "right";
  const x = bbox.left + bbox.width - 4 * devicePixelRatio;
  if (values[1] > max) ctx.fillText(`▲ up to ${digits(values[1])} ${panel.unit}`, x, bbox.top + 12 * devicePixelRatio);
  if (values[0] < min) ctx.fillText(`▼ down to ${digits(values[0])} ${panel.unit}`, x, bbox.top + bbox.height - 6 * devicePixelRatio);
  ctx.restore();
}

function levels(plot: uPlot, panel: Panel): void {
  const { ctx, bbox } = plot;
  for (const level of panel.levels ?? []) {
    const y = plot.valToPos(level, "y", true);
    if (!(y > bbox.top && y < bbox.top + bbox.height)) continue;
    ctx.save();
    ctx.strokeStyle = color("muted");
    ctx.setLineDash([5 * devicePixelRatio, 4 * devicePixelRatio]);
    ctx.beginPath();
    ctx.moveTo(bbox.left, y);
    ctx.lineTo(bbox.left + bbox.width, y);
    ctx.stroke();
    ctx.restore();
  }
}

/** A stack of charts over one time axis: intervals as bands, soils and events as coloured spans, one cursor, one zoom. */

import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { brush, brushed, onBrush, onPoint, point } from "../ui/brush";
import { columns } from "../ui/columns";
import { digits, fill, h } from "../ui/dom";
import { tried } from "../ui/notes";
import { color, onTheme } from "../ui/theme";
import { alone, beyond, levels, limits, line, shown, type Values } from "./axes";
import { bands, columnsOfBuckets, isDense } from "./buckets";
import { hearKeys, hearPointers, hearUpright, zoomed, type Range } from "./gestures";
import { Readout } from "./readout";
import { EVENT_COLORS, soilColor, soilsOf, type Panel, type Run } from "./run";

const SYNC = "drive";
const [LOWEST, HEAD] = [116, 26];
/** Rows are fetched for more than is shown, this share of it on either side, so that a pan finds them there. */
const MARGIN = 0.5;
/** Rows fetched for more than so many times what is shown are too coarse. */
const COARSE = 3;
const SOON = 40; // ms
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
  /** An upright axis was set, or follows its values again. */
  onUpright: (() => void) | null = null;
  onRange: ((range: Range) => void) | null = null;
  /** The file was replaced while it was open. */
  onReplaced: (() => void) | null = null;
  /** Ends of upright axes that the user set, in SI, by the panel's key; the others follow their values. */
  uprights: Record<string, Range> = {};
  /** The time of the sample that was picked. */
  picked: number | null = null;
  private plots: { panel: Panel; plot: uPlot; box: HTMLElement; readout: Readout }[] = [];
  private pointed: { time: number | null; here: boolean } | null = null;
  private pointing = 0;
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
    const forgets = [
      onTheme(() => this.rebuild()),
      onBrush(() => this.follow()),
      onPoint((path, time) => path === this.path && this.point(time)),
    ];
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
    cancelAnimationFrame(this.pointing);
    for (const { plot } of this.plots) plot.destroy();
  }

  show(path: string, run: Run, panels: Panel[]): void {
    const same = path === this.path && run.version === this.run?.version;
    this.path = path;
    this.run = run;
    if (!same) {
      this.range = this.whole;
      this.picked = null;
    }
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

  /** Put the cursor at a time: by the map or the plane (`here`, so that other tabs follow), or by another tab. */
  point(time: number | null, here = false): void {
    for (const { plot } of this.plots) plot.setCursor({ left: time === null ? -10 : plot.valToPos(time, "x"), top: 1 }, false);
    this.cursorAt(time, here);
  }

  /** Mark the sample that was picked. */
  mark(time: number | null): void {
    this.picked = time;
    for (const { plot } of this.plots) plot.redraw(false);
  }

  /** Set an upright axis, in SI; null lets it follow its values. */
  setUpright(key: string, range: Range | null): void {
    if (range && !(range[1] > range[0])) return;
    if (range) this.uprights[key] = range;
    else delete this.uprights[key];
    for (const { panel, plot, box } of this.plots) {
      if (panel.key !== key) continue;
      box.classList.toggle("fixed", range !== null);
      plot.setScale("x", { min: this.range[0], max: this.range[1] });
    }
    this.onUpright?.();
  }

  /** The ends that the user set, in the panel's unit. */
  private upright({ key, scale }: Panel): Range | null {
    const set = this.uprights[key];
    return set ? [set[0] * scale, set[1] * scale] : null;
  }

  /** The values under the cursor, once a frame; `here`: by this page's pointer, so that other pages follow. */
  private cursorAt(time: number | null, here: boolean): void {
    this.pointed = { time, here };
    this.pointing ||= requestAnimationFrame(() => {
      this.pointing = 0;
      const now = this.pointed;
      if (!now || !this.run) return;
      const near = 0.01 * (this.range[1] - this.range[0]);
      for (const { plot, readout } of this.plots) readout.show(plot.data, now.time, this.fetched?.cut ?? false, near);
      this.onCursor?.(now.time);
      if (now.here) point(this.path, now.time);
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
      const readout = new Readout(panel);
      const about = panel.about ? h("span", { class: "hint about", title: panel.about }, panel.about) : null;
      const setShown = (range: Range | null): void => this.setUpright(panel.key, range && [range[0] / panel.scale, range[1] / panel.scale]);
      const upright = (text: string, title: string, change: () => Range | null): HTMLElement =>
        h("button", { type: "button", class: "quiet", title, "aria-label": `${title}: ${panel.title}`, click: () => setShown(change()) }, text);
      const now = (): Range => this.scale(i) ?? [0, 1];
      const middle = (): number => (now()[0] + now()[1]) / 2;
      const buttons = panel.log
        ? null
        : h(
            "span",
            { class: "upright" },
            upright("y+", "Stretch the upright axis", () => zoomed(now(), middle(), 0.6)),
            upright("y−", "Shrink the upright axis", () => zoomed(now(), middle(), 1 / 0.6)),
            upright("auto", "Let the upright axis follow its values", () => null),
          );
      const box = h("div", { class: "chart", role: "group", "aria-label": `${panel.title} over time` }, h("div", { class: "chart-head" }, h("h2", {}, `${panel.title} [${panel.unit}]`), readout.element, about, buttons));
      box.classList.toggle("fixed", panel.key in this.uprights);
      this.element.append(box);
      const plot = new uPlot(this.options(panel, box.clientWidth || 700, i === panels.length - 1), [[]], box);
      this.hear(plot);
      if (!panel.log) hearUpright(plot.root, plot.over, now, setShown);
      return { panel, plot, box, readout };
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
      scales: { x: { time: false, range: () => this.range }, y: log ? { distr: 3, range: () => panel.log as Range } : { range: (plot, low, high) => this.upright(panel) ?? limits(plot, low, high, panel) } },
      axes: [
        { ...axis, size: 24, ticks: { ...axis.ticks, size: 4 }, gap: 3, values: (_, ticks) => ticks.map((v) => `${digits(v, 6)}${last ? " s" : ""}`) },
        { ...axis, size: 52, space: 24, ...(log ? { splits: () => MARKS, filter: (_: uPlot, at: number[]) => at } : {}), values: (_, ticks) => ticks.map((v) => digits(v, 4)) },
      ],
      series,
      hooks: {
        drawClear: [(plot) => this.spans(plot)],
        drawAxes: [(plot) => (this.isDense(plot) ? columnsOfBuckets(plot, panel.traces, this.fetched?.cut ? 2 : 1) : bands(plot, panel.traces))],
        draw: [(plot) => levels(plot, panel), (plot) => beyond(plot, panel), (plot) => this.drawPicked(plot)],
        setCursor: [(plot) => plot.cursor.left !== undefined && this.cursorAt(plot.cursor.left >= 0 ? plot.posToVal(plot.cursor.left, "x") : null, true)],
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

  /** An upright line with a head at the picked sample. */
  private drawPicked(plot: uPlot): void {
    if (this.picked === null) return;
    const { ctx, bbox } = plot;
    const x = plot.valToPos(this.picked, "x", true);
    if (x < bbox.left || x > bbox.left + bbox.width) return;
    const size = 5 * devicePixelRatio;
    ctx.save();
    ctx.strokeStyle = ctx.fillStyle = color("accent");
    ctx.lineWidth = 1.5 * devicePixelRatio;
    ctx.beginPath();
    ctx.moveTo(x, bbox.top);
    ctx.lineTo(x, bbox.top + bbox.height);
    ctx.stroke();
    ctx.beginPath();
    ctx.moveTo(x - size, bbox.top);
    ctx.lineTo(x + size, bbox.top);
    ctx.lineTo(x, bbox.top + 1.5 * size);
    ctx.fill();
    ctx.restore();
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

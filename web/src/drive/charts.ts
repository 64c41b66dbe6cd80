/** A stack of charts over one time axis: intervals as bands, soils and events as coloured spans, one cursor, one zoom. */

import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { brush, brushed, onBrush, onPoint, point } from "../ui/brush";
import { digits, fill, h } from "../ui/dom";
import { color, onTheme } from "../ui/theme";
import { AXES, type Axis, type Layer } from "./along";
import { beyond, extent, levels, limits } from "./axes";
import { draw } from "./buckets";
import { listenToKeys, listenToPointers, listenToUpright, zoomed, type Range } from "./gestures";
import { pick, spans } from "./marks";
import { Readout } from "./readout";
import { Rows, type Drawn } from "./rows";
import type { Panel } from "./run";

const SYNC = "drive";
const [LOWEST, HEAD] = [104, 26];
const SOON = 40; // ms
/** Of a logarithmic axis. */
export const MARKS = [0.05, 0.2, 1, 5, 50];
/** uPlot draws axes and has the cursor; traces are drawn by `buckets.ts`, so it is given no rows. */
const NO_ROWS: uPlot.AlignedData = [[0, 1], [0, 1]];

export interface Chart {
  panel: Panel;
  plot: uPlot;
  box: HTMLElement;
  readout: Readout;
  drawn: Drawn[];
}

export class Charts {
  readonly element = h("div", { class: "charts" });
  /** What is shown of the axis: times, or places along the way. */
  range: Range = [0, 1];
  onCursor: ((time: number | null) => void) | null = null;
  onPick: ((time: number) => void) | null = null;
  /** A vertical axis was set, or fits its values again. */
  onUpright: (() => void) | null = null;
  onRange: ((range: Range) => void) | null = null;
  /** Limits of vertical axes set by the user, in SI, by the panel's key; the others fit their values. */
  uprights: Record<string, Range> = {};
  /** The time of the sample that was picked. */
  picked: number | null = null;
  private plots: Chart[] = [];
  private pointed: { time: number | null; here: boolean } | null = null;
  private pointing = 0;
  private count = 0;
  private layers: Layer[] = [];
  private rows = new Rows(() => this.arrive());
  private frame = 0;
  private timer = 0;
  private forget: () => void;
  private watcher: ResizeObserver;

  constructor() {
    const forgets = [
      onTheme(() => this.main && this.rebuild()), // without a run the reason is shown
      onBrush(() => this.follow()),
      onPoint((path, time) => path === this.path && this.point(time)),
    ];
    this.forget = () => forgets.forEach((one) => one());
    this.watcher = new ResizeObserver(() => {
      for (const { plot, box } of this.plots) if (box.clientWidth > 80) plot.setSize({ width: box.clientWidth, height: this.height() });
      this.later();
    });
    this.watcher.observe(this.element);
    listenToKeys(this.element, this);
  }

  /** The first run, whose soils, events and picked sample are marked. */
  private get main(): Layer | undefined {
    return this.layers[0];
  }

  private get path(): string {
    return this.main?.path ?? "";
  }

  get axis(): Axis {
    return this.main?.way.axis ?? "time";
  }

  /** The file was replaced while it was open. */
  set onReplaced(listener: () => void) {
    this.rows.onReplaced = listener;
  }

  /** What is drawn, chart by chart. */
  get shown(): readonly Chart[] {
    return this.plots;
  }

  /** All of the axis that a run is on. */
  get whole(): Range {
    const ends = this.layers.map(({ way }) => way.whole);
    return ends.length ? [Math.min(...ends.map(([low]) => low)), Math.max(...ends.map(([, high]) => high))] : [0, 1];
  }

  /** Whether all of it is shown. */
  get isWhole(): boolean {
    const [low, high] = this.whole;
    return this.range[0] <= low && this.range[1] >= high;
  }

  /** The limits of a chart's vertical axis. */
  scale(number: number): Range | null {
    const { min, max } = this.plots[number]?.plot.scales["y"] ?? {};
    return typeof min === "number" && typeof max === "number" ? [min, max] : null;
  }

  close(): void {
    this.forget();
    this.watcher.disconnect();
    this.rows.close();
    clearTimeout(this.timer);
    cancelAnimationFrame(this.frame);
    cancelAnimationFrame(this.pointing);
    for (const { plot } of this.plots) plot.destroy();
  }

  /** Show panels of runs over an axis, the main run first. */
  show(layers: Layer[], panels: Panel[]): void {
    const [before, now] = [this.main, layers[0]];
    const same = before?.path === now?.path && before?.run.version === now?.run.version && this.axis === (now?.way.axis ?? "time");
    this.layers = layers;
    if (!same) this.picked = null;
    if (!same || this.range[1] <= this.whole[0] || this.range[0] >= this.whole[1]) this.range = this.whole;
    this.build(panels);
  }

  /** Show no run, but why. */
  clear(why: string): void {
    this.layers = [];
    this.build([]);
    delete this.element.dataset["rows"];
    fill(this.element, h("p", { class: "hint empty" }, why));
  }

  /** Show the times brushed last, on another page or in another tab, where they are of this run. */
  follow(): void {
    const other = brushed();
    const way = this.main?.way;
    if (way && other?.path === this.path) this.zoom(other.range.map((time) => way.place(time)) as Range);
  }

  /** Show another part of the axis, here and wherever this run is shown; the rows come from the server a moment later. */
  zoom(range: Range): void {
    const way = this.main?.way;
    if (!way) return;
    const whole = this.whole;
    const least = Math.min(0.05, whole[1] - whole[0]);
    let [low, high] = range;
    if (!(high - low >= least)) [low, high] = [(low + high - least) / 2, (low + high + least) / 2];
    if (!(high > whole[0] && low < whole[1])) [low, high] = whole;
    this.range = [Math.max(low, whole[0]), Math.min(high, whole[1])];
    this.redraw();
    brush(this.path, this.range.map((place) => way.time(place)) as Range);
    this.onRange?.(this.range);
    this.later();
  }

  /** Once a frame at most, with the rows that have arrived. */
  private redraw(): void {
    this.frame ||= requestAnimationFrame(() => {
      this.frame = 0;
      for (const { plot } of this.plots) plot.setScale("x", { min: this.range[0], max: this.range[1] });
    });
  }

  /** Put the cursor at a time of the main run: by the map or the plane (`here`, so that other tabs follow), or by another tab. */
  point(time: number | null, here = false): void {
    const place = time === null ? null : this.main?.way.place(time);
    for (const { plot } of this.plots) plot.setCursor({ left: place === null || place === undefined ? -10 : plot.valToPos(place, "x"), top: 1 }, false);
    this.cursorAt(time, here);
  }

  /** Mark the sample that was picked. */
  mark(time: number | null): void {
    this.picked = time;
    for (const { plot } of this.plots) plot.redraw(false);
  }

  /** Set a vertical axis, in SI; null fits it to its values. */
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
      const way = this.main?.way;
      if (!now || !way) return;
      const near = 0.01 * (this.range[1] - this.range[0]);
      for (const { drawn, readout } of this.plots) readout.show(drawn, now.time === null ? null : way.place(now.time), near);
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
    this.rows.show(this.layers, panels);
    this.element.classList.toggle("several", this.layers.length > 1);
    this.count = panels.length;
    this.plots = panels.map((panel, i) => {
      const readout = new Readout(panel);
      const about = panel.about ? h("span", { class: "hint about", title: panel.about }, panel.about) : null;
      const setShown = (range: Range | null): void => this.setUpright(panel.key, range && [range[0] / panel.scale, range[1] / panel.scale]);
      const upright = (text: string, title: string, change: () => Range | null): HTMLElement =>
        h("button", { type: "button", class: "quiet", title, "aria-label": `${text}: ${title} of ${panel.title}`, click: () => setShown(change()) }, text);
      const now = (): Range => this.scale(i) ?? [0, 1];
      const middle = (): number => (now()[0] + now()[1]) / 2;
      const buttons = panel.log
        ? null
        : h(
            "span",
            { class: "upright" },
            upright("y+", "Stretch the vertical axis", () => zoomed(now(), middle(), 0.6)),
            upright("y−", "Shrink the vertical axis", () => zoomed(now(), middle(), 1 / 0.6)),
            upright("auto", "Fit the vertical axis", () => null),
          );
      const box = h("div", { class: "chart", role: "group", "aria-label": `${panel.title} over ${AXES[this.axis].title}` }, h("div", { class: "chart-head" }, h("h2", {}, `${panel.title} [${panel.unit}]`), readout.element, about, buttons));
      box.classList.toggle("fixed", panel.key in this.uprights);
      this.element.append(box);
      const plot = new uPlot(this.options(panel, box.clientWidth || 700, i === panels.length - 1), NO_ROWS, box);
      this.listen(plot);
      if (!panel.log) listenToUpright(plot.root, plot.over, now, setShown);
      return { panel, plot, box, readout, drawn: [] };
    });
    void this.fetch();
  }

  /** The height by the style sheet; else the charts share the space, down to the least that can be read; then they scroll. */
  private height(): number {
    const many = Math.max(this.plots.length, this.count, 1);
    const set = parseFloat(getComputedStyle(this.element).getPropertyValue("--chart-height"));
    if (set > 0) return set; // the page scrolls, not the charts
    return Math.max(Math.floor((this.element.clientHeight - 12) / many) - HEAD, LOWEST);
  }

  private later(): void {
    if (!this.timer) this.timer = window.setTimeout(() => void this.fetch(), SOON);
  }

  /** Fetch rows where those at hand do not do; again, where the range has moved on meanwhile. */
  private async fetch(): Promise<void> {
    this.timer = 0;
    if (!this.plots.length) return;
    await this.rows.need(this.range, this.whole, Math.max(this.plots[0]?.box.clientWidth ?? 700, 100));
  }

  private arrive(): void {
    for (const chart of this.plots) chart.drawn = this.rows.of(chart.panel);
    this.element.dataset["rows"] = String(this.rows.count);
    this.redraw();
    this.later();
  }

  private options(panel: Panel, width: number, last: boolean): uPlot.Options {
    const log = panel.log !== undefined;
    const { unit } = AXES[this.axis];
    const marked = this.main?.way.marked;
    const drawn = (plot: uPlot): Drawn[] => this.plots.find((one) => one.plot === plot)?.drawn ?? [];
    const axis = { stroke: color("muted"), grid: { stroke: color("grid"), width: 1 }, ticks: { stroke: color("grid"), width: 1 }, font: "11px system-ui, sans-serif" };
    return {
      width,
      height: this.height(),
      padding: [6, marked ? 30 : 20, 0, 0], // half of the last mark
      legend: { show: false },
      cursor: { sync: { key: SYNC }, drag: { x: true, y: false, setScale: false }, points: { show: false }, y: false },
      scales: { x: { time: false, range: () => this.range }, y: log ? { distr: 3, range: () => panel.log as Range } : { range: (plot) => this.upright(panel) ?? limits(extent(drawn(plot), this.range), panel) } },
      axes: [
        {
          ...axis,
          size: 24,
          ticks: { ...axis.ticks, size: 4 },
          gap: 3,
          ...(marked ? { splits: (plot: uPlot, _: number, low: number, high: number) => marked.marks(low, high, Math.max(plot.bbox.width / devicePixelRatio / 90, 2)) } : {}),
          values: (_, at) => at.map((v, i) => (marked ? `${marked.text(v, (at[1] ?? v + 1) - (at[0] ?? v))}${last && !i ? marked.zone : ""}` : `${digits(v, 6)}${last ? ` ${unit}` : ""}`)),
        },
        { ...axis, size: 52, space: 24, ...(log ? { splits: () => MARKS, filter: (_: uPlot, at: number[]) => at } : {}), values: (_, ticks) => ticks.map((v) => digits(v, 4)) },
      ],
      series: [{}, { paths: () => null, points: { show: false } }],
      hooks: {
        drawClear: [(plot) => this.main && spans(plot, this.main.run, this.main.way)],
        drawAxes: [(plot) => draw(plot, drawn(plot))],
        draw: [
          (plot) => levels(plot, panel),
          (plot) => beyond(plot, panel, extent(drawn(plot), this.range)),
          (plot) => this.picked !== null && this.main && pick(plot, this.main.way.place(this.picked)),
        ],
        setCursor: [(plot) => plot.cursor.left !== undefined && this.cursorAt(plot.cursor.left >= 0 ? this.timeAt(plot, plot.cursor.left) : null, true)],
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

  private listen(plot: uPlot): void {
    listenToPointers(plot.over, this);
    plot.over.addEventListener("dblclick", () => this.zoom(this.whole));
    plot.over.addEventListener("click", (event) => this.onPick?.(this.timeAt(plot, event.offsetX)));
  }

  /** The main run's time at a pixel of a chart. */
  private timeAt(plot: uPlot, pixel: number): number {
    return this.main?.way.time(plot.posToVal(pixel, "x")) ?? NaN;
  }
}

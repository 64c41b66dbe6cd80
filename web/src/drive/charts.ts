/** A stack of charts over one time axis: intervals as bands, soils and events as coloured spans, one cursor, one zoom. */

import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { columns } from "../ui/columns";
import { digits, fill, h } from "../ui/dom";
import { tried } from "../ui/notes";
import { color, onTheme } from "../ui/theme";
import { EVENT_COLORS, soilColor, type Panel, type Run } from "./run";

const SYNC = "drive";
const [LOWEST, HEAD] = [116, 26];

export class Charts {
  readonly element = h("div", { class: "charts" });
  /** The times shown. */
  range: [number, number] = [0, 1];
  onCursor: ((time: number | null) => void) | null = null;
  onPick: ((time: number) => void) | null = null;
  onRange: ((range: [number, number]) => void) | null = null;
  private plots: { panel: Panel; plot: uPlot; box: HTMLElement }[] = [];
  private count = 0;
  private run: Run | null = null;
  private path = "";
  private pending: AbortController | null = null;
  private timer = 0;
  private forget: () => void;
  private watcher: ResizeObserver;

  constructor() {
    this.forget = onTheme(() => this.rebuild());
    this.watcher = new ResizeObserver(() => {
      for (const { plot, box } of this.plots) if (box.clientWidth > 80) plot.setSize({ width: box.clientWidth, height: this.height() });
      this.later();
    });
    this.watcher.observe(this.element);
  }

  close(): void {
    this.forget();
    this.watcher.disconnect();
    this.pending?.abort();
    clearTimeout(this.timer);
    for (const { plot } of this.plots) plot.destroy();
  }

  show(path: string, run: Run, panels: Panel[]): void {
    const same = path === this.path;
    this.path = path;
    this.run = run;
    if (!same) this.range = [run.start, run.end];
    this.build(panels);
  }

  /** Show other times; the rows come from the server a moment later. */
  zoom(range: [number, number]): void {
    const run = this.run;
    if (!run) return;
    const least = Math.min(0.05, run.end - run.start);
    let [low, high] = range;
    if (high - low < least) [low, high] = [(low + high - least) / 2, (low + high + least) / 2];
    this.range = [Math.max(low, run.start), Math.min(high, run.end)];
    for (const { plot } of this.plots) plot.setScale("x", { min: this.range[0], max: this.range[1] });
    this.onRange?.(this.range);
    this.later();
  }

  private rebuild(): void {
    this.build(this.plots.map(({ panel }) => panel));
  }

  private build(panels: Panel[]): void {
    for (const { plot } of this.plots) plot.destroy();
    fill(this.element);
    this.count = panels.length;
    this.plots = panels.map((panel, i) => {
      const legend = h("div", { class: "legend" }, panel.traces.map((t) => h("span", {}, h("i", { class: `swatch ${t.color}` }), t.label)));
      const box = h("div", { class: "chart", role: "img", "aria-label": `${panel.title} over time` }, h("div", { class: "chart-head" }, h("h3", {}, `${panel.title} [${panel.unit}]`), legend));
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
    return Math.max(Math.floor((this.element.clientHeight - 34) / many) - HEAD, LOWEST);
  }

  private later(): void {
    clearTimeout(this.timer);
    this.timer = window.setTimeout(() => void this.fetch(), 60);
  }

  private async fetch(): Promise<void> {
    if (!this.run || !this.plots.length) return;
    this.pending?.abort();
    const pending = (this.pending = new AbortController());
    const names = new Set<string>();
    for (const { panel } of this.plots) {
      for (const t of panel.traces) {
        names.add(t.column);
        if (t.band) names.add(`${t.column}:low`).add(`${t.column}:high`);
      }
    }
    const list = [...names];
    const [start, end] = this.range;
    const width = Math.max(this.plots[0]?.box.clientWidth ?? 700, 100);
    const found = await tried(async () => {
      try {
        return await columns("drive/window", { path: this.path, start, end, width }, list, pending.signal);
      } catch (error) {
        if (error instanceof DOMException && error.name === "AbortError") return undefined;
        throw error;
      }
    });
    if (!found || pending.signal.aborted) return;
    const at = new Map(found.names.map((name, i) => [name, found.data[i] as Float64Array]));
    const time = found.data[0] as Float64Array;
    for (const { panel, plot } of this.plots) {
      const data: (Float64Array | (number | null)[])[] = [time];
      for (const t of panel.traces) {
        if (t.band) data.push(shown(at.get(`${t.column}:low`), t.scale), shown(at.get(`${t.column}:high`), t.scale));
        data.push(shown(at.get(t.column), t.scale));
      }
      plot.setData(data as uPlot.AlignedData, false);
      plot.setScale("x", { min: start, max: end });
    }
    this.element.dataset["rows"] = String(found.count);
  }

  private options(panel: Panel, width: number, last: boolean): uPlot.Options {
    const series: uPlot.Series[] = [{}];
    const bands: uPlot.Band[] = [];
    for (const t of panel.traces) {
      const shade = color(t.color);
      if (t.band) {
        const plain = { stroke: "transparent", width: 0, points: { show: false } };
        series.push({ ...plain }, { ...plain });
        bands.push({ series: [series.length - 1, series.length - 2], fill: `color-mix(in srgb, ${shade} 22%, transparent)` });
      }
      series.push({ label: t.label, stroke: shade, width: 1.4, points: { show: false }, ...(t.dash ? { dash: t.dash } : {}) });
    }
    const axis = { stroke: color("muted"), grid: { stroke: color("grid"), width: 1 }, ticks: { stroke: color("grid"), width: 1 }, font: "11px system-ui, sans-serif" };
    return {
      width,
      height: this.height(),
      legend: { show: false },
      cursor: { sync: { key: SYNC }, drag: { x: true, y: false, setScale: false }, points: { show: false }, y: false },
      scales: { x: { time: false, range: () => this.range }, y: { range: (_, low, high) => limits(low, high, panel) } },
      axes: [
        { ...axis, size: last ? 40 : 26, ticks: { ...axis.ticks, size: 4 }, gap: 3, ...(last ? { label: "time [s]", labelSize: 14, labelFont: "11px system-ui, sans-serif" } : {}), values: (_, ticks) => ticks.map((v) => digits(v, 6)) },
        { ...axis, size: 52, space: 24, values: (_, ticks) => ticks.map((v) => digits(v, 4)) },
      ],
      series,
      bands,
      hooks: {
        drawClear: [(plot) => this.spans(plot)],
        draw: [(plot) => levels(plot, panel)],
        setCursor: [(plot) => plot.cursor.left !== undefined && this.onCursor?.(plot.cursor.left >= 0 ? plot.posToVal(plot.cursor.left, "x") : null)],
        setSelect: [
          (plot) => {
            if (plot.select.width < 4) return;
            const range: [number, number] = [plot.posToVal(plot.select.left, "x"), plot.posToVal(plot.select.left + plot.select.width, "x")];
            plot.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
            this.zoom(range);
          },
        ],
      },
    };
  }

  private hear(plot: uPlot): void {
    plot.over.addEventListener(
      "wheel",
      (event) => {
        if (!event.ctrlKey && !event.shiftKey && Math.abs(event.deltaX) < Math.abs(event.deltaY) && !event.altKey) return;
        event.preventDefault();
        const at = plot.posToVal(event.offsetX, "x");
        const factor = Math.exp((event.deltaY || event.deltaX) * 0.0015);
        this.zoom([at + (this.range[0] - at) * factor, at + (this.range[1] - at) * factor]);
      },
      { passive: false },
    );
    plot.over.addEventListener("dblclick", () => this.run && this.zoom([this.run.start, this.run.end]));
    plot.over.addEventListener("click", (event) => this.onPick?.(plot.posToVal(event.offsetX, "x")));
  }

  /** Soils as a tint behind, events as a strong strip at the foot. */
  private spans(plot: uPlot): void {
    const run = this.run;
    if (!run) return;
    const { ctx, bbox } = plot;
    const x = (time: number): number => Math.min(Math.max(plot.valToPos(time, "x", true), bbox.left), bbox.left + bbox.width);
    const soils = run.soils.length ? run.soils : (run.ground?.sections ?? []).map((s) => ({ name: s.soil, start: s.start, end: s.end }));
    ctx.save();
    for (const span of soils) {
      ctx.fillStyle = `color-mix(in srgb, ${color(soilColor(span.name))} 12%, transparent)`;
      ctx.fillRect(x(span.start), bbox.top, Math.max(x(span.end) - x(span.start), 0), bbox.height);
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

function shown(values: Float64Array | undefined, scale: number): (number | null)[] {
  const out: (number | null)[] = new Array(values?.length ?? 0);
  for (let i = 0; i < out.length; i++) {
    const v = (values as Float64Array)[i] as number;
    out[i] = Number.isNaN(v) ? null : v * scale;
  }
  return out;
}

/** The range of the data, held inside what the panel can sensibly show. */
function limits(low: number | null, high: number | null, panel: Panel): [number, number] {
  let from = Math.max(low ?? 0, panel.low ?? -Infinity);
  let to = Math.min(high ?? 1, panel.high ?? Infinity);
  if (!(to > from)) [from, to] = [from - 0.5, from + 0.5];
  const room = 0.06 * (to - from);
  return [from - room, to + room];
}

function levels(plot: uPlot, panel: Panel): void {
  const { ctx, bbox } = plot;
  for (const level of panel.levels ?? []) {
    const y = plot.valToPos(level.value, "y", true);
    if (!(y > bbox.top && y < bbox.top + bbox.height)) continue;
    ctx.save();
    ctx.strokeStyle = ctx.fillStyle = color("muted");
    ctx.setLineDash([5 * devicePixelRatio, 4 * devicePixelRatio]);
    ctx.beginPath();
    ctx.moveTo(bbox.left, y);
    ctx.lineTo(bbox.left + bbox.width, y);
    ctx.stroke();
    ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
    ctx.textAlign = "right";
    ctx.fillText(level.label, bbox.left + bbox.width - 4, y - 4 * devicePixelRatio);
    ctx.restore();
  }
}

/** The vertical axis of a chart: its limits, and the values beyond them. */

import type uPlot from "uplot";
import { digits } from "../ui/dom";
import { color } from "../ui/theme";
import type { Range } from "./gestures";
import { within, type Drawn, type Values } from "./rows";
import type { Panel } from "./run";

function stretch([low, high]: Range, values: Values | undefined, first: number, last: number, counts: (i: number) => boolean): Range {
  for (let i = first; values && i < last; i++) {
    if (!counts(i)) continue;
    const v = values[i] as number;
    if (v < low) low = v; // NaN is neither
    if (v > high) high = v;
  }
  return [low, high];
}

/** An interval so many times as wide as the median says that a row is hardly known, as after each standstill. */
const HARDLY = 5;
/** Rows that the median is taken of. */
const SOME = 300;

/** Whether a row is known well enough for the axis to follow it: one that is not would press the others flat. */
function sureOf({ low, high }: Drawn, first: number, last: number): (i: number) => boolean {
  if (!low || !high) return () => true;
  const width = (i: number): number => (high[i] ?? NaN) - (low[i] ?? NaN);
  const widths: number[] = [];
  for (let i = first; i < last; i += Math.ceil((last - first) / SOME)) if (!Number.isNaN(width(i))) widths.push(width(i));
  const most = HARDLY * (widths.sort((a, b) => a - b)[widths.length >> 1] ?? Infinity);
  return (i) => !(width(i) > most);
}

export interface Extent {
  /** Of all that is shown. */
  all: Range;
  /** Of the rows that are known, and of their intervals. */
  values: Range;
  bands: Range;
}

/** Smallest and largest value of the shown rows, and of their intervals. */
export function extent(drawn: Drawn[], shown: Range): Extent {
  const nothing: Range = [Infinity, -Infinity];
  let [all, values, bands] = [nothing, nothing, nothing];
  for (const one of drawn) {
    const [first, last] = within(one.x, shown);
    const sure = sureOf(one, first, last);
    all = stretch(all, one.values, first, last, () => true);
    values = stretch(values, one.values, first, last, sure);
    bands = stretch(stretch(bands, one.low, first, last, sure), one.high, first, last, sure);
  }
  return { all, values, bands };
}

/** The range of the data: intervals inside what the panel shows by custom, values inside the most it can sensibly show. */
export function limits({ values, bands }: Extent, panel: Panel): Range {
  const [soft, hard]: Range[] = [
    [panel.low ?? -Infinity, panel.high ?? Infinity],
    [panel.least ?? panel.low ?? -Infinity, panel.most ?? panel.high ?? Infinity],
  ];
  const inside = (v: number, [from, to]: Range): number => Math.min(Math.max(v, from), to);
  const ends = [...values.map((v) => inside(v, hard as Range)), ...bands.map((v) => inside(v, soft as Range))].filter(Number.isFinite);
  let [from, to] = ends.length && values[0] <= values[1] ? [Math.min(...ends), Math.max(...ends)] : [Math.max(0, panel.low ?? -Infinity), Math.min(1, panel.high ?? Infinity)];
  if (!(to > from)) [from, to] = [from - 0.5, from + 0.5];
  const room = 0.06 * (to - from);
  return [from - room, to + room];
}

/** What is said of values that lie outside the axis, above and below it; empty where there are none. */
export function outsideOf({ all }: Extent, panel: Panel, [low, high]: Range): [string, string] {
  if (panel.log) return ["", ""];
  const unit = panel.unit === "–" ? "" : ` ${panel.unit}`;
  return [all[1] > high ? `▲ up to ${digits(all[1])}${unit}` : "", all[0] < low ? `▼ down to ${digits(all[0])}${unit}` : ""];
}

/** Shown in the chart's corners: values beyond the axis are never hidden without a sign. */
export function beyond(plot: uPlot, panel: Panel, found: Extent): void {
  const { min, max } = plot.scales["y"] ?? {};
  if (typeof min !== "number" || typeof max !== "number") return;
  const { ctx, bbox } = plot;
  const [above, below] = outsideOf(found, panel, [min, max]);
  ctx.save();
  ctx.fillStyle = color("bad");
  ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
  ctx.textAlign = "right";
  const x = bbox.left + bbox.width - 4 * devicePixelRatio;
  ctx.fillText(above, x, bbox.top + 12 * devicePixelRatio);
  ctx.fillText(below, x, bbox.top + bbox.height - 12 * devicePixelRatio);
  ctx.restore();
}

export function levels(plot: uPlot, panel: Panel): void {
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

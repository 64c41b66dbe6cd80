/** The vertical axis of a chart: its limits, and the values beyond them. */

import type uPlot from "uplot";
import { digits } from "../ui/dom";
import { color } from "../ui/theme";
import type { Range } from "./gestures";
import { within, type Drawn, type Values } from "./rows";
import type { Panel } from "./run";

function stretch([low, high]: Range, values: Values | undefined, first: number, last: number): Range {
  for (let i = first; values && i < last; i++) {
    const v = values[i] as number;
    if (v < low) low = v; // NaN is neither
    if (v > high) high = v;
  }
  return [low, high];
}

/** Smallest and largest value of the shown rows, and of their intervals. */
export function extent(drawn: Drawn[], shown: Range): { values: Range; bands: Range } {
  let values: Range = [Infinity, -Infinity];
  let bands: Range = [Infinity, -Infinity];
  for (const one of drawn) {
    const [first, last] = within(one.x, shown);
    values = stretch(values, one.values, first, last);
    bands = stretch(stretch(bands, one.low, first, last), one.high, first, last);
  }
  return { values, bands };
}

/** The range of the data: intervals inside what the panel shows by custom, values inside the most it can sensibly show. */
export function limits({ values, bands }: { values: Range; bands: Range }, panel: Panel): Range {
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
export function outsideOf({ values }: { values: Range }, panel: Panel, [low, high]: Range): [string, string] {
  if (panel.log) return ["", ""];
  return [values[1] > high ? `▲ up to ${digits(values[1])} ${panel.unit}` : "", values[0] < low ? `▼ down to ${digits(values[0])} ${panel.unit}` : ""];
}

/** Shown in the chart's corners: values beyond the axis are never hidden without a sign. */
export function beyond(plot: uPlot, panel: Panel, found: { values: Range }): void {
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
  ctx.fillText(below, x, bbox.top + bbox.height - 6 * devicePixelRatio);
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

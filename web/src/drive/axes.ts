/** The upright axis of a chart: what it spans, what lies beyond it, and lines of traces. */

import uPlot from "uplot";
import { digits } from "../ui/dom";
import { color } from "../ui/theme";
import type { Range } from "./gestures";
import type { Panel } from "./run";

const LINE = uPlot.paths.linear?.() as uPlot.Series.PathBuilder;
const MANY = 300; // points of a line

/** A line through all points; of many, a pixel of the screen wide: wider ones cost twenty times as much without a graphics processor. */
export function line(...of: Parameters<uPlot.Series.PathBuilder>): uPlot.Series.Paths | null {
  const [plot, number, from, to] = of;
  (plot.series[number] as uPlot.Series).width = to - from > MANY ? 1 / devicePixelRatio : 1.4;
  return LINE(...of);
}

/** Values in the unit that is shown; where one is unknown, an array with null for it, as uPlot has it. */
export function shown(values: Float64Array | undefined, scale: number): Float64Array | (number | null)[] {
  if (!values) return [];
  const scaled = scale === 1 ? values : values.map((v) => v * scale);
  return scaled.some(Number.isNaN) ? Array.from(scaled, (v) => (Number.isNaN(v) ? null : v)) : scaled;
}

export type Values = ArrayLike<number | null | undefined>;

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
export function limits(plot: uPlot, low: number | null, high: number | null, panel: Panel): Range {
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
export function beyond(plot: uPlot, panel: Panel): void {
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

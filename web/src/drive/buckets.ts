/** Intervals as areas; and, where there are more points than pixels, a column of pixels each from its smallest to its largest value: a
 * line through them would cost a frame. */

import type uPlot from "uplot";
import { color } from "../ui/theme";
import type { Trace } from "./run";

type Values = ArrayLike<number | null>;
const LEAST = 1.4; // pixels of a column's height
const DASH = 4;

/** Which of a chart's series hold a trace: its limits (where it has any), then itself. */
function* seriesOf(plot: uPlot, traces: Trace[]): Generator<{ trace: Trace; low?: Values; high?: Values; values: Values }> {
  let at = 1;
  for (const trace of traces) {
    const limits = trace.band ? { low: plot.data[at++] as Values, high: plot.data[at++] as Values } : {};
    const values = plot.data[at++] as Values | undefined;
    if (values) yield { trace, ...limits, values };
  }
}

function clipped(plot: uPlot, draw: (pen: CanvasRenderingContext2D) => void): void {
  const { ctx, bbox } = plot;
  ctx.save();
  ctx.beginPath();
  ctx.rect(Math.round(bbox.left), Math.round(bbox.top), Math.round(bbox.width), Math.round(bbox.height)); // whole pixels: a plain clip
  ctx.clip();
  draw(ctx);
  ctx.restore();
}

const tint = (trace: Trace): string => `color-mix(in srgb, ${color(trace.bandColor ?? trace.color)} 22%, transparent)`;

/** Whether a chart's points are so many that they are drawn as columns. */
export function isDense(plot: uPlot): boolean {
  const { min, max } = plot.scales["x"] ?? {};
  return plot.valToIdx(max ?? 1) - plot.valToIdx(min ?? 0) > plot.bbox.width / devicePixelRatio;
}

/** Rows as they are: each trace's interval as one area; where it is unknown it breaks. */
export function bands(plot: uPlot, traces: Trace[]): void {
  const time = plot.data[0];
  const { min, max } = plot.scales["x"] ?? {};
  const first = Math.max(plot.valToIdx(min ?? 0) - 1, 0);
  const last = Math.min(plot.valToIdx(max ?? 1) + 2, time.length);
  clipped(plot, (pen) => {
    for (const { trace, low, high } of seriesOf(plot, traces)) {
      if (!low || !high) continue;
      pen.fillStyle = tint(trace);
      for (let i = first; i < last; i++) {
        if (low[i] === null || high[i] === null) continue;
        const from = i;
        pen.beginPath();
        for (; i < last && low[i] !== null && high[i] !== null; i++) pen.lineTo(plot.valToPos(time[i] as number, "x", true), plot.valToPos(high[i] as number, "y", true));
        for (let k = i - 1; k >= from; k--) pen.lineTo(plot.valToPos(time[k] as number, "x", true), plot.valToPos(low[k] as number, "y", true));
        pen.fill();
      }
    }
  });
}

/** Intervals, then values over them; `points` of each bucket: 2 where rows were cut, 1 where they are as they were. */
export function columnsOfBuckets(plot: uPlot, traces: Trace[], points: 1 | 2): void {
  clipped(plot, (pen) => {
    for (const { trace, low, high, values } of seriesOf(plot, traces)) {
      if (low && high) {
        pen.fillStyle = tint(trace);
        for (const [x, width, top, bottom] of pixels(plot, low, high, points, 0)) pen.fillRect(x, top, width, bottom - top);
      }
      pen.fillStyle = color(trace.color);
      const least = LEAST * devicePixelRatio;
      let [before, after] = [NaN, NaN]; // the last column's top and bottom
      for (const [x, width, top, bottom] of pixels(plot, values, values, points, points - 1)) {
        const from = top > after ? after : top;
        const to = bottom < before ? before : bottom;
        [before, after] = [top, bottom];
        if (trace.dash && x % (2 * DASH * devicePixelRatio) >= DASH * devicePixelRatio) continue;
        const more = Math.max(least - (to - from), 0);
        pen.fillRect(x, from - more / 2, width, to - from + more);
      }
    }
  });
}

/** Left, width, top and bottom of each column of pixels; `high` is read `later` points after `low`. A column
 * of what is unknown is left out, and NaN ends what the next one joins on to. */
function* pixels(plot: uPlot, low: Values, high: Values, points: number, later: number): Generator<[number, number, number, number]> {
  const time = plot.data[0];
  const { left, width } = plot.bbox;
  const { min, max } = plot.scales["x"] ?? {};
  const [begin, end] = [min ?? 0, max ?? 1];
  const scale = width / (end - begin);
  const x = (t: number): number => Math.round(left + (t - begin) * scale);
  let [at, top, bottom] = [-Infinity, Infinity, -Infinity];
  for (let i = 0; i + points <= time.length; i += points) {
    const [from, to] = [x(time[i] as number), x(time[i + points] ?? (time[i + points - 1] as number))];
    if (to < left || from > left + width) continue;
    if (from !== at) [at, top, bottom] = [from, Infinity, -Infinity];
    const [least, most] = [low[i], high[i + later]];
    if (typeof least === "number" && typeof most === "number") {
      top = Math.min(top, plot.valToPos(most, "y", true));
      bottom = Math.max(bottom, plot.valToPos(least, "y", true));
    }
    if (to === from) continue; // the next bucket falls on the same pixels
    if (bottom >= top) yield [from, to - from, top, bottom];
    else yield [from, 0, NaN, NaN];
    at = -Infinity;
  }
}

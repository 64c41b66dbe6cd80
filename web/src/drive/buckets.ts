/** Traces with their intervals: lines, and, where there are more points than pixels, a column of pixels each from its smallest to its
 * largest value: a line through them would cost a frame. */

import type uPlot from "uplot";
import { color } from "../ui/theme";
import { within, type Drawn, type Values } from "./rows";
import type { Trace } from "./run";

const LEAST = 1.4; // pixels of a column's height
const MANY = 300; // points of a line
const DOT = 4; // pixels of a sample without neighbours

/** A number is known. */
export const isKnown = (v: number | null | undefined): v is number => typeof v === "number" && !Number.isNaN(v);

function clipped(plot: uPlot, draw: (pen: CanvasRenderingContext2D) => void): void {
  const { ctx, bbox } = plot;
  ctx.save();
  ctx.beginPath();
  ctx.rect(Math.round(bbox.left), Math.round(bbox.top), Math.round(bbox.width), Math.round(bbox.height)); // whole pixels: a plain clip
  ctx.clip();
  draw(ctx);
  ctx.restore();
}

/** Pixels of the canvas: uPlot's own way to them costs ten times as much a point. */
interface Pixels {
  left: number;
  width: number;
  x(place: number): number;
  y(value: number): number;
}

function pixelsOf(plot: uPlot): Pixels {
  const { left, top, width, height } = plot.bbox;
  const scale = plot.scales["y"] ?? {};
  const upright = scale.distr === 3 ? Math.log10 : (v: number): number => v;
  const [begin, end] = [plot.scales["x"]?.min ?? 0, plot.scales["x"]?.max ?? 1];
  const [low, high] = [upright(scale.min ?? 0), upright(scale.max ?? 1)];
  const [across, up] = [width / (end - begin), height / (high - low)];
  return { left, width, x: (place) => left + (place - begin) * across, y: (value) => top + height - (upright(value) - low) * up };
}

/** Intervals first, then values over them. */
export function draw(plot: uPlot, drawn: Drawn[]): void {
  const { min, max } = plot.scales["x"] ?? {};
  const to = pixelsOf(plot);
  const rows = drawn.map((one): [number, number] => within(one.x, [min ?? 0, max ?? 1]));
  const dense = drawn.map((one, i) => one.cut || (rows[i] as [number, number])[1] - (rows[i] as [number, number])[0] > plot.bbox.width / devicePixelRatio);
  clipped(plot, (pen) => {
    drawn.forEach((one, i) => {
      pen.fillStyle = `color-mix(in srgb, ${color(one.trace.bandColor ?? one.trace.color)} 22%, transparent)`;
      if (dense[i]) columnsOfBand(to, pen, one);
      else band(to, pen, one, rows[i] as [number, number]);
    });
    drawn.forEach((one, i) => {
      pen.fillStyle = pen.strokeStyle = color(one.trace.color);
      if (dense[i]) columnsOfBuckets(to, pen, one);
      else line(to, pen, one, rows[i] as [number, number]);
    });
  });
}

/** The interval of rows as they are: one area; where it is unknown it breaks. */
function band(to: Pixels, pen: CanvasRenderingContext2D, { x, low, high }: Drawn, [first, last]: [number, number]): void {
  if (!low || !high) return;
  const known = (i: number): boolean => isKnown(low[i]) && isKnown(high[i]);
  for (let i = first; i < last; i++) {
    if (!known(i)) continue;
    const from = i;
    pen.beginPath();
    for (; i < last && known(i); i++) pen.lineTo(to.x(x[i] as number), to.y(high[i] as number));
    for (let k = i - 1; k >= from; k--) pen.lineTo(to.x(x[k] as number), to.y(low[k] as number));
    pen.fill();
  }
}

/** A line through rows as they are; a sample without known neighbours is a point. Of many, the line is a pixel of the screen wide: wider
 * ones cost twenty times as much without a graphics processor. */
function line(to: Pixels, pen: CanvasRenderingContext2D, { x, values, trace }: Drawn, [first, last]: [number, number]): void {
  pen.lineWidth = (last - first > MANY ? 1 / devicePixelRatio : 1.4) * devicePixelRatio;
  pen.lineJoin = "round";
  pen.setLineDash((trace.dash ?? []).map((length) => length * devicePixelRatio));
  pen.beginPath();
  let on = false;
  for (let i = first; i < last; i++) {
    const v = values[i];
    if (!isKnown(v)) {
      on = false;
      continue;
    }
    const [px, py] = [to.x(x[i] as number), to.y(v)];
    if (on) pen.lineTo(px, py);
    else pen.moveTo(px, py);
    if (!on && !isKnown(values[i + 1])) {
      const size = DOT * devicePixelRatio;
      pen.fillRect(px - size / 2, py - size / 2, size, size);
    }
    on = true;
  }
  pen.stroke();
  pen.setLineDash([]);
}

function columnsOfBand(to: Pixels, pen: CanvasRenderingContext2D, one: Drawn): void {
  if (!one.low || !one.high) return;
  for (const [x, width, top, bottom] of columnsOf(to, one, one.low, one.high, 0)) pen.fillRect(x, top, width, bottom - top);
}

function columnsOfBuckets(to: Pixels, pen: CanvasRenderingContext2D, one: Drawn): void {
  const least = LEAST * devicePixelRatio;
  let [before, after] = [NaN, NaN]; // the last column's top and bottom
  for (const [x, width, top, bottom] of columnsOf(to, one, one.values, one.values, one.cut ? 1 : 0)) {
    const from = top > after ? after : top;
    const to = bottom < before ? before : bottom;
    [before, after] = [top, bottom];
    if (!inked(one.trace, x / devicePixelRatio)) continue;
    const more = Math.max(least - (to - from), 0);
    pen.fillRect(x, from - more / 2, width, to - from + more);
  }
}

/** Whether a dashed trace has ink at a pixel. */
function inked({ dash }: Trace, x: number): boolean {
  if (!dash?.length) return true;
  let left = x % dash.reduce((sum, length) => sum + length, 0);
  for (const [i, length] of dash.entries()) {
    if (left < length) return i % 2 === 0;
    left -= length;
  }
  return false;
}

/** Left, width, top and bottom of each column of pixels; `high` is read `later` points after `low`. A column
 * of what is unknown is left out, and NaN ends what the next one joins on to. */
function* columnsOf(pixels: Pixels, { x: place, cut }: Drawn, low: Values, high: Values, later: number): Generator<[number, number, number, number]> {
  const points = cut ? 2 : 1;
  const { left, width } = pixels;
  const x = (t: number): number => Math.round(pixels.x(t));
  let [at, top, bottom] = [-Infinity, Infinity, -Infinity];
  for (let i = 0; i + points <= place.length; i += points) {
    const [from, to] = [x(place[i] as number), x(place[i + points] ?? (place[i + points - 1] as number))];
    if (to < left || from > left + width) continue;
    if (from !== at) [at, top, bottom] = [from, Infinity, -Infinity];
    const [least, most] = [low[i], high[i + later]];
    if (isKnown(least) && isKnown(most)) {
      top = Math.min(top, pixels.y(most));
      bottom = Math.max(bottom, pixels.y(least));
    }
    if (to === from) continue; // the next bucket falls on the same pixels
    if (bottom >= top) yield [from, to - from, top, bottom];
    else yield [from, 0, NaN, NaN];
    at = -Infinity;
  }
}

/**
 * How a picture of a printed diagram lies in the plot. Two marks on each axis give the affine map, so any rotation or skew will do;
 * a logarithmic axis is linear in the logarithm.
 */

import { digits } from "../ui/dom";

export type Pixel = [number, number];

export interface Mark {
  pixel: Pixel;
  value: number;
}

export interface Axis {
  marks: [Mark, Mark];
  log: boolean;
}

export interface Line {
  name: string;
  points: Pixel[];
}

export interface Calibration {
  version: 1;
  slip: Axis | null;
  adhesion: Axis | null;
  opacity: number;
  shown: boolean;
  lines: Line[];
}

export interface PictureMap {
  /** From a pixel of the picture to (slip, adhesion). */
  toValue(pixel: Pixel): Pixel;
  /** From (slip, adhesion) to a pixel; NaN where a logarithmic axis has no such value. */
  toPixel(value: Pixel): Pixel;
  /** Whether straight lines stay straight. */
  linear: boolean;
}

export const EMPTY: Calibration = { version: 1, slip: null, adhesion: null, opacity: 0.5, shown: true, lines: [] };

/** The map of a calibration, or the sentence that says what is missing. */
export function mapOf(calibration: Pick<Calibration, "slip" | "adhesion">): PictureMap | string {
  const { slip, adhesion } = calibration;
  if (!slip || !adhesion) return "Click two points on each axis.";
  for (const axis of [slip, adhesion]) {
    const [a, b] = axis.marks;
    if (a.value === b.value) return "The two values of an axis must differ.";
    if (axis.log && Math.min(a.value, b.value) <= 0) return "A logarithmic axis needs positive values.";
  }
  const [p1, p2] = slip.marks;
  const [q1, q2] = adhesion.marks;
  const u: Pixel = [p2.pixel[0] - p1.pixel[0], p2.pixel[1] - p1.pixel[1]];
  const v: Pixel = [q2.pixel[0] - q1.pixel[0], q2.pixel[1] - q1.pixel[1]];
  const area = u[0] * v[1] - u[1] * v[0];
  if (Math.abs(area) < 1e-3 * Math.hypot(...u) * Math.hypot(...v) || Math.hypot(...u) < 1 || Math.hypot(...v) < 1) {
    return "The two axes have the same direction: click points further apart.";
  }
  const forward = (axis: Axis, value: number): number => (axis.log ? Math.log(value) : value);
  const back = (axis: Axis, value: number): number => (axis.log ? Math.exp(value) : value);
  const between = (axis: Axis, share: number): number => {
    const [a, b] = axis.marks;
    return back(axis, forward(axis, a.value) + share * (forward(axis, b.value) - forward(axis, a.value)));
  };
  const share = (axis: Axis, value: number): number => {
    const [a, b] = axis.marks;
    return (forward(axis, value) - forward(axis, a.value)) / (forward(axis, b.value) - forward(axis, a.value));
  };
  // A point is p1 + alpha u + beta v; lines of one slip run along v. The adhesion's zero of beta lies at q1.
  const origin = ((q1.pixel[0] - p1.pixel[0]) * -u[1] + (q1.pixel[1] - p1.pixel[1]) * u[0]) / area;
  return {
    linear: !slip.log && !adhesion.log,
    toValue([x, y]) {
      const dx = x - p1.pixel[0];
      const dy = y - p1.pixel[1];
      const alpha = (dx * v[1] - dy * v[0]) / area;
      const beta = (dy * u[0] - dx * u[1]) / area - origin;
      return [between(slip, alpha), between(adhesion, beta)];
    },
    toPixel([s, mu]) {
      const alpha = share(slip, s);
      const beta = share(adhesion, mu) + origin;
      return [p1.pixel[0] + alpha * u[0] + beta * v[0], p1.pixel[1] + alpha * u[1] + beta * v[1]];
    },
  };
}

/** Why slip values at an axis are hardly meant as they are read, 0.6 as 6 ‰ or 60 as 6000 %; "" where they may be. */
export function slipDoubt(values: number[], percent: boolean): string {
  const largest = Math.max(...values.map(Math.abs));
  if (percent && largest <= 0.01) return `The axis ends at ${digits(100 * largest)} % of slip. Is it printed as a ratio, so that this is ${digits(1e4 * largest)} %?`;
  if (!percent && largest > 1) return `The axis ends at ${digits(100 * largest)} % of slip. Is it printed in per cent, so that this is ${digits(largest)} %?`;
  return "";
}

/** How well a curve goes through what it would be fitted to: the same measures as a fit's, over the same bins. */

import { at, type Samples } from "./samples";
import type { State } from "./state";

export interface Target {
  name: string;
  color: string;
  cloud: { slip: number[]; adhesion: number[] };
  bins: { slip: number; mean: number; std: number }[];
}

/** What a fit of the active curve would use: the chosen soil (its points where it has no bins), or a digitised line; null without data. */
export function targetOf(state: State): Target | null {
  const picture = /^picture:(.*)#(\d+)$/.exec(state.target);
  if (picture) {
    const line = state.kept.pictures[picture[1] ?? ""]?.lines[Number(picture[2])];
    return line ? { name: line.name, color: "ink", cloud: { slip: [], adhesion: [] }, bins: line.points.map(([slip, mean]) => ({ slip, mean, std: 0 })) } : null;
  }
  const soil = state.soils.find((one) => one.key === state.target) ?? state.soils[0];
  if (!soil) return null;
  const { slip, adhesion } = soil.points;
  const { name, color } = soil;
  if (soil.bins.length) return { name, color, cloud: soil.points, bins: soil.bins };
  return { name, color, cloud: { slip: [], adhesion: [] }, bins: slip.map((s, i) => ({ slip: s, mean: adhesion[i] ?? NaN, std: 0 })) };
}

export interface Quality {
  count: number;
  rms: number;
  largest: number;
  r2: number;
}

/** Of a curve over bins: their number, root mean square and largest of the residuals, and R² (1 − residual over total sum of squares). */
export function quality(bins: { slip: number; mean: number }[], samples: Samples): Quality {
  const pairs = bins.map(({ slip, mean }) => [mean, mean - at(samples, slip)] as const).filter(([, left]) => Number.isFinite(left));
  const count = pairs.length;
  const average = pairs.reduce((sum, [mean]) => sum + mean, 0) / count;
  const squares = pairs.reduce((sum, [, left]) => sum + left * left, 0);
  const spread = pairs.reduce((sum, [mean]) => sum + (mean - average) ** 2, 0);
  return { count, rms: Math.sqrt(squares / count), largest: Math.max(...pairs.map(([, left]) => Math.abs(left)), 0), r2: spread > 0 ? 1 - squares / spread : NaN };
}

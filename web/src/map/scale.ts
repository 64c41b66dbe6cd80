/** The scale that a quantity is coloured by: its ends by quantiles, what lies beyond them, and how much ink an uncertain value gets. */

import { digits } from "../ui/dom";
import { withUnit } from "../ui/units";

/** The colour of ground without a label: none of the soils'. */
export const UNLABELLED = "line";
const LEVELS = 5;
export const PALEST = 0.2;

/** 5 % and 95 % of the values: one spike must not wash out the rest. */
export function spread(values: Float64Array): [number, number] {
  const known = values.filter((v) => !Number.isNaN(v)).sort();
  const low = known[Math.floor(0.05 * known.length)] ?? 0;
  const high = known[Math.floor(0.95 * known.length)] ?? 1;
  return high > low ? [low, high] : [low - 0.5, low + 0.5];
}

/** How many values lie beyond a scale, and how far. */
export function outliers(values: Float64Array | undefined, low: number, high: number): { under: number; over: number; least: number; most: number } {
  const found = { under: 0, over: 0, least: NaN, most: NaN };
  for (const v of values ?? []) {
    if (v < low) [found.under, found.least] = [found.under + 1, found.least < v ? found.least : v];
    if (v > high) [found.over, found.most] = [found.over + 1, found.most > v ? found.most : v];
  }
  return found;
}

/** In words; `noun`: what they are. */
export function outside(found: ReturnType<typeof outliers>, scale: number, unit: string, noun = "points"): string {
  const side = (count: number, value: number, word: string): string[] => (count ? [`${count} ${noun} ${word}, to ${withUnit(digits(value * scale), { name: unit })}`] : []);
  const said = [...side(found.under, found.least, "below"), ...side(found.over, found.most, "above")];
  return said.length ? `; ${said.join("; ")}` : "";
}

/** The ink of a value whose 95 % interval is so wide to either side: full where it is narrow against the scale, palest where it fills it or
 * is not known. In five steps, so that neighbours are one line. */
export function opacity(half: number, scale: number): number {
  const share = Number.isFinite(half) && scale > 0 ? Math.min((2 * half) / scale, 1) : 1;
  return 1 - ((1 - PALEST) * Math.round(share * LEVELS)) / LEVELS;
}

/** Curves and points as CSV. */

import { save } from "../ui/dom";
import { note, tried } from "../ui/notes";
import { csvOf } from "../ui/sheet";
import { at, sampled } from "./samples";
import type { State } from "./state";

/** The shown curves on a grid of 1 % of slip, a column a curve. */
export async function curveTable(state: State): Promise<void> {
  const shown = state.kept.curves.filter((curve) => curve.shown);
  const samples = await tried(() => Promise.all(shown.map(sampled)));
  if (!samples) return;
  const rows: (string | number)[][] = [["slip [-]", ...shown.map((curve) => `${curve.name} [-]`)]];
  for (let i = 0; i <= 100; i++) {
    const s = i / 100;
    rows.push([s, ...samples.map((one) => Number(at(one, s).toPrecision(8)))]);
  }
  save("adhesion-slip.csv", csvOf(rows));
}

/** The points, bins and digitised points that are shown, one a row. Points of long runs are thinned, which is said. */
export function pointTable(state: State): void {
  const rows: (string | number)[][] = [];
  let thinned = "";
  for (const soil of state.soils.filter((one) => one.shown)) {
    const { name } = soil;
    soil.points.slip.forEach((slip, i) => rows.push([name, "point", slip, soil.points.adhesion[i] ?? "", "", ""]));
    for (const bin of soil.bins) rows.push([name, "bin", bin.slip, bin.mean, bin.std, bin.count]);
    if (soil.count > soil.points.slip.length) thinned += ` ${soil.name}: ${soil.points.slip.length} of ${soil.count} samples.`;
  }
  for (const [path, picture] of Object.entries(state.kept.pictures)) {
    for (const line of picture.shown ? picture.lines : []) for (const [slip, adhesion] of line.points) rows.push([`${path} ${line.name}`, "digitised", slip, adhesion, "", ""]);
  }
  if (!rows.length) {
    note("No points are shown.", "error");
    return;
  }
  save("points.csv", csvOf([["curve", "kind", "slip [-]", "adhesion [-]", "std [-]", "count"], ...rows]));
  if (thinned) note(`Points are thinned as in the plot;${thinned} Bins use all points.`);
}

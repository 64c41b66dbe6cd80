/** The track: as lines of one shade each, and as a table. */

import { during, type Run } from "../drive/run";
import type { Columns } from "../ui/columns";
import type { Ink } from "../ui/ink";
import { note } from "../ui/notes";
import { csvOf } from "../ui/sheet";
import { color } from "../ui/theme";
import type { Place, Project } from "./figure";
import { soilAt, type Legend } from "./quantities";

const [TRACK, RIM, BRUSHED] = [5, 8, 16]; // pixels, as on the page

/** Without a position for so many seconds, and so many usual steps, a track is parted. */
const [APART, STEPS] = [5, 3];

/** Stretches of one shade and one ink are one line: a map of 20 000 features would stutter. A gap in time is not bridged. */
export function linesOf({ data }: Columns, shade: (i: number) => string, ink: (i: number) => number): GeoJSON.Feature[] {
  const [time, lon, lat] = data as [Float64Array, Float64Array, Float64Array];
  const features: GeoJSON.Feature[] = [];
  const apart = Math.max(APART, STEPS * median(Array.from(time.subarray(1), (t, i) => t - (time[i] as number))));
  let from = 0;
  for (let i = 1; i <= time.length; i++) {
    const gap = i === time.length || (time[i] as number) - (time[i - 1] as number) > apart;
    if (!gap && shade(i) === shade(from) && ink(i) === ink(from)) continue;
    const line: number[][] = [];
    for (let k = from; k <= (gap ? i - 1 : i); k++) line.push([lon[k] as number, lat[k] as number]);
    if (line.length > 1) features.push({ type: "Feature", properties: { shade: shade(from), ink: ink(from) }, geometry: { type: "LineString", coordinates: line } });
    from = i;
  }
  return features;
}

function median(values: number[]): number {
  return values.sort((a, b) => a - b)[values.length >> 1] ?? 0;
}

/** The points of the track between two times (null: all) as CSV: time, place, the quantity in the unit that is shown, soil, event. */
export function tableOf({ data, names, of, count }: Columns, run: Run, legend: Legend, range: [number, number] | null): Blob {
  const [time, lon, lat, values] = data as [Float64Array, Float64Array, Float64Array, Float64Array | undefined];
  const measured = "words" in legend ? null : legend.unit;
  const unit = measured?.name === "–" ? "-" : (measured?.name ?? "");
  const head = ["time [s]", "longitude [deg]", "latitude [deg]", ...(measured ? [`${names[3] ?? ""} [${unit}]`] : []), "soil", "event"];
  const rows: (string | number)[][] = [];
  time.forEach((t, i) => {
    if (range && (t < range[0] || t > range[1])) return;
    const value = measured ? [Number(((values?.[i] ?? NaN) * measured.scale).toPrecision(12))] : [];
    rows.push([t, lon[i] ?? NaN, lat[i] ?? NaN, ...value, soilAt(run, t), during(run.events, t)?.kind ?? ""]);
  });
  if (of && of > count) note(`The track is thinned to ${count} of ${of} positions, and so is the table; Drive saves every row.`);
  return csvOf([head, ...rows]);
}

/** The track on a sheet: the stretch whose times are shown below it, the picked sample above. */
export function drawTrack(ink: Ink, project: Project, { track, brushed, picked }: { track: GeoJSON.Feature[]; brushed: GeoJSON.Feature[]; picked: Place | null }): void {
  const line = (feature: GeoJSON.Feature, shade: string, wide: number, alpha = 1): void => {
    if (feature.geometry.type === "LineString") ink.line(feature.geometry.coordinates.flatMap((place) => project(place as Place)), { color: shade, width: wide, alpha, round: true });
  };
  for (const feature of brushed) line(feature, color("accent"), BRUSHED, 0.45);
  for (const feature of track) line(feature, color("muted"), RIM);
  for (const feature of track) line(feature, String(feature.properties?.["shade"]), TRACK, Number(feature.properties?.["ink"] ?? 1));
  if (!picked) return;
  ink.dots(project(picked), 9, color("ink"), 1);
  ink.dots(project(picked), 6, color("accent"), 1);
}

/** What is said of one cell, and the cells as a table. */

import { digits } from "../../ui/dom";
import { csvOf } from "../../ui/sheet";
import { unitOf, type Unit } from "../../ui/units";
import type { Cells, Field, Mapped, Place } from "./data";
import { titleOf } from "./layers";

/** A value with its standard deviation, both to the place that the latter bears. */
export function withStd(value: number, std: number, { scale, name }: Pick<Unit, "scale" | "name">): string {
  const [v, s] = [value * scale, std * scale];
  const decimals = s > 0 && Number.isFinite(s) ? Math.min(Math.max(1 - Math.floor(Math.log10(s)), 0), 8) : 3;
  return `${v.toFixed(decimals)} ± ${Number.isFinite(s) ? s.toFixed(decimals) : "?"}${name === "–" ? "" : ` ${name}`}`;
}

export function degrees([longitude, latitude]: Place, decimals = 6): string {
  const one = (value: number, [plus, minus]: string): string => `${Math.abs(value).toFixed(decimals)}° ${value < 0 ? minus : plus}`;
  return `${one(latitude, "NS")} ${one(longitude, "EW")}`;
}

export function reading(i: number, cells: Cells, field: Field, mapped: Mapped, place: Place): string {
  const unit = unitOf(mapped.name);
  const [rows, passes] = [cells.rows[i] as number, cells.passes[i] as number];
  const soil = cells.soils[cells.soil[i] as number];
  const probability = cells.soil_probability[i] as number;
  const difference = cells.difference?.[i] ?? NaN;
  return [
    `${titleOf(mapped.name, field)} ${withStd(cells.value[i] as number, cells.std[i] as number, unit)} (SD)`,
    rows ? `${rows} ${rows === 1 ? "row" : "rows"}, ${passes} ${passes === 1 ? "pass" : "passes"}` : "not driven: by kriging from its neighbours",
    (cells.headland[i] as number) > 0.5 ? "headland" : "field",
    soil ? `${soil}${Number.isNaN(probability) ? "" : ` ${digits(100 * probability)} %`}` : "",
    Number.isNaN(difference) ? "" : `change ${withStd(difference, cells.difference_std?.[i] ?? NaN, unit)}, ${cells.significant?.[i] ? "significant" : "not significant"}`,
    degrees(place),
  ]
    .filter(Boolean)
    .join("   ");
}

/** The cells that are shown as CSV, values in the unit that is shown. */
export function tableOf(cells: Cells, field: Field, mapped: Mapped, shown: (i: number) => boolean, placeOf: (column: number, row: number) => Place): Blob {
  const unit = unitOf(mapped.name);
  const name = unit.name === "–" ? "-" : unit.name;
  const scaled = (value: number | undefined): number => Number(((value ?? NaN) * unit.scale).toPrecision(6));
  const again = cells.difference !== undefined;
  const head = ["longitude [deg]", "latitude [deg]", `east [m] EPSG:${field.epsg}`, "north [m]", `${mapped.name} [${name}]`, `standard deviation [${name}]`, "rows", "passes", "headland", "soil", "soil probability", ...(again ? [`change [${name}]`, `its standard deviation [${name}]`, "significant"] : [])];
  const rows: (string | number)[][] = [head];
  for (let i = 0; i < cells.count; i++) {
    if (!shown(i)) continue;
    const [column, row] = [(cells.column[i] as number) + 0.5, (cells.row[i] as number) + 0.5];
    const [longitude, latitude] = placeOf(column, row);
    const change = again ? [scaled(cells.difference?.[i]), scaled(cells.difference_std?.[i]), cells.significant?.[i] ?? 0] : [];
    rows.push([longitude.toFixed(8), latitude.toFixed(8), column * field.cell, row * field.cell, scaled(cells.value[i]), scaled(cells.std[i]), cells.rows[i] as number, cells.passes[i] as number, Number((cells.headland[i] as number).toPrecision(3)), cells.soils[cells.soil[i] as number] ?? "", cells.soil_probability[i] as number, ...change]);
  }
  return csvOf(rows);
}

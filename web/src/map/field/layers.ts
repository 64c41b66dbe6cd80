/** The layers of a map: what of a quantity's cells is drawn, in which colours, and the legend. */

import { soilColor } from "../../drive/run";
import { color, theme } from "../../ui/theme";
import { unitOf, type Unit } from "../../ui/units";
import type { Legend } from "../quantities";
import { opacity, outliers, outside, spread, UNLABELLED } from "../scale";
import { CIVIDIS, mixed, rgbOf, type Rgb } from "../shade";
import type { Cells, Field, Mapped } from "./data";

/** What a quantity is called where its cells are read, and in the choice. */
export function titleOf(quantity: string, { reference_slip }: Pick<Field, "reference_slip">): string {
  const percent = Number((100 * reference_slip).toPrecision(3));
  return { adhesion: `Adhesion µ at ${percent} % slip`, soil_resistance: "Soil resistance ρs", slip: "Slip", efficiency: "Efficiency η" }[quantity] ?? quantity;
}

export type LayerName = "value" | "std" | "change" | "passes" | "count" | "headland" | "soil";
export type AreaName = "all" | "field" | "headland";

/** The layers of a quantity, with why one has nothing to show. */
export function layersOf(field: Field, mapped: Mapped | undefined): { value: LayerName; title: string; none?: string }[] {
  return [
    { value: "value", title: "Value" },
    { value: "std", title: "Standard deviation" },
    { value: "change", title: "Change", ...(mapped?.changes.length ? {} : { none: "driven once" }) },
    { value: "passes", title: "Passes" },
    { value: "count", title: "Rows" },
    { value: "headland", title: "Field and headland" },
    { value: "soil", title: "Soil", ...(field.soils ? {} : { none: "not known" }) },
  ];
}

/** A layer as it is drawn: the colour of each cell, and the legend. */
export interface Painted {
  legend: Legend;
  /** The colour of a cell, and its ink from 0 to 1. */
  paint(i: number): [Rgb, number];
}

const NEITHER = 0.3; // ink of a change that is not significant

/** Whether a cell is in the chosen area. */
export const inArea = (cells: Cells, area: AreaName) => (i: number): boolean => area === "all" || (cells.headland[i] as number) > 0.5 === (area === "headland");

export function painted(layer: LayerName, cells: Cells, field: Field, mapped: Mapped, area: AreaName, fade: boolean): Painted {
  const inside = inArea(cells, area);
  const title = titleOf(mapped.name, field);
  const unit = unitOf(mapped.name);
  const of = (values: ArrayLike<number>): Float64Array => Float64Array.from({ length: cells.count }, (_, i) => (inside(i) ? (values[i] as number) : NaN)).filter((v) => !Number.isNaN(v));
  if (layer === "headland") {
    const words = (["field", "headland"] as const).map((text) => ({ text, shade: text === "field" ? "blue" : "orange" }));
    return { legend: { title: "Field and headland", words }, paint: (i) => [rgbOf(color((cells.headland[i] as number) > 0.5 ? "orange" : "blue")), 1] };
  }
  if (layer === "soil") return soils(cells, inside, fade);
  if (layer === "change") return change(cells, mapped, title, unit, inside, of);
  const values = layer === "value" ? cells.value : layer === "std" ? cells.std : layer === "passes" ? cells.passes : cells.rows;
  const [low, high] = layer === "passes" ? counted(of(values)) : spread(of(values));
  const fades = layer === "value" && fade;
  const legend: Legend = {
    title: { value: title, std: `Standard deviation: ${title}`, passes: "Passes", count: "Rows" }[layer],
    unit: layer === "value" || layer === "std" ? unit : plain(layer === "passes" ? "passes" : "rows"),
    low,
    high,
    about: layer === "passes" ? "" : `5 % to 95 % of the cells${outside(outliers(of(values), low, high), unitScale(layer, unit), layer === "count" ? "rows" : unit.name, "cells")}`,
    ...(fades ? { fades: "fainter where the 95 % interval is wider, faintest where it is as wide as the scale" } : {}),
  };
  return {
    legend,
    paint: (i) => [CIVIDIS_STEPS(((values[i] as number) - low) / (high - low)), fades ? opacity(1.96 * (cells.std[i] as number), high - low) : 1],
  };
}

const STEPS = 256;
const CIVIDIS_STEPS = stepped(CIVIDIS);

/** The colours of a scale, mixed once. */
function stepped(colors: (share: number) => Rgb): (share: number) => Rgb {
  const all = Array.from({ length: STEPS }, (_, k) => colors(k / (STEPS - 1)));
  return (share) => all[Math.round(Math.min(Math.max(share, 0), 1) * (STEPS - 1))] as Rgb;
}

const plain = (name: string): Unit => ({ name, scale: 1, decimals: 0 });
const unitScale = (layer: LayerName, unit: Unit): number => (layer === "count" ? 1 : unit.scale);

/** The ends of a scale of whole numbers. */
function counted(values: Float64Array): [number, number] {
  let [low, high] = [Infinity, -Infinity];
  for (const v of values) [low, high] = [Math.min(low, v), Math.max(high, v)];
  return high > low ? [low, high] : [Number.isFinite(low) ? low : 0, (Number.isFinite(low) ? low : 0) + 1];
}

/** Less is orange, more is blue, which colour-blind readers can distinguish; none is the page's own grey. */
function change(cells: Cells, mapped: Mapped, title: string, unit: Unit, inside: (i: number) => boolean, of: (values: ArrayLike<number>) => Float64Array): Painted {
  const { difference = new Float32Array(cells.count).fill(NaN), significant } = cells;
  const [low, high] = spread(of(difference));
  const most = Math.max(Math.abs(low), Math.abs(high));
  const stops = theme() === "dark" ? ["#ff8a4a", "#8a5a3c", "#4a525b", "#3f6f92", "#58aee6"] : ["#b04600", "#e0925a", "#dfe3e8", "#7ab0d4", "#005a8e"];
  const colors = stepped((share) => mixed(stops, share));
  const [again, changed] = mapped.changes.reduce(([n, k], one) => [n + one.cells, k + one.significant], [0, 0]);
  return {
    legend: {
      title: `Change of ${title}`,
      unit,
      low: -most,
      high: most,
      about: `from the first pass to the last: ${changed} of ${again} cells driven again changed (at most 5 % of them by chance); cells driven once are left out`,
      colors: (share) => `rgb(${colors(share).join(" ")})`,
      fades: "faint where the change is not significant",
    },
    paint: (i) => {
      const d = difference[i] as number;
      return Number.isNaN(d) || !inside(i) ? [[0, 0, 0], 0] : [colors(0.5 + d / (2 * most)), significant?.[i] ? 1 : NEITHER];
    },
  };
}

function soils(cells: Cells, inside: (i: number) => boolean, fade: boolean): Painted {
  const there = new Set<number>();
  for (let i = 0; i < cells.count; i++) if (inside(i)) there.add(cells.soil[i] as number);
  const shade = (name: string): string => (name ? soilColor(name) : UNLABELLED);
  const words = cells.soils.filter((_, k) => there.has(k)).map((name) => ({ text: name || "unlabelled", shade: shade(name) }));
  const colors = cells.soils.map((name) => rgbOf(color(shade(name))));
  return {
    legend: { title: fade ? "Soil, fainter where it is less probable" : "Soil", words },
    paint: (i) => {
      const probability = cells.soil_probability[i] as number;
      return [colors[cells.soil[i] as number] as Rgb, fade && !Number.isNaN(probability) ? Math.max(probability ** 2, 0.2) : 1];
    },
  };
}

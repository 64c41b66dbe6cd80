/** A column of a log before it means anything: what it holds, in words and as a small plot. */

import { digits, h } from "../ui/dom";
import { svg } from "./sketch";

export interface Column {
  name: string;
  kind: string;
  unit: string | null;
  missing: number;
  minimum: number | null;
  median: number | null;
  maximum: number | null;
  examples: string[];
  outline: ([number, number] | null)[] | null;
}

/** What a column holds, in its own unit. */
export function rangeOf(column: Column | undefined): string {
  if (!column || column.minimum === null) return (column?.examples ?? []).slice(0, 3).join(", ");
  const fine = digits(column.minimum) === digits(column.maximum) ? 7 : 3; // a field's longitudes differ from the fifth digit on
  return `${digits(column.minimum, fine)} to ${digits(column.maximum, fine)}, median ${digits(column.median, fine)}${column.unit ? ` ${column.unit}` : ""}`;
}

/** `unit`: that of the channel, which a column without one is taken to be in. */
export function chosenByHand(column: Column | undefined, unit: string | null): string {
  return `chosen by you; ${unit && column && !column.unit ? "? no unit is stated: check it; " : ""}${rangeOf(column)}`;
}

/** How a column runs: the range of each stretch of the log, with zero as a line where it is crossed. */
export function plot(column: Column, turned: boolean): Element {
  const outline = column.outline;
  if (!outline) return h("span");
  const known = outline.filter((one) => one !== null);
  const low = Math.min(...known.map((one) => one[0]));
  const high = Math.max(...known.map((one) => one[1]));
  const span = high - low || 1;
  const y = (value: number): number => (turned ? 2 + (28 * (value - low)) / span : 30 - (28 * (value - low)) / span);
  const width = 120 / outline.length;
  const path = outline
    .map((one, i) => (one ? `M${((i + 0.5) * width).toFixed(1)} ${(y(one[0]) + 0.6).toFixed(1)}V${(y(one[1]) - 0.6).toFixed(1)}` : ""))
    .join("");
  return svg(
    "svg",
    { viewBox: "0 0 120 32", class: "outline", role: "img", "aria-label": `${column.name} over the log, ${digits(low)} to ${digits(high)}` },
    low < 0 && high > 0 ? svg("line", { x1: 0, x2: 120, y1: y(0), y2: y(0), class: "zero" }) : null,
    svg("path", { d: path, "stroke-width": Math.max(1.2, width) }),
  );
}

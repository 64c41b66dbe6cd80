/** Everything known of one sample, in words and tables. */

import { moment, type Timed } from "../ui/clock";
import { digits, h } from "../ui/dom";
import { unitOf } from "../ui/units";
import type { Event } from "./run";

export interface Sample {
  row: number;
  time: number;
  values: Record<string, number | null>;
  measured: Record<string, number | null>;
  labels: Record<string, string>;
  event: string;
  why: string[];
}

export function described(sample: Sample, event: Event | undefined, run: Timed | null): (HTMLElement | null)[] {
  const names = Object.keys(sample.values).filter((name) => !name.endsWith("_std"));
  const measured = Object.entries(sample.measured);
  const spread = (name: string): string => {
    const std = sample.values[`${name}_std`];
    return std === undefined || std === null ? "" : `± ${digits(1.96 * std * unitOf(name).scale, 2)}`;
  };
  const value = (name: string, v: number | null | undefined, count: number): string => digits(typeof v === "number" ? v * unitOf(name).scale : v, count);
  return [
    h("p", {}, h("strong", {}, `t = ${run ? moment(run, sample.time, 3) : `${sample.time.toFixed(3)} s`}`), ` (row ${sample.row})`, sample.labels["soil"] ? `, ${sample.labels["soil"]}` : ""),
    sample.event ? h("p", { class: "bad" }, `${sample.event}${event?.why ? `: ${event.why}` : ""}`) : null,
    h("h3", {}, "Why µ changed"),
    ...sample.why.map((text) => h("p", { class: "why" }, text)),
    h("h3", {}, "Estimated"),
    h("table", {}, h("tbody", {}, names.map((name) => h("tr", {}, h("th", { scope: "row" }, name), h("td", {}, value(name, sample.values[name], 4)), h("td", {}, spread(name)), h("td", { class: "unit" }, unitOf(name).name))))),
    measured.length ? h("h3", {}, "Measured") : null,
    measured.length ? h("table", {}, h("tbody", {}, measured.map(([name, v]) => h("tr", {}, h("th", { scope: "row" }, name), h("td", {}, value(name, v, 5)), h("td", {}), h("td", { class: "unit" }, unitOf(name).name))))) : null,
  ];
}

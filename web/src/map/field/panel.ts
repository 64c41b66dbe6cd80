/** Beside the map: field and headland apart, changes between runs, anomalies as a list, how the map was made. */

import type { Job } from "../../ui/api";
import { digits, h } from "../../ui/dom";
import { unitOf } from "../../ui/units";
import { commandLine } from "../../start/jobs";
import type { Anomaly, Area, Field, Mapped } from "./data";
import { titleOf } from "./layers";
import { degrees, withStd } from "./reading";

const LISTED = 200;
const SEARCHED = ["adhesion", "soil_resistance"];
const WORDS: Record<string, string> = { grips: "grips better", slips: "grips less", soft: "soft", firm: "firm", high: "high", low: "low" };

/** Of a map of slip alone, which tells nothing of grip: a turn without its tool slips less too. */
const OF_SLIP: Record<string, string> = { grips: "slips less", slips: "slips more" };
const HALF = 1.96; // standard deviations of half a 95 % interval

/** The panel of one quantity; `go`: an anomaly was chosen; `job`: what made the file, where this studio did. */
export function panelOf(field: Field, mapped: Mapped, found: Anomaly[], go: (anomaly: Anomaly) => void, job: Job | undefined): HTMLElement[] {
  return [areas(field, mapped), changes(mapped), anomalies(mapped, found, go), about(field, job)];
}

function areas(field: Field, { name, areas: of }: Mapped): HTMLElement {
  const unit = unitOf(name);
  const row = (title: string, area: Area | null): HTMLElement =>
    h("tr", {}, h("th", { scope: "row" }, title), area ? [h("td", {}, digits(area.middle * unit.scale)), h("td", {}, `${digits(area.low * unit.scale)} to ${digits(area.high * unit.scale)}`), h("td", {}, area.cells)] : h("td", { colspan: 3 }, "no cell"));
  return h(
    "section",
    {},
    h("h2", {}, titleOf(name, field)),
    h("table", { class: "areas" }, h("thead", {}, h("tr", {}, h("th", { scope: "col" }, "Area"), h("th", { scope: "col" }, `Median${unit.name === "–" ? "" : ` [${unit.name}]`}`), h("th", { scope: "col" }, "10 to 90 %"), h("th", { scope: "col" }, "Cells"))), h("tbody", {}, row("Field", of.field), row("Headland", of.headland))),
  );
}

function changes({ changes: all }: Mapped): HTMLElement {
  const of = ({ first, last, cells, significant }: Mapped["changes"][number]): HTMLElement => h("li", {}, `${first === last ? `within ${first}` : `${first} → ${last}`}: ${significant} of ${cells} cells`);
  return h("section", {}, h("h2", {}, "Changed between passes"), all.length ? h("ul", {}, all.map(of)) : h("p", { class: "hint" }, "Every cell was driven once. Drive the field again, or map several days together."));
}

function anomalies({ name }: Mapped, found: Anomaly[], go: (anomaly: Anomaly) => void): HTMLElement {
  const unit = unitOf(name);
  const none = found.length || SEARCHED.includes(name) ? "No patch differs from its surroundings." : "Searched in adhesion and soil resistance, which belong to the ground.";
  const line = (one: Anomaly, i: number): HTMLElement =>
    h(
      "li",
      {},
      h("button", { type: "button", class: "link", "data-key": `anomaly ${i}`, click: () => go(one) }, `${i + 1}  ${(name === "slip" ? OF_SLIP : WORDS)[one.kind] ?? one.kind}: ${one.difference > 0 ? "+" : ""}${withStd(one.difference, HALF * one.difference_std, unit)}`),
      h("span", { class: "hint" }, `${digits(one.area)} m² at ${degrees(one.place, 5)}, p\u00a0${one.p < 1e-4 ? "<\u00a00.0001" : digits(one.p, 2)}`),
    );
  return h("section", { id: "anomalies" }, h("h2", {}, found.length ? `Anomalies (${found.length})` : "Anomalies"), found.length ? h("p", { class: "hint" }, "By how much they differ from their surroundings, ± 95 %.") : null, found.length ? h("ol", { class: "anomalies" }, found.slice(0, LISTED).map(line)) : h("p", { class: "hint" }, none), found.length > LISTED ? h("p", { class: "hint" }, `The ${LISTED} strongest; all are in the file.`) : null);
}

function about(field: Field, job: Job | undefined): HTMLElement {
  const runs = field.runs.length === 1 ? field.runs[0] : `${field.runs.length} runs: ${field.runs.join(", ")}`;
  return h(
    "details",
    { class: "about-map" },
    h("summary", {}, h("h2", {}, `About this map${field.notes.length ? ` (${field.notes.length} ${field.notes.length === 1 ? "note" : "notes"})` : ""}`)),
    h("p", {}, `Of ${runs}. Cells of ${digits(field.cell)} m, ${field.cells} in all, EPSG:${field.epsg}; positions in ${field.datum}.`),
    field.notes.length ? h("ul", {}, field.notes.map((note) => h("li", {}, note))) : null,
    job ? [h("p", { class: "hint" }, "Command line that makes it:"), commandLine(job.command)] : null,
  );
}

/** The line above the charts: which run has which colour; soils, events and notes of the main one. */

import { h } from "../ui/dom";
import type { Layer } from "./along";
import { runColor } from "./overlay";
import { EVENT_COLORS, soilColor, soilsOf } from "./run";

/** `chosen`: the wheels that are shown. */
export function legendOf(layers: Layer[], chosen: string[]): (HTMLElement | null)[] {
  const run = layers[0]?.run;
  if (!run) return [];
  const soils = [...new Set(soilsOf(run).map((s) => s.name))];
  const kinds = [...new Set(run.events.map((event) => event.kind))];
  const several = layers.length > 1;
  const without = layers.filter((layer) => !layer.run.wheels.some((wheel) => chosen.includes(wheel)));
  return [
    ...(several ? layers.map(({ label, path }, i) => h("span", { class: "run", title: path }, h("i", { class: `swatch ${runColor(i)}` }), label)) : []),
    without.length ? h("span", { class: "bad", id: "no-wheels" }, `No wheel of ${several ? without.map(({ label }) => label).join(", ") : "the run"} is chosen, so its wheels' traces are not shown.`) : null,
    several && soils.length + kinds.length ? h("span", { class: "hint" }, `Of ${layers[0]?.label}:`) : null,
    ...soils.map((name) => h("span", {}, h("i", { class: `patch ${soilColor(name)}` }), name)),
    ...kinds.map((kind) => h("span", {}, h("i", { class: `strip ${EVENT_COLORS[kind] ?? "ink"}` }), kind)),
    run.recording ? null : h("span", { class: "hint" }, "The recording is not in this folder: measured channels are left out."),
    run.notes.length ? h("details", { class: "chooser run-notes" }, h("summary", {}, `${run.notes.length} ${run.notes.length === 1 ? "note" : "notes"}`), h("ul", { class: "menu" }, run.notes.map((text) => h("li", {}, text)))) : null,
  ];
}

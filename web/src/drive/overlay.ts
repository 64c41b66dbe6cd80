/** Several runs in one set of charts: a colour a run, a dash a trace, so that no two look the same, also to colour-blind readers. */

import { h, fill } from "../ui/dom";
import { oneAtATime } from "../ui/page";
import { onceReleased } from "../ui/press";
import { CURVE_COLORS } from "../ui/theme";
import type { Layer } from "./along";
import { formulaPanels, type Formula } from "./formulas";
import { panelsOf, type Panel, type Trace } from "./run";

/** Runs that can lie over the main one: the palette has a colour for each. */
export const OTHERS = CURVE_COLORS.length - 1;
/** Dashes of the traces of one run: solid, dashed, dotted, both. */
const DASHES = [[], [7, 4], [2, 3], [9, 3, 2, 3]];

export const runColor = (layer: number): string => CURVE_COLORS[layer % CURVE_COLORS.length] ?? "blue";

/** The panels of some runs, each quantity of all of them in one. */
export function panelsOfAll(layers: Layer[], wheels: string[], formulas: Formula[]): Panel[] {
  const each = layers.map((layer) => [...panelsOf(layer.run, wheels), ...formulaPanels(layer, formulas)]);
  if (each.length < 2) return each[0] ?? [];
  const all: { panel: Panel; kinds: string[] }[] = [];
  each.forEach((panels, layer) => {
    for (const panel of panels) {
      let one = all.find(({ panel: other }) => other.key === panel.key && other.title === panel.title);
      if (!one) all.push((one = { panel: { ...panel, traces: [] }, kinds: [] }));
      for (const trace of panel.traces) one.panel.traces.push(ofRun(trace, layer, layers[layer]?.label ?? "", one.kinds));
    }
  });
  return all.map(({ panel }) => panel);
}

function ofRun({ bandColor: _, dash: __, ...trace }: Trace, layer: number, run: string, kinds: string[]): Trace {
  if (!kinds.includes(trace.label)) kinds.push(trace.label);
  const dash = kinds.indexOf(trace.label) % DASHES.length;
  return { ...trace, layer, color: runColor(layer), label: `${run} ${trace.label}`.trim(), dash: DASHES[dash] ?? [], dashed: dash };
}

/** The chooser of runs to draw over the main one; `choose` shows them, and redraws this with those that could be shown. */
export function overlayChooser(choose: (paths: string[]) => Promise<void>): { element: HTMLElement; draw: (runs: string[], main: string, chosen: string[]) => void } {
  const element = h("details", { class: "chooser", id: "overlay" }, h("summary", {}, "Overlay"));
  const menu = h("div", { class: "menu" });
  element.append(menu);
  let ticked = new Set<string>();
  let asked = 0; // boxes ticked whose runs are not shown yet: their ticks stay
  const show = oneAtATime(() => choose([...ticked]));
  const tick = async (path: string, on: boolean): Promise<void> => {
    if (on) ticked.add(path);
    else ticked.delete(path);
    asked++;
    await show().finally(() => asked--);
  };
  return {
    element,
    draw: (runs, main, chosen) =>
      onceReleased(element, () => {
        const summary = element.querySelector("summary");
        if (summary) summary.textContent = chosen.length ? `Overlay: ${chosen.length}` : "Overlay";
        const others = runs.filter((path) => path !== main);
        if (asked < 2) ticked = new Set(chosen);
        fill(
          menu,
          others.map((path) => {
            const box = h("input", { type: "checkbox", checked: ticked.has(path), disabled: !ticked.has(path) && ticked.size >= OTHERS });
            box.addEventListener("change", () => void tick(path, box.checked));
            return h("label", { class: "check" }, box, path);
          }),
          h("p", { class: "hint" }, others.length ? `Up to ${OTHERS} runs over the one shown, by time since their start or by distance driven.` : "There are no other estimates in this folder."),
        );
      }),
  };
}

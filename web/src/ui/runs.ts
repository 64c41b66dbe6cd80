/** The run that a page opens, and the message where that run is not available. */

import type { Item } from "./api";
import { h } from "./dom";

/** The estimates of the folder, by path. */
export function runsOf(items: Item[]): Map<string, string> {
  return new Map(items.filter((item) => item.kind === "estimates").map((item) => [item.path, `${item.size} ${item.modified}`]));
}

/** The options of a run's choice; one that is requested and missing comes first, so that the choice never names another run. */
export function options(runs: Map<string, string>, chosen: string): HTMLElement[] {
  const names = [...runs.keys()];
  const missing = chosen && !runs.has(chosen) ? [h("option", { value: chosen, selected: true }, `${chosen} (not available)`)] : [];
  if (!names.length && !missing.length) return [h("option", { value: "" }, "No estimates in the folder")];
  return [...missing, ...names.map((name) => h("option", { value: name, selected: name === chosen }, name))];
}

/** What is said in place of a run that a link names and the folder does not hold as estimates. */
export function notHere(path: string): string {
  return `${path} contains no estimates that can be read, or is not in this folder. Choose another run.`;
}

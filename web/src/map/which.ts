/** What the page shows: the track of a run, or the cells of a map; one choice for both. */

import type { Item } from "../ui/api";
import { h } from "../ui/dom";
import { options, runsOf } from "../ui/runs";

export const isMap = (path: string): boolean => path.toLowerCase().endsWith(".gpkg");
export const addressOf = (path: string): string => `#/map?${isMap(path) ? "map" : "path"}=${encodeURIComponent(path)}`;

/** The maps of the folder, by path. */
export function mapsOf(items: Item[]): Map<string, string> {
  return new Map(items.filter((item) => item.kind === "map").map((item) => [item.path, `${item.size} ${item.modified}`]));
}

/** The options of the choice, runs and maps apart. */
export function listed(items: Item[], chosen: string): HTMLElement[] {
  const [runs, maps] = [runsOf(items), mapsOf(items)];
  const group = (label: string, of: Map<string, string>, here: boolean): HTMLElement => h("optgroup", { label }, options(of, here ? chosen : ""));
  if (!maps.size && !isMap(chosen)) return options(runs, chosen);
  return [...(runs.size ? [group("Tracks of runs", runs, !isMap(chosen))] : []), group("Maps", maps, isMap(chosen))];
}

/** Open what was chosen where it is of the other kind; whether it was. */
export function isElsewhere(chosen: string, here: "path" | "map"): boolean {
  const other = isMap(chosen) !== (here === "map");
  if (other) location.hash = addressOf(chosen);
  return other;
}

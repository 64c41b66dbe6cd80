/** What is shown, as the part of an address after "?": a link opens the same view. */

import { AXES, type Axis } from "./along";
import type { Pair } from "./across";
import { NAME, type Formula } from "./formulas";
import type { Range } from "./gestures";

export interface View {
  path: string;
  /** Null: the whole run. */
  range: Range | null;
  wheels: string[] | null;
  panels: string[] | null;
  /** The picked sample's time. */
  at: number | null;
  /** Limits of vertical axes, in SI, so that a link shows the same in a browser with other units. */
  uprights: Record<string, Range>;
  axis: Axis;
  /** Runs that lie over this one. */
  others: string[];
  formulas: Formula[];
  /** What is plotted over what; null: the usual. */
  pair: Pair | null;
}

const [UPRIGHT, FORMULA] = ["y.", "f."];
const round = (value: number): string => String(Number(value.toPrecision(9)));

export function written(view: Partial<View> & { path: string }): string {
  const query = new URLSearchParams({ path: view.path });
  if (view.range) query.set("from", round(view.range[0])), query.set("to", round(view.range[1]));
  if (view.wheels) query.set("wheels", view.wheels.join());
  if (view.panels) query.set("panels", view.panels.join());
  if (typeof view.at === "number") query.set("at", round(view.at));
  for (const [key, [low, high]] of Object.entries(view.uprights ?? {})) query.set(UPRIGHT + key, `${round(low)},${round(high)}`);
  if (view.axis && view.axis !== "time") query.set("over", view.axis);
  for (const path of view.others ?? []) query.append("with", path);
  for (const { name, unit, text } of view.formulas ?? []) query.set(`${FORMULA}${name}${unit ? ` [${unit}]` : ""}`, text);
  if (view.pair) query.set("x", view.pair[0]), query.set("y", view.pair[1]);
  return query.toString().replaceAll("%2C", ",");
}

export function read(query: URLSearchParams): View {
  const list = (name: string): string[] | null => query.get(name)?.split(",").filter(Boolean) ?? null;
  const number = (text: string | null): number => (text ? Number(text) : NaN);
  const range = (low: number, high: number): Range | null => (high > low ? [low, high] : null);
  const at = number(query.get("at"));
  const uprights: Record<string, Range> = {};
  const formulas: Formula[] = [];
  for (const [name, text] of query) {
    const [low, high] = text.split(",").map(Number);
    const ends = name.startsWith(UPRIGHT) ? range(low ?? NaN, high ?? NaN) : null;
    if (ends) uprights[name.slice(UPRIGHT.length)] = ends;
    const formula = name.startsWith(FORMULA) ? /^(.*?)(?: \[(.*)\])?$/.exec(name.slice(FORMULA.length)) : null;
    if (formula && NAME.test(formula[1] ?? "")) formulas.push({ name: formula[1] ?? "", unit: formula[2] ?? "", text });
  }
  const [x, y] = [query.get("x"), query.get("y")];
  const over = query.get("over") ?? "";
  return {
    path: query.get("path") ?? "",
    range: range(number(query.get("from")), number(query.get("to"))),
    wheels: list("wheels"),
    panels: list("panels"),
    at: Number.isFinite(at) ? at : null,
    uprights,
    axis: over in AXES ? (over as Axis) : "time",
    others: query.getAll("with").filter(Boolean),
    formulas,
    pair: x && y ? [x, y] : null,
  };
}

let timer = 0;

/** Put a page's view into the address, a moment later: browsers refuse a change a frame. */
export function address(page: string, query: () => string): void {
  clearTimeout(timer);
  timer = window.setTimeout(() => {
    if (location.hash.startsWith(`#/${page}`)) history.replaceState(null, "", `#/${page}?${query()}`);
  }, 250);
}

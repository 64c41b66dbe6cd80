/** Any quantity over any other, of what the charts show: the mu-s plane of a wheel unless something else is chosen. */

import { columns } from "../ui/columns";
import { fill, h } from "../ui/dom";
import { tried } from "../ui/notes";
import { onceReleased } from "../ui/press";
import { AXES, type Layer } from "./along";
import { formulaPanels, type Formula } from "./formulas";
import type { Range } from "./gestures";
import { runColor } from "./overlay";
import { Plane, type Pairs, type Quantity } from "./plane";
import { panelsOf } from "./run";

const [FREE, PATIENCE] = ["", 150]; // ms

/** A column for either axis of the plot. */
export type Pair = [x: string, y: string];

/** What can be drawn over what: all that the panels show of all wheels, time since start and distance. */
export function quantitiesOf(layer: Layer, formulas: Formula[]): Quantity[] {
  const { run } = layer;
  const axes = (["elapsed", "distance"] as const).filter((axis) => axis === "elapsed" || run.distance !== null);
  const found = [
    ...[...panelsOf(run, run.wheels), ...formulaPanels(layer, formulas)].flatMap(({ title, unit, traces }) =>
      traces.map(({ column, label, scale }) => ({ column, title: traces.length > 1 || run.wheels.includes(label) ? `${title} ${label}` : title, unit, scale })),
    ),
    ...axes.map((axis) => ({ column: `axis:${axis}`, title: AXES[axis].title, unit: AXES[axis].unit, scale: 1 })),
  ];
  return found.filter((one, i) => found.findIndex(({ column }) => column === one.column) === i);
}

export class Across {
  readonly plane = new Plane();
  readonly element = h("section", { "aria-label": "One quantity over another" });
  /** Other quantities were chosen. */
  onPair: (() => void) | null = null;
  private which = h("select", { "aria-label": "Wheel of the plane" });
  private x = h("select", { id: "across-x" });
  private y = h("select", { id: "across-y" });
  private free = h("div", { hidden: true }, h("div", { class: "field" }, h("label", { for: "across-y" }, "upward"), this.y), h("div", { class: "field" }, h("label", { for: "across-x" }, "to the right"), this.x));
  private caption = h("p", { class: "hint", id: "across-caption" });
  private quantities: Quantity[] = [];
  private layers: Layer[] = [];
  private formulas: Formula[] = [];
  private shown: Range = [0, 1];
  private last: Pair = ["", ""];
  private timer = 0;
  private turn = 0;

  constructor() {
    this.element.append(h("div", { class: "row" }, h("h2", {}, "µ–s plane"), this.which), this.free, this.plane.element, this.caption);
    this.which.addEventListener("change", () => {
      if (this.wheel === FREE) [this.x.value, this.y.value] = this.last; // free choice begins with what was shown
      this.changed();
    });
    for (const select of [this.x, this.y]) select.addEventListener("change", () => this.changed());
  }

  close(): void {
    clearTimeout(this.timer);
    this.plane.close();
  }

  /** Whether there is anything in the plot. */
  get drawn(): boolean {
    return Number(this.element.dataset["pairs"] ?? 0) > 0;
  }

  /** What is said below it. */
  get said(): string {
    return this.caption.textContent ?? "";
  }

  /** The wheel whose plane is shown; empty where it is of other quantities. */
  get wheel(): string {
    return this.which.value;
  }

  /** What is shown over what, null for the plane of the last wheel: what is shown unless something else is chosen. */
  get pair(): Pair | null {
    const last = [...this.which.options].at(-2)?.value;
    return this.wheel && this.wheel === last ? null : this.columns;
  }

  private get columns(): Pair {
    return this.wheel ? [`slip_${this.wheel}`, `adhesion_${this.wheel}`] : [this.x.value, this.y.value];
  }

  /** Other runs are shown; `pair` is what to show of them, null for what is shown now or usual. */
  show(layers: Layer[], formulas: Formula[], pair: Pair | null): void {
    const main = layers[0];
    const before = this.layers.length ? { columns: this.columns, wheel: this.wheel } : null;
    [this.layers, this.formulas] = [layers, formulas];
    this.quantities = main ? quantitiesOf(main, formulas) : [];
    const has = (column: string | undefined): boolean => this.quantities.some((one) => one.column === column);
    const wheels = (main?.run.wheels ?? []).filter((wheel) => has(`slip_${wheel}`) && has(`adhesion_${wheel}`));
    const wanted = pair ?? before?.columns ?? null;
    const known = wanted?.every(has) ? wanted : null;
    const named = known && wheels.find((wheel) => known[0] === `slip_${wheel}` && known[1] === `adhesion_${wheel}`);
    const chosen = named && (pair || before?.wheel) ? named : known ? FREE : (wheels.at(-1) ?? FREE);
    fill(this.which, wheels.map((wheel) => h("option", { value: wheel, selected: wheel === chosen }, wheel)), h("option", { value: FREE, selected: chosen === FREE }, "any two quantities"));
    const slip = `slip_${main?.run.wheels.at(-1) ?? ""}`;
    const usual: Pair = [has("ground_speed") ? "ground_speed" : "axis:elapsed", has(slip) ? slip : (this.quantities[0]?.column ?? "")];
    ([this.x, this.y] as const).forEach((select, i) => fill(select, this.quantities.map(({ column, title, unit }) => h("option", { value: column, selected: column === (known ?? usual)[i] }, `${title} [${unit}]`))));
    this.refresh();
  }

  private changed(): void {
    this.refresh();
    this.onPair?.();
  }

  private refresh(): void {
    this.last = this.columns;
    this.free.hidden = this.wheel !== FREE;
    const title = this.element.querySelector("h2");
    if (title) title.textContent = this.wheel ? "µ–s plane" : "Plot";
    this.draw(this.shown);
  }

  /** Draw the pairs of the stretch that the charts show. */
  draw(range: Range): void {
    this.shown = range;
    clearTimeout(this.timer);
    this.timer = window.setTimeout(() => void this.fetch(), PATIENCE);
  }

  private async fetch(): Promise<void> {
    const turn = ++this.turn;
    const [x, y] = this.columns.map((column) => this.quantities.find((one) => one.column === column));
    if (!x || !y) {
      this.plane.show([], null);
      this.element.dataset["pairs"] = "0";
      this.caption.textContent = "";
      return;
    }
    const [start, end] = this.shown;
    const all: Pairs[] = [];
    for (const [i, layer] of this.layers.entries()) {
      const has = i === 0 ? this.quantities : quantitiesOf(layer, this.formulas);
      if (![x, y].every(({ column }) => has.some((one) => one.column === column))) continue;
      const { path, run, way } = layer;
      const found = await tried(() => columns("drive/pairs", { path, x: x.column, y: y.column, start, end, axis: way.axis, version: run.version }, []));
      if (turn !== this.turn) return;
      const [time, across, up] = found?.data ?? [];
      if (found && time && across && up) all.push({ time, x: across, y: up, of: found.of ?? found.count, color: this.layers.length > 1 ? runColor(i) : "muted", label: layer.label, run: layer.run });
    }
    const beyond = this.plane.show(all, { x, y, curve: this.wheel !== FREE });
    // its lines move all that is below, which a press may be on
    onceReleased(document.body, () => (this.caption.textContent = captionOf(all, beyond)));
    this.element.dataset["pairs"] = String(all.reduce((sum, one) => sum + one.time.length, 0));
  }
}

/** How many points there are, how many of them are drawn, and how many lie beyond the axes. */
function captionOf(all: Pairs[], beyond: number): string {
  const [drawn, there] = [all.reduce((sum, one) => sum + one.time.length, 0), all.reduce((sum, one) => sum + one.of, 0)];
  if (!there) return "No row in the charts has values of both.";
  const count = (n: number): string => n.toLocaleString("en").replaceAll(",", " ");
  return `${drawn < there ? `${count(drawn)} of the ${count(there)} samples that the charts show, thinned evenly` : `The ${count(there)} samples that the charts show`}${beyond ? `; ${count(beyond)} of those drawn lie beyond the axes` : ""}.`;
}

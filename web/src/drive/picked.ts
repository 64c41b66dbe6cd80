/** The sample picked on a chart: its values and why µ changed, marked on the charts and on the plane. */

import { get } from "../ui/api";
import { fill, h } from "../ui/dom";
import { tried } from "../ui/notes";
import type { Across } from "./across";
import type { Charts } from "./charts";
import { during, type Run } from "./run";
import { described, type Sample } from "./sample";

const CLICK = "Click a chart to see all values at that instant, and why µ changed. ◀ ▶ step through samples.";

/** What the page shows: `from` is the time at the left edge of its charts. */
interface Shown {
  path: string;
  run: Run;
  from: number;
}

export class Picked {
  readonly element: HTMLElement[];
  private details = h("section", { class: "sample", "aria-label": "Sample", "aria-live": "polite" });
  private sample: Sample | null = null;
  private asking = false;

  /** `changed` is called when another sample was picked. */
  constructor(
    private charts: Charts,
    private across: Across,
    private shown: () => Shown | null,
    private changed: () => void,
  ) {
    const step = (by: number, name: string, sign: string): HTMLElement => h("button", { type: "button", click: () => this.step(by), "aria-label": `${name} sample` }, sign);
    this.element = [h("div", { class: "row" }, h("h2", {}, "Sample"), h("span", { class: "spring" }), step(-1, "Previous", "◀"), step(1, "Next", "▶")), this.details];
    fill(this.details, h("p", { class: "hint" }, CLICK));
  }

  /** When it is; null where none is picked. */
  get time(): number | null {
    return this.sample?.time ?? null;
  }

  async pick(time: number): Promise<void> {
    const shown = this.shown();
    if (this.asking || !shown) return;
    this.asking = true;
    const found = await tried(() => get<Sample>("drive/sample", { path: shown.path, time, version: shown.run.version }));
    this.asking = false;
    if (!found || this.shown()?.path !== shown.path) return;
    this.sample = found;
    this.charts.mark(found.time);
    this.changed();
    this.draw();
  }

  forget(): void {
    this.sample = null;
    this.charts.mark(null);
    this.across.plane.at(null);
    fill(this.details, h("p", { class: "hint" }, CLICK));
  }

  /** Again, in other units. */
  draw(): void {
    const [found, run] = [this.sample, this.shown()?.run];
    if (!found || !run) return;
    const of = (name: string): number => found.values[name] ?? NaN;
    const { wheel, plane } = this.across;
    plane.at({
      slip: of(`slip_${wheel}`),
      adhesion: of(`adhesion_${wheel}`),
      slip_std: of(`slip_${wheel}_std`),
      adhesion_std: of(`adhesion_${wheel}_std`),
      a: of("curve_a"),
      a_std: of("curve_a_std"),
    });
    fill(this.details, described(found, during(run.events, found.time), run));
  }

  private step(by: number): void {
    const shown = this.shown();
    if (!shown) return;
    const { start, end, rows } = shown.run;
    void this.pick((this.time ?? shown.from) + (by * (end - start)) / Math.max(rows - 1, 1));
  }
}

/** The legend of a chart, with each trace's value under the cursor. */

import { digits, h } from "../ui/dom";
import { isKnown } from "./buckets";
import { firstFrom, type Drawn, type Values } from "./rows";
import type { Panel } from "./run";

export class Readout {
  readonly element: HTMLElement;
  private values: HTMLOutputElement[];

  constructor(private panel: Panel) {
    this.values = panel.traces.map(() => h("output", { class: "value", "aria-live": "off" }));
    this.element = h(
      "div",
      { class: "legend" },
      panel.traces.map((t, i) => h("span", {}, h("i", { class: `swatch ${t.color}${t.dashed ? ` dash-${t.dashed}` : t.dash?.length ? " dashed" : ""}` }), t.label, this.values[i])),
    );
  }

  /** Show the values nearest to a place, at most `near` away on the axis; of rows that were cut, the smallest and the largest of the
   * bucket. Null: none. */
  show(drawn: Drawn[], place: number | null, near: number): void {
    this.panel.traces.forEach((trace, i) => {
      const rows = drawn.find((one) => one.trace === trace);
      const output = this.values[i];
      if (!output) return;
      const text = place === null || !rows ? "" : valueAt(rows.x, rows.values, rows.low, rows.high, place, rows.cut, near);
      if (output.value !== text) output.value = text;
    });
  }
}

/** A value with half the width of its interval; of a bucket its smallest and largest value; "–" where nothing is known nearby. */
export function valueAt(times: ArrayLike<number>, values: Values, low: Values | undefined, high: Values | undefined, time: number, cut: boolean, near: number): string {
  const known = (k: number): boolean => isKnown(values[k]);
  const i = nearestKnown(times, known, time, near);
  if (i < 0) return "–";
  const v = values[i] as number;
  if (cut) {
    const first = i - (i % 2);
    const [least, most] = [values[first] ?? v, values[first + 1] ?? v];
    return digits(least) === digits(most) ? digits(v) : `${digits(least)} … ${digits(most)}`;
  }
  const [from, to] = [low?.[i], high?.[i]];
  return isKnown(from) && isKnown(to) ? `${digits(v)} ± ${digits((to - from) / 2, 2)}` : digits(v);
}

/** The place of the known sample nearest to a time, -1 where none is within `near`, or within the step of its samples. */
export function nearestKnown(times: ArrayLike<number>, known: (i: number) => boolean, time: number, near: number): number {
  const low = firstFrom(times, time);
  let best = -1;
  let away = Infinity;
  for (const step of [-1, 1]) {
    for (let i = step < 0 ? low - 1 : low; i >= 0 && i < times.length; i += step) {
      const apart = Math.abs((times[i] as number) - time);
      if (apart > Math.max(near, spacing(times, i, step)) || apart >= away) break;
      if (!known(i)) continue;
      [best, away] = [i, apart];
      break;
    }
  }
  return best;
}

/** How far the sample beyond this one is, else the one before it: in a hole of the log the rows at its ends are not of the cursor's place. */
function spacing(times: ArrayLike<number>, i: number, step: number): number {
  return Math.abs(((times[i + step] ?? times[i - step] ?? times[i]) as number) - (times[i] as number));
}

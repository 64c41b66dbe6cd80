/** What a track can be coloured by, and the legend of it on the page and on a sheet. */

import { during, EVENT_COLORS, soilColor, type Run } from "../drive/run";
import { digits, fill, h } from "../ui/dom";
import type { Ink } from "../ui/ink";
import { legend as legendLines, LINE, widthOf } from "../ui/sheet";
import { color } from "../ui/theme";
import { type Unit, withUnit } from "../ui/units";
import { PALEST, UNLABELLED } from "./scale";
import { SCALE } from "./shade";

const QUANTITIES: [string, string][] = [
  ["slip", "Slip"],
  ["adhesion", "Adhesion µ"],
  ["soil_resistance", "Soil resistance ρs"],
  ["net_traction", "Net traction κ"],
  ["efficiency", "Efficiency η"],
  ["ground_speed", "Ground speed"],
  ["curve_a", "Curve a"],
  ["nis", "NIS"],
  ["altitude", "Altitude"],
];

export interface Quantity {
  value: string;
  title: string;
}

export function quantitiesOf(run: Run): Quantity[] {
  const found: Quantity[] = [];
  for (const [name, title] of QUANTITIES) {
    if (run.columns.includes(name)) found.push({ value: name, title });
    for (const wheel of run.wheels) if (run.columns.includes(`${name}_${wheel}`)) found.push({ value: `${name}_${wheel}`, title: `${title} ${wheel}` });
  }
  return [...found, { value: "soil", title: "Soil" }, { value: "event", title: "Events" }];
}

/** A quantity that is a word, not a number. */
export const isNamed = (quantity: string): boolean => quantity === "soil" || quantity === "event";

export function soilAt(run: Run | null, time: number): string {
  return during(run?.soils, time)?.name ?? during(run?.ground?.sections, time)?.soil ?? "";
}

export interface Scale {
  title: string;
  unit: Unit;
  low: number;
  high: number;
  /** What is said of it. */
  about: string;
  /** Its colours, where they are not the usual. */
  colors?: (share: number) => string;
  /** What is drawn paler, in words: shown with a sample from full to palest. */
  fades?: string;
}

/** Of a quantity that is a word: each word with its colour. */
export interface Words {
  title: string;
  words: { text: string; shade: string }[];
}

export type Legend = Scale | Words;

/** The words of soils or events, with the ground's that has no label where the track crosses it. */
export function wordsOf(run: Run, quantity: Quantity, times: ArrayLike<number>): Words {
  if (quantity.value === "event") return { title: quantity.title, words: [...new Set(run.events.map((e) => e.kind))].map((text) => ({ text, shade: EVENT_COLORS[text] ?? "ink" })) };
  const soils = [...new Set([...run.soils.map((s) => s.name), ...(run.ground?.sections ?? []).map((s) => s.soil)])].map((text) => ({ text, shade: soilColor(text) }));
  const blank = Array.from(times).some((time) => !soilAt(run, time));
  return { title: quantity.title, words: blank ? [...soils, { text: "unlabelled", shade: UNLABELLED }] : soils };
}

export function showLegend(element: HTMLElement, legend: Legend): void {
  if ("words" in legend) {
    fill(element, legend.words.length ? legend.words.map(({ text, shade }) => h("span", {}, h("i", { class: `strip ${shade}` }), text)) : h("span", { class: "hint" }, "none in this run"));
    return;
  }
  const { title, unit, low, high, about, colors = SCALE, fades } = legend;
  const bar = strip(180, (share) => [colors(share), 1]);
  const pale = fades ? h("span", { class: "hint" }, strip(60, (share) => [colors(0.75), 1 - (1 - PALEST) * share]), fades) : null;
  fill(element, h("span", {}, title), h("span", {}, digits(low * unit.scale), bar, withUnit(digits(high * unit.scale), unit)), pale, h("span", { class: "hint" }, about));
}

function strip(width: number, ink: (share: number) => [string, number]): HTMLElement {
  const bar = h("canvas", { width, height: 10, class: "bar", "aria-hidden": "true" });
  const pen = bar.getContext("2d");
  for (let i = 0; pen && i < width; i++) {
    [pen.fillStyle, pen.globalAlpha] = ink(i / (width - 1));
    pen.fillRect(i, 0, 1, 10);
  }
  return bar;
}

/** Draw the legend in lines no wider than `width`; returns its height. */
export function inkLegend(ink: Ink, legend: Legend, x: number, y: number, width: number): number {
  const heading = "words" in legend ? legend.title : `${legend.title} [${legend.unit.name}]`;
  ink.text(heading, x, y, color("ink"), "start", { bold: true });
  const from = x + widthOf(heading, true) + 16;
  if ("words" in legend) {
    const sample = (shade: string) => (to: Ink, at: number, line: number): void => to.line([at, line, at + 20, line], { color: color(shade), width: 5 });
    return Math.max(legendLines(ink, legend.words.map(({ text, shade }) => ({ text, sample: sample(shade) })), from, y, width - (from - x)), LINE);
  }
  const [low, high] = [legend.low, legend.high].map((v) => digits(v * legend.unit.scale)) as [string, string];
  const bar = from + widthOf(low) + 6;
  ink.text(low, from, y, color("ink"), "start");
  for (let i = 0; i < 60; i++) ink.area([bar + 3 * i, y - 5, Math.min(bar + 3 * i + 4, bar + 180), y - 5, Math.min(bar + 3 * i + 4, bar + 180), y + 5, bar + 3 * i, y + 5], SCALE(i / 59), 1);
  ink.text(high, bar + 186, y, color("ink"), "start");
  let [line, height] = ["", LINE];
  for (const word of [...[legend.about, legend.fades].filter(Boolean).join("; ").split(" "), ""]) {
    if (word && widthOf(`${line} ${word}`) < width) line += ` ${word}`;
    else {
      ink.text(line.trim(), x, y + height, color("muted"), "start");
      [line, height] = [word, height + LINE];
    }
  }
  return height;
}

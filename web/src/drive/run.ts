/** A run as the server describes it, and the panels that can be drawn of it. */

import type { Timed } from "../ui/clock";
import { unitNamed, type Kind } from "../ui/units";

export interface Span {
  name: string;
  start: number;
  end: number;
}

export interface Event {
  kind: string;
  start: number;
  end: number;
  why: string;
}

export interface Section {
  start: number;
  end: number;
  soil: string;
  probabilities: Record<string, number>;
}

export interface Run extends Timed {
  rows: number;
  /** How far it went [m]; null where it has no ground speed. */
  distance: number | null;
  columns: string[];
  measured: string[];
  recording: string | null;
  wheels: string[];
  method: string;
  vehicle: string;
  radius: Record<string, number>;
  notes: string[];
  /** The file as it was described; a request that names it is refused once the file is replaced. */
  version: string;
  events: Event[];
  soils: Span[];
  ground: { path: string; sections: Section[]; changes: { time: number; std: number; probability: number }[] } | null;
}

export interface Trace {
  /** Index of the run shown that it belongs to; the main one by default. */
  layer?: number;
  /** The column asked of the server. */
  column: string;
  label: string;
  color: string;
  /** The column whose 95 % limits are drawn around it; empty: none. */
  band: string;
  bandColor?: string;
  dash?: number[];
  /** Which of the dashes it is, for its sample in the legend. */
  dashed?: number;
  /** To what is shown, from the column. */
  scale: number;
}

/** A panel as it is shown: `unit` names the unit, and the other numbers are in it. */
export interface Panel {
  key: string;
  title: string;
  unit: string;
  /** To what is shown, from SI. */
  scale: number;
  traces: Trace[];
  /** Values at which lines cross the panel, such as the expected NIS. */
  levels?: number[];
  /** What intervals may stretch the axis to; and values, where these differ from it. What lies beyond is listed in a corner. */
  low?: number;
  high?: number;
  least?: number;
  most?: number;
  /** The ends of a logarithmic axis. */
  log?: [number, number];
  /** An explanation for those who do not know the quantity. */
  about?: string;
}

/** Colours of wheels, in the order of the run's. */
export const WHEEL_COLORS = ["blue", "vermillion", "green", "purple", "orange", "sky", "muted", "ink"];
const DASH = [4, 4];

/** A panel in SI; its unit is a kind of quantity, where the user chooses one, else a name. */
type InSI = Omit<Panel, "scale" | "unit"> & { unit: Kind | "–" | "×Q₀" };

/** All panels that the run has columns for, in the units that are shown; `wheels` are the chosen ones. */
export function panelsOf(run: Run, wheels: string[]): Panel[] {
  const has = (name: string): boolean => run.columns.includes(name);
  const meant = (name: string): boolean => run.measured.includes(name);
  const color = (wheel: string): string => WHEEL_COLORS[run.wheels.indexOf(wheel) % WHEEL_COLORS.length] ?? "blue";
  const each = (name: string): Trace[] =>
    wheels
      .filter((wheel) => has(`${name}_${wheel}`))
      .map((wheel) => ({ column: `${name}_${wheel}`, label: wheel, color: color(wheel), band: has(`${name}_${wheel}_std`) ? `${name}_${wheel}` : "", scale: 1 }));
  const measured = (name: string, label: string, shade: string): Trace[] =>
    meant(name) ? [{ column: `measured:${name}`, label, color: shade, band: "", dash: DASH, scale: 1 }] : [];
  const one = (column: string, label: string, shade = "blue"): Trace[] =>
    has(column) ? [{ column, label, color: shade, band: has(`${column}_std`) ? column : "", scale: 1 }] : [];
  const speeds = wheels.flatMap((wheel): Trace[] => {
    const scale = run.radius[wheel] ?? NaN; // without a radius there is no speed in m/s
    const own = has(`wheel_speed_${wheel}`) && scale > 0
      ? [{ column: `wheel_speed_${wheel}`, label: `r ω ${wheel}`, color: color(wheel), band: "", scale }]
      : [];
    return own;
  });
  const panels: InSI[] = [
    { key: "adhesion", title: "Adhesion µ", unit: "–", traces: each("adhesion") },
    { key: "slip", title: "Slip s", unit: "share", traces: each("slip"), low: -0.2, high: 1, least: -1.5, most: 2 },
    { key: "resistance", title: "Soil resistance ρs", unit: "–", traces: one("soil_resistance", "ρs", "purple") },
    { key: "efficiency", title: "Tractive efficiency η", unit: "share", traces: each("efficiency"), low: 0, high: 1, least: -1, most: 1.2 },
    { key: "traction", title: "Net traction κ", unit: "–", traces: each("net_traction") },
    {
      key: "speed",
      title: "Speeds",
      unit: "speed",
      traces: [...one("ground_speed", "v", "ink"), ...measured("ground_speed", "v measured", "muted"), ...speeds],
    },
    { key: "torque", title: "Drive torque, measured", unit: "torque", traces: wheels.flatMap((w) => measured(`drive_torque_${w}`, w, color(w)).map(solid)) },
    { key: "drawbar", title: "Drawbar force, measured", unit: "force", traces: measured("drawbar_force", "pull", "green").map(solid) },
    { key: "curve", title: "Online curve: a", unit: "–", traces: one("curve_a", "a", "green"), low: 0, high: 2.5 },
    { key: "nis", title: "Consistency of the filter: NIS", unit: "–", ...nis(run) },
    {
      key: "supervisor",
      title: run.method === "bank" ? "Bank: scale of the noise" : "Supervisor γ",
      unit: "–",
      traces: one("supervisor", run.method === "bank" ? "0 smallest, 1 largest" : "γ", "orange"),
      low: 0,
      high: 1.02,
      about: run.method === "bank" ? "The expected scale of the process noise, between the bank's smallest and largest." : "How far A may act: Q = [I + γ (A − I)] Q₀.",
    },
    {
      key: "adaptation",
      title: "Adaptation A",
      unit: "×Q₀",
      traces: adaptation(run, wheels, color),
      levels: [1],
      log: [0.03, 80],
      about: "The diagonal of A: the factor on the process noise of each state that the innovations call for. Q = [I + γ (A − I)] Q₀.",
    },
    { key: "load", title: "Vertical load", unit: "force", traces: run.columns.filter((c) => c.startsWith("vertical_load_")).map((column, i) => ({ column, label: column.slice(14), color: WHEEL_COLORS[i] ?? "blue", band: "", scale: 1 })) },
  ];
  return panels.filter((panel) => panel.traces.length > 0).map(inChosenUnit);
}

function inChosenUnit(panel: InSI): Panel {
  const { name, scale } = unitNamed(panel.unit);
  const scaled = (key: "low" | "high" | "least" | "most"): Partial<Panel> => (panel[key] === undefined ? {} : { [key]: panel[key] * scale });
  return { ...panel, unit: name, scale, traces: panel.traces.map((t) => ({ ...t, scale: t.scale * scale })), ...scaled("low"), ...scaled("high"), ...scaled("least"), ...scaled("most") };
}

/** NIS over the channels taken, a mean of a second, with its limits. */
function nis(run: Run): Pick<Panel, "traces" | "levels" | "about" | "low" | "high"> {
  if (!run.columns.includes("nis")) return { traces: [] };
  return {
    traces: [{ column: "nis:mean", label: "NIS / channels, mean of 1 s", color: "vermillion", band: "nis", bandColor: "muted", scale: 1 }],
    levels: [1],
    low: 0,
    high: 5,
    about:
      "Size of the innovations relative to what the filter expects: 1 if its intervals are right, and in the band 95 % of the time. Above the band the intervals are too narrow.",
  };
}

/** A trace a state of the shown wheels; A is diagonal. */
function adaptation(run: Run, wheels: string[], color: (wheel: string) => string): Trace[] {
  const states: [string, string, string, number[]?][] = [
    ...wheels.map((w): [string, string, string] => [`adhesion_${w}`, `µ ${w}`, color(w)]),
    ["soil_resistance", "ρs", "ink"],
    ...wheels.map((w): [string, string, string, number[]] => [`wheel_speed_${w}`, `ω ${w}`, color(w), DASH]),
    ["ground_speed", "v", "ink", DASH],
  ];
  return states
    .filter(([state]) => run.columns.includes(`adaptation_${state}`))
    .map(([state, label, shade, dash]) => ({ column: `adaptation_${state}`, label, color: shade, band: "", scale: 1, ...(dash ? { dash } : {}) }));
}

function solid(trace: Trace): Trace {
  const { dash: _, ...rest } = trace;
  return rest;
}

/** The stretches of soils of a run: its labels, else those recognised. */
export function soilsOf(run: Run): Span[] {
  return run.soils.length ? run.soils : (run.ground?.sections ?? []).map((s) => ({ name: s.soil, start: s.start, end: s.end }));
}

/** The first of some stretches that holds a time. */
export function during<T extends { start: number; end: number }>(stretches: readonly T[] | undefined, time: number): T | undefined {
  return stretches?.find((s) => s.start <= time && s.end >= time);
}

/** Colours of soils and events: soils are tints, events are strong. */
const SOIL_COLORS: Record<string, string> = { hard: "muted", fine: "orange", wet: "sky", coarse: "purple", grass: "green" };
const SPARE = ["blue", "vermillion", "orange", "sky", "purple", "green"];

const given = new Map<string, string>();

/** The colour of a ground by its name: its own, or one that no other ground has had here, as long as there are any. */
export function soilColor(name: string): string {
  let found = given.get(name);
  if (!found) {
    let sum = 0;
    for (const c of name) sum = (sum * 31 + c.charCodeAt(0)) % 9973;
    const first = sum % SPARE.length;
    const wanted = [SOIL_COLORS[name] ?? "", ...SPARE.slice(first), ...SPARE.slice(0, first)].filter(Boolean);
    const taken = new Set(given.values());
    found = wanted.find((one) => !taken.has(one)) ?? wanted[0] ?? "blue";
    given.set(name, found);
  }
  return found;
}

export const EVENT_COLORS: Record<string, string> = {
  immobilization: "vermillion",
  stuck: "ink",
  push: "purple",
  standstill: "muted",
  gap: "sky",
  outlier: "orange",
};

/** The units that numbers are shown in: one choice for all pages, kept by this browser. Data stay in SI; only what is shown is scaled. */

import { fill, h } from "./dom";

export interface Unit {
  name: string;
  /** From SI to this unit. */
  scale: number;
  /** Decimals of a number that changes while it is read. */
  decimals: number;
}

/** What can be chosen, the first unless something else was. */
const KINDS = {
  share: { title: "Slip, efficiency", units: [unit("%", 100, 0), unit("–", 1, 2)] },
  speed: { title: "Speed", units: [unit("m/s", 1, 2), unit("km/h", 3.6, 1), unit("mph", 3600 / 1609.344, 1)] },
  force: { title: "Force, load", units: [unit("N", 1, 0), unit("kN", 1e-3, 2)] },
  torque: { title: "Torque", units: [unit("N m", 1, 0), unit("kN m", 1e-3, 2)] },
  rotation: { title: "Wheel, engine speed", units: [unit("rad/s", 1, 2), unit("1/min", 60 / (2 * Math.PI), 1)] },
};

export type Kind = keyof typeof KINDS;

/** What a column holds, by how its name begins; a text is a unit that is not chosen. */
const COLUMNS: [RegExp, Kind | string][] = [
  [/^(slip|efficiency)(_|$)/, "share"],
  [/^(ground_speed|wheel_based_speed)$/, "speed"],
  [/^(wheel_speed_|engine_speed$)/, "rotation"],
  [/^(drive_torque_|engine_torque$)/, "torque"],
  [/^(drawbar_force$|hitch_load$|vertical_load_|wheel_force_)/, "force"],
  [/^mass$/, "kg"],
  [/^(adhesion(_|$)|net_traction_|curve_a$|soil_resistance$|nis$|supervisor$|adaptation_)/, "–"],
  [/^(distance|altitude)$/, "m"],
  [/^fuel_rate$/, "m³/s"],
  [/^(latitude|longitude)$/, "°"],
  [/^(pitch|roll)$/, "rad"],
  [/^acceleration_/, "m/s²"],
  [/^angular_velocity_/, "rad/s"],
  [/^time$/, "s"],
];

const KEY = "terragrip-units";
const listeners = new Set<() => void>();
let chosen = kept();

function unit(name: string, scale: number, decimals: number): Unit {
  return { name, scale, decimals };
}

function kept(): Record<string, unknown> {
  try {
    return (JSON.parse(localStorage.getItem(KEY) ?? "{}") as Record<string, unknown> | null) ?? {};
  } catch {
    return {}; // written by something else
  }
}

/** The unit that a kind of quantity is shown in now. */
export function unitFor(kind: Kind): Unit {
  const { units } = KINDS[kind];
  return units.find(({ name }) => name === chosen[kind]) ?? (units[0] as Unit);
}

/** The unit that a column of estimates or of a recording is shown in, by its name as the server takes it (`measured:`, `:low`, `_std`);
 * without a name where the column is not one of ours. */
export function unitOf(column: string): Unit {
  const plain = column.replace(/^measured:/, "").replace(/:\w+$/, "").replace(/_std$/, "");
  return unitNamed(COLUMNS.find(([pattern]) => pattern.test(plain))?.[1] ?? "");
}

/** The unit of a kind of quantity, or one that is not chosen, by its own name. */
export function unitNamed(name: Kind | string): Unit {
  return name in KINDS ? unitFor(name as Kind) : unit(name, 1, 3);
}

/** A number as it is shown while it changes, without its unit; "–" where it is not known. */
export function fixed(value: number, { scale, decimals }: Unit): string {
  return Number.isFinite(value) ? (value * scale).toFixed(decimals).replace(/^-(?=[0.]*$)/, "") : "–";
}

/** A number with its unit in a sentence; a ratio has none. */
export function withUnit(number: string, { name }: Pick<Unit, "name">): string {
  return name === "–" || !name ? number : `${number} ${name}`;
}

/** Called after another unit was chosen, here or in another tab, until the returned function is called. */
export function onUnits(listener: () => void): () => void {
  listeners.add(listener);
  return () => listeners.delete(listener);
}

function choose(kind: Kind, name: string): void {
  chosen = { ...chosen, [kind]: name };
  localStorage.setItem(KEY, JSON.stringify(chosen));
  changed();
}

function changed(): void {
  for (const listener of listeners) listener();
}

/** Follow what is chosen in other tabs. */
export function startUnits(): void {
  addEventListener("storage", ({ key }) => {
    if (key !== KEY && key !== null) return;
    chosen = kept();
    changed();
  });
}

/** The chooser of units. */
export function unitsChooser(): HTMLElement {
  const menu = h("div", { class: "menu" });
  const draw = (): void =>
    fill(
      menu,
      (Object.keys(KINDS) as Kind[]).map((kind) => {
        const { title, units } = KINDS[kind];
        const field = h("select", { id: `unit-${kind}` }, units.map(({ name }) => h("option", { value: name, selected: name === unitFor(kind).name }, name === "–" ? "ratio (–)" : name)));
        field.addEventListener("change", () => choose(kind, field.value));
        return h("label", { class: "field" }, title, field);
      }),
      h("p", { class: "hint" }, "For all pages, stored in this browser. Files keep the units that they name."),
    );
  const element = h("details", { class: "chooser", id: "units" }, h("summary", {}, "Units"), menu);
  element.addEventListener("toggle", () => element.open && draw());
  draw();
  return element;
}

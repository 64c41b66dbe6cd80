/** What the fit page shows, and its undo. Data of soils and pictures are held apart: undo never loses them. */

import { CURVE_COLORS } from "../ui/theme";
import { Sampler, type Parameters } from "./samples";
import type { Calibration } from "./picture";

export interface Parameter {
  name: string;
  unit: string;
  lower: number;
  upper: number;
  start: number;
  meaning: string;
}

export interface Model {
  name: string;
  source: string;
  fixed: string[];
  parameters: Parameter[];
}

export interface FitResult {
  model: string;
  parameters: Parameters;
  free: string[];
  interval: Record<string, [number, number]>;
  r2: number;
  nrmse: number;
  bins: Bin[];
  clusters: number;
  common_slip_sd?: number | undefined;
  identifiability: { condition: number; identifiable: boolean; effective: Parameters; twin: Parameters | null; sentence: string };
  notes: string[];
  /** Free parameters that stopped at an end of their range: the data do not fix them. */
  at_bound: string[];
  band?: undefined | { slip: number[]; low: number[]; high: number[] };
  /** Of a fit that began at the curve as it was set by hand: R² of the automatic fit before, null where there was none. */
  automatic?: number | null;
}

export interface Bin {
  slip: number;
  mean: number;
  std: number;
  count: number;
}

export interface Curve {
  id: number;
  name: string;
  model: string;
  parameters: Parameters;
  color: string;
  shown: boolean;
  /** Parameters that a fit leaves as they are. */
  held: string[];
  /** Ends that a fit keeps to, where they are not the model's own. */
  bounds: Record<string, [number, number]>;
  fit: FitResult | null;
  /** Key of the soil that it was fitted to; empty where it goes through none's points. */
  data: string;
  source: string;
}

export interface Soil {
  key: string;
  path: string;
  name: string;
  soil: string;
  color: string;
  shown: boolean;
  points: { slip: number[]; adhesion: number[] };
  bins: Bin[];
  count: number;
  note: string;
}

interface Kept {
  curves: Curve[];
  active: number;
  pictures: Record<string, Calibration>;
}

const DEEP = 200;

/** What is kept while another page is open, undo too. */
interface Left {
  kept: Kept;
  soils: Soil[];
  images: Map<string, HTMLImageElement>;
  target: string;
  by: "pull" | "slip";
  past: string[];
  future: string[];
  settled: string;
  colors: number;
  opened: Record<string, string>;
}

const KEY = "terragrip-fit";
let left: Left | null = null;

export class State {
  models: Model[] = [];
  soils: Soil[] = [];
  images = new Map<string, HTMLImageElement>();
  /** The soil, or "picture:path#line", that a fit uses. */
  target = "";
  /** What bins of estimates are laid over: the vehicle's pull, or the wheel's slip. */
  by: "pull" | "slip" = "pull";
  /** Samples of curves by their id, and of what their fits found by `fit <id>`. */
  samples = new Sampler(() => this.changed("curve"));
  kept: Kept = { curves: [], active: 0, pictures: {} };
  /** Files whose soils and curves were added, and how they were then. */
  opened: Record<string, string> = {};
  private past: string[] = [];
  private future: string[] = [];
  private settled = JSON.stringify(this.kept);
  private listeners = new Set<(what: Change) => void>();
  private colors = 0;

  on(listener: (what: Change) => void): void {
    this.listeners.add(listener);
  }

  /** Report a change; "curve" is the quick one, while a slider moves. */
  changed(what: Change): void {
    for (const listener of this.listeners) listener(what);
  }

  /** A step of the undo history. Call when a change is complete. */
  commit(): void {
    const now = JSON.stringify(this.kept);
    if (now === this.settled) return;
    this.past.push(this.settled);
    if (this.past.length > DEEP) this.past.shift();
    this.future = [];
    this.settled = now;
  }

  /** What is shown is the beginning, behind which nothing can be undone. */
  begin(): void {
    this.settled = JSON.stringify(this.kept);
  }

  undo(): boolean {
    return this.step(this.past, this.future);
  }

  redo(): boolean {
    return this.step(this.future, this.past);
  }

  private step(from: string[], to: string[]): boolean {
    const before = from.pop();
    if (before === undefined) return false;
    to.push(this.settled);
    this.settled = before;
    this.kept = JSON.parse(before) as Kept;
    this.changed("all");
    return true;
  }

  /** Keep what is shown for the next time that the page opens; over a reload without undo, and without what the folder has. */
  leave(): void {
    const { kept, soils, images, target, by, past, future, settled, colors, opened } = this;
    left = { kept, soils, images, target, by, past, future, settled, colors, opened };
    const bare = soils.map((soil) => ({ ...soil, points: { slip: [], adhesion: [] }, bins: [] }));
    try {
      sessionStorage.setItem(KEY, JSON.stringify({ kept, soils: bare, target, by, settled: JSON.stringify(kept), colors, opened }));
    } catch {
      sessionStorage.removeItem(KEY); // it is full: what is older must not come back
    }
  }

  /** Restore the last state; false where there is none. */
  takeUp(): boolean {
    const last = left ?? (JSON.parse(sessionStorage.getItem(KEY) ?? "null") as Partial<Left> | null);
    if (last) Object.assign(this, last);
    return last !== null;
  }

  get canUndo(): boolean {
    return this.past.length > 0;
  }

  get canRedo(): boolean {
    return this.future.length > 0;
  }

  get active(): Curve | undefined {
    return this.kept.curves.find((curve) => curve.id === this.kept.active);
  }

  /** Make a curve the active one, and the soil that it was fitted to the one that a fit uses: else "Fit to points" would draw it through another's. */
  choose(curve: Curve): void {
    this.kept.active = curve.id;
    if (this.soils.some((soil) => soil.key === curve.data)) this.target = curve.data;
  }

  /** Forget a soil; where a fit would have used it, it uses the first that is left. */
  remove(soil: Soil): void {
    this.soils = this.soils.filter((other) => other !== soil);
    if (this.target === soil.key) this.target = this.soils[0]?.key ?? "";
  }

  model(name: string): Model | undefined {
    return this.models.find((model) => model.name === name);
  }

  nextColor(): string {
    return CURVE_COLORS[this.colors++ % CURVE_COLORS.length] ?? "blue";
  }

  addCurve(model: string, parameters?: Parameters, name?: string, source = "drawn in the studio"): Curve {
    const chosen = this.model(model);
    const start = Object.fromEntries((chosen?.parameters ?? []).map((p) => [p.name, p.start]));
    const id = Math.max(0, ...this.kept.curves.map((c) => c.id)) + 1;
    const curve: Curve = {
      id,
      name: name ?? `curve ${id}`,
      model,
      parameters: { ...start, ...parameters },
      color: this.nextColor(),
      shown: true,
      held: [...(chosen?.fixed ?? [])],
      bounds: {},
      fit: null,
      data: "",
      source,
    };
    this.kept.curves.push(curve);
    this.kept.active = id;
    return curve;
  }
}

export type Change = "curve" | "data" | "view" | "pictures" | "all";

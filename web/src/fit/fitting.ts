/** Fits by the server, and the points that they use. */

import { send } from "../ui/api";
import { note, tried, withdraw } from "../ui/notes";
import type { Curve, FitResult, Soil, State } from "./state";

const NO_POINTS = "Choose a soil, or digitise a line of a picture, first.";

/** Withdraw what a fit without points had said, once there are some. */
export function noteOfPoints(state: State): void {
  if (points(state)) withdraw(NO_POINTS);
}

/** Fit the active curve to the chosen points; from where it is (`here`), or from the starts that the server tries. */
export async function fit(state: State, here = false): Promise<void> {
  const curve = state.active;
  if (!curve) return;
  const data = points(state);
  if (!data) {
    note(NO_POINTS, "error");
    return;
  }
  const before = curve.fit;
  if (!(await fitTo(curve, here ? { ...data, start: curve.parameters } : data, state.target.replace(/^picture:/, "")))) return;
  if (here && curve.fit) curve.fit.automatic = before?.automatic ?? before?.r2 ?? null;
  state.commit();
  state.changed("all");
}

/** Fit a curve to each soil that is shown, by the active curve's model, held parameters and limits; each soil has a curve of its own name.
 * `progress` is called with the soil being fitted. */
export async function fitEach(state: State, progress: (text: string) => void): Promise<void> {
  const form = state.active;
  const soils = state.soils.filter((soil) => soil.shown && (soil.bins.length || soil.points.slip.length));
  if (!form || !soils.length) {
    note("Show a soil first: choose a file of estimates or digitised points.", "error");
    return;
  }
  const { model, held, bounds, parameters } = structuredClone(form);
  for (const [i, soil] of soils.entries()) {
    progress(`Fitting ${soil.name}, ${i + 1} of ${soils.length} …`);
    let curve = state.kept.curves.find((one) => one.source === `${FITTED}${soil.key}`);
    const before = structuredClone(curve);
    const taken = state.kept.curves.some((one) => one.name === soil.name);
    curve ??= state.addCurve(model, parameters, taken ? `${soil.name} (${soil.path})` : soil.name);
    Object.assign(curve, { model, held: [...held], bounds: structuredClone(bounds), parameters: { ...parameters }, color: soil.color, shown: true });
    state.kept.active = form.id; // what the panel and the residuals show, also while the fit runs
    if (await fitTo(curve, pointsOf(state, soil), soil.key)) continue;
    if (before) Object.assign(curve, before);
    else state.kept.curves = state.kept.curves.filter((one) => one !== curve);
  }
  state.commit();
  state.changed("all");
}

const FITTED = "fitted to ";

/** Fit and use the result; false where it failed, which is reported. */
async function fitTo(curve: Curve, data: Record<string, unknown>, source: string): Promise<boolean> {
  const wanted = { model: curve.model, intercept: "intercept" in curve.parameters, fixed: held(curve), bounds: curve.bounds, ...data };
  const found = await tried(() => send<FitResult>("POST", "fit", wanted));
  if (!found) return false;
  curve.fit = found;
  curve.parameters = { ...found.parameters };
  curve.data = source;
  curve.source = `${FITTED}${source}`;
  return true;
}

/** The parameters that the fit leaves alone, with their values; "free" where it may move all. */
function held(curve: Curve): Record<string, number> | "free" {
  const values = Object.fromEntries(curve.held.filter((name) => name in curve.parameters).map((name) => [name, curve.parameters[name] as number]));
  return Object.keys(values).length ? values : "free";
}

/** The data of the fit: a soil of estimates or of a library by name, else points. */
function points(state: State): Record<string, unknown> | null {
  const picture = /^picture:(.*)#(\d+)$/.exec(state.target);
  if (picture) {
    const line = state.kept.pictures[picture[1] ?? ""]?.lines[Number(picture[2])];
    return line ? { slip: line.points.map((p) => p[0]), adhesion: line.points.map((p) => p[1]) } : null;
  }
  const soil = state.soils.find((one) => one.key === state.target) ?? state.soils[0];
  return soil ? pointsOf(state, soil) : null;
}

function pointsOf(state: State, soil: Soil): Record<string, unknown> {
  const { path, soil: name, points } = soil;
  if (path.endsWith(".json")) return { path, soil: name };
  if (path.endsWith(".parquet")) return { path, soil: name, ...(state.by === "slip" ? { bins: { by: "slip" } } : {}) };
  return { slip: points.slip, adhesion: points.adhesion };
}

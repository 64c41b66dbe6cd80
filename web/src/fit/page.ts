/** The fit page: curves by slider over points, bins and pictures. */

import { ME, get, send, type Item } from "../ui/api";
import { h, save } from "../ui/dom";
import { note, tried } from "../ui/notes";
import type { Page } from "../ui/page";
import { CurvesPanel } from "./curves_panel";
import { ListPanel } from "./list_panel";
import { mapOf } from "./picture";
import { PicturesPanel } from "./pictures_panel";
import { Plot } from "./plot";
import { at, sampled } from "./samples";
import { sameCurve } from "./scene";
import { State, type Curve, type FitResult, type Model } from "./state";

export const page: Page = (main, { notices, query }) => {
  const state = new State();
  const plot = new Plot(state);
  const pictures = new PicturesPanel(state, () => plot.fit());
  const list = new ListPanel(state, () => plot.fit(), pictures.element);
  const curves = new CurvesPanel(state, { fit: () => void fit(state), save: () => void keep(state) });
  const undo = h("button", { type: "button", click: () => step("undo"), title: "Ctrl+Z" }, "Undo");
  const redo = h("button", { type: "button", click: () => step("redo"), title: "Ctrl+Shift+Z" }, "Redo");
  const tools = h(
    "div",
    { class: "tools" },
    undo,
    redo,
    h("button", { type: "button", click: () => plot.fit() }, "Show all"),
    h("span", { class: "spring" }),
    h("button", { type: "button", click: () => void png(plot) }, "PNG"),
    h("button", { type: "button", click: () => save("adhesion-slip.svg", new Blob([plot.svg()], { type: "image/svg+xml" })) }, "SVG"),
    h("button", { type: "button", click: () => void table(state) }, "CSV"),
  );
  main.append(list.element, h("section", { class: "middle", "aria-label": "Plot" }, tools, plot.element), curves.element);
  plot.onClick = (at, shift) => pictures.click(at, shift);
  state.on(() => {
    undo.disabled = !state.canUndo;
    redo.disabled = !state.canRedo;
  });

  function step(way: "undo" | "redo"): void {
    if (state[way]()) pictures.keepAll();
  }

  function key(event: KeyboardEvent): void {
    const typing = event.target instanceof HTMLInputElement && event.target.type !== "range" && event.target.type !== "checkbox";
    if (typing || !(event.ctrlKey || event.metaKey)) return;
    const pressed = event.key.toLowerCase();
    if (pressed !== "z" && pressed !== "y") return;
    event.preventDefault();
    step(pressed === "y" || event.shiftKey ? "redo" : "undo");
  }

  function paste(event: ClipboardEvent): void {
    if (pictures.take(event.clipboardData?.files ?? [])) event.preventDefault();
  }

  function drop(event: DragEvent): void {
    event.preventDefault();
    if (!pictures.take(event.dataTransfer?.files ?? [])) note("This page takes PNG, JPEG and WebP pictures; drop logs on the folder page.", "error");
  }

  const hover = (event: DragEvent): void => event.preventDefault();

  async function reload(): Promise<void> {
    const folder = await tried(() => get<{ items: Item[] }>("folder"));
    if (!folder) return;
    pictures.load(folder.items);
    await list.load(folder.items);
  }

  async function start(): Promise<void> {
    state.models = (await tried(() => get<Model[]>("models"))) ?? [];
    if (!state.takeUp()) {
      state.addCurve("exponential", undefined, "prototype", "paper, eq. 8");
      state.commit();
    }
    state.changed("all");
    await reload();
    const path = query.get("path");
    if (path) await list.open(path);
    plot.fit();
  }

  const forget = notices.on((notice) => {
    if (notice.kind === "folder") void reload();
    if (notice.kind === "picture" && notice.by !== ME) void pictures.renewed(notice.path);
  });
  addEventListener("keydown", key);
  addEventListener("paste", paste);
  main.addEventListener("drop", drop);
  main.addEventListener("dragover", hover);
  void start();
  // For the browser tests: how often the plot was drawn, and what is on it.
  Object.assign(window, { terragripFit: { plot, state, at, mapOf } });
  return () => {
    state.leave();
    forget();
    plot.close();
    removeEventListener("keydown", key);
    removeEventListener("paste", paste);
    main.removeEventListener("drop", drop);
    main.removeEventListener("dragover", hover);
  };
};

async function fit(state: State): Promise<void> {
  const curve = state.active;
  if (!curve) return;
  const data = points(state);
  if (!data) {
    note("Choose a soil, or digitise a line of a picture, first.", "error");
    return;
  }
  const wanted = { model: curve.model, intercept: "intercept" in curve.parameters, fixed: held(curve), bounds: curve.bounds, ...data };
  const found = await tried(() => send<FitResult>("POST", "fit", wanted));
  if (!found) return;
  curve.fit = found;
  curve.parameters = { ...found.parameters };
  curve.source = `fitted to ${state.target.replace(/^picture:/, "")}`;
  state.commit();
  state.changed("all");
}

/** The parameters that the fit leaves alone, with their values; "free" where it may move all. */
function held(curve: Curve): Record<string, number> | "free" {
  const values = Object.fromEntries(curve.held.filter((name) => name in curve.parameters).map((name) => [name, curve.parameters[name] as number]));
  return Object.keys(values).length ? values : "free";
}

/** What the fit takes: a soil of estimates by name, else points. */
function points(state: State): Record<string, unknown> | null {
  const picture = /^picture:(.*)#(\d+)$/.exec(state.target);
  if (picture) {
    const line = state.kept.pictures[picture[1] ?? ""]?.lines[Number(picture[2])];
    return line ? { slip: line.points.map((p) => p[0]), adhesion: line.points.map((p) => p[1]) } : null;
  }
  const soil = state.soils.find((one) => one.key === state.target) ?? state.soils[0];
  if (!soil) return null;
  if (soil.path.endsWith(".parquet")) return { path: soil.path, soil: soil.soil };
  const bins = soil.bins.length > 0;
  return {
    slip: bins ? soil.bins.map((b) => b.slip) : soil.points.slip,
    adhesion: bins ? soil.bins.map((b) => b.mean) : soil.points.adhesion,
  };
}

async function keep(state: State): Promise<void> {
  const curve = state.active;
  if (!curve) return;
  const library = prompt("Soil library to save to (a JSON file of this folder):", "soils.json");
  if (!library) return;
  const fitted = curve.fit && sameCurve(curve) ? curve.fit : null;
  const soil = {
    library,
    name: curve.name,
    model: curve.model,
    parameters: curve.parameters,
    source: curve.source,
    ...(fitted ? { interval: fitted.interval, r2: fitted.r2, nrmse: fitted.nrmse, bins: fitted.bins } : {}),
  };
  const store = (replace: boolean): Promise<unknown> => send("POST", "soils/save", { ...soil, replace });
  try {
    await store(false);
  } catch (error) {
    const text = error instanceof Error ? error.message : String(error);
    if (!text.includes("both libraries hold")) {
      note(text, "error");
      return;
    }
    if (!confirm(`${library} holds a soil named ${curve.name} already. Replace it?`)) return;
    if (!(await tried(() => store(true)))) return;
  }
  note(`${curve.name} saved to ${library}`);
}

async function png(plot: Plot): Promise<void> {
  const picture = await plot.png();
  if (picture) save("adhesion-slip.png", picture);
}

/** The shown curves on a grid of 1 % of slip, a column a curve. */
async function table(state: State): Promise<void> {
  const shown = state.kept.curves.filter((curve) => curve.shown);
  const quoted = (text: string): string => (/[",\n]/.test(text) ? `"${text.replace(/"/g, '""')}"` : text);
  const samples = await tried(() => Promise.all(shown.map(sampled)));
  if (!samples) return;
  const rows = [["slip", ...shown.map((curve) => quoted(curve.name))].join(",")];
  for (let i = 0; i <= 100; i++) {
    const s = i / 100;
    rows.push([s, ...samples.map((one) => Number(at(one, s).toPrecision(8)))].join(","));
  }
  save("adhesion-slip.csv", new Blob([`${rows.join("\n")}\n`], { type: "text/csv" }));
}

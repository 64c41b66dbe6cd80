/** The fit page: curves by slider over points, bins and pictures. */

import { ME, get, send, type Item } from "../ui/api";
import { h, save } from "../ui/dom";
import { note, tried } from "../ui/notes";
import { oneAtATime, type Page } from "../ui/page";
import { CurvesPanel } from "./curves_panel";
import { fit, fitEach, noteOfPoints } from "./fitting";
import { ListPanel } from "./list_panel";
import { mapOf } from "./picture";
import { PicturesPanel } from "./pictures_panel";
import { Plot } from "./plot";
import { Loupe } from "./loupe";
import { Residuals } from "./residuals";
import { at } from "./samples";
import { sameCurve } from "./scene";
import { State, type Model } from "./state";
import { curveTable, pointTable } from "./tables";

export const page: Page = (main, { notices, query }) => {
  const state = new State();
  const plot = new Plot(state);
  const pictures = new PicturesPanel(state, () => plot.fit());
  const list = new ListPanel(state, () => plot.fit(), pictures.element);
  const curves = new CurvesPanel(state, { fit: (here) => fit(state, here), each: (progress) => fitEach(state, progress), save: () => void keep(state) });
  const residuals = new Residuals(state, plot.view);
  const loupe = new Loupe(plot.element, state, plot.view);
  const undo = h("button", { type: "button", click: () => step("undo"), title: "Ctrl+Z" }, "Undo");
  const redo = h("button", { type: "button", click: () => step("redo"), title: "Ctrl+Shift+Z" }, "Redo");
  const tools = h(
    "div",
    { class: "tools" },
    undo,
    redo,
    h("button", { type: "button", click: () => plot.fit() }, "Show all"),
    residuals.button,
    h("span", { class: "spring" }),
    h("button", { type: "button", click: () => void png(plot) }, "PNG"),
    h("button", { type: "button", click: () => save("adhesion-slip.svg", new Blob([plot.svg()], { type: "image/svg+xml" })) }, "SVG"),
    h("button", { type: "button", click: () => void curveTable(state), title: "The curves that are shown, every per cent of slip" }, "Curves CSV"),
    h("button", { type: "button", id: "points-csv", click: () => pointTable(state), title: "Points, bins and digitised points that are shown" }, "Points CSV"),
  );
  main.append(list.element, h("section", { class: "middle", "aria-label": "Plot" }, tools, plot.quality, plot.element, residuals.element), curves.element);
  plot.onView = () => residuals.later();
  plot.handles.hidden = () => pictures.isDigitising;
  loupe.wanted = () => pictures.isDigitising;
  plot.onClick = (at, shift) => pictures.click(at, shift);
  state.on(() => {
    noteOfPoints(state);
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

  let started = false;
  const reload = oneAtATime(async () => {
    const folder = await tried(() => get<{ items: Item[] }>("folder"));
    if (!folder) return;
    pictures.load(folder.items);
    await list.load(folder.items);
    if (started) await list.renew();
  });

  async function start(): Promise<void> {
    state.models = (await tried(() => get<Model[]>("models"))) ?? [];
    if (!state.takeUp()) {
      state.addCurve("exponential", undefined, "prototype", "paper, eq. 8");
      state.begin();
    }
    state.changed("all");
    await reload();
    await list.reread();
    await pictures.reread();
    const path = query.get("path");
    if (path && !list.isOpen(path)) await list.open(path);
    started = true;
    await list.renew();
    plot.fit();
  }

  const forget = notices.on((notice) => {
    if (notice.kind === "folder") void reload();
    if (notice.kind === "picture" && notice.by !== ME) void pictures.renewed(notice.path);
  });
  const hide = (): void => state.leave();
  addEventListener("pagehide", hide);
  addEventListener("keydown", key);
  addEventListener("paste", paste);
  main.addEventListener("drop", drop);
  main.addEventListener("dragover", hover);
  void start();
  // For the browser tests: how often the plot was drawn, and what is on it.
  Object.assign(window, { terragripFit: { plot, state, at, mapOf, residuals } });
  return () => {
    state.leave();
    removeEventListener("pagehide", hide);
    forget();
    plot.close();
    residuals.close();
    removeEventListener("keydown", key);
    removeEventListener("paste", paste);
    main.removeEventListener("drop", drop);
    main.removeEventListener("dragover", hover);
  };
};

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
    ...(fitted ? { free: fitted.free, interval: fitted.interval, band: fitted.band, r2: fitted.r2, nrmse: fitted.nrmse, bins: fitted.bins, clusters: fitted.clusters || null, common_slip_sd: fitted.common_slip_sd ?? null, identifiability: fitted.identifiability, notes: fitted.notes } : {}),
  };
  const store = async (): Promise<boolean> => {
    try {
      await send("POST", "soils/save", { ...soil, replace: false });
    } catch (error) {
      if (!(error instanceof Error && error.message.includes("both libraries hold"))) throw error;
      if (!confirm(`${library} holds a soil named ${curve.name} already. Replace it?`)) return false;
      await send("POST", "soils/save", { ...soil, replace: true });
    }
    return true;
  };
  if (await tried(store, "library")) note(`${curve.name} saved to ${library}`);
}

async function png(plot: Plot): Promise<void> {
  const picture = await plot.png();
  if (picture) save("adhesion-slip.png", picture);
}

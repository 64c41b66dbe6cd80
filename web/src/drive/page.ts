/** A run over time: measured against estimated, with intervals, soils, events and what the filter thinks of itself. */

import { sampled } from "../fit/samples";
import { get, type Item } from "../ui/api";
import { brushed } from "../ui/brush";
import { moment } from "../ui/clock";
import { digits, fill, h, working } from "../ui/dom";
import { note, tried } from "../ui/notes";
import { oneAtATime, type Page } from "../ui/page";
import { notHere, options, runsOf } from "../ui/runs";
import { saveMenu } from "../ui/sheet";
import { wholeRun } from "./convert";
import { onUnits } from "../ui/units";
import { Across } from "./across";
import { AdvicePanel } from "./advice";
import { AXES, layerOf, shortNames, type Axis, type Layer } from "./along";
import { Charts } from "./charts";
import { panelMenu, wheelChips } from "./choices";
import { EventList } from "./events";
import { sheetOf } from "./figure";
import { check, FormulaList, keptFormulas, keyOf } from "./formulas";
import { zoomed, type Range } from "./gestures";
import { layouts, type Layout } from "./layouts";
import { legendOf } from "./legend";
import { address, read, written, type View } from "./link";
import { OTHERS, overlayChooser, panelsOfAll } from "./overlay";
import { Picked } from "./picked";
import { tableOf } from "./table";
import { Views } from "./views";
import { during, type Run } from "./run";

const FIRST = ["adhesion", "slip", "resistance", "speed"];
const KEY = "terragrip-drive-panels";
const HINT = "Drag or shift+wheel zooms, arrow keys pan, double click shows all.";
const HINT_FINGERS = "Two fingers zoom, one pans.";
const FINGERS = matchMedia("(max-width: 600px), (hover: none)");

export const page: Page = (main, { notices, query }) => {
  const charts = new Charts();
  const across = new Across();
  const { plane } = across;
  void tried(() => sampled({ model: "exponential", parameters: { a: 1 } })).then((shape) => shape && plane.shaped(shape));
  const choice = h("select", { id: "run", "aria-label": "Run" });
  const wheels = h("div", { class: "chips", role: "group", "aria-label": "Wheels" });
  const panels = h("details", { class: "chooser" }, h("summary", {}, "Panels"));
  const legend = h("div", { class: "chips legend-row" });
  const readout = h("output", { class: "line", "aria-live": "off" });
  const asked = read(query);
  const list = new EventList((event) => void goTo(event));
  const views = new Views((range) => charts.zoom(range), () => {
    back.disabled = !views.canBack;
    forward.disabled = !views.canForward;
  });
  const back = h("button", { type: "button", id: "back", disabled: true, click: () => views.back(), title: "Previous time range (Backspace)" }, "Back");
  const forward = h("button", { type: "button", id: "forward", disabled: true, click: () => views.forward(), "aria-label": "Next time range" }, "↷");
  const advice = new AdvicePanel();
  const picked = new Picked(charts, across, () => (run ? { path, run, from: layers[0]?.way.time(charts.range[0]) ?? run.start } : null), () => remember());
  const over = h("select", { id: "over", "aria-label": "Horizontal axis" }, (Object.keys(AXES) as Axis[]).map((name) => h("option", { value: name }, `Over ${AXES[name].title}`)));
  const overlay = overlayChooser((paths) => lay(paths));
  let layers: Layer[] = []; // the run and those over it
  let run: Run | null = null;
  let path = "";
  let axis: Axis = asked.axis;
  let others: string[] = asked.others.slice(0, OTHERS);
  let seen = new Map<string, string>(); // size and time of change of what is open
  let runs = new Map<string, string>(); // and of all estimates
  let chosen: string[] = []; // wheels
  let shown: string[] = asked.panels ?? JSON.parse(localStorage.getItem(KEY) ?? "null") ?? FIRST;
  const kept = keptFormulas();
  const formulas = new FormulaList([...kept.filter(({ name }) => !asked.formulas.some((one) => one.name === name)), ...asked.formulas], () => layers[0], (made) => {
    if (made && !shown.includes(keyOf(made))) shown = [...shown, keyOf(made)];
    void known().then(draw);
  });
  let linked: View | null = asked; // until its run is open
  charts.uprights = { ...asked.uprights };

  const tools = h(
    "div",
    { class: "tools" },
    [choice, overlay.element, over, wheels, panels, formulas.element],
    layouts(layout, takeUp),
    saveMenu(() => ["drive", ...layers.map(({ label }) => label)].join("-"), async () => (layers.length ? sheetOf(charts, layers, across) : undefined), () => tableOf(charts, layers), wholeRun(() => path)),
    h("span", { class: "spring" }),
    [back, forward],
    h("button", { type: "button", id: "zoom-in", click: () => zoom(0.5), "aria-label": "Zoom in" }, "+"),
    h("button", { type: "button", click: () => zoom(2), "aria-label": "Zoom out" }, "−"),
    h("button", { type: "button", click: () => charts.zoom(charts.whole) }, "Whole run"),
  );
  main.append(
    h("section", { class: "middle", "aria-label": "Charts" }, tools, legend, charts.element, h("div", { class: "foot" }, readout)),
    h(
      "aside",
      { class: "panel", "aria-label": "Scatter plot and sample" },
      across.element,
      list.element,
      advice.element,
      picked.element,
    ),
  );

  function zoom(factor: number): void {
    const [low, high] = charts.range;
    const at = picked.time === null ? NaN : (layers[0]?.way.place(picked.time) ?? NaN);
    charts.zoom(zoomed(charts.range, at > low && at < high ? at : (low + high) / 2, factor));
  }

  /** What is shown, in the address. */
  function remember(): void {
    address("drive", () => {
      const { pair } = across;
      const used = formulas.all.filter((one) => shown.includes(keyOf(one)) || pair?.includes(`=${one.text}`));
      return written({ path, range: charts.isWhole ? null : charts.range, wheels: chosen, panels: shown, at: picked.time, uprights: charts.uprights, axis, others, formulas: used, pair });
    });
  }

  function layout(): Layout {
    const used = formulas.all.filter((one) => shown.includes(keyOf(one)));
    return { panels: shown, wheels: chosen, uprights: { ...charts.uprights }, formulas: used, pair: across.pair, axis };
  }

  function takeUp(wanted: Layout): void {
    shown = wanted.panels;
    charts.uprights = { ...wanted.uprights };
    const there = wanted.wheels.filter((wheel) => layers.some((layer) => layer.run.wheels.includes(wheel)));
    if (there.length) chosen = there;
    const own = wanted.formulas ?? [];
    formulas.keep([...formulas.all.filter(({ name }) => !own.some((one) => one.name === name)), ...own], null);
    drawWheels();
    void known().then(async () => {
      across.show(layers, formulas.all, wanted.pair ?? null);
      if (wanted.axis && (wanted.axis !== "time" || !others.length)) await along(wanted.axis);
      draw();
    });
  }

  /** Ask the server which formulas the runs can compute. */
  async function known(): Promise<void> {
    const texts = formulas.all.map(({ text }) => text);
    await tried(() => Promise.all(layers.map((layer) => check(layer, texts))));
    formulas.draw();
    across.show(layers, formulas.all, null);
  }

  /** Draw over another axis; the stretch that is shown stays. */
  async function along(wanted: Axis): Promise<void> {
    if (!layers.length || wanted === axis) return;
    const way = layers[0]?.way;
    const times = charts.isWhole || !way ? null : (charts.range.map((place) => way.time(place)) as Range);
    const found = await tried(() => Promise.all(layers.map((layer) => moved(layer, wanted))));
    if (found) {
      [layers, axis] = [found, wanted];
      draw();
      const now = found[0]?.way;
      charts.zoom(times && now ? (times.map((time) => now.place(time)) as Range) : charts.whole);
      views.start(charts.range);
    }
    over.value = axis;
  }

  async function moved(layer: Layer, wanted: Axis): Promise<Layer> {
    if (wanted === "distance" && layer.run.distance === null) throw new Error(`${layer.path} has no ground speed, so no distance`);
    return { ...(await layerOf(layer.path, wanted, layer.run)), label: layer.label, ...(layer.faults ? { faults: layer.faults } : {}) };
  }

  /** Lay other runs over the main one; those that cannot be read are left out with a message. */
  async function lay(paths: string[]): Promise<void> {
    const [main] = layers;
    if (!main) return;
    const whole = charts.isWhole;
    if (paths.length && axis === "time") await along("elapsed");
    const found: Layer[] = [];
    for (const other of paths) {
      const layer = layers.slice(1).find((one) => one.path === other && runs.get(other) === seen.get(other)) ?? (await tried(async () => moved(await layerOf(other, "time"), axis)));
      if (layer) found.push(layer);
    }
    others = found.map((layer) => layer.path);
    for (const { run } of found) if (!run.wheels.some((wheel) => chosen.includes(wheel))) chosen = [...chosen, ...run.wheels.slice(-2)];
    for (const other of others) seen.set(other, runs.get(other) ?? "");
    layers = [layers[0] ?? main, ...found];
    const names = shortNames(layers.map((layer) => layer.path));
    layers.forEach((layer, i) => (layer.label = names[i] ?? layer.path));
    overlay.draw([...runs.keys()], path, others);
    for (const option of over.options) option.disabled = option.value === "time" && others.length > 0;
    over.value = axis;
    drawWheels();
    fill(legend, legendOf(layers, chosen));
    await known();
    draw();
    if (whole) charts.zoom(charts.whole);
  }

  /** Show an event with some time about it, and its first sample. */
  async function goTo(event: { start: number; end: number }): Promise<void> {
    const about = Math.max(event.end - event.start, 4);
    const way = layers[0]?.way;
    if (way) charts.zoom([way.place(event.start - 0.5 * about), way.place(event.end + 0.5 * about)]);
    await picked.pick(event.start);
  }

  function draw(): void {
    if (!run) return;
    remember();
    const all = panelsOfAll(layers, chosen, formulas.all);
    panelMenu(panels, all, shown, (keys) => {
      shown = keys;
      localStorage.setItem(KEY, JSON.stringify(shown));
      charts.show(layers, all.filter((panel) => shown.includes(panel.key)));
      remember();
    });
    charts.show(layers, all.filter((panel) => shown.includes(panel.key)));
  }

  function drawWheels(): void {
    wheelChips(wheels, [...new Set(layers.flatMap((layer) => layer.run.wheels))], chosen, (names) => {
      chosen = names;
      drawWheels();
      fill(legend, legendOf(layers, chosen));
      draw();
    });
  }

  async function open(wanted: string): Promise<void> {
    const reading = window.setTimeout(() => fill(legend, working(`Reading ${wanted} …`)), 200);
    const layer = await tried(() => layerOf(wanted, "time"));
    const placed = layer && axis !== "time" ? ((await tried(() => moved(layer, axis))) ?? layer) : layer;
    clearTimeout(reading);
    if (!placed) {
      if (wanted !== path) leave(wanted, notHere(wanted));
      return;
    }
    const found = placed.run;
    const again = wanted === path && run?.wheels.join() === found.wheels.join();
    path = wanted;
    run = found;
    axis = placed.way.axis;
    layers = [placed];
    others = others.filter((other) => other !== wanted);
    if (!again) chosen = found.wheels.slice(-2);
    const link = linked?.path === wanted ? linked : null;
    linked = null;
    if (link?.wheels?.some((wheel) => found.wheels.includes(wheel))) chosen = link.wheels;
    choice.value = wanted;
    list.show(found);
    advice.of(wanted, found.version);
    hover(null);
    await lay(others);
    if (link?.pair) across.show(layers, formulas.all, link.pair);
    if (link?.range) charts.zoom(link.range);
    else charts.follow();
    if (!again) views.start(charts.range);
    if (link?.at !== null && link?.at !== undefined) void picked.pick(link.at);
    else if (!again) picked.forget();
    across.draw(charts.range);
  }

  /** No run is shown, and why. */
  function leave(wanted: string, why: string): void {
    path = wanted;
    run = null;
    layers = [];
    charts.clear(why);
    picked.forget();
    list.show(null);
    advice.of("", "");
    for (const one of [legend, wheels]) fill(one);
    across.show([], [], null);
    readout.value = "";
  }

  function hover(time: number | null): void {
    plane.point(time);
    if (time === null || !run) {
      readout.value = run ? (FINGERS.matches ? HINT_FINGERS : HINT) : "";
      return;
    }
    const soil = during(run.soils, time)?.name;
    const section = during(run.ground?.sections, time);
    const event = during(run.events, time);
    const recognised = section ? `recognised: ${section.soil} (${digits(100 * (section.probabilities[section.soil] ?? 0), 2)} %)` : "";
    const way = layers[0]?.way;
    const far = axis === "time" || !way ? "" : `${AXES[axis].title} ${way.said(way.place(time))}`;
    readout.value = [`t ${moment(run, time)}`, far, soil, recognised, event && `${event.kind}${event.why ? `: ${event.why}` : ""}`].filter(Boolean).join("   ");
  }

  charts.onCursor = hover;
  charts.onPick = (time) => void picked.pick(time);
  charts.onUpright = remember;
  plane.onPoint = (time) => charts.point(time, true);
  charts.onRange = (range) => {
    views.seen(range);
    remember();
    across.draw(range);
  };
  choice.addEventListener("change", () => {
    seen = new Map();
    path = choice.value;
    run = null;
    charts.uprights = {};
    void reload();
  });
  charts.onReplaced = () => void reload();
  across.onPair = () => {
    remember();
    picked.draw(); // by another wheel
  };
  over.addEventListener("change", () => void along(over.value as Axis).then(remember));

  const reload = oneAtATime(async () => {
    const folder = await tried(() => get<{ items: Item[] }>("folder"));
    if (!folder) return;
    runs = runsOf(folder.items);
    const wanted = path || query.get("path") || brushed()?.path || [...runs.keys()][0] || "";
    const now = runs.get(wanted) ?? "";
    fill(choice, options(runs, wanted));
    if (!wanted) charts.clear("Nothing to show yet: open a recording on the folder page and estimate it.");
    else if (!now) leave(wanted, path && run ? `${wanted} was removed from the folder. Choose another run.` : notHere(wanted));
    else if (now !== seen.get(wanted) || !run) {
      if (run && seen.has(wanted)) note(`${wanted} was replaced: reloaded`);
      seen.set(wanted, now);
      await open(wanted);
    } else if (others.some((other) => runs.get(other) !== seen.get(other))) {
      const [there, gone] = [others.filter((other) => runs.has(other)), others.filter((other) => !runs.has(other))];
      for (const other of gone) note(`${other} was removed from the folder`);
      for (const other of there) if (runs.get(other) !== seen.get(other)) note(`${other} was replaced: reloaded`);
      await lay(there);
    } else overlay.draw([...runs.keys()], path, others);
  });

  const key = (event: KeyboardEvent): void => {
    if (event.key !== "Backspace" || event.target instanceof HTMLInputElement) return;
    event.preventDefault();
    views.back();
  };
  main.addEventListener("keydown", key);
  const forgets = [
    notices.on((notice) => notice.kind === "folder" && void reload()),
    onUnits(() => {
      draw();
      across.show(layers, formulas.all, null);
      picked.draw();
    }),
  ];
  void reload();
  Object.assign(window, { terragripDrive: { charts, across } });
  return () => {
    forgets.forEach((forget) => forget());
    main.removeEventListener("keydown", key);
    for (const one of [views, charts, advice]) one.close();
    across.close();
  };
};

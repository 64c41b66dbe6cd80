/** A run over time: measured against estimated, with intervals, soils, events and what the filter thinks of itself. */

import { sampled } from "../fit/samples";
import { get, type Item } from "../ui/api";
import { brushed } from "../ui/brush";
import { digits, fill, h } from "../ui/dom";
import { note, tried } from "../ui/notes";
import type { Page } from "../ui/page";
import { notHere, options, runsOf } from "../ui/runs";
import { onUnits } from "../ui/units";
import { Charts } from "./charts";
import { EventList } from "./events";
import { zoomed } from "./gestures";
import { layouts, type Layout } from "./layouts";
import { address, read, written, type View } from "./link";
import { Plane, type Points } from "./plane";
import { described, type Sample } from "./sample";
import { Views } from "./views";
import { during, EVENT_COLORS, panelsOf, soilColor, soilsOf, type Run } from "./run";

const FIRST = ["adhesion", "slip", "resistance", "speed"];
const KEY = "terragrip-drive-panels";
const HINT = "Drag, shift+wheel or two fingers zoom; arrow keys, sideways wheel or one finger pan; wheel or drag on an upright axis for that; double click shows the whole run.";

const CLICK = "Click a chart to see everything known of that moment, and why µ moved. ◀ ▶ step through samples.";

export const page: Page = (main, { notices, query }) => {
  const charts = new Charts();
  const plane = new Plane();
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
  const back = h("button", { type: "button", id: "back", disabled: true, click: () => views.back(), title: "The times shown before (Backspace)" }, "Back");
  const forward = h("button", { type: "button", id: "forward", disabled: true, click: () => views.forward(), "aria-label": "Forward again" }, "↷");
  const details = h("section", { class: "sample", "aria-label": "Sample", "aria-live": "polite" });
  const planeWheel = h("select", { "aria-label": "Wheel of the plane" });
  let run: Run | null = null;
  let path = "";
  let seen = ""; // size and time of change of what is open
  let chosen: string[] = [];
  let shown: string[] = asked.panels ?? JSON.parse(localStorage.getItem(KEY) ?? "null") ?? FIRST;
  let picked: number | null = null;
  let linked: View | null = asked; // until its run is open
  charts.uprights = { ...asked.uprights };
  let asking = false;
  let sample: Sample | null = null; // the picked one

  const tools = h(
    "div",
    { class: "tools" },
    choice,
    wheels,
    panels,
    layouts(layout, takeUp),
    h("span", { class: "spring" }),
    back,
    forward,
    h("button", { type: "button", id: "zoom-in", click: () => zoom(0.5), "aria-label": "Zoom in" }, "+"),
    h("button", { type: "button", click: () => zoom(2), "aria-label": "Zoom out" }, "−"),
    h("button", { type: "button", click: () => charts.zoom(charts.whole) }, "Whole run"),
  );
  main.append(
    h("section", { class: "middle", "aria-label": "Charts" }, tools, legend, charts.element, h("div", { class: "foot" }, readout)),
    h(
      "aside",
      { class: "panel", "aria-label": "Plane and sample" },
      h("div", { class: "row" }, h("h2", {}, "µ–s plane"), planeWheel),
      plane.element,
      list.element,
      h(
        "div",
        { class: "row" },
        h("h2", {}, "Sample"),
        h("span", { class: "spring" }),
        h("button", { type: "button", click: () => stepSample(-1), "aria-label": "Previous sample" }, "◀"),
        h("button", { type: "button", click: () => stepSample(1), "aria-label": "Next sample" }, "▶"),
      ),
      details,
    ),
  );
  fill(details, h("p", { class: "hint" }, CLICK));

  function zoom(factor: number): void {
    const [low, high] = charts.range;
    charts.zoom(zoomed(charts.range, picked !== null && picked > low && picked < high ? picked : (low + high) / 2, factor));
  }

  /** What is shown, in the address. */
  function remember(): void {
    address("drive", () => {
      const [low, high] = charts.range;
      const whole = low <= charts.whole[0] && high >= charts.whole[1];
      return written({ path, range: whole ? null : charts.range, wheels: chosen, panels: shown, at: picked, uprights: charts.uprights });
    });
  }

  function layout(): Layout {
    return { panels: shown, wheels: chosen, uprights: { ...charts.uprights } };
  }

  function takeUp(wanted: Layout): void {
    shown = wanted.panels;
    charts.uprights = { ...wanted.uprights };
    const there = wanted.wheels.filter((wheel) => run?.wheels.includes(wheel));
    if (there.length) chosen = there;
    drawWheels();
    draw();
  }

  /** Show an event with some time about it, and its first sample. */
  async function goTo(event: { start: number; end: number }): Promise<void> {
    const about = Math.max(event.end - event.start, 4);
    charts.zoom([event.start - 0.5 * about, event.end + 0.5 * about]);
    await pick(event.start);
  }

  function draw(): void {
    if (!run) return;
    remember();
    const all = panelsOf(run, chosen);
    fill(
      panels,
      h("summary", {}, "Panels"),
      h(
        "div",
        { class: "menu" },
        all.map((panel) => {
          const box = h("input", { type: "checkbox", checked: shown.includes(panel.key) });
          box.addEventListener("change", () => {
            shown = box.checked ? [...shown, panel.key] : shown.filter((key) => key !== panel.key);
            localStorage.setItem(KEY, JSON.stringify(shown));
            charts.show(path, run as Run, all.filter((p) => shown.includes(p.key)));
            remember();
          });
          return h("label", { class: "check" }, box, panel.title);
        }),
      ),
    );
    charts.show(path, run, all.filter((panel) => shown.includes(panel.key)));
  }

  function drawWheels(): void {
    fill(
      wheels,
      (run?.wheels ?? []).map((wheel) => {
        const button = h("button", { type: "button", class: "chip", "aria-pressed": String(chosen.includes(wheel)) }, wheel);
        button.addEventListener("click", () => {
          chosen = chosen.includes(wheel) ? chosen.filter((w) => w !== wheel) : (run?.wheels ?? []).filter((w) => w === wheel || chosen.includes(w));
          drawWheels();
          draw();
        });
        return button;
      }),
    );
  }

  function drawLegend(): void {
    if (!run) return;
    const soils = [...new Set(soilsOf(run).map((s) => s.name))];
    const kinds = [...new Set(run.events.map((event) => event.kind))];
    fill(
      legend,
      soils.map((name) => h("span", {}, h("i", { class: `patch ${soilColor(name)}` }), name)),
      kinds.map((kind) => h("span", {}, h("i", { class: `strip ${EVENT_COLORS[kind] ?? "ink"}` }), kind)),
      run.recording ? null : h("span", { class: "hint" }, "The recording is not in this folder: measured channels are left out."),
      run.notes.length ? h("details", { class: "chooser run-notes" }, h("summary", {}, `${run.notes.length} ${run.notes.length === 1 ? "note" : "notes"}`), h("ul", { class: "menu" }, run.notes.map((text) => h("li", {}, text)))) : null,
    );
  }

  async function open(wanted: string): Promise<void> {
    const reading = window.setTimeout(() => fill(legend, h("span", { class: "hint" }, `Reading ${wanted} …`)), 200);
    const found = await tried(() => get<Run>("drive", { path: wanted }));
    clearTimeout(reading);
    if (!found) {
      if (wanted !== path) leave(wanted, notHere(wanted));
      return;
    }
    const again = wanted === path && run?.wheels.join() === found.wheels.join();
    path = wanted;
    run = found;
    if (!again) chosen = found.wheels.slice(-2);
    const link = linked?.path === wanted ? linked : null;
    linked = null;
    const named = link?.wheels?.filter((wheel) => found.wheels.includes(wheel)) ?? [];
    if (named.length) chosen = named;
    choice.value = wanted;
    list.show(found.events);
    fill(planeWheel, found.wheels.map((wheel) => h("option", { value: wheel, selected: wheel === found.wheels.at(-1) }, wheel)));
    drawWheels();
    drawLegend();
    hover(null);
    draw();
    if (link?.range) charts.zoom(link.range);
    else charts.follow();
    if (!again) views.start(charts.range);
    if (link?.at !== null && link?.at !== undefined) void pick(link.at);
    else if (!again) forgetSample();
    void drawPlane();
  }

  function forgetSample(): void {
    picked = sample = null;
    charts.mark(null);
    plane.at(null);
    fill(details, h("p", { class: "hint" }, CLICK));
  }

  /** No run is shown, and why. */
  function leave(wanted: string, why: string): void {
    path = wanted;
    run = null;
    charts.clear(why);
    forgetSample();
    list.show([]);
    for (const one of [legend, wheels]) fill(one);
    plane.show({ slip: [], adhesion: [], time: [] });
    readout.value = "";
  }

  async function drawPlane(): Promise<void> {
    if (!run || !planeWheel.value) return;
    const [start, end] = charts.range;
    const points = await tried(() => get<Points>("drive/plane", { path, wheel: planeWheel.value, start, end, version: run?.version }));
    if (points) plane.show(points);
  }

  async function pick(time: number): Promise<void> {
    if (asking) return;
    asking = true;
    const found = await tried(() => get<Sample>("drive/sample", { path, time, version: run?.version }));
    asking = false;
    if (!found) return;
    picked = found.time;
    charts.mark(picked);
    remember();
    sample = found;
    showSample(found);
  }

  function stepSample(by: number): void {
    if (!run) return;
    const period = (run.end - run.start) / Math.max(run.rows - 1, 1);
    void pick((picked ?? charts.range[0]) + by * period);
  }

  function showSample(found: Sample): void {
    const wheel = planeWheel.value;
    const of = (name: string): number => found.values[name] ?? NaN;
    plane.at({
      slip: of(`slip_${wheel}`),
      adhesion: of(`adhesion_${wheel}`),
      slip_std: of(`slip_${wheel}_std`),
      adhesion_std: of(`adhesion_${wheel}_std`),
      a: of("curve_a"),
      a_std: of("curve_a_std"),
    });
    fill(details, described(found, during(run?.events, found.time)));
  }

  function hover(time: number | null): void {
    plane.point(time);
    if (time === null || !run) {
      readout.value = run ? HINT : "";
      return;
    }
    const soil = during(run.soils, time)?.name;
    const section = during(run.ground?.sections, time);
    const event = during(run.events, time);
    const recognised = section ? `recognised: ${section.soil} (${digits(100 * (section.probabilities[section.soil] ?? 0), 2)} %)` : "";
    readout.value = [`t ${time.toFixed(2)} s`, soil, recognised, event && `${event.kind}${event.why ? `: ${event.why}` : ""}`].filter(Boolean).join("   ");
  }

  charts.onCursor = hover;
  charts.onPick = (time) => void pick(time);
  let soon = 0;
  charts.onUpright = remember;
  plane.onPoint = (time) => charts.point(time, true);
  charts.onRange = (range) => {
    views.seen(range);
    remember();
    clearTimeout(soon);
    soon = window.setTimeout(() => void drawPlane(), 150);
  };
  choice.addEventListener("change", () => {
    seen = "";
    path = choice.value;
    run = null;
    charts.uprights = {};
    void reload();
  });
  charts.onReplaced = () => void reload();
  planeWheel.addEventListener("change", () => {
    void drawPlane();
    if (picked !== null) void pick(picked);
  });

  async function reload(): Promise<void> {
    const folder = await tried(() => get<{ items: Item[] }>("folder"));
    if (!folder) return;
    const runs = runsOf(folder.items);
    const wanted = path || query.get("path") || brushed()?.path || [...runs.keys()][0] || "";
    const now = runs.get(wanted) ?? "";
    fill(choice, options(runs, wanted));
    if (!wanted) charts.clear("Nothing to show yet: open a recording on the folder page and estimate it.");
    else if (!now) leave(wanted, path && run ? `${wanted} was removed from the folder. Choose another run.` : notHere(wanted));
    else if (now !== seen || !run) {
      if (run && seen) note(`${wanted} was replaced: shown anew`);
      seen = now;
      await open(wanted);
    }
  }

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
      if (sample) showSample(sample);
    }),
  ];
  void reload();
  Object.assign(window, { terragripDrive: { charts } });
  return () => {
    forgets.forEach((forget) => forget());
    main.removeEventListener("keydown", key);
    views.close();
    charts.close();
    plane.close();
  };
};

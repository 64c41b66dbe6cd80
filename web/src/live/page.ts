/** The live page: big numbers for the cab, six traces, warnings. Fed by the live service, or by a run played again. */

import { WHEEL_COLORS } from "../drive/run";
import { sampled } from "../fit/samples";
import { get, type Item } from "../ui/api";
import { digits, fill, h } from "../ui/dom";
import { tried } from "../ui/notes";
import type { Page } from "../ui/page";
import { onUnits, unitFor, unitNamed, type Kind } from "../ui/units";
import { Alarms } from "./alarms";
import { Feed, of, type Said } from "./feed";
import { ageOf, brief, eventNow, instant, LINGER, oldSaid, reading, seconds, sentence, STATUS_AGE, WARNING } from "./numbers";
import { SetpointLine, type Setpoint } from "./setpoint";
import { Traces, type Trace } from "./traces";

/** Seconds between checks of the last row's age. */
const CHECK = 0.1;

/** Seconds that the traces can show. */
const SPANS = [10, 30, 60, 120, 300];

export const page: Page = (main, { notices, query }) => {
  const source = h("select", { id: "live-source", "aria-label": "Source" });
  const speed = h("select", { "aria-label": "Speed of the replay" }, [1, 2, 5, 10, 20].map((x) => h("option", { value: x }, `${x}×`)));
  const pause = h("button", { type: "button", id: "pause", "aria-pressed": "false" }, "Pause");
  const state = h("span", { id: "live-state", class: "state", role: "status" }, "…");
  const health = h("span", { class: "hint", id: "health" });
  const warning = h("div", { class: "warning", role: "alert", hidden: true });
  const slip = tile("Slip", "share");
  const grip = tile("Grip in use", "share");
  const soil = tile("Soil", null);
  const speedTile = tile("Speed", "speed");
  const old = h("p", { class: "old", id: "live-age", hidden: true });
  const quiet = h("p", { class: "old", id: "live-silent", hidden: true });
  const said = h("ul", { class: "said", "aria-label": "Events", tabindex: "0" });
  let warnedAt = -Infinity;
  let peak = NaN; // largest adhesion of the online curve over its scale
  void tried(() => sampled({ model: "exponential", parameters: { a: 1 } })).then((shape) => shape && (peak = shape.peak[1]));
  let updates = 0;
  let rate = 0;
  let delay = 0; // of the estimates against their samples, by the last status [s]
  let heldAt = NaN; // when what is shown was held [ms]

  let begin: number | null = null; // where the replay begins [s]
  let chosen = query.get("vehicle") ?? ""; // of a service of many

  const feed = new Feed(() => {
    const replay = source.value;
    return new URLSearchParams(replay ? { replay, speed: speed.value, ...(begin === null ? {} : { start: String(begin) }) } : of(chosen)).toString();
  });
  const vehicle = h("select", { id: "live-vehicle", "aria-label": "Vehicle", hidden: true });
  vehicle.addEventListener("change", () => {
    chosen = vehicle.value;
    feed.again();
  });
  const traces = new Traces(feed.ring, () => feed.hello?.events ?? []);
  const alarms = new Alarms();
  const setpoint = new SetpointLine();
  const span = h("select", { id: "live-span", "aria-label": "Time range" }, SPANS.map((x) => h("option", { value: x, selected: x === traces.span }, x < 60 ? `${x} s` : `${x / 60} min`)));
  span.addEventListener("change", () => {
    traces.span = Number(span.value);
    traces.lookBack(traces.back);
  });
  const seek = h("input", { type: "range", id: "seek", step: "any", "aria-label": "Position in the replay", hidden: true });
  let seeking = false; // while it is dragged; what only has the focus goes on with the replay
  seek.addEventListener("input", () => (seeking = true));
  seek.addEventListener("change", () => {
    seeking = false;
    begin = Number(seek.value);
    feed.again();
  });
  const past = h("input", { type: "range", id: "live-back", step: "any", value: "100", disabled: true });
  past.addEventListener("input", () => traces.lookBack(Number(past.value)));
  const follow = h("button", { type: "button", id: "follow", hidden: true, click: () => traces.lookBack(null) }, "Now");
  const place = h("output", { class: "hint", "aria-live": "off" });
  traces.onBack = drawPast;
  const cab = h("a", { class: "button", href: "#/cab" }, "Cab");
  main.append(
    h("div", { class: "tools" }, source, vehicle, speed, seek, pause, span, alarms.settings, cab, state, h("span", { class: "spring" }), health),
    warning,
    alarms.element,
    old,
    quiet,
    h("div", { class: "tiles" }, slip.element, grip.element, soil.element, speedTile.element),
    setpoint.element,
    traces.element,
    h("div", { class: "past" }, h("label", { for: "live-back" }, "Look back"), past, place, follow),
    said,
  );

  /** The position of the traces among the rows held. */
  function drawPast(): void {
    const { ring } = feed;
    if (!ring.taken) return;
    past.min = String(Math.min(ring.oldest + traces.span, ring.now));
    past.max = String(ring.now);
    past.value = String(traces.back ?? ring.now);
    past.disabled = ring.now - ring.oldest <= traces.span;
    follow.hidden = traces.back === null;
    place.value = traces.back === null ? "" : `looking back ${(ring.now - traces.back).toFixed(0)} s; the numbers above are current`;
    past.setAttribute("aria-valuetext", place.value || "now");
    if (feed.hello?.replay && !seeking) seek.value = String(ring.now);
    seek.setAttribute("aria-valuetext", `${Number(seek.value).toFixed(0)} s`);
  }


  let why = "";
  feed.onState = (now, reason) => {
    why = reason;
    if (now === "connected" && feed.hello) {
      traces.show(tracesOf(feed.hello.wheels, feed.hello.columns));
      traces.lookBack(null);
      const { replay, name = "", vehicles = [] } = feed.hello;
      fill(vehicle, vehicles.map((one) => h("option", { value: one, selected: one === name }, one)));
      vehicle.hidden = !vehicles.length;
      chosen = name || chosen; // after a loss the same again, not what is first then
      seek.hidden = !replay;
      if (replay) [seek.min, seek.max, seek.value] = [String(replay.start), String(replay.end), String(begin ?? replay.start)];
      cab.href = `#/cab?${new URLSearchParams(replay ? { replay: source.value, speed: speed.value } : of(name))}`;
      warnedAt = -Infinity;
      warning.hidden = true;
      for (const one of [slip, grip, soil, speedTile]) one.set("–", "");
      setpoint.show(null);
      delay = 0;
      delete health.dataset["drops"];
      fill(said);
      fill(quiet);
    }
    freshness();
  };

  /** Whether what is shown is what is: else the numbers fade, and how old they are is said in their place. */
  function freshness(): void {
    const { limit, silent, played, unmeasured, waiting, isOld, predicted } = ageOf(feed, delay, Number(speed.value), traces.held !== null);
    const connected = feed.state === "connected";
    const isCurrent = connected && !isOld && !waiting;
    state.className = `state ${isCurrent ? "done" : feed.state === "lost" || (connected && isOld && traces.held === null) ? "failed" : ""}`;
    state.textContent = { connecting: "connecting …", connected: isCurrent ? "connected" : waiting ? "connected, no rows yet: the service waits for its sources" : traces.held !== null ? "paused" : "no measurements", lost: feed.hello ? `connection lost: ${why}` : why, ended: "the run has ended" }[feed.state];
    main.classList.toggle("stale", isOld);
    main.classList.toggle("predicted", predicted);
    traces.late = connected && traces.held === null && silent > limit ? silent * played : 0;
    old.hidden = !isOld;
    quiet.hidden = !quiet.textContent || !(feed.age("status") < STATUS_AGE);
    if (!isOld) return;
    setpoint.show(null); // an old one is no advice
    old.textContent =
      traces.held !== null ? `Paused: these numbers are ${seconds((performance.now() - heldAt) / 1000)} old.` : oldSaid(predicted, unmeasured, feed.state === "ended");
    if (traces.late) traces.redraw();
  }
  feed.onRows = () => {
    updates++;
    if (traces.held === null) traces.redraw();
    numbers();
    if (main.classList.contains("stale") || main.classList.contains("predicted") || feed.ring.isPredicted || feed.messages === 1) freshness();
  };
  feed.onSaid = tell;

  function tell(message: Said): void {
    if (message.source !== undefined && message.text !== undefined) {
      said.prepend(h("li", {}, h("strong", {}, message.kind), message.time === null ? "" : ` at ${instant(message.time)}`, message.text ? `: ${message.text}` : ""));
      while (said.children.length > 6) said.lastElementChild?.remove();
      if (message.kind in WARNING) warn(message.kind, message.text);
    } else if (message.kind === "setpoint") {
      if (traces.held === null) setpoint.show(message as unknown as Setpoint);
    } else if (message.kind === "soil") {
      const sure = message.probability === null || message.probability === undefined ? (message.labelled ? "labelled" : "") : `${digits(100 * message.probability, 2)} % sure`;
      soil.set(message.soil || "–", sure);
    } else if (message.kind === "status") {
      const lost = Object.values(message.counts ?? {}).reduce((sum, one) => sum + (one["dropped"] ?? 0), 0);
      delay = message.delay ?? 0;
      quiet.textContent = sentence(message.silent);
      health.dataset["drops"] = `${lost} dropped${message.delay === undefined ? "" : `, ${digits(1000 * message.delay, 2)} ms behind`}`;
    }
  }

  function warn(kind: string, text: string): void {
    warnedAt = feed.ring.now;
    warning.hidden = false;
    fill(warning, h("strong", {}, WARNING[kind] ?? kind), text ? ` ${brief(text)}` : "");
  }

  function numbers(): void {
    const { ring, hello } = feed;
    if (!hello) return;
    const event = eventNow(ring, hello);
    if (event in WARNING && warning.hidden) warn(event, "");
    if (event in WARNING) warnedAt = ring.now;
    else if (!warning.hidden && !(ring.now - warnedAt < LINGER)) warning.hidden = true;
    const now = reading(ring, hello, peak);
    if (traces.held === null) {
      slip.set(...now.slip.shown);
      grip.set(...now.grip.shown);
      speedTile.set(...now.speed.shown);
    }
    if (!ring.isPredicted) alarms.check(now, event);
  }

  pause.addEventListener("click", () => {
    traces.held = traces.held === null ? feed.ring.now : null;
    heldAt = feed.arrived.row;
    pause.setAttribute("aria-pressed", String(traces.held !== null));
    pause.textContent = traces.held === null ? "Pause" : "Follow";
    if (traces.held === null && feed.ring.taken) numbers();
    freshness();
    traces.redraw();
  });
  source.addEventListener("change", () => {
    begin = null;
    speed.hidden = source.value === "";
    feed.again();
  });
  speed.addEventListener("change", () => feed.again());

  async function reload(first: boolean): Promise<void> {
    const [folder, live] = await Promise.all([tried(() => get<{ items: Item[] }>("folder")), tried(() => get<{ service: boolean }>("live/sources"))]);
    const runs = (folder?.items ?? []).filter((item) => item.kind === "estimates").map((item) => item.path);
    const before = first ? (query.get("replay") ?? (live?.service ? "" : (runs[0] ?? ""))) : source.value;
    fill(
      source,
      live?.service || !runs.length ? h("option", { value: "" }, live?.service ? "live service" : "no live service, no runs") : null,
      runs.map((path) => h("option", { value: path }, `replay ${path}`)),
    );
    if (before && !runs.includes(before)) source.prepend(h("option", { value: before }, `replay ${before} (not available)`));
    source.value = before;
    speed.hidden = source.value === "";
    if (first) {
      speed.value = query.get("speed") ?? "1";
      feed.again();
    }
  }

  const clock = window.setInterval(() => {
    rate = updates;
    updates = 0;
    drawPast();
    const drops = feed.age("status") < STATUS_AGE ? (health.dataset["drops"] ?? "") : "";
    health.textContent = feed.state === "connected" && rate && !main.classList.contains("stale") ? [`${rate} update${rate === 1 ? "" : "s"}/s`, drops].filter(Boolean).join(", ") : "";
  }, 1000);
  const watch = window.setInterval(() => {
    freshness();
    const { isOld } = ageOf(feed, delay, Number(speed.value), false); // an alarm is no part of what was paused
    alarms.silent(feed.ring.taken > 0 && isOld && feed.state !== "ended");
  }, 1000 * CHECK);
  const forgets = [
    notices.on((notice) => notice.kind === "folder" && void reload(false)),
    onUnits(() => {
      if (feed.hello) traces.show(tracesOf(feed.hello.wheels, feed.hello.columns));
      for (const one of [slip, grip, speedTile]) one.set("–", "");
      if (feed.ring.taken) numbers();
    }),
  ];
  void reload(true);
  Object.assign(window, { terragripLive: { feed, traces, alarms } });
  return () => {
    clearInterval(clock);
    clearInterval(watch);
    main.classList.remove("stale", "predicted");
    forgets.forEach((forget) => forget());
    feed.close();
    alarms.close();
    setpoint.close();
    traces.close();
  };
};

function tile(title: string, kind: Kind | null): { element: HTMLElement; set: (value: string, more: string) => void } {
  const number = h("span", { class: "big" }, "–");
  const more = h("span", { class: "more" }, "");
  const unit = h("span", { class: "unit" }, kind && unitFor(kind).name);
  const element = h("div", { class: "tile" }, h("h2", {}, title), h("div", {}, number, unit), more);
  return {
    element,
    set(value, text) {
      if (number.textContent !== value) number.textContent = value;
      if (more.textContent !== text) more.textContent = text;
      const name = kind ? unitFor(kind).name : "";
      if (unit.textContent !== name) unit.textContent = name;
    },
  };
}

function tracesOf(wheels: string[], columns: string[]): Trace[] {
  const each = (name: string): Trace["lines"] =>
    wheels
      .map((wheel, i) => ({ column: `${name}_${wheel}`, color: WHEEL_COLORS[i % WHEEL_COLORS.length] ?? "blue", label: wheel }))
      .filter((line) => columns.includes(line.column));
  const one = (column: string, color: string): Trace["lines"] => (columns.includes(column) ? [{ column, color, label: column }] : []);
  const trace = (title: string, kind: Kind | "–", lines: Trace["lines"], low: number, high: number, least: number): Trace => {
    const { name, scale } = unitNamed(kind);
    return { title, unit: name, scale, lines, low: low * scale, high: high * scale, least: least * scale };
  };
  return [
    trace("Slip", "share", each("slip"), -1.5, 2, 0.1),
    trace("Adhesion µ", "–", each("adhesion"), -0.5, 1.5, 0.1),
    trace("Ground speed", "speed", one("ground_speed", "blue"), 0, 20, 0.2),
    trace("Soil resistance ρs", "–", one("soil_resistance", "purple"), -0.3, 1, 0.05),
    trace("Efficiency η", "share", each("efficiency"), 0, 1, 0.1),
    trace("Online curve a", "–", one("curve_a", "green"), 0, 3, 0.1),
  ].filter(({ lines }) => lines.length);
}

/** The live page: big numbers for the cab, six traces, warnings. Fed by the live service, or by a run played again. */

import { soilColor, WHEEL_COLORS } from "../drive/run";
import { sampled } from "../fit/samples";
import { get, type Item } from "../ui/api";
import { digits, fill, h } from "../ui/dom";
import { tried } from "../ui/notes";
import type { Page } from "../ui/page";
import { Feed, LEAST_AGE, oldAfter, type Said } from "./feed";
import { Traces, type Trace } from "./traces";

const WARNING: Record<string, string> = {
  immobilization: "About to dig in",
  stuck: "Stuck",
  push: "The tool pushes",
};
const LINGER = 2;
const STANDING = 0.05; // m/s
/** Seconds between looks at how old the last row is, and after which a status says nothing of now (one comes every second). */
const LOOK = 0.1;
const STATUS_AGE = 2.5;

export const page: Page = (main, { notices, query }) => {
  const source = h("select", { id: "live-source", "aria-label": "Source" });
  const speed = h("select", { "aria-label": "Speed of the replay" }, [1, 2, 5, 10, 20].map((x) => h("option", { value: x }, `${x}×`)));
  const pause = h("button", { type: "button", id: "pause", "aria-pressed": "false" }, "Pause");
  const state = h("span", { id: "live-state", class: "state", role: "status" }, "…");
  const health = h("span", { class: "hint", id: "health" });
  const warning = h("div", { class: "warning", role: "alert", hidden: true });
  const slip = tile("Slip", "%");
  const grip = tile("Grip in use", "%");
  const soil = tile("Soil", "");
  const speedTile = tile("Speed", "m/s");
  const old = h("p", { class: "old", id: "live-age", hidden: true });
  const said = h("ul", { class: "said", "aria-label": "Events" });
  let warnedAt = -Infinity;
  let peak = NaN; // largest adhesion of the online curve over its scale
  void tried(() => sampled({ model: "exponential", parameters: { a: 1 } })).then((shape) => shape && (peak = shape.peak[1]));
  let updates = 0;
  let rate = 0;
  let delay = 0; // of the estimates against their samples, by the last status [s]
  let heldAt = NaN; // when what is shown was held [ms]

  const feed = new Feed(() => {
    const replay = source.value;
    return new URLSearchParams(replay ? { replay, speed: speed.value } : {}).toString();
  });
  const traces = new Traces(feed.ring, () => feed.hello?.events ?? []);
  main.append(
    h("div", { class: "tools" }, source, speed, pause, state, h("span", { class: "spring" }), health),
    warning,
    old,
    h("div", { class: "tiles" }, slip.element, grip.element, soil.element, speedTile.element),
    traces.element,
    said,
  );

  let why = "";
  feed.onState = (now, reason) => {
    why = reason;
    if (now === "connected" && feed.hello) {
      traces.show(tracesOf(feed.hello.wheels, feed.hello.columns));
      warnedAt = -Infinity;
      warning.hidden = true;
      for (const one of [slip, grip, soil, speedTile]) one.set("–", "");
      delay = 0;
      delete health.dataset["drops"];
      fill(said);
    }
    freshness();
  };

  /** Whether what is shown is what is: else the numbers fade, and how old they are is said in their place. */
  function freshness(): void {
    const played = feed.hello?.replay ? Number(speed.value) : 1;
    const limit = oldAfter(feed.ring.period / played);
    const silent = feed.age("row");
    const unmeasured = feed.age("measured") + (feed.age("status") < STATUS_AGE ? delay : 0);
    const connected = feed.state === "connected";
    const waiting = connected && !feed.ring.taken;
    const isOld = feed.ring.taken > 0 && (!connected || traces.held !== null || !(unmeasured <= limit));
    const heard = connected && !isOld && !waiting;
    state.className = `state ${heard ? "done" : feed.state === "lost" || (connected && isOld && traces.held === null) ? "failed" : ""}`;
    state.textContent = { connecting: "connecting …", connected: heard ? "connected" : waiting ? "connected, no rows yet" : traces.held !== null ? "paused" : "no measurements", lost: `connection lost: ${why}`, ended: "the run has ended" }[feed.state];
    main.classList.toggle("stale", isOld);
    const predicted = connected && traces.held === null && feed.ring.isPredicted && silent <= LEAST_AGE;
    main.classList.toggle("predicted", predicted);
    traces.late = connected && traces.held === null && silent > limit ? silent * played : 0;
    old.hidden = !isOld;
    if (!isOld) return;
    const seconds = traces.held === null ? unmeasured : (performance.now() - heldAt) / 1000;
    const age = Number.isFinite(seconds) ? `${seconds.toFixed(1)} s` : "ages";
    old.textContent =
      traces.held !== null
        ? `Paused: these numbers are ${age} old.`
        : predicted
          ? `Predicted: nothing was measured for ${age}; the filter goes on alone, with growing intervals.`
          : `These numbers are ${age} old${feed.state === "ended" ? ": the run has ended" : ": no rows come"}.`;
    if (traces.late) traces.redraw();
  }
  feed.onRows = () => {
    updates++;
    if (traces.held === null) {
      traces.redraw();
      numbers();
    }
    if (main.classList.contains("stale") || main.classList.contains("predicted") || feed.ring.isPredicted || feed.messages === 1) freshness();
  };
  feed.onSaid = tell;

  function tell(message: Said): void {
    if (message.source !== undefined && message.text !== undefined) {
      said.prepend(h("li", {}, h("strong", {}, message.kind), message.time === null ? "" : ` ${message.time.toFixed(1)} s`, message.text ? `: ${message.text}` : ""));
      while (said.children.length > 6) said.lastElementChild?.remove();
      if (message.kind in WARNING) warn(message.kind, message.text);
    } else if (message.kind === "soil") {
      const sure = message.probability === null || message.probability === undefined ? (message.labelled ? "labelled" : "") : `${digits(100 * message.probability, 2)} % sure`;
      soil.set(message.soil || "–", sure);
      soil.element.dataset["soil"] = soilColor(message.soil ?? "");
    } else if (message.kind === "status") {
      const lost = Object.values(message.counts ?? {}).reduce((sum, one) => sum + (one["dropped"] ?? 0), 0);
      delay = message.delay ?? 0;
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
    const code = ring.event[(ring.taken - 1) % ring.event.length] ?? 0;
    const event = hello.events[code] ?? "";
    if (event in WARNING && warning.hidden) warn(event, "");
    if (event in WARNING) warnedAt = ring.now;
    else if (!warning.hidden && !(ring.now - warnedAt < LINGER)) warning.hidden = true;
    const wheels = hello.wheels;
    const slips = wheels.map((wheel) => ring.last(`slip_${wheel}`)).filter(Number.isFinite);
    const most = Math.max(...slips);
    const wheel = wheels.find((name) => ring.last(`slip_${name}`) === most) ?? "";
    const spread = 196 * ring.last(`slip_${wheel}_std`);
    slip.set(slips.length ? (100 * most).toFixed(0) : "–", slips.length ? `${wheel}, ± ${spread.toFixed(0)}` : Math.abs(ring.last("ground_speed")) < STANDING ? "standing" : "not known");
    const offered = peak * ring.last("curve_a");
    const used = Math.max(...wheels.map((name) => ring.last(`adhesion_${name}`)));
    const known = peak > 0 && ring.last("curve_a_std") < 0.35 * ring.last("curve_a");
    grip.set(known ? Math.min((100 * used) / offered, 100).toFixed(0) : "–", known ? `µ ${digits(used, 2)} of ${digits(offered, 2)}` : `µ ${digits(used, 2)}; what the soil offers is not known yet`);
    const v = ring.last("ground_speed");
    speedTile.set(Number.isFinite(v) ? v.toFixed(2) : "–", Number.isFinite(v) ? `± ${(1.96 * ring.last("ground_speed_std")).toFixed(2)}` : "not known");
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
    if (before && !runs.includes(before)) source.prepend(h("option", { value: before }, `replay ${before} (not to be had)`));
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
    const drops = feed.age("status") < STATUS_AGE ? (health.dataset["drops"] ?? "") : "";
    health.textContent = feed.state === "connected" && rate && !main.classList.contains("stale") ? [`${rate} updates/s`, drops].filter(Boolean).join(", ") : "";
  }, 1000);
  const watch = window.setInterval(freshness, 1000 * LOOK);
  const forget = notices.on((notice) => notice.kind === "folder" && void reload(false));
  void reload(true);
  Object.assign(window, { terragripLive: { feed, traces } });
  return () => {
    clearInterval(clock);
    clearInterval(watch);
    main.classList.remove("stale", "predicted");
    forget();
    feed.close();
    traces.close();
  };
};

/** What a driver can read at a glance: what happens, without the figures and the rule after it, which the list of events tells. */
function brief(text: string): string {
  return text.split(": ")[0] ?? text;
}

function tile(title: string, unit: string): { element: HTMLElement; set: (value: string, more: string) => void } {
  const number = h("span", { class: "big" }, "–");
  const more = h("span", { class: "more" }, "");
  const element = h("div", { class: "tile" }, h("h2", {}, title), h("div", {}, number, h("span", { class: "unit" }, unit)), more);
  return {
    element,
    set(value, text) {
      if (number.textContent !== value) number.textContent = value;
      if (more.textContent !== text) more.textContent = text;
    },
  };
}

function tracesOf(wheels: string[], columns: string[]): Trace[] {
  const each = (name: string): Trace["lines"] =>
    wheels
      .map((wheel, i) => ({ column: `${name}_${wheel}`, color: WHEEL_COLORS[i % WHEEL_COLORS.length] ?? "blue", label: wheel }))
      .filter((line) => columns.includes(line.column));
  const one = (column: string, color: string): Trace["lines"] => (columns.includes(column) ? [{ column, color, label: column }] : []);
  return [
    { title: "Slip", unit: "%", scale: 100, lines: each("slip"), low: -150, high: 200 },
    { title: "Adhesion µ", unit: "–", scale: 1, lines: each("adhesion"), low: -0.5, high: 1.5 },
    { title: "Ground speed", unit: "m/s", scale: 1, lines: one("ground_speed", "blue"), low: 0, high: 20 },
    { title: "Soil resistance ρs", unit: "–", scale: 1, lines: one("soil_resistance", "purple"), low: -0.3, high: 1 },
    { title: "Efficiency η", unit: "%", scale: 100, lines: each("efficiency"), low: 0, high: 100 },
    { title: "Online curve a", unit: "–", scale: 1, lines: one("curve_a", "green"), low: 0, high: 3 },
  ];
}

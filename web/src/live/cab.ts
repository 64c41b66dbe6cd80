/** A page for a tablet in the cab: three big numbers, the warning, and how old they are. It fails visibly. */

import { sampled } from "../fit/samples";
import { fill, h, onFrame } from "../ui/dom";
import { tried } from "../ui/notes";
import type { Page } from "../ui/page";
import { onUnits, unitFor, unitsChooser, type Kind } from "../ui/units";
import { Alarms } from "./alarms";
import { Feed, of, type Said } from "./feed";
import { ageOf, brief, eventNow, LINGER, reading, seconds, sentence, STATUS_AGE, WARNING, type Figure } from "./numbers";

const CHECK = 100; // ms

export const page: Page = (main, { query }) => {
  const replay = query.get("replay");
  const vehicle = of(query.get("vehicle") ?? "");
  const speed = Number(query.get("speed")) || 1;
  const alarms = new Alarms();
  const tiles = { slip: tile("Slip", "share"), grip: tile("Grip in use", "share"), speed: tile("Speed", "speed") };
  const warning = h("div", { class: "cab-warning", role: "alert" });
  const age = h("p", { class: "cab-age", id: "cab-age", role: "status" }, "connecting …");
  main.append(
    h("h1", { class: "visually-hidden" }, "Cab"),
    h("div", { class: "cab-numbers" }, tiles.slip.element, tiles.grip.element, tiles.speed.element),
    warning,
    alarms.element,
    h("div", { class: "cab-foot" }, age, h("span", { class: "spring" }), unitsChooser(), alarms.settings, h("button", { type: "button", click: () => void tried(() => document.documentElement.requestFullscreen()) }, "Full screen"), h("a", { class: "button", href: `#/live?${new URLSearchParams(vehicle)}` }, "Leave")),
  );
  let peak = NaN; // largest adhesion of the online curve over its scale
  let delay = 0;
  let warnedAt = -Infinity;
  let [why, silent] = ["", ""];
  void tried(() => sampled({ model: "exponential", parameters: { a: 1 } })).then((shape) => shape && (peak = shape.peak[1]));
  const feed = new Feed(() => new URLSearchParams(replay ? { replay, speed: String(speed) } : vehicle).toString());

  function warn(kind: string, text: string): void {
    warnedAt = feed.ring.now;
    fill(warning, h("strong", {}, WARNING[kind] ?? kind), text ? ` ${brief(text)}` : "");
  }

  feed.onSaid = (said: Said) => {
    if (said.kind === "status") [delay, silent] = [said.delay ?? 0, sentence(said.silent)];
    else if (said.kind in WARNING && said.source !== undefined) warn(said.kind, said.text ?? "");
  };
  feed.onState = (_, reason) => {
    why = reason;
    check();
  };
  /** The newest row, at the next frame. */
  const show = onFrame(() => {
    const { ring, hello } = feed;
    if (!hello || !ring.taken) return;
    const event = eventNow(ring, hello);
    if (event in WARNING && !warning.textContent) warn(event, "");
    if (event in WARNING) warnedAt = ring.now;
    else if (!(ring.now - warnedAt < LINGER)) fill(warning);
    const now = reading(ring, hello, peak);
    for (const name of ["slip", "grip", "speed"] as const) tiles[name].set(now[name]);
    if (!ring.isPredicted) alarms.check(now, event);
    check();
  });
  const forget = onUnits(show);
  feed.onRows = show;

  /** The age of the numbers; old ones are struck out, with a message in the largest letters of the page. */
  function check(): void {
    const { isOld, predicted, waiting, unmeasured } = ageOf(feed, delay, speed, false);
    const dead = isOld || waiting || feed.state !== "connected";
    main.classList.toggle("dead", dead && !predicted);
    main.classList.toggle("predicted", predicted);
    const said = !feed.ring.taken ? "NO DATA YET" : predicted ? `PREDICTED ONLY, no measurement for ${seconds(unmeasured)}` : `NO DATA for ${seconds(unmeasured)}`;
    const more = feed.state === "lost" ? why : feed.state === "connected" && feed.age("status") < STATUS_AGE ? silent : "";
    fill(age, dead || predicted ? said : `measured ${seconds(unmeasured)} ago`, feed.state === "ended" ? " (the run has ended)" : more && h("small", {}, more));
    alarms.silent(feed.ring.taken > 0 && isOld && feed.state !== "ended");
  }
  const watch = window.setInterval(check, CHECK);
  // A tablet that goes dark shows nothing at all; where the browser has no such lock, its own settings must keep it awake.
  let lock: WakeLockSentinel | null = null;
  const wake = (): void => {
    if (document.visibilityState === "visible") void navigator.wakeLock?.request("screen").then((one) => (lock = one), () => undefined);
  };
  wake();
  document.addEventListener("visibilitychange", wake);
  Object.assign(window, { terragripCab: { feed, alarms } });
  return () => {
    clearInterval(watch);
    forget();
    document.removeEventListener("visibilitychange", wake);
    void lock?.release();
    main.classList.remove("dead", "predicted");
    alarms.close();
    feed.close();
  };
};

function tile(title: string, kind: Kind): { element: HTMLElement; set: (figure: Figure) => void } {
  const number = h("span", { class: "cab-number" }, "–");
  const more = h("p", { class: "cab-more" });
  const name = h("h2", {}, `${title} [${unitFor(kind).name}]`);
  return {
    element: h("section", { class: "cab-tile", "aria-label": title }, name, number, more),
    set({ shown: [value, text] }) {
      const said = `${title} [${unitFor(kind).name}]`;
      if (name.textContent !== said) name.textContent = said;
      if (number.textContent !== value) number.textContent = value;
      if (more.textContent !== text) more.textContent = text;
    },
  };
}

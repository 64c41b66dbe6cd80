/** The numbers of the live page and the cab page: those of the newest row, and their age. */

import { digits } from "../ui/dom";
import { fixed, unitFor } from "../ui/units";
import { LEAST_AGE, oldAfter, type Feed, type Hello, type Ring } from "./feed";

export const WARNING: Record<string, string> = {
  immobilization: "Digging in soon",
  stuck: "Stuck",
  push: "The tool pushes",
};
/** Seconds that a warning is shown after its last row. */
export const LINGER = 2;
/** Seconds after which a status is out of date (one comes every second). */
export const STATUS_AGE = 2.5;
/** Speed [m/s] below which a machine stands. */
export const STANDING = 0.05;

/** A number for alarms, NaN where it is not known; and as it is shown: its digits, and the text below. */
export interface Figure {
  value: number;
  shown: [string, string];
}

/** Slip of the driven wheel that slips most, share of the soil's offer in use, ground speed [m/s]. */
export interface Reading {
  slip: Figure;
  grip: Figure;
  speed: Figure;
}

/** `peak`: the largest adhesion of the online curve over its scale. */
export function reading(ring: Ring, { wheels, driven }: Hello, peak: number): Reading {
  const watched = driven?.length ? driven : wheels; // a free wheel rolls on where a driven one's speed is lost
  const slips = watched.map((wheel) => ring.last(`slip_${wheel}`)).filter(Number.isFinite);
  const lost = watched.filter((wheel) => !Number.isFinite(ring.last(`slip_${wheel}`)));
  const most = Math.max(...slips);
  const wheel = watched.find((name) => ring.last(`slip_${name}`) === most) ?? "";
  const [share, pace] = [unitFor("share"), unitFor("speed")];
  const spread = 1.96 * ring.last(`slip_${wheel}_std`);
  const offered = peak * ring.last("curve_a");
  const used = Math.max(...wheels.map((name) => ring.last(`adhesion_${name}`)));
  const known = peak > 0 && ring.last("curve_a_std") < 0.35 * ring.last("curve_a");
  const grip = known ? Math.min(used / offered, 1) : NaN;
  const v = ring.last("ground_speed");
  return {
    slip: {
      value: slips.length ? most : NaN,
      shown: [fixed(most, share), slips.length ? `${wheel}, ± ${fixed(spread, share)}${lost.length ? `; ${lost.join(", ")} not known` : ""}` : Math.abs(v) < STANDING ? "standing" : "not known"],
    },
    grip: { value: grip, shown: [fixed(grip, share), known ? `µ ${digits(used, 2)} of ${digits(offered, 2)}` : wheels.some((name) => ring.names.includes(`adhesion_${name}`)) ? `µ ${digits(used, 2)}; the soil's maximum is not known yet` : "needs a drive torque"] },
    speed: { value: v, shown: [fixed(v, pace), Number.isFinite(v) ? `± ${fixed(1.96 * ring.last("ground_speed_std"), pace)}` : "not known"] },
  };
}

/** The event of the newest row, empty for none. */
export function eventNow(ring: Ring, hello: Hello): string {
  return hello.events[ring.event[(ring.taken - 1) % ring.event.length] ?? 0] ?? "";
}

/** How old the newest row is. `delay`: of estimates against their samples [s]; `speed`: of a replay; `held`: paused by the user. */
export function ageOf(feed: Feed, delay: number, speed: number, held: boolean) {
  const played = feed.hello?.replay ? speed : 1;
  const limit = oldAfter(feed.ring.period / played);
  const silent = feed.age("row");
  const unmeasured = feed.age("measured") + (feed.age("status") < STATUS_AGE ? delay : 0);
  const connected = feed.state === "connected";
  return {
    played,
    limit,
    silent,
    unmeasured,
    waiting: connected && !feed.ring.taken,
    isOld: feed.ring.taken > 0 && (!connected || held || !(unmeasured <= limit)),
    predicted: connected && !held && feed.ring.isPredicted && silent <= LEAST_AGE,
  };
}

export const seconds = (age: number): string => (Number.isFinite(age) ? `${age.toFixed(1)} s` : "ages");

/** A time of samples: of day, where it counts from 1970. */
export const instant = (time: number): string => (time > 1e8 && time < 1e11 ? `${new Date(1000 * time).toISOString().slice(11, 19)} UTC` : `${time.toFixed(1)} s`);

/** The sources that are silent, as the service says it. */
export const sentence = (silent: string[] = []): string => silent.join("; ").replace(/^./, (first) => first.toUpperCase());

export function oldSaid(predicted: boolean, age: number, ended: boolean): string {
  return predicted
    ? `Predicted: no measurement for ${seconds(age)}; intervals grow until there is one.`
    : `These numbers are ${seconds(age)} old${ended ? ": the run has ended" : ": no new rows"}.`;
}

/** What a driver can read at a glance: the event, without the figures and the rule after it, which are in the list of events. */
export function brief(text: string): string {
  const [head = "", ...rest] = text.split(": ");
  return rest.length && /^[a-z]/.test(head) ? rest.join(": ") : head; // the service's begin with the warning, which is said beside them
}

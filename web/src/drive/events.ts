/** The list of a run's events: next, previous, and the explanation of each. */

import { digits, fill, h } from "../ui/dom";
import { timeOfDay } from "../ui/clock";
import { EVENT_COLORS, type Event, type Run } from "./run";

/** Entries that the list shows; next and previous go through all. */
const LISTED = 400;

export class EventList {
  readonly element = h("section", { class: "events", "aria-label": "Events" });
  private list = h("ul", { class: "list" });
  private count = h("span", { class: "hint" });
  private events: Event[] = [];
  private chosen = -1;

  constructor(private choose: (event: Event) => void) {
    this.element.append(
      h(
        "div",
        { class: "row" },
        h("h2", {}, "Events"),
        this.count,
        h("span", { class: "spring" }),
        h("button", { type: "button", click: () => this.step(-1), "aria-label": "Previous event" }, "◀"),
        h("button", { type: "button", click: () => this.step(1), "aria-label": "Next event" }, "▶"),
      ),
      this.list,
    );
  }

  /** The events of a run; none without one. */
  show(run: Run | null): void {
    const events = run?.events ?? [];
    this.events = [...events].sort((a, b) => a.start - b.start);
    this.chosen = -1;
    this.count.textContent = events.length ? `${events.length}${events.length > LISTED ? `, ${LISTED} listed` : ""}` : "none";
    fill(
      this.list,
      this.events.slice(0, LISTED).map((event, i) =>
        h(
          "li",
          {},
          h("i", { class: `strip ${EVENT_COLORS[event.kind] ?? "ink"}`, "aria-hidden": "true" }),
          h("button", { type: "button", class: "name", title: event.why, click: () => this.go(i) }, `${run && timeOfDay(run, event.start, 1)}  ${event.kind}${event.end > event.start ? `, ${digits(event.end - event.start, 2)} s` : ""}`),
        ),
      ),
    );
  }

  /** Choose the event before or after the chosen one; without one, the first or the last. */
  step(by: number): void {
    if (!this.events.length) return;
    const next = this.chosen < 0 ? (by > 0 ? 0 : this.events.length - 1) : this.chosen + by;
    this.go(Math.min(Math.max(next, 0), this.events.length - 1));
  }

  private go(i: number): void {
    const event = this.events[i];
    if (!event) return;
    this.chosen = i;
    for (const [k, line] of [...this.list.children].entries()) {
      line.classList.toggle("chosen", k === i);
      if (k === i) line.scrollIntoView({ block: "nearest" });
    }
    this.choose(event);
  }
}

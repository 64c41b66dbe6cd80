/** The wheels and axles of a log by the names of the vehicle: a log may call `hl` what the vehicle calls `rl`. */

import { fill, h } from "../ui/dom";

/** The names of a vehicle file. */
export interface Parts {
  wheels: string[];
  axles: string[];
}

interface Channel {
  name: string;
  wheel: string;
}

const AXLE = /^vertical_load_/;

export class WheelNames {
  readonly element = h("div", { class: "wheel-names" });
  given = new Map<string, string>();
  private parts: Parts = { wheels: [], axles: [] };
  private channels: Channel[] = [];

  /** `changed`: another name was given. */
  constructor(private changed: () => void) {}

  /** The channels of the log that may be renamed. */
  of(channels: Channel[]): void {
    this.channels = channels.filter(({ wheel }) => wheel);
    this.draw();
  }

  /** The vehicle's own names; without a vehicle any name will do. */
  offer(parts: Parts): void {
    this.parts = parts;
    this.draw();
  }

  /** What a wheel or axle of the log is called. */
  nameOf(wheel: string): string {
    return this.given.get(wheel) ?? wheel;
  }

  /** A channel with the name of its wheel. */
  channel({ name, wheel }: Channel): string {
    return wheel ? name.slice(0, -wheel.length) + this.nameOf(wheel) : name;
  }

  /** Wheels and axles that have `used` channels and that the vehicle does not have. */
  strangers(used: (channel: string) => boolean): string[] {
    const names = this.channels.filter(({ name }) => used(name)).map(({ name, wheel }) => [wheel, this.known(name)] as const);
    return [...new Set(names.filter(([wheel, known]) => known.length && !known.includes(this.nameOf(wheel))).map(([wheel]) => wheel))];
  }

  /** Two that have been given one name; null where there are none. */
  twice(): [string, string] | null {
    for (const axle of [false, true]) {
      const seen = new Map<string, string>();
      for (const wheel of this.list(axle)) {
        const before = seen.get(this.nameOf(wheel));
        if (before !== undefined) return [before, wheel];
        seen.set(this.nameOf(wheel), wheel);
      }
    }
    return null;
  }

  /** Put the cursor at the first name that the vehicle does not have. */
  focus(wheel: string): void {
    for (const one of this.element.querySelectorAll("details")) one.open = true;
    document.getElementById(idOf(wheel))?.focus();
  }

  private known(channel: string): string[] {
    return AXLE.test(channel) ? this.parts.axles : this.parts.wheels;
  }

  private list(axle: boolean): string[] {
    return [...new Set(this.channels.filter(({ name }) => AXLE.test(name) === axle).map(({ wheel }) => wheel))];
  }

  private draw(): void {
    const groups = [false, true].flatMap((axle) => this.list(axle).map((wheel) => this.field(wheel, axle ? this.parts.axles : this.parts.wheels)));
    const odd = this.strangers(() => true).length > 0;
    fill(this.element, groups.length ? h("details", { open: odd }, h("summary", {}, "Assign the wheels"), h("p", { class: "hint" }, "The log’s wheels and axles, by the names of the vehicle file."), h("div", { class: "row" }, groups)) : null);
  }

  private field(wheel: string, known: string[]): HTMLElement {
    const now = this.nameOf(wheel);
    const choices = [...new Set([...known, now, wheel])];
    const field = known.length
      ? h("select", { id: idOf(wheel) }, choices.map((name) => h("option", { value: name, selected: name === now }, known.includes(name) ? name : `${name} (not a part of the vehicle)`)))
      : h("input", { type: "text", id: idOf(wheel), value: now, maxlength: 40 });
    field.addEventListener("change", () => {
      if (field.value.trim()) this.given.set(wheel, field.value.trim());
      this.changed();
    });
    return h("label", {}, `${wheel} is `, field);
  }
}

const idOf = (wheel: string): string => `wheel-${wheel}`;

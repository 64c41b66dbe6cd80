/** Handles on the active curve, dragged by mouse, finger or arrow keys. The server says where they lie, and the curve that a moved one gives. */

import { send } from "../ui/api";
import { digits, h } from "../ui/dom";
import { tried } from "../ui/notes";
import { unitFor, withUnit } from "../ui/units";
import type { View } from "../ui/view";
import type { Handle, Parameters, Samples } from "./samples";
import type { State } from "./state";

const NAMES: Record<Handle["name"], [string, string, string]> = {
  zero: ["zero", "ns-resize", "value at zero slip: drag up or down"],
  rise: ["rise", "ew-resize", "half of the height: drag left to make the rise steeper, right to make it flatter"],
  peak: ["peak", "move", "peak: drag to another slip and height"],
  level: ["level", "ns-resize", "level at 60 % slip: drag up or down"],
};

/** One drag, from the curve as it was when it began. */
interface Drag {
  id: number;
  name: Handle["name"];
  before: Parameters;
  goal: [number, number];
  /** From the handle to where it was seized, in pixels. */
  off: [number, number];
  asking: boolean;
  stale: boolean;
  over: boolean;
}

export class Handles {
  readonly element = h("div", { class: "handles" });
  /** Handles would be in the way while clicks have another meaning. */
  hidden: () => boolean = () => false;
  private drag: Drag | null = null;
  private buttons = new Map<string, HTMLElement>();

  constructor(
    private state: State,
    private view: View,
  ) {}

  /** Put the handles where the curve is drawn. */
  place(): void {
    const curve = this.state.active;
    const samples = curve?.shown ? this.state.samples.of(curve.id, curve) : null;
    const shown = this.hidden() ? [] : (samples?.handles ?? []).filter(({ slip }) => slip >= this.view.x.low && slip <= this.view.x.high);
    const dragged = this.drag && !this.drag.over ? this.drag.name : null;
    for (const [name, button] of this.buttons) if (name !== dragged && !shown.some((one) => one.name === name)) this.drop(name, button);
    const unit = unitFor("share");
    for (const one of shown) {
      const { name, slip, value } = one;
      const [x, y] = this.spot(one);
      const button = this.buttons.get(name) ?? this.make(name);
      button.style.translate = `${x}px ${y}px`;
      button.classList.toggle("right", x > 0.7 * this.view.width);
      button.style.borderColor = `var(--${curve?.color})`;
      (button.firstElementChild as HTMLElement).dataset["at"] = `${withUnit(digits(unit.scale * slip), unit)}, µ ${digits(value)}`;
      button.setAttribute("aria-label", `${NAMES[name][2]}. Slip ${withUnit(digits(unit.scale * slip), unit)}, µ ${digits(value)}`);
    }
  }

  /** A handle's place on the screen; of one above or below what is shown, at the edge, so that the curve can be fetched back. */
  private spot({ slip, value }: Handle): [number, number] {
    return this.within(this.view.px(slip), this.view.py(value));
  }

  /** A place on the screen, or the nearest inside the axes. */
  private within(px: number, py: number): [number, number] {
    const { x, y, width, height } = this.view.box;
    return [Math.min(Math.max(px, x), x + width), Math.min(Math.max(py, y), y + height)];
  }

  private drop(name: string, button: HTMLElement): void {
    const focused = document.activeElement === button;
    button.remove();
    this.buttons.delete(name);
    if (focused) (this.element.firstElementChild as HTMLElement | null ?? this.element.parentElement)?.focus();
  }

  private make(name: Handle["name"]): HTMLElement {
    const [text, cursor, about] = NAMES[name];
    const button = h("button", { type: "button", class: "handle", id: `handle-${name}`, title: `${about}; arrow keys too, with shift ten times as far` }, h("span", {}, text));
    button.style.cursor = cursor;
    button.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      event.stopPropagation();
      button.setPointerCapture(event.pointerId);
      const here = this.here(name);
      if (!here) return;
      const [x, y] = this.spot(here);
      this.drag = this.begin(name, [event.clientX - x, event.clientY - y]);
    });
    button.addEventListener("pointermove", (event) => {
      if (!this.drag || this.drag.over || !button.hasPointerCapture(event.pointerId)) return;
      const [x, y] = this.within(event.clientX - this.drag.off[0], event.clientY - this.drag.off[1]);
      void this.lead(this.drag, [this.view.x_of(x), this.view.y_of(y)]);
    });
    for (const kind of ["pointerup", "pointercancel", "keyup", "blur"] as const) button.addEventListener(kind, () => this.end());
    button.addEventListener("dblclick", (event) => event.stopPropagation());
    button.addEventListener("keydown", (event) => this.key(name, event));
    this.buttons.set(name, button);
    const names = Object.keys(NAMES);
    const next = names.slice(names.indexOf(name) + 1).map((other) => this.buttons.get(other)).find((one) => one);
    this.element.insertBefore(button, next ?? null); // the others stay where they are: one of them may be dragged
    return button;
  }

  private here(name: string): Handle | undefined {
    const curve = this.state.active;
    return curve && this.state.samples.of(curve.id, curve)?.handles.find((one) => one.name === name);
  }

  private begin(name: Handle["name"], off: [number, number]): Drag | null {
    const [curve, here] = [this.state.active, this.here(name)];
    if (!curve || !here) return null;
    return { id: curve.id, name, before: { ...curve.parameters }, goal: [here.slip, here.value], off, asking: false, stale: false, over: false };
  }

  private key(name: Handle["name"], event: KeyboardEvent): void {
    const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (event.key === "Escape") this.revert();
    if (!way || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    event.stopPropagation(); // else the plot pans
    if (this.drag?.name === name) this.drag.over = false; // its last step is still on the way
    else this.drag = this.begin(name, [0, 0]);
    if (!this.drag) return;
    const step = event.shiftKey ? 0.05 : 0.005; // of what the plot shows
    const { x, y } = this.view;
    const [slip, value] = this.drag.goal;
    void this.lead(this.drag, [slip + (way[0] ?? 0) * step * (x.high - x.low), value + (way[1] ?? 0) * step * (y.high - y.low)]);
  }

  /** Ask for the curve whose handle is at the goal: one request at a time, and the last goal counts. */
  private async lead(drag: Drag, goal: [number, number]): Promise<void> {
    drag.goal = goal;
    drag.stale = true;
    if (drag.asking) return;
    drag.asking = true;
    while (drag.stale) {
      drag.stale = false;
      const curve = this.state.kept.curves.find((one) => one.id === drag.id);
      if (!curve) break;
      const { model, held, bounds } = curve;
      const found = await tried(() => send<Samples & { parameters: Parameters }>("POST", "curve/move", { model, parameters: drag.before, held, bounds, handle: drag.name, slip: drag.goal[0], value: drag.goal[1] }));
      if (!found || this.drag !== drag || curve !== this.state.active) break; // reverted or undone meanwhile
      curve.parameters = found.parameters;
      this.state.samples.put(curve.id, curve, found);
      this.state.changed("curve");
    }
    drag.asking = false;
    if (drag.over) this.settle(drag);
  }

  private end(): void {
    if (!this.drag || this.drag.over) return;
    this.drag.over = true;
    if (!this.drag.asking) this.settle(this.drag);
  }

  /** A drag is a step of the undo history. */
  private settle(drag: Drag): void {
    if (this.drag !== drag) return;
    this.drag = null;
    this.state.commit();
    this.state.changed("all");
  }

  private revert(): void {
    const curve = this.state.active;
    if (!this.drag || this.drag.over || !curve) return;
    curve.parameters = this.drag.before;
    this.drag = null;
    this.state.changed("all");
  }
}

/** The vehicle maker: a form over what is known of a machine, its sketch, and what each missing number costs. */

import { get, send } from "../ui/api";
import { digits, fill, h } from "../ui/dom";
import { tried } from "../ui/notes";
import { draftOf, keepDraft } from "./draft";
import { row } from "./fields";
import { commandLine } from "./jobs";
import { sketch, type Vehicle } from "./sketch";

interface Field {
  name: string;
  title: string;
  unit: string;
  /** What is typical; null where nothing is assumed. */
  value: number | null;
  spread: number | null;
  source: string | null;
  needed: boolean;
  is_spread: boolean;
  known: number | null;
  /** Known, and far from what is typical. */
  is_far: boolean;
}

interface Made {
  fields: Field[];
  vehicle: Vehicle;
  text: string;
}

interface Wanted {
  machine: string;
  signals: string;
  known: Record<string, string>;
  name: string;
}

interface Cost {
  what: string;
  field: string;
  half_width: Record<string, number>;
}

const QUANTITIES: [string, string][] = [
  ["slip", "slip"],
  ["adhesion", "µ"],
  ["soil_resistance", "ρs"],
  ["net_traction", "net traction"],
];
const PAUSE = 350; // ms after the last key before the server is asked

export class MachineMaker {
  readonly element = h("form", { class: "maker", "aria-label": "Make a vehicle file" });
  private kind = h("select", { id: "machine-class", required: true });
  private signals = h("select", { id: "machine-signals" });
  private name = h("input", { type: "text", id: "machine-name", placeholder: "e.g. Fendt 724, blue tyres" });
  private output: HTMLInputElement;
  private inputs = new Map<string, HTMLInputElement>();
  private form = h("div", { class: "maker-fields" });
  private picture = h("div", { class: "maker-picture" });
  private costs = h("div", { class: "costs", "aria-live": "polite" });
  private problem = h("p", { class: "bad", role: "alert", id: "machine-problem" });
  private save = h("button", { type: "submit", class: "primary", id: "save-machine", disabled: true }, "Save the vehicle file");
  private shown = ""; // class and signals that the fields are of
  private typed: Record<string, string> = {}; // numbers for fields that are drawn next
  private timer = 0;
  private turn = 0;

  constructor(
    output: string,
    signals: string,
    private saved: (vehicle: string) => void,
  ) {
    this.output = h("input", { type: "text", id: "machine-output", value: output, required: true });
    fill(
      this.element,
      h("div", { class: "maker-head" }, row("Machine", this.kind), row("Its log measures", this.signals), row("Name", this.name)),
      h("div", { class: "maker-body" }, h("div", {}, this.form, this.problem), h("div", {}, this.picture, this.costs)),
      h("div", { class: "row end" }, h("label", { for: this.output.id }, "Save as"), this.output, this.save),
    );
    this.kind.addEventListener("change", () => void this.check());
    this.signals.addEventListener("change", () => void this.check());
    this.name.addEventListener("change", () => void this.check());
    this.element.addEventListener("submit", (event) => {
      event.preventDefault();
      void this.keep();
    });
    void tried(async () => {
      const all = await get<{ classes: { name: string; title: string }[]; signals: Record<string, string> }>("machines");
      fill(this.kind, h("option", { value: "" }, "– choose –"), all.classes.map((one) => h("option", { value: one.name }, one.title)));
      fill(this.signals, Object.entries(all.signals).map(([name, title]) => h("option", { value: name, selected: name === signals }, title)));
      this.takeUp(output);
    });
  }

  /** Go on with what was typed and not saved; the draft is that of the file proposed. */
  private takeUp(output: string): void {
    for (const event of ["input", "change"]) this.element.addEventListener(event, () => keepDraft(output, this.wanted));
    this.element.addEventListener("kept", () => keepDraft(output, null));
    const draft = draftOf<Wanted>(output);
    if (!draft) return;
    [this.kind.value, this.signals.value, this.name.value, this.typed] = [draft.machine, draft.signals, draft.name, draft.known];
    void this.check();
  }

  /** What the log measures, by the columns that were chosen. */
  measures(signals: string): void {
    if (this.signals.value === signals) return;
    this.signals.value = signals;
    void this.check();
  }

  private get wanted(): Wanted {
    const known = Object.fromEntries([...this.inputs].map(([name, field]) => [name, field.value.trim()]).filter(([, value]) => value)) as Record<string, string>;
    return { machine: this.kind.value, signals: this.signals.value, known, name: this.name.value };
  }

  private async check(): Promise<void> {
    if (!this.kind.value) return;
    const turn = ++this.turn;
    const now = `${this.kind.value} ${this.signals.value}`;
    if (now !== this.shown) {
      if (this.inputs.size) this.typed = this.wanted.known; // stays where the other class asks for it too
      this.inputs.clear();
    }
    let made: Made;
    try {
      made = await send<Made>("POST", "machines/made", { ...this.wanted });
    } catch (error) {
      if (turn === this.turn) this.refuse(error instanceof Error ? error.message : String(error));
      return;
    }
    if (turn !== this.turn) return;
    this.refuse("");
    const isOther = now !== this.shown;
    this.shown = now;
    if (isOther) {
      this.drawFields(made.fields);
      if (Object.keys(this.wanted.known).length) return this.check();
    }
    this.drawTypical(made.fields);
    const known = new Set(made.fields.filter((field) => field.known !== null).map((field) => field.name));
    fill(this.picture, sketch(made.vehicle, known), h("details", {}, h("summary", {}, "The file"), h("pre", { tabindex: "0" }, made.text)));
    const costs = await tried(() => send<Cost[]>("POST", "machines/costs", this.wanted));
    if (costs && turn === this.turn) this.drawCosts(costs, made.fields);
  }

  /** What forbids saving, or "". While the server is still asked, the button stays as it is: else it would swallow a click. */
  private refuse(problem: string): void {
    this.save.disabled = problem !== "";
    const place = (problem.split(":", 1)[0] as string).replaceAll(".", "_"); // wheel_radius, or wheel.radius of the file
    for (const [name, input] of this.inputs) {
      const isWrong = problem !== "" && name === place;
      input.setAttribute("aria-invalid", String(isWrong));
      if (isWrong) input.after(this.problem);
    }
    if (!this.problem.isConnected || !this.problem.parentElement?.querySelector("[aria-invalid=true]")) this.form.after(this.problem);
    this.problem.textContent = problem;
    for (const one of [this.picture, this.costs]) one.classList.toggle("of-before", problem !== "");
  }

  private drawFields(fields: Field[]): void {
    const asked = (field: Field): HTMLElement => {
      const input = h("input", { type: "text", id: `machine-${field.name}`, value: this.typed[field.name] ?? "", placeholder: typical(field), "aria-describedby": `typical-${field.name}`, autocomplete: "off" });
      input.addEventListener("input", () => {
        clearTimeout(this.timer);
        this.timer = window.setTimeout(() => void this.check(), PAUSE);
      });
      this.inputs.set(field.name, input);
      return h("div", { class: "asked" }, h("label", { for: input.id }, field.title, " ", h("span", { class: field.needed ? "badge needed" : "badge" }, field.needed ? "needed" : "optional")), input, h("p", { class: "hint", id: `typical-${field.name}` }));
    };
    const machine = fields.filter((field) => !field.is_spread);
    const first = machine.filter((field) => field.needed);
    const others = machine.filter((field) => !field.needed);
    const sensors = fields.filter((field) => field.is_spread);
    fill(
      this.form,
      fields.length ? h("p", { class: "hint" }, "With its unit (6.2 t, 83 cm). Left empty: typical of the class, and its uncertainty widens the intervals.") : h("p", { class: "hint" }, "No number of the machine is needed: the log itself gives the zero of slip."),
      first.map(asked),
      others.map(asked),
      sensors.length ? h("details", {}, h("summary", {}, "Noise of its sensors"), sensors.map(asked)) : null,
    );
  }

  /** What is typical, which moves with the mass and the radius. */
  private drawTypical(fields: Field[]): void {
    for (const field of fields) {
      const input = this.inputs.get(field.name);
      if (input) input.placeholder = typical(field);
      const line = this.element.querySelector(`#typical-${field.name}`);
      if (!line) continue;
      const [far, said] = [field.is_far, field.known === null ? "" : `${digits(field.known)} ${field.unit === "1" ? "" : field.unit}`];
      line.className = far ? "bad" : "hint";
      line.textContent = said ? said + (far ? `: far from what is typical of the class, ${typical(field)}. Is the unit right, and the point a decimal point?` : "") : field.source === null ? "" : `typical ${typical(field)}; ${field.source}`;
    }
  }

  private drawCosts(costs: Cost[], fields: Field[]): void {
    const best = costs[0]?.half_width ?? {};
    const shown = QUANTITIES.filter(([name]) => name in best);
    const counts = (cost: Cost): boolean => shown.some(([name]) => (cost.half_width[name] ?? 0) > 1.1 * (best[name] ?? 0));
    const title = (cost: Cost): string => {
      const field = fields.find((one) => one.name === cost.field);
      if (!field) return cost.what;
      return field.known === null ? `not known: ${field.title}` : cost.what.includes("by tape") ? `${field.title}: by tape, not calibrated` : `${field.title} ± ${digits(field.known)} ${field.unit}`;
    };
    const last = costs.length - 1;
    const rows = costs.filter((cost, i) => !cost.field || i === 0 || i === last || counts(cost));
    const small = costs.filter((cost) => !rows.includes(cost)).map((cost) => fields.find((field) => field.name === cost.field)?.title ?? cost.field);
    fill(
      this.costs,
      h("h3", {}, "Effect of each missing number"),
      h("p", { class: "hint" }, "Half the 95 % interval. Computed, not measured: this machine at work in simulation, each uncertainty alone through the filter."),
      h("div", { class: "wide", tabindex: "0", role: "region", "aria-label": "Costs" }, h("table", { class: "numbers" }, h("thead", {}, h("tr", {}, h("th", {}, ""), shown.map(([, text]) => h("th", { scope: "col" }, `± ${text}`)))), h("tbody", {}, rows.map((cost) => h("tr", { class: cost.field ? null : "whole" }, h("th", { scope: "row" }, title(cost)), shown.map(([name]) => h("td", {}, (cost.half_width[name] ?? NaN).toFixed(3)))))))),
      small.length ? h("p", { class: "hint" }, `Of little effect: ${small.join("; ")}.`) : null,
    );
  }

  private async keep(): Promise<void> {
    const output = this.output.value.trim();
    const kept = await tried(() => send<{ path: string; command: string }>("POST", "machines/file", { ...this.wanted, output }), "machine");
    if (!kept) return;
    this.saved(kept.path);
    this.element.dispatchEvent(new CustomEvent("kept", { detail: commandLine(kept.command) }));
  }
}

function typical(field: Field): string {
  const unit = field.unit === "1" ? "" : ` ${field.unit}`;
  if (field.value === null || field.spread === null) return "none";
  return field.is_spread ? `± ${digits(field.value)}${unit}` : `${digits(field.value)} ± ${digits(field.spread)}${unit}`;
}

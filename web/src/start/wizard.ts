/** From a log to estimates: what is in it, which vehicle and profile, go. */

import { get, send, type Item, type Job } from "../ui/api";
import { fill, h } from "../ui/dom";
import { tried } from "../ui/notes";

interface Inspection {
  rows: number;
  ready: boolean;
  /** Why an estimate cannot run, though the log is whole; null where nothing is known against it. */
  problem: string | null;
  missing: string[];
  warnings: string[];
  profile: string;
  text: string;
}

interface Methods {
  default: string;
  methods: Record<string, { smooth: boolean }>;
}

export class Wizard {
  readonly element = h("form", { method: "dialog", "aria-labelledby": "wizard-title" });
  private found = h("div", { class: "found", "aria-live": "polite" }, "Looking into the log …");
  private vehicle: HTMLSelectElement;
  private profile: HTMLSelectElement;
  private method = h("select", { id: "wizard-method" });
  private smooth = h("input", { type: "checkbox", id: "wizard-smooth" });
  private output: HTMLInputElement;
  private go = h("button", { type: "submit", class: "primary" }, "Estimate");
  private methods: Methods | undefined;
  private looks = 0;

  constructor(
    private recording: string,
    private items: Item[],
    private close: () => void,
  ) {
    const of = (kind: string): string[] => items.filter((item) => item.kind === kind).map((item) => item.path);
    this.vehicle = choice("wizard-vehicle", of("vehicle"), "No vehicle file in the folder: drop one");
    this.profile = choice("wizard-profile", of("profile"), "", "no profile: the columns have our names");
    const stem = recording.replace(/(\.\w{1,8}){1,2}$/, "");
    this.output = h("input", { type: "text", id: "wizard-output", value: `${stem}-estimates.parquet`, required: true });
    this.profile.addEventListener("change", () => void this.look());
    this.vehicle.addEventListener("change", () => void this.look());
    this.method.addEventListener("change", () => {
      this.limits();
      void this.look();
    });
    this.element.addEventListener("submit", (event) => {
      event.preventDefault();
      void this.start();
    });
    fill(
      this.element,
      h("h2", { id: "wizard-title" }, recording),
      this.found,
      row("Vehicle", this.vehicle),
      row("Profile", this.profile),
      row("Method", this.method),
      h("label", { class: "check" }, this.smooth, "smooth (run it backwards too)"),
      row("Write to", this.output),
      h("div", { class: "row end" }, h("button", { type: "button", click: close }, "Cancel"), this.go),
    );
  }

  /** Inspect the log with what is chosen. */
  async look(): Promise<void> {
    this.methods ??= await tried(() => get<Methods>("methods"));
    if (this.methods && !this.method.options.length) {
      for (const name of Object.keys(this.methods.methods)) this.method.append(h("option", { value: name, selected: name === this.methods.default }, name));
    }
    const query = { path: this.recording, profile: this.profile.value || undefined, vehicle: this.vehicle.value || undefined, method: this.method.value || undefined };
    const turn = ++this.looks;
    this.go.disabled = true;
    try {
      const found = await get<Inspection>("inspect", query);
      if (turn === this.looks) this.show(found);
    } catch (error) {
      if (turn !== this.looks) return;
      fill(this.found, h("p", { class: "bad", role: "alert" }, error instanceof Error ? error.message : String(error)));
      this.go.disabled = true;
    }
  }

  private show(found: Inspection): void {
    fill(
      this.found,
      h("p", { class: found.ready && this.vehicle.value ? "good" : "bad" }, this.verdict(found)),
      found.warnings.map((text) => h("p", { class: "hint" }, text)),
      h("details", {}, h("summary", {}, "What is in it"), h("pre", { tabindex: "0" }, found.text)),
      found.ready || found.problem ? null : h("button", { type: "button", click: () => void this.keepProfile(found.profile) }, "Save the proposed profile to the folder"),
    );
    this.go.disabled = !found.ready || !this.vehicle.value;
  }

  /** "Ready" is said only where the estimate was begun, and ran. */
  private verdict(found: Inspection): string {
    const rows = `${found.rows.toLocaleString()} rows`;
    if (found.ready) return this.vehicle.value ? `${rows}, ready to estimate.` : `${rows}; a vehicle file is missing.`;
    return found.problem ? `Not ready: ${found.problem}` : `Not ready: ${found.missing.join("; ") || "choose a profile"}.`;
  }

  private async keepProfile(text: string): Promise<void> {
    const path = `${this.recording.replace(/(\.\w{1,8}){1,2}$/, "")}-profile.yaml`;
    const taken = await tried(() => putText(path, text));
    if (!taken) return;
    this.profile.append(h("option", { value: path, selected: true }, path));
    await this.look();
  }

  private limits(): void {
    const able = this.methods?.methods[this.method.value]?.smooth ?? false;
    this.smooth.disabled = !able;
    if (!able) this.smooth.checked = false;
  }

  private async start(): Promise<void> {
    const output = this.output.value.trim();
    const replace = this.items.some((item) => item.path === output);
    if (replace && !confirm(`Replace ${output}?`)) return;
    const job = await tried(() =>
      send<Job>("POST", "jobs/estimate", {
        recording: this.recording,
        vehicle: this.vehicle.value,
        profile: this.profile.value || null,
        method: this.method.value,
        smooth: this.smooth.checked,
        output,
        replace,
      }),
    );
    if (job) this.close();
  }
}

async function putText(path: string, text: string): Promise<{ path: string }> {
  const answer = await fetch(`./api/file?path=${encodeURIComponent(path)}`, { method: "PUT", body: text });
  const said = (await answer.json()) as { path: string; detail?: string };
  if (!answer.ok) throw new Error(said.detail ?? answer.statusText);
  return said;
}

function choice(id: string, paths: string[], none: string, empty?: string): HTMLSelectElement {
  const first = empty ?? (paths.length ? undefined : none);
  return h("select", { id }, first === undefined ? null : h("option", { value: "" }, first), paths.map((path) => h("option", { value: path }, path)));
}

function row(label: string, field: HTMLElement): HTMLElement {
  return h("div", { class: "field" }, h("label", { for: field.id }, label), field);
}

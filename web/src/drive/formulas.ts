/** Signals derived by a formula in column names: kept by this browser, worked out by the server, drawn as any channel. */

import { request } from "../ui/api";
import { fill, h } from "../ui/dom";
import type { Layer } from "./along";
import type { Panel } from "./run";

export interface Formula {
  name: string;
  /** As the user typed it; empty: not known. */
  unit: string;
  text: string;
}

const KEY = "terragrip-formulas";
export const NAME = /^[\p{L}\p{N}_+−-][\p{L}\p{N} _.+−-]{0,39}$/u;
const UNIT = /^[^\]\s]?[^\]]{0,19}$/u;

export function keptFormulas(): Formula[] {
  try {
    const kept = JSON.parse(localStorage.getItem(KEY) ?? "[]") as Formula[];
    return Array.isArray(kept) ? kept.filter((one) => NAME.test(one.name) && UNIT.test(one.unit) && typeof one.text === "string") : [];
  } catch {
    return []; // written by something else
  }
}

/** The key of a formula's panel. */
export const keyOf = ({ name }: Formula): string => `f.${name}`;

/** The panels of those formulas that a run has the columns for. */
export function formulaPanels(layer: Layer, formulas: Formula[]): Panel[] {
  return formulas
    .filter(({ text }) => layer.faults?.get(text) === null)
    .map((one) => ({ key: keyOf(one), title: one.name, unit: one.unit || "unit not known", about: one.text, scale: 1, traces: [{ column: `=${one.text}`, label: "", color: "blue", band: "", scale: 1 }] }));
}

/** Ask the server which formulas a run cannot compute, and why; answers are kept. */
export async function check(layer: Layer, texts: string[]): Promise<void> {
  const faults = (layer.faults ??= new Map());
  const open = texts.filter((text) => !faults.has(text));
  if (!open.length) return;
  const answer = await request("drive/formulas", { path: layer.path, version: layer.run.version }, {}, open.map((text) => `text=${encodeURIComponent(text)}`).join("&"));
  const said = (await answer.json()) as (string | null)[];
  open.forEach((text, i) => faults.set(text, said[i] ?? null));
}

/** The chooser: what there is, and a form for one more. */
export class FormulaList {
  readonly element = h("details", { class: "chooser", id: "formulas" });
  private name = h("input", { type: "text", id: "formula-name", maxlength: 40, required: true });
  private text = h("input", { type: "text", id: "formula-text", maxlength: 500, required: true, spellcheck: "false", autocomplete: "off", placeholder: "slip_rl - slip_rr", "aria-describedby": "formula-fault formula-help" });
  private unit = h("input", { type: "text", id: "formula-unit", maxlength: 20, placeholder: "not known" });
  private fault = h("p", { class: "bad", id: "formula-fault", role: "alert" });
  private listed = h("ul", { class: "list" });
  private columns = h("div", { class: "column-names" });

  /** `layer`: the main run; `changed` with the formula that was just made, if one was. */
  constructor(
    public all: Formula[],
    private layer: () => Layer | undefined,
    private changed: (made: Formula | null) => void,
  ) {
    const field = (label: string, input: HTMLInputElement): HTMLElement => h("div", { class: "field" }, h("label", { for: input.id }, label), input);
    const add = (event: Event): void => {
      event.preventDefault();
      void this.add();
    };
    fill(
      this.element,
      h("summary", {}, "Formulas"),
      h(
        "div",
        { class: "menu" },
        this.listed,
        h("form", { submit: add, novalidate: true }, field("Name", this.name), field("Formula", this.text), this.fault, field("Unit", this.unit), h("div", { class: "row end" }, h("button", { type: "submit" }, "Add"))),
        h("p", { class: "hint", id: "formula-help" }, "+ − * / **, < <= > >= == !=, abs, sqrt, min, max, mean, where, diff, over columns in SI; time, elapsed and distance are columns too. min, max and mean of one column are over the run; mean(x, 0.5) is over half a second."),
        h("details", {}, h("summary", {}, "Columns"), this.columns),
      ),
    );
    this.text.addEventListener("input", () => this.say(""));
  }

  /** Draw what there is, for the main run. */
  draw(): void {
    const layer = this.layer();
    fill(
      this.listed,
      this.all.map((one) => {
        const fault = layer?.faults?.get(one.text);
        return h(
          "li",
          {},
          h("button", { type: "button", class: "name", title: "Edit", click: () => this.edit(one) }, h("span", {}, `${one.name} [${one.unit || "?"}]`), h("code", {}, one.text), fault ? h("span", { class: "bad" }, fault.replace(/^formula: /, "")) : null),
          h("button", { type: "button", class: "quiet", "aria-label": `Remove ${one.name}`, click: () => this.keep(this.all.filter((other) => other !== one), null) }, "×"),
        );
      }),
    );
    const insert = (name: string) => (): void => {
      this.text.setRangeText(name, this.text.selectionStart ?? 0, this.text.selectionEnd ?? 0, "end");
      this.text.focus();
      this.say("");
    };
    const measured = (layer?.run.measured ?? []).map((name) => (layer?.run.columns.includes(name) ? `measured_${name}` : name));
    fill(this.columns, [...(layer?.run.columns ?? []), ...measured].filter((name) => /^[\p{L}_]\w*$/u.test(name)).map((name) => h("button", { type: "button", class: "quiet", click: insert(name) }, name)));
  }

  private edit({ name, unit, text }: Formula): void {
    [this.name.value, this.unit.value, this.text.value] = [name, unit, text];
    this.say("");
    this.text.focus();
  }

  private say(fault: string): void {
    this.fault.textContent = fault;
    this.text.setAttribute("aria-invalid", String(fault !== ""));
  }

  private async add(): Promise<void> {
    const layer = this.layer();
    const made: Formula = { name: this.name.value.trim(), unit: this.unit.value.trim(), text: this.text.value.trim() };
    const refuse = (input: HTMLInputElement, fault: string): void => {
      this.say(fault);
      input.focus();
    };
    if (!NAME.test(made.name)) return refuse(this.name, "A name may contain letters, digits, spaces, . _ + -");
    if (!UNIT.test(made.unit)) return refuse(this.unit, "A unit may not contain ] or begin with a space");
    if (!layer) return refuse(this.text, "Choose a run first");
    try {
      await check(layer, [made.text]);
    } catch (error) {
      return refuse(this.text, error instanceof Error ? error.message : String(error));
    }
    const fault = layer.faults?.get(made.text);
    if (fault) return refuse(this.text, fault.replace(/^formula: /, ""));
    this.say("");
    [this.name.value, this.unit.value, this.text.value] = ["", "", ""];
    this.keep([...this.all.filter((one) => one.name !== made.name), made], made);
    this.name.focus();
  }

  /** Use other formulas: of a link or a layout, or after a change. */
  keep(all: Formula[], made: Formula | null): void {
    this.all = all;
    localStorage.setItem(KEY, JSON.stringify(all));
    this.changed(made);
  }
}

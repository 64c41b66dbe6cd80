/** The panel on the right: the active curve's model, a slider and a number field for each parameter, its fit. */

import { digits, fill, h } from "../ui/dom";
import { numberField, numberOf } from "../ui/number";
import { unitFor, withUnit } from "../ui/units";
import { farthest } from "./samples";
import { sameCurve } from "./scene";
import type { Curve, FitResult, Parameter, State } from "./state";

const SYMBOLS: Record<string, string> = { alpha_1: "α₁", alpha_2: "α₂", c1: "c₁", c2: "c₂", c3: "c₃", mobility: "Bn", wheel_numeric: "Cn" };
const STEPS = 1000;
const WIDE: Record<string, [number, number]> = {
  // A slider is of no use over the whole range of a fit; the number field allows all of it.
  a: [0, 3],
  alpha_1: [-0.5, 1],
  alpha_2: [-60, -0.5],
  A: [0, 2],
  k: [0.5, 60],
  d: [-0.5, 1.5],
  b: [0, 2],
  c: [0.5, 60],
  c1: [0, 2],
  c2: [0.5, 120],
  c3: [-0.5, 1.5],
  D: [0, 2],
  B: [0.1, 40],
  E: [-5, 1],
  intercept: [-0.3, 0.3],
  mobility: [1, 100],
  wheel_numeric: [1, 150],
};

export class CurvesPanel {
  readonly element = h("section", { class: "panel", "aria-label": "Curve" });
  private working = false;
  private rows = new Map<string, { slider: HTMLInputElement; field: HTMLInputElement; parameter: Parameter }>();

  constructor(
    private state: State,
    private actions: { fit: (here: boolean) => Promise<void>; each: (progress: (text: string) => void) => Promise<void>; save: () => void },
  ) {
    state.on((change) => {
      if (change === "all") this.draw();
      if (change === "curve") this.follow();
    });
  }

  /** Fit, and show that it runs: a bootstrap takes seconds. A second click does nothing. */
  private async work(fit: (progress: (text: string) => void) => Promise<void>): Promise<void> {
    if (this.working) return;
    this.working = true;
    await fit((text) => {
      const line = document.getElementById("fit-progress");
      if (line) line.textContent = text;
    });
    this.working = false;
    const line = document.getElementById("fit-progress");
    if (line) line.textContent = "";
  }

  draw(): void {
    this.rows.clear();
    const curve = this.state.active;
    if (!curve) {
      fill(this.element, h("h2", {}, "Curve"), h("p", { class: "hint" }, "No curve yet."), this.adder());
      return;
    }
    const model = this.state.model(curve.model);
    const parameters = [...(model?.parameters ?? [])];
    if ("intercept" in curve.parameters) {
      parameters.push({ name: "intercept", unit: "1", lower: -1, upper: 1, start: 0, meaning: "−ρ, where the sensor sees net traction" });
    }
    fill(
      this.element,
      h("h2", {}, "Curve"),
      h("div", { class: "field" }, h("label", { for: "curve-name" }, "Name"), this.nameField(curve)),
      h("div", { class: "field" }, h("label", { for: "curve-model" }, "Model"), this.modelChoice(curve)),
      h("p", { class: "source" }, model?.source ?? ""),
      h("p", { class: "hint" }, "Drag the curve by its handles, or the sliders. Ticked: held, neither a drag nor a fit changes it. Below each slider: the limits of both."),
      parameters.map((p) => this.row(curve, p)),
      this.interceptChoice(curve),
      h(
        "div",
        { class: "row" },
        h("button", { type: "button", class: "primary", id: "fit-button", click: () => void this.work((progress) => (progress("Fitting …"), this.actions.fit(false))) }, "Fit to points"),
        h("button", { type: "button", id: "fit-here", click: () => void this.work((progress) => (progress("Fitting …"), this.actions.fit(true))), title: "A fit that begins at the curve as it is now, and ends in the nearest minimum" }, "Fit from here"),
        h("button", { type: "button", id: "fit-each", click: () => void this.work((progress) => this.actions.each(progress)), title: "A curve for each soil that is shown, with this model, its held parameters and limits" }, "Fit each soil"),
        h("button", { type: "button", click: this.actions.save }, "Save to library"),
      ),
      h("p", { class: "hint", id: "fit-progress", role: "status" }),
      this.result(curve),
      this.fitted(),
      this.adder(),
    );
  }

  /** The fits of all curves side by side, where there are two or more. */
  private fitted(): HTMLElement | null {
    const curves = this.state.kept.curves.filter((one) => one.fit && sameCurve(one));
    if (curves.length < 2) return null;
    const names = [...new Set(curves.flatMap((one) => one.fit?.free ?? []))];
    const cell = (one: Curve, name: string): string => {
      const [low, high] = one.fit?.interval[name] ?? [NaN, NaN];
      return name in one.parameters ? `${digits(one.parameters[name])}${high > low ? ` (${digits(low)} to ${digits(high)})` : ""}` : "";
    };
    return h(
      "table",
      { class: "fits", id: "fits" },
      h("caption", {}, "Fits, with 95 % intervals"),
      h("thead", {}, h("tr", {}, h("th", { scope: "col" }, "Soil"), names.map((name) => h("th", { scope: "col" }, SYMBOLS[name] ?? name)), h("th", { scope: "col" }, "R²"), h("th", { scope: "col" }, "identified"))),
      h("tbody", {}, curves.map((one) => h("tr", {}, h("th", { scope: "row" }, one.name), names.map((name) => h("td", {}, cell(one, name))), h("td", {}, digits(one.fit?.r2)), h("td", {}, one.fit?.identifiability.identifiable && !one.fit.at_bound.length ? "yes" : "no")))),
    );
  }

  private adder(): HTMLElement {
    return h(
      "button",
      {
        type: "button",
        click: () => {
          this.state.addCurve("exponential");
          this.state.commit();
          this.state.changed("all");
        },
      },
      "Add a curve",
    );
  }

  private nameField(curve: Curve): HTMLElement {
    const field = h("input", { id: "curve-name", type: "text", value: curve.name, maxlength: 100 });
    field.addEventListener("change", () => {
      curve.name = field.value.trim() || curve.name;
      this.state.commit();
      this.state.changed("all");
    });
    return field;
  }

  private modelChoice(curve: Curve): HTMLElement {
    const choice = h(
      "select",
      { id: "curve-model" },
      this.state.models.map((m) => h("option", { value: m.name, selected: m.name === curve.model }, m.name.replace("_", "–"))),
    );
    choice.addEventListener("change", () => {
      const model = this.state.model(choice.value);
      if (!model) return;
      const intercept = curve.parameters["intercept"];
      curve.model = model.name;
      curve.held = [...model.fixed];
      curve.bounds = {};
      curve.parameters = Object.fromEntries(model.parameters.map((p) => [p.name, p.start]));
      if (intercept !== undefined) curve.parameters["intercept"] = intercept;
      curve.fit = null;
      this.state.commit();
      this.state.changed("all");
      document.getElementById("curve-model")?.focus();
    });
    return choice;
  }

  private row(curve: Curve, parameter: Parameter): HTMLElement {
    const { name } = parameter;
    const [low, high] = curve.bounds[name] ?? WIDE[name] ?? [parameter.lower, parameter.upper];
    const now = curve.parameters[name] ?? parameter.start;
    const slider = h("input", {
      type: "range",
      min: Math.min(low, now),
      max: Math.max(high, now),
      step: (high - low) / STEPS,
      id: `slider-${name}`,
      "aria-label": `${name}: ${parameter.meaning}`,
    });
    const field = numberField({ id: `field-${name}`, "aria-label": `${name}, exact`, required: true, least: parameter.lower, most: parameter.upper }, (typed) => {
      curve.parameters[name] = typed;
      slider.min = String(Math.min(low, typed));
      slider.max = String(Math.max(high, typed));
      slider.value = String(typed);
      this.state.changed("curve");
      this.settle();
    });
    slider.value = String(now);
    field.value = digits(now, 5);
    slider.addEventListener("input", () => {
      curve.parameters[name] = Number(slider.value);
      field.value = digits(Number(slider.value), 5);
      this.state.changed("curve");
    });
    slider.addEventListener("change", () => this.settle());
    this.rows.set(name, { slider, field, parameter });
    const hold = h("input", { type: "checkbox", id: `hold-${name}`, checked: curve.held.includes(name), "aria-label": `hold ${name}: neither a drag nor a fit changes it`, title: "hold: neither a drag nor a fit changes it" });
    hold.addEventListener("change", () => {
      curve.held = hold.checked ? [...curve.held, name] : curve.held.filter((other) => other !== name);
      this.state.changed("curve"); // other handles
      this.settle();
    });
    return h(
      "div",
      { class: "slider", title: parameter.meaning },
      h("label", { for: `field-${name}` }, SYMBOLS[name] ?? name),
      slider,
      field,
      name === "intercept" ? null : hold,
      name === "intercept" ? null : this.bounds(curve, parameter),
    );
  }

  /** The two ends of a parameter for the fit; an empty field is the model's own end. */
  private bounds(curve: Curve, parameter: Parameter): HTMLElement {
    const { name, lower, upper } = parameter;
    const ends = [lower, upper].map((own, i) => {
      const now = curve.bounds[name]?.[i];
      const value = now === undefined || now === own ? "" : digits(now, 5);
      return numberField({ id: `${i ? "upper" : "lower"}-${name}`, placeholder: digits(own, 3), value, "aria-label": `${name}, ${i ? "largest" : "smallest"} value of a fit` }, () => set());
    });
    const set = (): void => {
      if (ends.some((field) => field.value.trim() && Number.isNaN(numberOf(field.value)))) return; // refused as it was typed
      const typed = ends.map((field) => numberOf(field.value));
      const [from, to] = [Number.isFinite(typed[0]) ? (typed[0] as number) : lower, Number.isFinite(typed[1]) ? (typed[1] as number) : upper];
      const right = lower <= from && from < to && to <= upper;
      const asked = ends.find((field) => field === document.activeElement) ?? (ends[0] as HTMLInputElement);
      for (const field of ends) field.setCustomValidity("");
      if (!right) {
        asked.setCustomValidity(`the smaller first, from ${lower} to ${upper}`);
        asked.reportValidity();
        return;
      }
      if (from === lower && to === upper) delete curve.bounds[name];
      else curve.bounds[name] = [from, to];
      curve.parameters[name] = Math.min(Math.max(curve.parameters[name] ?? parameter.start, from), to);
      const focused = document.activeElement?.id;
      this.state.commit();
      this.state.changed("all");
      if (focused) document.getElementById(focused)?.focus();
    };
    return h("div", { class: "bounds" }, ends[0], h("span", { "aria-hidden": "true" }, "to"), ends[1]);
  }

  private settle(): void {
    this.state.commit();
    const result = this.element.querySelector(".result");
    const curve = this.state.active;
    if (result && curve) result.replaceWith(this.result(curve));
  }

  /** How far a curve set by hand lies from its fit. */
  private apart(curve: Curve, fit: FitResult): string {
    const { samples } = this.state;
    const [mine, fitted] = [samples.of(curve.id, curve), samples.of(`fit ${curve.id}`, fit)];
    if (!mine || !fitted || !samples.isCurrent(curve.id, curve)) return "Changed by hand since this fit.";
    const [slip, off] = farthest(mine, fitted);
    const unit = unitFor("share");
    const said = (share: number): string => withUnit(digits(unit.scale * share, 3), unit);
    return Number.isFinite(slip) ? `By hand: µ is ${off > 0 ? "+" : "−"}${digits(Math.abs(off), 2)} off this fit at ${said(slip)} slip, the most from ${digits(0.05 * unit.scale)} to ${said(0.6)}.` : "";
  }

  /** The sliders and fields go with a curve that is dragged. */
  private follow(): void {
    const curve = this.state.active;
    for (const [name, { slider, field }] of this.rows) {
      const now = curve?.parameters[name];
      if (now === undefined || document.activeElement === slider || document.activeElement === field) continue;
      slider.min = String(Math.min(Number(slider.min), now));
      slider.max = String(Math.max(Number(slider.max), now));
      slider.value = String(now);
      field.value = digits(now, 5);
    }
    this.tellApart();
  }

  private tellApart(): void {
    const [said, curve] = [this.element.querySelector(".apart"), this.state.active];
    if (said && curve?.fit) said.textContent = sameCurve(curve) ? "" : this.apart(curve, curve.fit);
  }

  private back(curve: Curve, fit: FitResult): void {
    curve.parameters = { ...fit.parameters };
    this.state.commit();
    this.state.changed("all");
    document.getElementById("fit-button")?.focus();
  }

  private interceptChoice(curve: Curve): HTMLElement {
    const box = h("input", { type: "checkbox", checked: "intercept" in curve.parameters });
    box.addEventListener("change", () => {
      if (box.checked) curve.parameters["intercept"] = 0;
      else delete curve.parameters["intercept"];
      this.state.commit();
      this.state.changed("all");
    });
    return h("label", { class: "check" }, box, "net traction (with an intercept −ρ)");
  }

  private result(curve: Curve): HTMLElement {
    const fit = curve.fit;
    if (!fit) return h("div", { class: "result" });
    const badge = fit.identifiability;
    const identified = badge.identifiable && !fit.at_bound.length;
    const rows = fit.free.map((name) => {
      const interval = fit.interval[name];
      const range = interval ? `${digits(interval[0])} … ${digits(interval[1])}` : "–";
      return h("tr", {}, h("th", { scope: "row" }, SYMBOLS[name] ?? name), h("td", {}, digits(fit.parameters[name], 4)), h("td", {}, range));
    });
    const effective = Object.keys(fit.interval)
      .filter((name) => !fit.free.includes(name))
      .map((name) => {
        const [low, high] = fit.interval[name] as [number, number];
        return h("tr", {}, h("th", { scope: "row" }, name), h("td", {}, digits(badge.effective?.[name], 4)), h("td", {}, `${digits(low)} … ${digits(high)}`));
      });
    return h(
      "div",
      { class: `result${sameCurve(curve) ? "" : " stale"}`, "aria-live": "polite" },
      h("p", { class: "apart" }, sameCurve(curve) ? "" : this.apart(curve, fit)),
      sameCurve(curve) ? null : h("button", { type: "button", id: "back-to-fit", click: () => this.back(curve, fit) }, "Back to the fit"),
      h("table", {}, h("thead", {}, h("tr", {}, h("td"), h("th", {}, "fit"), h("th", {}, "95 % interval"))), h("tbody", {}, rows, effective)),
      fit.automatic === undefined ? null : h("p", {}, `Begun at the curve as it was${fit.automatic === null ? "" : `; the automatic fit had R² ${digits(fit.automatic)}`}.`),
      h("p", {}, `R² ${digits(fit.r2)}, NRMSE ${digits(fit.nrmse)}, ${fit.bins.length} bins`),
      h("p", { class: `badge ${identified ? "good" : "poor"}` }, identified ? "identifiable" : "not identifiable", ` (condition ${digits(badge.condition, 2)})`),
      fit.at_bound.length ? h("p", { class: "hint" }, `${fit.at_bound.map((name) => SYMBOLS[name] ?? name).join(", ")}: at a limit of its range, so the data do not determine it. Hold it, or fit with more slip.`) : null,
      fit.notes.map((text) => h("p", { class: "hint" }, text)),
    );
  }
}

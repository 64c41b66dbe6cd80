/** Results of `terragrip advise` for a run, soil by soil, requested when the panel is opened. */

import { get } from "../ui/api";
import { digits, fill, h, working } from "../ui/dom";
import { tried } from "../ui/notes";
import { onUnits, unitFor, withUnit } from "../ui/units";

interface Best {
  slip: number;
  interval: [number, number];
  efficiency: number;
  net_traction: number;
}

interface Action {
  what: string;
  why: string;
  gain: number | null;
  interval: [number, number] | null;
}

interface SoilAdvice {
  name: string;
  metres: number;
  best_efficiency: Best | null;
  best_productivity: Best | null;
  actions: Action[];
  missing: string[];
  limits: string[];
  drive: Record<string, number>;
  field_work: Record<string, number>;
}

interface Advice {
  soils: SoilAdvice[];
  weight: number;
}

const WORK: [string, string][] = [
  ["hectares_per_hour", "ha/h"],
  ["litres_per_hour", "l/h"],
  ["litres_per_hectare_measured", "l/ha measured"],
  ["litres_per_hectare", "l/ha from the pull"],
];

export class AdvicePanel {
  readonly element = h("details", { class: "advice" }, h("summary", {}, h("h2", {}, "Advice")));
  private body = h("div", { "aria-live": "polite" });
  private path = "";
  private version = "";
  private asked = "";
  private known: Advice | null = null;
  private forget = onUnits(() => this.known && this.draw(this.known));

  constructor() {
    this.element.append(this.body);
    this.element.addEventListener("toggle", () => void this.ask());
  }

  close(): void {
    this.forget();
  }

  /** The run that is open now, "" for none. */
  of(path: string, version: string): void {
    [this.path, this.version] = [path, version];
    if (`${path} ${version}` === this.asked) return;
    this.known = null;
    this.asked = "";
    fill(this.body);
    void this.ask();
  }

  private async ask(): Promise<void> {
    const { path, version } = this;
    if (!this.element.open || this.asked === `${path} ${version}`) return;
    this.asked = `${path} ${version}`;
    if (!path) return fill(this.body, h("p", { class: "hint" }, "No run is open."));
    fill(this.body, working("Computing …"));
    const found = await tried(() => get<Advice>("advice", { path, version }));
    if (this.path !== path || this.version !== version) return; // another run was opened meanwhile
    if (found) this.draw((this.known = found));
    else {
      this.asked = "";
      fill(this.body, h("p", { class: "hint" }, "No advice for this run; the message gives the reason."));
    }
  }

  private draw(advice: Advice): void {
    fill(this.body, advice.soils.map((soil) => this.soil(soil, advice.weight, advice.soils.length > 1)));
  }

  private soil(soil: SoilAdvice, weight: number, several: boolean): HTMLElement {
    const { best_efficiency: best, best_productivity: power, drive } = soil;
    const share = unitFor("share");
    const force = unitFor("force");
    const bare = (value: number): string => (share.scale * value).toFixed(share.scale > 1 ? 1 : 3);
    const slip = (value: number): string => withUnit(bare(value), share);
    const between = (one: Best): string => `${slip(one.slip)} (${bare(one.interval[0])} to ${bare(one.interval[1])})`;
    const pull = (ratio: number): string => `${digits(force.scale * weight * ratio, 3)} ${force.name}`;
    const rows: [string, string][] = [];
    if (best) {
      rows.push(["Best slip, 95 %", between(best)], ["Slip driven", slip(drive["slip"] ?? NaN)]);
    }
    if (best && drive["efficiency"] !== undefined) {
      rows.push(["Efficiency, driven → best", `${slip(drive["efficiency"])} → ${slip(best.efficiency)}`]);
      rows.push(["Pull, driven → best", `${pull(drive["net_traction"] ?? NaN)} → ${pull(best.net_traction)}`]);
    }
    if (power) rows.push(["Most pull power at", between(power)]);
    if (drive["share_within"] !== undefined) {
      const percent = (name: string): string => digits(100 * (drive[`share_${name}`] ?? NaN), 2);
      const of = (name: string): string => `${percent(name)} % (${percent(`${name}_low`)} to ${percent(`${name}_high`)})`;
      rows.push([`Time, 95 %, at ${slip(drive["band_low"] ?? NaN)} to ${slip(drive["band_high"] ?? NaN)}`, of("within")], ["Below, above", `${of("below")}, ${of("above")}`]);
    }
    for (const [key, unit] of WORK) if (soil.field_work[key] !== undefined) rows.push(["Field work", `${digits(soil.field_work[key], 3)} ${unit}`]);
    return h(
      "section",
      { class: "soil-advice" },
      several || soil.name ? h("h3", {}, `${soil.name || "unlabelled"}, ${digits(soil.metres, 3)} m`) : null,
      h("table", {}, rows.map(([name, value]) => h("tr", {}, h("th", { scope: "row" }, name), h("td", {}, value)))),
      soil.limits.map((text) => h("p", { class: "hint" }, text)),
      soil.actions.length ? h("ul", { class: "todo" }, soil.actions.map((one) => h("li", {}, h("strong", {}, one.what), ` ${gained(one)}${one.why}`))) : null,
      soil.missing.length ? h("details", { open: !soil.actions.length }, h("summary", {}, "What is missing"), h("ul", {}, soil.missing.map((text) => h("li", {}, text)))) : null,
    );
  }
}

function gained({ gain, interval }: Action): string {
  if (gain === null || interval === null) return "";
  const points = (value: number): string => (100 * value).toFixed(1);
  return `Gains ${points(gain)} points of efficiency (${points(interval[0])} to ${points(interval[1])}). `;
}

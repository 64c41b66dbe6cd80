/** The panel on the left: curves, soils of the folder, literature, pictures. */

import { get, type Item } from "../ui/api";
import { fill, h } from "../ui/dom";
import { note, tried } from "../ui/notes";
import { onceReleased } from "../ui/press";
import type { Curve, FitResult, Soil, State } from "./state";

interface Literature {
  name: string;
  model: string;
  parameters: Record<string, number>;
  source: string;
}

/** A soil of estimates or of digitised points, or of a library with what its fit gave. */
interface Served extends Partial<Soil>, Partial<Omit<FitResult, "bins">> {
  name: string;
  source?: string;
}

/** The fit that a library keeps of a soil: without it a curve that the data leave open would be shown as if it were known. */
function fitOf({ model, parameters, free, interval, identifiability, r2, nrmse, bins = [], clusters = 0, common_slip_sd, notes = [], band }: Served): FitResult | null {
  if (!model || !parameters || !free || !interval || !identifiability) return null;
  return { model, parameters: { ...parameters }, free, interval, identifiability, r2: r2 ?? NaN, nrmse: nrmse ?? NaN, bins, clusters, common_slip_sd, notes, at_bound: [], band };
}

export class ListPanel {
  readonly element = h("section", { class: "panel", "aria-label": "Curves and data" });
  private files: Item[] = [];
  private literature: Literature[] = [];

  constructor(
    private state: State,
    private shown: () => void,
    private pictures: HTMLElement,
  ) {
    state.on((change) => {
      if (change === "all" || change === "data") this.draw();
    });
  }

  async load(items: Item[]): Promise<void> {
    this.files = items.filter((item) => item.kind === "estimates" || item.kind === "library" || item.path.endsWith(".csv"));
    if (!this.literature.length) this.literature = (await tried(() => get<Literature[]>("literature"))) ?? [];
    onceReleased(this.element, () => this.draw());
  }

  draw(): void {
    fill(
      this.element,
      h("h2", {}, "Curves"),
      h("ul", { class: "list", id: "curve-list" }, this.state.kept.curves.map((curve) => this.curve(curve))),
      this.literatureChoice(),
      h("h2", {}, "Soils"),
      this.state.soils.length
        ? h("ul", { class: "list", id: "soil-list" }, this.state.soils.map((soil) => this.soil(soil)))
        : h("p", { class: "hint" }, "Choose a file of estimates, a soil library or digitised points."),
      this.fileChoice(),
      this.binChoice(),
      this.pictures,
    );
  }

  private curve(curve: Curve): HTMLElement {
    const { kept } = this.state;
    const box = h("input", { type: "checkbox", checked: curve.shown, "aria-label": `show ${curve.name}` });
    box.addEventListener("change", () => {
      curve.shown = box.checked;
      this.state.commit();
      this.state.changed("curve");
    });
    const choose = (): void => {
      this.state.choose(curve);
      this.state.commit();
      this.state.changed("all");
    };
    const remove = (): void => {
      kept.curves = kept.curves.filter((other) => other.id !== curve.id);
      if (kept.active === curve.id) kept.active = kept.curves.at(-1)?.id ?? 0;
      this.state.commit();
      this.state.changed("all");
    };
    return h(
      "li",
      { class: curve.id === kept.active ? "chosen" : null },
      box,
      h("span", { class: `swatch ${curve.color}`, "aria-hidden": "true" }),
      h("button", { type: "button", class: "name", "aria-pressed": String(curve.id === kept.active), title: curve.source, click: choose }, curve.name),
      h("button", { type: "button", class: "quiet", "aria-label": `remove ${curve.name}`, click: remove }, "×"),
    );
  }

  private soil(soil: Soil): HTMLElement {
    const box = h("input", { type: "checkbox", checked: soil.shown, "aria-label": `show ${soil.name}` });
    box.addEventListener("change", () => {
      soil.shown = box.checked;
      this.state.changed("data");
    });
    const chosen = this.state.target === soil.key;
    const choose = (): void => {
      this.state.target = soil.key;
      soil.shown = true;
      this.state.changed("data");
    };
    const remove = (): void => {
      this.state.remove(soil);
      this.state.changed("data");
    };
    return h(
      "li",
      { class: chosen ? "chosen" : null },
      box,
      h("span", { class: `swatch round ${soil.color}`, "aria-hidden": "true" }),
      h("button", { type: "button", class: "name", "aria-pressed": String(chosen), title: soil.note || `${soil.path}: ${soil.count} samples`, click: choose }, soil.name),
      h("button", { type: "button", class: "quiet", "aria-label": `remove ${soil.name}`, click: remove }, "×"),
    );
  }

  private literatureChoice(): HTMLElement {
    const choice = h(
      "select",
      { "aria-label": "Add a curve from the literature" },
      h("option", { value: "" }, "Literature …"),
      this.literature.map((soil, i) => h("option", { value: i }, `${soil.name} (${soil.source.split(",")[0]})`)),
    );
    choice.addEventListener("change", () => {
      const soil = this.literature[Number(choice.value)];
      if (!soil || choice.value === "") return;
      this.state.addCurve(soil.model, soil.parameters, soil.name, soil.source);
      this.state.commit();
      this.state.changed("all");
      this.shown();
    });
    return choice;
  }

  private fileChoice(): HTMLElement {
    const choice = h(
      "select",
      { id: "soil-file", "aria-label": "Show the soils of a file" },
      h("option", { value: "" }, this.files.length ? "Soils of a file …" : "No estimates or libraries in the folder"),
      this.files.map((item) => h("option", { value: item.path }, item.path)),
    );
    choice.addEventListener("change", () => void this.open(choice.value));
    return choice;
  }

  private binChoice(): HTMLElement {
    const choice = h(
      "select",
      { id: "bins-by", title: "By pull, as terragrip soils does: noise of slip does not move a sample into another bin. By slip: as in most papers." },
      (["pull", "slip"] as const).map((by) => h("option", { value: by, selected: by === this.state.by }, by === "pull" ? "the vehicle's pull" : "slip")),
    );
    choice.addEventListener("change", () => {
      this.state.by = choice.value === "slip" ? "slip" : "pull";
      void this.reread(this.state.soils.filter(({ path }) => path.endsWith(".parquet"))).then(() => document.getElementById("bins-by")?.focus());
    });
    return h("div", { class: "field" }, h("label", { for: "bins-by" }, "Bins by"), choice);
  }

  /** Follow files that were replaced: a fit is over what they have now. Their curves stay as they are here. */
  async renew(): Promise<void> {
    for (const path of Object.keys(this.state.opened)) {
      if (this.state.opened[path] === this.version(path) || !this.files.some((file) => file.path === path)) continue;
      this.state.opened[path] = this.version(path);
      note(`${path} was replaced: reloaded`);
      await this.reread(this.state.soils.filter((soil) => soil.path === path));
    }
  }

  /** Read points and bins again: binned otherwise, of a file that was replaced, or after the page was reloaded. */
  async reread(soils = this.state.soils.filter(({ bins, points }) => !bins.length && !points.slip.length)): Promise<void> {
    for (const path of new Set(soils.map((soil) => soil.path))) {
      const served = await tried(() => get<Served[]>("soils", { path, by: this.state.by }));
      for (const soil of served ? soils.filter((one) => one.path === path) : []) {
        const now = served?.find((one) => soil.key === `${path}#${one.name}`);
        if (now) Object.assign(soil, { bins: now.bins ?? [], points: now.points ?? soil.points, note: now.note ?? "" });
        else this.state.remove(soil);
      }
    }
    if (soils.length) this.state.changed("all");
  }

  private version(path: string): string {
    const file = this.files.find((one) => one.path === path);
    return `${file?.size} ${file?.modified}`;
  }

  /** Whether what a file has is on the page, changed by hand or not: who comes back finds it as it was left. */
  isOpen(path: string): boolean {
    const { opened, soils, kept } = this.state;
    return opened[path] === this.version(path) && [...soils.map((soil) => soil.key), ...kept.curves.map((curve) => curve.data)].some((key) => key.startsWith(`${path}#`));
  }

  async open(path: string): Promise<void> {
    if (!path) return;
    const served = await tried(() => get<Served[]>("soils", { path, by: this.state.by }));
    if (served) this.state.opened[path] = this.version(path);
    const curves: Curve[] = [];
    for (const one of served ?? []) {
      const key = `${path}#${one.name}`;
      this.state.soils = this.state.soils.filter((soil) => soil.key !== key);
      if (one.model && one.parameters) {
        const curve = Object.assign(this.state.addCurve(one.model, one.parameters, one.name, one.source || path), { data: key, fit: fitOf(one) });
        if (curve.fit) curve.held = Object.keys(curve.parameters).filter((name) => name !== "intercept" && !curve.fit?.free.includes(name));
        curves.push(curve);
      }
      if (!one.bins?.length && !one.points?.slip.length) {
        if (one.note) note(`${path}: ${one.note}`, "error");
        continue;
      }
      this.state.soils.push({
        key,
        path,
        name: one.name,
        soil: one.soil ?? one.name,
        color: one.model ? (this.state.active?.color ?? this.state.nextColor()) : this.state.nextColor(),
        shown: true,
        points: one.points ?? { slip: [], adhesion: [] },
        bins: one.bins ?? [],
        count: one.count ?? one.points?.slip.length ?? 0,
        note: one.note ?? "",
      });
      if (!this.state.target) this.state.target = key;
    }
    if (curves[0]) this.state.choose(curves[0]);
    this.state.commit();
    this.state.changed("all");
    this.shown();
  }
}

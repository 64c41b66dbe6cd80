/** Background pictures: load by file, drop or paste, calibrate, fade, digitise a line. */

import { ME, address, get, send, upload, type Item } from "../ui/api";
import { fill, h } from "../ui/dom";
import { note, tried } from "../ui/notes";
import { onceReleased } from "../ui/press";
import { calibrate } from "./calibrate";
import { EMPTY, mapOf, type Calibration, type Pixel } from "./picture";
import type { State } from "./state";

const TYPES: Record<string, string> = { "image/png": ".png", "image/jpeg": ".jpg", "image/webp": ".webp" };

export class PicturesPanel {
  readonly element = h("div", { class: "pictures" });
  /** The line that clicks on the plot go to. */
  private digitising: { path: string; line: number } | null = null;
  private files: string[] = [];
  private sending: Promise<void> = Promise.resolve();

  constructor(
    private state: State,
    private shown: () => void,
  ) {
    state.on((change) => {
      if (change === "all" || change === "pictures" || change === "data") this.draw();
    });
  }

  /** Whether clicks on the plot are points of a line. */
  get isDigitising(): boolean {
    return this.digitising !== null;
  }

  load(items: Item[]): void {
    this.files = items.filter((item) => item.kind === "picture" && !item.path.endsWith(".svg")).map((item) => item.path);
    onceReleased(this.element, () => this.draw());
  }

  /** Add pictures that were dropped or pasted; true if there was one. */
  take(files: Iterable<File>): boolean {
    const pictures = [...files].filter((file) => file.type in TYPES);
    for (const file of pictures) void this.add(file);
    return pictures.length > 0;
  }

  private async add(file: File): Promise<void> {
    const plain = file.name.replace(/[^\w.() -]+/g, "_").replace(/^\.+/, "") || "picture.png";
    const named = /\.\w+$/.test(plain) ? plain : plain + (TYPES[file.type] ?? ".png");
    const taken = await tried(() => upload(this.free(named), file, false, () => undefined));
    if (taken) await this.open(taken.path);
  }

  private free(name: string): string {
    const [, stem = name, ending = ""] = /^(.*?)(\.\w+)$/.exec(name) ?? [];
    for (let i = 1; ; i++) {
      const path = i === 1 ? `${stem}${ending}` : `${stem}-${i}${ending}`;
      if (!this.files.includes(path) && !(path in this.state.kept.pictures)) return path;
    }
  }

  async open(path: string): Promise<void> {
    const found = await tried(() => get<Calibration>("picture", { path }));
    if (!found || !(await this.image(path))) return;
    this.state.kept.pictures[path] = { ...EMPTY, ...found };
    this.state.commit();
    this.state.changed("all");
    if (typeof mapOf(found) === "string") await this.edit(path);
  }

  private async image(path: string): Promise<HTMLImageElement | undefined> {
    const image = new Image();
    image.src = address("file", { path });
    return tried(async () => {
      await image.decode().catch(() => {
        throw new Error(`${path}: cannot be shown`);
      });
      this.state.images.set(path, image);
      return image;
    });
  }

  private async edit(path: string): Promise<void> {
    const image = this.state.images.get(path);
    const before = this.state.kept.pictures[path];
    if (!image || !before) return;
    await this.keep(path, await calibrate(path, image, before));
    this.shown();
  }

  /** Load the pictures again, after the page was reloaded. */
  async reread(): Promise<void> {
    for (const path of Object.keys(this.state.kept.pictures)) {
      if (this.state.images.has(path)) continue;
      await this.image(path);
      await this.renewed(path);
      this.state.changed("pictures");
    }
  }

  /** Another page changed a calibration: use it unless it is ours already. */
  async renewed(path: string): Promise<void> {
    const mine = this.state.kept.pictures[path];
    if (!mine) return;
    const found = await tried(() => get<Calibration>("picture", { path }));
    if (!found || JSON.stringify({ ...EMPTY, ...found }) === JSON.stringify(mine)) return;
    this.state.kept.pictures[path] = { ...EMPTY, ...found };
    this.state.changed("all");
  }

  private async keep(path: string, calibration: Calibration, redraw: "all" | "pictures" = "all"): Promise<void> {
    this.state.kept.pictures[path] = calibration;
    this.state.commit();
    this.state.changed(redraw);
    await this.store(path);
  }

  /** Send a calibration as it is when its turn comes: two requests at once could arrive the wrong way round. */
  private store(path: string): Promise<void> {
    this.sending = this.sending.then(async () => {
      const now = this.state.kept.pictures[path];
      if (now) await tried(() => send("PUT", "picture", now, { path, by: ME }));
    });
    return this.sending;
  }

  /** Send what undo or redo brought back to the server too. */
  keepAll(): void {
    for (const path of Object.keys(this.state.kept.pictures)) void this.store(path);
  }

  /** A click on the plot: a point of the line being digitised; with shift the nearest is removed. */
  click(value: Pixel, shift: boolean): void {
    if (!this.digitising) return;
    const { path, line } = this.digitising;
    const calibration = this.state.kept.pictures[path];
    const target = calibration?.lines[line];
    if (!calibration || !target) return;
    if (shift) {
      const away = (p: Pixel): number => Math.hypot(p[0] - value[0], p[1] - value[1]);
      const nearest = target.points.reduce((best, p) => (away(p) < away(best) ? p : best), target.points[0] ?? value);
      target.points = target.points.filter((p) => p !== nearest);
    } else {
      target.points = [...target.points, value].sort((a, b) => a[0] - b[0]);
    }
    void this.keep(path, calibration);
  }

  draw(): void {
    const { pictures } = this.state.kept;
    const more = this.files.filter((path) => !(path in pictures));
    const choice = h(
      "select",
      { "aria-label": "Open a picture from the folder" },
      h("option", { value: "" }, more.length ? "Picture from the folder …" : this.files.length ? "No more in the folder" : "No pictures in the folder"),
      more.map((path) => h("option", { value: path }, path)),
    );
    choice.addEventListener("change", () => void (choice.value && this.open(choice.value)));
    const file = h("input", { type: "file", accept: Object.keys(TYPES).join(","), multiple: true, id: "picture-file", class: "visually-hidden" });
    file.addEventListener("change", () => this.take(file.files ?? []));
    fill(
      this.element,
      h("h2", {}, "Background pictures"),
      Object.entries(pictures).map(([path, calibration]) => this.picture(path, calibration)),
      choice,
      h("div", { class: "row" }, file, h("label", { for: "picture-file", class: "button" }, "Load a picture"), h("span", { class: "hint" }, "or drop or paste one")),
    );
  }

  private picture(path: string, calibration: Calibration): HTMLElement {
    const shown = h("input", { type: "checkbox", checked: calibration.shown, "aria-label": `show ${path}` });
    shown.addEventListener("change", () => void this.keep(path, { ...calibration, shown: shown.checked }));
    const fade = h("input", { type: "range", min: 0, max: 1, step: 0.01, "aria-label": `opacity of ${path}` });
    fade.value = String(calibration.opacity);
    fade.addEventListener("input", () => {
      calibration.opacity = Number(fade.value);
      this.state.changed("curve");
      this.state.changed("view");
    });
    fade.addEventListener("change", () => void this.keep(path, { ...calibration, opacity: Number(fade.value) }, "pictures"));
    const missing = mapOf(calibration);
    return h(
      "div",
      { class: "picture" },
      h("label", { class: "check" }, shown, path),
      typeof missing === "string" ? h("p", { class: "hint" }, missing) : h("div", { class: "slider" }, h("span", {}, "opacity"), fade),
      h(
        "div",
        { class: "row" },
        h("button", { type: "button", click: () => void this.edit(path) }, "Axes"),
        h("button", { type: "button", disabled: typeof missing === "string", click: () => this.newLine(path) }, "Digitise a line"),
        this.copyChoice(path),
        h("button", { type: "button", class: "quiet", "aria-label": `close ${path}`, click: () => this.close(path) }, "×"),
      ),
      h("ul", { class: "list" }, calibration.lines.map((line, i) => this.line(path, calibration, i, line.name, line.points.length))),
    );
  }

  private close(path: string): void {
    delete this.state.kept.pictures[path];
    if (this.digitising?.path === path) this.digitising = null;
    this.state.commit();
    this.state.changed("all");
  }

  private copyChoice(path: string): HTMLElement | null {
    const others = Object.keys(this.state.kept.pictures).filter((other) => other !== path);
    if (!others.length) return null;
    const choice = h("select", { "aria-label": `copy the axes of ${path} to` }, h("option", { value: "" }, "Copy axes to …"), others.map((other) => h("option", { value: other }, other)));
    choice.addEventListener("change", () => {
      const [from, to] = [this.state.kept.pictures[path], this.state.kept.pictures[choice.value]];
      if (from && to) void this.keep(choice.value, { ...to, slip: structuredClone(from.slip), adhesion: structuredClone(from.adhesion) });
    });
    return choice;
  }

  private newLine(path: string): void {
    const calibration = this.state.kept.pictures[path];
    if (!calibration) return;
    calibration.lines.push({ name: `line ${calibration.lines.length + 1}`, points: [] });
    this.digitising = { path, line: calibration.lines.length - 1 };
    this.state.target = `picture:${path}#${this.digitising.line}`;
    note("Click along the line in the plot; shift and click removes a point.");
    void this.keep(path, calibration);
  }

  private line(path: string, calibration: Calibration, index: number, name: string, count: number): HTMLElement {
    const on = this.digitising?.path === path && this.digitising.line === index;
    const choose = (): void => {
      this.digitising = on ? null : { path, line: index };
      this.state.target = `picture:${path}#${index}`;
      this.state.changed("data");
    };
    const remove = (): void => {
      this.digitising = null;
      void this.keep(path, { ...calibration, lines: calibration.lines.filter((_, i) => i !== index) });
    };
    return h(
      "li",
      { class: on ? "chosen" : null },
      h("button", { type: "button", class: "name", "aria-pressed": String(on), click: choose }, `${name}: ${count} points`),
      h("button", { type: "button", class: "quiet", "aria-label": `remove ${name}`, click: remove }, "×"),
    );
  }
}

/** The dialog in which a picture's axes are calibrated: two points an axis, by click, drag or number. */

import { fill, h } from "../ui/dom";
import { numberField } from "../ui/number";
import { mapOf, slipDoubt, type Axis, type Calibration, type Mark, type Pixel } from "./picture";

type AxisName = "slip" | "adhesion";
type Draft = Record<AxisName, { marks: (Mark | null)[]; log: boolean }>;

const ORDER: [AxisName, number][] = [
  ["slip", 0],
  ["slip", 1],
  ["adhesion", 0],
  ["adhesion", 1],
];
const TITLE: Record<AxisName, string> = { slip: "Slip axis", adhesion: "Adhesion axis" };
const FIRST: Record<AxisName, [number, number]> = { slip: [0, 0.5], adhesion: [0, 0.5] };

/** Ask for the calibration of a picture; the old one where the user cancels. */
export function calibrate(name: string, image: HTMLImageElement, before: Calibration): Promise<Calibration> {
  return new Promise((resolve) => {
    const editor = new Editor(name, image, before, (after) => {
      editor.dialog.close();
      editor.dialog.remove();
      resolve(after ?? before);
    });
    document.body.append(editor.dialog);
    editor.dialog.showModal();
  });
}

class Editor {
  readonly dialog: HTMLDialogElement;
  private draft: Draft;
  private next = 0;
  private zoom = 1;
  private percent = true;
  private stage = h("div", { class: "stage" });
  private canvas = h("canvas", { class: "sheet", tabindex: "0", role: "img", "aria-label": "Click two points on each axis, or type their pixels" });
  private side = h("div", { class: "side" });

  constructor(
    name: string,
    private image: HTMLImageElement,
    private before: Calibration,
    private done: (after: Calibration | null) => void,
  ) {
    const copy = (axis: Axis | null): Draft[AxisName] => ({
      marks: axis ? axis.marks.map((mark) => ({ ...mark })) : [null, null],
      log: axis?.log ?? false,
    });
    this.draft = { slip: copy(before.slip), adhesion: copy(before.adhesion) };
    this.next = ORDER.findIndex(([axis, i]) => !this.draft[axis].marks[i]);
    this.stage.append(this.canvas);
    this.dialog = h(
      "dialog",
      { class: "calibrate", "aria-labelledby": "calibrate-title", cancel: () => this.done(null) },
      h("h2", { id: "calibrate-title" }, `Axes of ${name}`),
      h("div", { class: "split" }, this.stage, this.side),
    );
    this.listen();
    this.dialog.addEventListener("toggle", () => this.start());
    queueMicrotask(() => this.start());
  }

  private start(): void {
    const room = this.stage.clientWidth || 800;
    this.zoom = Math.min(1.5, Math.max(room / this.image.naturalWidth, 0.1));
    this.draw();
    this.drawSide();
  }

  private listen(): void {
    let held: Mark | null = null;
    const at = (event: PointerEvent): Pixel => {
      const box = this.canvas.getBoundingClientRect();
      return [(event.clientX - box.left) / this.zoom, (event.clientY - box.top) / this.zoom];
    };
    this.canvas.addEventListener("pointerdown", (event) => {
      const pixel = at(event);
      // A mark of the other axis is no obstacle: most printed figures have one origin for both.
      const wanted = ORDER[this.next]?.[0];
      const near = this.marks().find((mark) => Math.hypot(mark.pixel[0] - pixel[0], mark.pixel[1] - pixel[1]) * this.zoom < 9 && (!wanted || this.draft[wanted].marks.includes(mark)));
      if (near) held = near;
      else if (this.next >= 0) {
        const [axis, i] = ORDER[this.next] as [AxisName, number];
        held = { pixel, value: this.draft[axis].marks[i]?.value ?? (FIRST[axis][i] as number) };
        this.draft[axis].marks[i] = held;
        this.next = ORDER.findIndex(([a, j]) => !this.draft[a].marks[j]);
      }
      this.canvas.setPointerCapture(event.pointerId);
      this.refresh();
    });
    this.canvas.addEventListener("pointermove", (event) => {
      if (!held) return;
      held.pixel = at(event);
      this.refresh();
    });
    this.canvas.addEventListener("pointerup", () => (held = null));
    this.canvas.addEventListener(
      "wheel",
      (event) => {
        if (!event.ctrlKey) return;
        event.preventDefault();
        this.magnify(Math.exp(-event.deltaY * 0.002));
      },
      { passive: false },
    );
  }

  private magnify(factor: number): void {
    this.zoom = Math.min(Math.max(this.zoom * factor, 0.05), 8);
    this.draw();
  }

  private marks(): Mark[] {
    return ORDER.map(([axis, i]) => this.draft[axis].marks[i]).filter((mark): mark is Mark => !!mark);
  }

  private refresh(): void {
    this.draw();
    this.drawSide();
  }

  private result(): Calibration | string {
    const axis = (name: AxisName): Axis | null => {
      const { marks, log } = this.draft[name];
      return marks[0] && marks[1] ? { marks: [marks[0], marks[1]], log } : null;
    };
    const after = { ...this.before, slip: axis("slip"), adhesion: axis("adhesion") };
    const map = mapOf(after);
    return typeof map === "string" ? map : after;
  }

  private draw(): void {
    const pen = this.canvas.getContext("2d");
    if (!pen) return;
    this.canvas.width = Math.round(this.image.naturalWidth * this.zoom);
    this.canvas.height = Math.round(this.image.naturalHeight * this.zoom);
    pen.fillStyle = "#fff";
    pen.fillRect(0, 0, this.canvas.width, this.canvas.height);
    pen.drawImage(this.image, 0, 0, this.canvas.width, this.canvas.height);
    const place = (mark: Mark): Pixel => [mark.pixel[0] * this.zoom, mark.pixel[1] * this.zoom];
    for (const [axis, shade] of [["slip", "#0072b2"], ["adhesion", "#d55e00"]] as const) {
      const marks = this.draft[axis].marks;
      pen.strokeStyle = pen.fillStyle = shade;
      pen.lineWidth = 2;
      if (marks[0] && marks[1]) {
        pen.beginPath();
        pen.moveTo(...place(marks[0]));
        pen.lineTo(...place(marks[1]));
        pen.stroke();
      }
      for (const [i, mark] of marks.entries()) {
        if (!mark) continue;
        const [x, y] = place(mark);
        pen.beginPath();
        pen.arc(x, y, 6, 0, 2 * Math.PI);
        pen.moveTo(x - 11, y);
        pen.lineTo(x + 11, y);
        pen.moveTo(x, y - 11);
        pen.lineTo(x, y + 11);
        pen.stroke();
        pen.font = "bold 13px system-ui, sans-serif";
        pen.fillText(`${axis === "slip" ? "s" : "µ"}${i + 1}`, x + 10, y - 10);
      }
    }
  }

  private drawSide(): void {
    const found = this.result();
    const ready = typeof found !== "string";
    const step = this.next >= 0 ? ORDER[this.next] : undefined;
    const lead = step ? `Click point ${step[1] + 1} of the ${step[0]} axis (its tick in the picture).` : ready ? "Drag a mark to move it." : found;
    const percent = h("input", { type: "checkbox", checked: this.percent });
    percent.addEventListener("change", () => {
      this.percent = percent.checked;
      this.drawSide();
    });
    fill(
      this.side,
      h("p", { role: "status" }, lead),
      (["slip", "adhesion"] as const).map((axis) => this.axisFields(axis)),
      this.doubt(),
      h("label", { class: "check" }, percent, "slip values in per cent"),
      h(
        "div",
        { class: "row" },
        h("button", { type: "button", click: () => this.magnify(1.25) }, "Zoom in"),
        h("button", { type: "button", click: () => this.magnify(0.8) }, "Zoom out"),
      ),
      h(
        "div",
        { class: "row end" },
        h("button", { type: "button", click: () => this.done(null) }, "Cancel"),
        h("button", { type: "button", class: "primary", disabled: !ready, click: () => ready && this.done(found) }, "Use these axes"),
      ),
    );
  }

  /** Values that were typed in the other unit than the ticked one, and a button that reads them in it. */
  private doubt(): HTMLElement | null {
    const marks = this.draft.slip.marks;
    const doubt = marks[0] && marks[1] ? slipDoubt([marks[0].value, marks[1].value], this.percent) : "";
    if (!doubt) return null;
    const reread = (): void => {
      for (const mark of marks) if (mark) mark.value *= this.percent ? 100 : 0.01;
      this.percent = !this.percent;
      this.drawSide();
    };
    return h("p", { class: "bad", role: "alert" }, doubt, " ", h("button", { type: "button", id: "reread-slip", click: reread }, this.percent ? "It is a ratio" : "It is in per cent"));
  }

  private axisFields(axis: AxisName): HTMLElement {
    const log = h("input", { type: "checkbox", checked: this.draft[axis].log });
    log.addEventListener("change", () => {
      this.draft[axis].log = log.checked;
      this.refresh();
    });
    const scale = axis === "slip" && this.percent ? 100 : 1;
    const rows = [0, 1].map((i) => {
      const mark = this.draft[axis].marks[i] ?? null;
      const set = (change: (mark: Mark) => void): void => {
        const now = mark ?? { pixel: [0, 0] as Pixel, value: FIRST[axis][i] as number };
        change(now);
        this.draft[axis].marks[i] = now;
        this.next = ORDER.findIndex(([a, j]) => !this.draft[a].marks[j]);
        this.draw();
        this.drawSide();
      };
      const field = (label: string, value: number | undefined, put: (mark: Mark, v: number) => void): HTMLElement => {
        const shown = value === undefined ? "" : Number(value.toFixed(label === "value" ? 5 : 1));
        return h("td", {}, numberField({ "aria-label": `${TITLE[axis]}, point ${i + 1}, ${label}`, value: shown }, (v) => Number.isFinite(v) && set((m) => put(m, v))));
      };
      return h(
        "tr",
        {},
        h("th", { scope: "row" }, `${axis === "slip" ? "s" : "µ"}${i + 1}`),
        field("value", mark ? mark.value * scale : undefined, (m, v) => (m.value = v / scale)),
        field("pixel x", mark?.pixel[0], (m, v) => (m.pixel = [v, m.pixel[1]])),
        field("pixel y", mark?.pixel[1], (m, v) => (m.pixel = [m.pixel[0], v])),
      );
    });
    const unit = axis === "slip" && this.percent ? "value [%]" : "value";
    return h(
      "fieldset",
      {},
      h("legend", {}, TITLE[axis]),
      h("table", { class: "fields" }, h("thead", {}, h("tr", {}, ["", unit, "x [px]", "y [px]"].map((t) => h("th", {}, t)))), h("tbody", {}, rows)),
      h("label", { class: "check" }, log, "logarithmic"),
    );
  }
}

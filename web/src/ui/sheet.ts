/** Saving what is shown: a drawing as PNG or SVG, a table as CSV. */

import { h, save } from "./dom";
import { CanvasInk, FONT, SvgInk, type Ink } from "./ink";
import { tried } from "./notes";
import { color } from "./theme";

export interface Sheet {
  width: number;
  height: number;
  draw(ink: Ink): void;
}

/** Pixels of a PNG a point of its drawing. */
const SHARP = 2;

export function svgOf({ width, height, draw }: Sheet): string {
  const ink = new SvgInk();
  draw(ink);
  return ink.toString(width, height, color("paper"));
}

export function pngOf({ width, height, draw }: Sheet): Promise<Blob> {
  const canvas = h("canvas", { width: SHARP * width, height: SHARP * height });
  const pen = canvas.getContext("2d");
  if (!pen) throw new Error("The browser could not make a canvas of that size; show fewer panels.");
  pen.scale(SHARP, SHARP);
  pen.fillStyle = color("paper");
  pen.fillRect(0, 0, width, height);
  draw(new CanvasInk(pen));
  return new Promise((resolve, reject) => canvas.toBlob((blob) => (blob ? resolve(blob) : reject(new Error("The browser could not make a PNG of that size; show fewer panels."))), "image/png"));
}

/** Rows of words and numbers as CSV; what is not known is empty. */
export function csvOf(rows: (string | number | null | undefined)[][]): Blob {
  const cell = (value: string | number | null | undefined): string => {
    if (value === null || value === undefined || Number.isNaN(value)) return "";
    const text = String(value);
    return /[",\r\n]/.test(text) ? `"${text.replace(/"/g, '""')}"` : text;
  };
  return new Blob([`${rows.map((row) => row.map(cell).join(",")).join("\n")}\n`], { type: "text/csv" });
}

/** The chooser: `sheet` gives the drawing and `table` the CSV of what is shown now, undefined where there is nothing; `name` of the file; `more` below them. */
export function saveMenu(name: () => string, sheet: () => Promise<Sheet | undefined>, table: () => Promise<Blob | undefined>, more?: HTMLElement): HTMLElement {
  const keep = async (ending: string, content: Blob | undefined): Promise<void> => void (content && save(`${name().replace(/[^\p{L}\p{N}._-]+/gu, "-")}.${ending}`, content));
  const drawn = (ending: string, make: (sheet: Sheet) => Blob | Promise<Blob>) => (): void =>
    void tried(async () => {
      const one = await sheet();
      if (one) await keep(ending, await make(one));
    });
  const button = (text: string, title: string, click: () => void): HTMLElement => h("button", { type: "button", id: `save-${text.toLowerCase()}`, title, click }, text);
  return h(
    "details",
    { class: "chooser", id: "saving" },
    h("summary", {}, "Save"),
    h(
      "div",
      { class: "menu row" },
      button("PNG", "A picture of what is shown", drawn("png", pngOf)),
      button("SVG", "A drawing of what is shown, for print", drawn("svg", (one) => new Blob([svgOf(one)], { type: "image/svg+xml" }))),
      button("CSV", "The rows of what is shown, with units", () => void tried(async () => keep("csv", await table()))),
      more,
    ),
  );
}

/** How wide a text is drawn. */
export function widthOf(text: string, bold = false): number {
  const pen = (measure ??= document.createElement("canvas").getContext("2d"));
  if (!pen) return 7 * text.length;
  pen.font = bold ? `600 ${FONT}` : FONT;
  return pen.measureText(text).width;
}
let measure: CanvasRenderingContext2D | null = null;

/** Entries of a legend, a sample before each, in lines no wider than `width`; returns their height. */
export function legend(ink: Ink, entries: { text: string; sample: (ink: Ink, x: number, y: number) => void }[], x: number, y: number, width: number): number {
  let [at, line] = [x, y];
  for (const { text, sample } of entries) {
    const wide = 26 + widthOf(text) + 16;
    if (at > x && at + wide > x + width) [at, line] = [x, line + LINE];
    sample(ink, at, line);
    ink.text(text, at + 26, line, color("ink"), "start");
    at += wide;
  }
  return entries.length ? line - y + LINE : 0;
}
export const LINE = 18;

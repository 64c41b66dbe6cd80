/** Where a picture lies on the map: from its file, or typed by the user. */

import { h } from "../ui/dom";
import { numberField, numberOf } from "../ui/number";

export type Corners = [[number, number], [number, number], [number, number], [number, number]];

export interface Placed {
  corners: Corners | null;
}

interface Bounds {
  getWest(): number;
  getEast(): number;
  getSouth(): number;
  getNorth(): number;
}

/** Ask for the edges of a picture without coordinates; null where the user cancels. */
export function corners(name: string, bounds: Bounds, before: Corners | null = null): Promise<Corners | null> {
  return new Promise((resolve) => {
    const field = (label: string, value: number): HTMLInputElement => numberField({ id: `edge-${label}`, value: value.toFixed(6), required: true });
    const fields = { north: field("north", before?.[0][1] ?? bounds.getNorth()), south: field("south", before?.[2][1] ?? bounds.getSouth()), west: field("west", before?.[0][0] ?? bounds.getWest()), east: field("east", before?.[1][0] ?? bounds.getEast()) };
    const dialog = h("dialog", { class: "wizard", "aria-labelledby": "edges" });
    const form = h(
      "form",
      { method: "dialog" },
      h("h2", { id: "edges" }, `Edges of ${name}`),
      h("p", { class: "hint" }, "This picture has no position. Enter its edges in degrees (WGS 84)."),
      Object.entries(fields).map(([label, input]) => h("div", { class: "field" }, h("label", { for: input.id }, label), input)),
      h("div", { class: "row end" }, h("button", { type: "button", click: () => end(null) }, "Cancel"), h("button", { type: "submit", class: "primary" }, "Place it")),
    );
    const end = (found: Corners | null): void => {
      dialog.close();
      dialog.remove();
      resolve(found);
    };
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      const [n, s, w, e] = [fields.north, fields.south, fields.west, fields.east].map((input) => numberOf(input.value)) as [number, number, number, number];
      end([[w, n], [e, n], [e, s], [w, s]]);
    });
    dialog.addEventListener("cancel", () => end(null));
    dialog.append(form);
    document.body.append(dialog);
    dialog.showModal();
  });
}

const KEY = "terragrip-basemap";

interface Kept {
  picture: string;
  placed: Record<string, Corners>;
}

function kept(): Kept {
  const none = { picture: "", placed: {} };
  try {
    return { ...none, ...(JSON.parse(localStorage.getItem(KEY) ?? "{}") as Partial<Kept>) };
  } catch {
    return none; // written by something else
  }
}

const keep = (change: Partial<Kept>): void => localStorage.setItem(KEY, JSON.stringify({ ...kept(), ...change }));

/** The basemap shown last in this browser, and the edges of pictures without coordinates. */
export const keptBasemap = (): string => kept().picture;
export const keepBasemap = (picture: string): void => keep({ picture });
export const keptCorners = (picture: string): Corners | null => kept().placed[picture] ?? null;
export const keepCorners = (picture: string, corners: Corners): void => keep({ placed: { ...kept().placed, [picture]: corners } });

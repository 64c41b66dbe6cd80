/** Layouts by name: which panels, wheels and formulas are shown, the pair plotted over each other, and the limits of vertical axes. Stored in this browser. */

import { fill, h } from "../ui/dom";
import { note } from "../ui/notes";
import type { Pair } from "./across";
import type { Axis } from "./along";
import type { Formula } from "./formulas";
import type { Range } from "./gestures";

export interface Layout {
  panels: string[];
  wheels: string[];
  uprights: Record<string, Range>;
  /** Layouts of older versions lack these. */
  formulas?: Formula[];
  pair?: Pair | null;
  axis?: Axis;
}

const KEY = "terragrip-layouts";

function kept(): Record<string, Layout> {
  try {
    return (JSON.parse(localStorage.getItem(KEY) ?? "{}") as Record<string, Layout>) ?? {};
  } catch {
    return {}; // written by something else
  }
}

/** The chooser; `now` gives what is shown, `show` applies a layout. */
export function layouts(now: () => Layout, show: (layout: Layout) => void): HTMLElement {
  const element = h("details", { class: "chooser", id: "layouts" });
  const keep = (all: Record<string, Layout>): void => {
    localStorage.setItem(KEY, JSON.stringify(all));
    draw();
  };
  function draw(): void {
    const all = kept();
    const name = h("input", { type: "text", id: "layout-name", maxlength: 60, placeholder: "Name", "aria-label": "Name of the layout" });
    const save = (event: Event): void => {
      event.preventDefault();
      const word = name.value.trim();
      if (!word) return name.focus();
      keep({ ...all, [word]: now() });
      note(`Layout ${word} is stored in this browser`);
      document.getElementById("layout-name")?.focus();
    };
    fill(
      element,
      h("summary", {}, "Layouts"),
      h(
        "div",
        { class: "menu" },
        Object.entries(all).map(([word, layout]) =>
          h(
            "div",
            { class: "row" },
            h("button", { type: "button", class: "name", click: () => show(layout) }, word),
            h("span", { class: "spring" }),
            h(
              "button",
              {
                type: "button",
                class: "quiet",
                "aria-label": `Remove layout ${word}`,
                click: () => {
                  keep(Object.fromEntries(Object.entries(all).filter(([other]) => other !== word)));
                  document.getElementById("layout-name")?.focus();
                },
              },
              "×",
            ),
          ),
        ),
        h("form", { class: "row", submit: save }, name, h("button", { type: "submit" }, "Save")),
      ),
    );
  }
  draw();
  return element;
}

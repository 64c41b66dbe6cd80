/** Which panels and wheels are shown. */

import { fill, h } from "../ui/dom";
import type { Panel } from "./run";

/** Fill a chooser with a box a panel; `change` gets the keys of those that are to be shown. */
export function panelMenu(element: HTMLElement, panels: Panel[], shown: string[], change: (keys: string[]) => void): void {
  const each = panels.filter((panel, i) => panels.findIndex(({ key }) => key === panel.key) === i);
  let keys = shown;
  fill(
    element,
    h("summary", {}, "Panels"),
    h(
      "div",
      { class: "menu" },
      each.map((panel) => {
        const box = h("input", { type: "checkbox", checked: keys.includes(panel.key) });
        box.addEventListener("change", () => {
          keys = box.checked ? [...keys, panel.key] : keys.filter((key) => key !== panel.key);
          change(keys);
        });
        return h("label", { class: "check" }, box, panel.title);
      }),
    ),
  );
}

/** Fill a group with a button a wheel; `change` gets those that are to be shown, in the order of `wheels`. */
export function wheelChips(element: HTMLElement, wheels: string[], chosen: string[], change: (wheels: string[]) => void): void {
  fill(
    element,
    wheels.map((wheel) => {
      const button = h("button", { type: "button", class: "chip", "aria-pressed": String(chosen.includes(wheel)) }, wheel);
      button.addEventListener("click", () => change(wheels.filter((one) => chosen.includes(one) !== (one === wheel))));
      return button;
    }),
  );
}

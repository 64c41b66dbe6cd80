/** Menus that fold out (`details.chooser`): a click elsewhere or Escape folds them in. */

const open = (): HTMLDetailsElement[] => [...document.querySelectorAll<HTMLDetailsElement>("details.chooser[open]")];

export function foldChoosers(): void {
  addEventListener("pointerdown", ({ target }) => {
    for (const one of open()) if (!(target instanceof Node && one.contains(target))) one.open = false;
  });
  addEventListener("keydown", (event) => {
    if (event.key !== "Escape") return;
    for (const one of open()) {
      const inside = one.contains(document.activeElement);
      one.open = false;
      if (inside) one.querySelector("summary")?.focus();
    }
  });
}

/** Menus that fold out (`details.chooser`): a click elsewhere, focus elsewhere or Escape folds them in. */

const open = (): HTMLDetailsElement[] => [...document.querySelectorAll<HTMLDetailsElement>("details.chooser[open]")];

export function foldChoosers(): void {
  const foldBut = (place: EventTarget | null): void => {
    for (const one of open()) if (!(place instanceof Node && one.contains(place))) one.open = false;
  };
  addEventListener("pointerdown", ({ target }) => foldBut(target));
  addEventListener("focusin", ({ target }) => {
    if (target !== document.getElementById("main")) foldBut(target); // a label that is pressed gives the focus to it for a moment
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

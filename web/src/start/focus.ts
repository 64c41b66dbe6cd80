/** Focus that never falls to the body when a part of the page is redrawn. */

import { fill } from "../ui/dom";
import { focusOn } from "../ui/focus";

type Children = Parameters<typeof fill>[1];

/** Replace an element's children; what had the focus has it again, by its id or `data-key`, else the element's first heading. */
export function refill(parent: HTMLElement, children: Children): void {
  const active = document.activeElement;
  const inside = active instanceof HTMLElement && parent.contains(active);
  const key = inside ? (active.id ? `#${CSS.escape(active.id)}` : active.dataset.key ? `[data-key="${CSS.escape(active.dataset.key)}"]` : "") : "";
  fill(parent, children);
  if (!inside) return;
  const same = key ? parent.querySelector<HTMLElement>(key) : null;
  if (same) same.focus({ preventScroll: true });
  else focusOn(parent.querySelector<HTMLElement>("h1, h2, h3") ?? document.querySelector<HTMLElement>("main"));
}

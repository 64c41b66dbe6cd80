/** The keyboard's place: where the focused control is redrawn, hidden or disabled, focus goes to its successor, never to the body. */

const FOCUSABLE = "a[href], button, input, select, summary, textarea, [tabindex='0']";

let last: HTMLElement | null = null;
/** Where it stood: controls before it may be gone too. */
let place = 0;

const usable = (element: HTMLElement): boolean => !element.matches(":disabled") && element.checkVisibility();
const all = (): HTMLElement[] => [...document.querySelectorAll<HTMLElement>(FOCUSABLE)];
const called = (element: HTMLElement): string => [element.tagName, element.getAttribute("aria-label") ?? (element instanceof HTMLInputElement ? element.labels?.[0]?.textContent : element.textContent)].join("\0");

function restore(): void {
  const now = document.activeElement;
  if (!last || (now && now !== document.body && now !== last) || (last.isConnected && usable(last))) return;
  const id = last.id ? document.getElementById(last.id) : null;
  const candidates = all().filter(usable);
  const name = called(last);
  const same = candidates.find((one) => called(one) === name);
  const near = all().slice(place).find(usable) ?? candidates.at(-1);
  (id && usable(id) ? id : (same ?? near))?.focus({ preventScroll: true });
}

export function keepFocus(): void {
  addEventListener("focusin", ({ target }) => {
    last = target instanceof HTMLElement && target.matches(FOCUSABLE) ? target : null;
    place = last ? all().indexOf(last) : 0;
  });
  addEventListener("pointerdown", ({ target }) => {
    if (target instanceof Element && !target.closest(FOCUSABLE)) last = null; // left on purpose
  });
  new MutationObserver(restore).observe(document.body, { subtree: true, childList: true, attributeFilter: ["disabled", "hidden"] });
}

/** Focus what is not reached by Tab, such as a heading. */
export function focusOn(element: HTMLElement | null): void {
  if (!element) return;
  if (!element.hasAttribute("tabindex")) element.tabIndex = -1;
  element.focus({ preventScroll: true });
}

/** Light and dark: the system's choice until the user makes one. Canvas drawings take their colours from here. */

const KEY = "terragrip-theme";
const listeners = new Set<() => void>();
const colors = new Map<string, string>(); // of the theme: looking them up costs more than drawing

export type Theme = "light" | "dark";

export function theme(): Theme {
  const chosen = localStorage.getItem(KEY);
  if (chosen === "light" || chosen === "dark") return chosen;
  return matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
}

export function startTheme(): void {
  apply();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", apply);
}

export function switchTheme(): void {
  localStorage.setItem(KEY, theme() === "dark" ? "light" : "dark");
  apply();
}

export function onTheme(listener: () => void): () => void {
  listeners.add(listener);
  return () => listeners.delete(listener);
}

function apply(): void {
  document.documentElement.dataset.theme = theme();
  colors.clear();
  for (const listener of listeners) listener();
}

/** A colour of the style sheet by its name, such as "ink". */
export function color(name: string): string {
  let found = colors.get(name);
  if (found === undefined) {
    found = getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
    if (found) colors.set(name, found); // else the sheet is not there yet
  }
  return found;
}

/** Okabe and Ito's palette by names of the style sheet, in the order that new curves take them. */
export const CURVE_COLORS = ["blue", "vermillion", "green", "purple", "orange", "sky"] as const;

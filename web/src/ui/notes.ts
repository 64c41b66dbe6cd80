import { h } from "./dom";

/** One line at the foot of the page; an error stays until it is dismissed. */
export function note(text: string, kind: "info" | "error" = "info"): void {
  const box = document.getElementById("notes");
  if (!box) return;
  const line = h("div", { class: `note ${kind}`, role: kind === "error" ? "alert" : null }, h("span", {}, text));
  line.append(h("button", { type: "button", "aria-label": "Dismiss", click: () => line.remove() }, "×"));
  box.append(line);
  while (box.children.length > 4) box.firstElementChild?.remove();
  if (kind === "info") setTimeout(() => line.remove(), 6000);
}

/** Run something and show its failure as a note; undefined where it failed. */
export async function tried<T>(work: () => Promise<T>): Promise<T | undefined> {
  try {
    return await work();
  } catch (error) {
    note(error instanceof Error ? error.message : String(error), "error");
    return undefined;
  }
}

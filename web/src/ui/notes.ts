import { h } from "./dom";

const SHOWN = 6000; // ms

/** One line at the foot of the page; an error stays until it is dismissed, or its page is left. The same line is not shown twice. */
export function note(text: string, kind: "info" | "error" = "info"): void {
  const box = document.getElementById("notes");
  if (!box) return;
  for (const old of box.querySelectorAll(`.note.${kind}`)) if (old.firstElementChild?.textContent === text) old.remove();
  const line = h("div", { class: `note ${kind}`, role: kind === "error" ? "alert" : null }, h("span", {}, text));
  line.append(h("button", { type: "button", "aria-label": "Dismiss", click: () => line.remove() }, "×"));
  box.append(line);
  while (box.children.length > 4) box.firstElementChild?.remove();
  if (kind === "info") setTimeout(() => line.remove(), SHOWN);
}

/** Another page was opened: errors of the one before leave after as long as an info is shown. */
export function leaveNotes(): void {
  for (const line of document.querySelectorAll("#notes > .note")) setTimeout(() => line.remove(), SHOWN);
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

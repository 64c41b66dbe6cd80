import { h } from "./dom";

export const SHOWN = 6000; // ms

/** One line at the foot of the page; an error stays until it is dismissed, or its page is left, work until it is withdrawn. The same line is not shown twice.
 * `about`: of what it is, for `tried`. */
export function note(text: string, kind: "info" | "error" | "work" = "info", about = ""): void {
  const box = document.getElementById("notes");
  if (!box) return;
  withdraw(text);
  const line = h("div", { class: `note ${kind}`, role: kind === "error" ? "alert" : null, "data-about": about }, h("span", {}, text), kind === "work" && h("progress", { "aria-label": text }));
  line.append(h("button", { type: "button", "aria-label": "Dismiss", click: () => line.remove() }, "×"));
  box.append(line);
  while (box.children.length > 4) box.firstElementChild?.remove();
  if (kind === "info") setTimeout(() => line.remove(), SHOWN);
}

/** Remove the lines with a text, or after a while all: what is no longer so, and errors of a page that was left. */
export function withdraw(text?: string, after = 0): void {
  for (const line of document.querySelectorAll("#notes > .note")) {
    if (text !== undefined && line.firstElementChild?.textContent !== text) continue;
    if (after) setTimeout(() => line.remove(), after);
    else line.remove();
  }
}

/** Run something and show its failure as a note; undefined where it failed. With `about`, the failure of the same work before is no
 * longer shown once it succeeds. */
export async function tried<T>(work: () => Promise<T>, about = ""): Promise<T | undefined> {
  try {
    const done = await work();
    if (about) for (const line of document.querySelectorAll(`#notes > [data-about="${CSS.escape(about)}"]`)) line.remove();
    return done;
  } catch (error) {
    note(error instanceof Error ? error.message : String(error), "error", about);
    return undefined;
  }
}

/** Fields of the forms: a label beside each, and lists of files to choose from. */

import { fill, h } from "../ui/dom";

export function row(label: string, field: HTMLElement): HTMLElement {
  return h("div", { class: "field" }, h("label", { for: field.id }, label), field);
}

/** A list of files; `none` is what stands where none is chosen. */
export function choice(id: string, paths: string[], chosen: string, none: string): HTMLSelectElement {
  return h("select", { id }, offered(paths, chosen, none));
}

/** Offer what is in the folder now. */
export function reoffer(select: HTMLSelectElement, paths: string[], chosen: string, none: string): void {
  if (paths.join("\n") !== [...select.options].map((one) => one.value).filter(Boolean).join("\n")) fill(select, offered(paths, chosen, none));
}

function offered(paths: string[], chosen: string, none: string): HTMLElement[] {
  return [h("option", { value: "" }, none), ...paths.map((path) => h("option", { value: path, selected: path === chosen }, path))];
}

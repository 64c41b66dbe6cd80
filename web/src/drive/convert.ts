/** The whole run as a file of another program: Excel, MATLAB, a map. */

import { get, request } from "../ui/api";
import { fill, h, save } from "../ui/dom";
import { note, tried, withdraw } from "../ui/notes";

/** A row of buttons, one per kind of file that the server knows; `path` is of the run. */
export function wholeRun(path: () => string): HTMLElement {
  const buttons = h("div", { class: "row" });
  const take = async (suffix: string): Promise<void> => {
    const from = path();
    const name = `${from.split("/").at(-1)?.replace(/\.parquet$/, "")}${suffix}`;
    note(`Writing ${name} …`, "work"); // a large one as Excel or MCAP for a minute
    const file = await tried(async () => (await request("drive/converted", { path: from, suffix })).blob());
    withdraw(`Writing ${name} …`);
    if (file) save(name, file);
  };
  void tried(async () => {
    const kinds = await get<Record<string, string>>("drive/kinds");
    fill(buttons, Object.entries(kinds).map(([suffix, title]) => h("button", { type: "button", id: `whole-${suffix.slice(1)}`, title: `All rows and columns of the run as ${title}`, click: () => void take(suffix) }, suffix)));
  });
  return h("div", { role: "group", "aria-label": "The whole run" }, h("p", { class: "hint" }, "The whole run, all rows and columns:"), buttons);
}

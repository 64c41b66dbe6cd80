/** The start page: what the folder holds, new logs by drop, commands over chosen files; a log on its way to estimates. */

import "./start.css";
import { address, get, send, upload, type Item } from "../ui/api";
import { fill, h } from "../ui/dom";
import { note, tried } from "../ui/notes";
import { oneAtATime, type Context, type Page } from "../ui/page";
import { onceReleased } from "../ui/press";
import { ACTIONS, ask } from "./commands";
import { refill } from "./focus";
import { freeName, JobList, viewOf } from "./jobs";
import { LogPage } from "./log";
import { MachineMaker } from "./machine";

const KINDS: [string, string, string][] = [
  ["recording", "Recordings", "Drop a log here: CSV, Parquet, MAT, bag, MCAP, MF4, CAN …"],
  ["estimates", "Estimates", "None yet: open a recording and estimate it."],
  ["library", "Soil libraries", "None yet: learn one from estimates, or save a curve on the fit page."],
  ["ground", "Ground", "None yet: find changes of the ground from estimates."],
  ["map", "Maps", "None yet: make one from estimates of a drive with positions."],
  ["report", "Reports", "None yet: write one from estimates."],
  ["vehicle", "Vehicles", "None yet: an estimate needs one."],
  ["profile", "Profiles", "Only needed for logs with other column names; choosing a log's columns makes one."],
  ["picture", "Pictures", "Scans of printed curves, for the fit page."],
];

export const page: Page = (main, context) => {
  const log = context.query.get("log");
  return log ? openLog(main, context, log) : context.query.has("machine") ? openMaker(main) : openFolder(main, context);
};

function openLog(main: HTMLElement, context: Context, log: string): () => void {
  return new LogPage(main, context, log).leave;
}

/** The vehicle maker on a page of its own, without a log. */
function openMaker(main: HTMLElement): void {
  const body = h("div");
  main.append(h("p", { class: "back" }, h("a", { href: "#/start" }, "← Folder")), h("h1", {}, "A vehicle file from known numbers"), body);
  void tried(async () => {
    const { items } = await get<{ items: Item[] }>("folder");
    const maker = new MachineMaker(freeName(items, "vehicle", ".yaml"), "torque", (path) => note(`${path} saved`));
    maker.element.addEventListener("kept", (event) => fill(body, h("p", { class: "good" }, "Saved in the folder. The command line that makes it again:"), (event as CustomEvent<HTMLElement>).detail));
    fill(body, maker.element);
  });
}

function openFolder(main: HTMLElement, { notices }: Context): () => void {
  const lists = h("div", { class: "kinds" });
  const jobs = new JobList(notices);
  const input = h("input", { type: "file", multiple: true, id: "new-file", class: "visually-hidden" });
  const drop = h(
    "div",
    { class: "drop", id: "drop" },
    h("p", {}, "Drop logs, vehicles, profiles or libraries here, or ", input, h("label", { for: "new-file", class: "button" }, "choose files")),
    h("div", { id: "uploads" }),
  );
  const title = h("h1", {}, "Folder");
  const dialog = h("dialog", { class: "wizard" });
  main.append(title, drop, jobs.element, lists, dialog);
  let items: Item[] = [];
  let listed = false;
  const ticked = new Set<string>();

  input.addEventListener("change", () => {
    take(input.files ?? []);
    input.value = "";
  });

  function take(files: Iterable<File>): void {
    const all = [...files];
    for (const file of all) void add(file, all.length === 1);
  }

  async function add(file: File, alone: boolean): Promise<void> {
    const exists = items.some((item) => item.path === file.name);
    if (exists && !confirm(`${file.name} is there already. Replace it?`)) return;
    const bar = h("progress", { max: 1, value: 0, "aria-label": `sending ${file.name}` });
    const line = h("p", {}, file.name, " ", bar);
    drop.querySelector("#uploads")?.append(line);
    const taken = await tried(() => upload(file.name, file, exists, (share) => (bar.value = share)));
    line.remove();
    if (!taken) return;
    note(`${taken.path} is in the folder`);
    if (!drop.isConnected) return; // the user went on to another page meanwhile
    if (taken.kind === "recording" && alone) location.hash = pageOf(taken.path);
    else await reload();
  }

  const reload = oneAtATime(async () => {
    const folder = await tried(() => get<{ name: string; items: Item[] }>("folder"));
    if (!folder) return;
    title.textContent = folder.name || "Folder";
    if (listed && JSON.stringify(folder.items) === JSON.stringify(items)) return;
    listed = true;
    items = folder.items;
    const there = new Set(items.map((item) => item.path));
    for (const path of ticked) if (!there.has(path)) ticked.delete(path);
    onceReleased(lists, () => refill(lists, KINDS.map(([kind, name, none]) => section(kind, name, none))));
  });

  function section(kind: string, name: string, none: string): HTMLElement {
    const of = items.filter((item) => item.kind === kind);
    const actions = of.length ? (ACTIONS[kind] ?? []) : [];
    const rows = of.map((item) =>
      h(
        "tr",
        {},
        actions.length ? h("td", {}, tick(item)) : null,
        h("td", { class: "name" }, main_action(item)),
        h("td", { class: "number" }, bytes(item.size)),
        h("td", { class: "when" }, new Date(item.modified * 1000).toLocaleString([], { dateStyle: "short", timeStyle: "short" })),
        h("td", {}, remove_button(item)),
      ),
    );
    return h(
      "section",
      { "aria-label": name },
      h("h2", {}, name),
      actions.length ? h("div", { class: "row actions" }, actions.map(([command, text]) => h("button", { type: "button", "data-key": `do ${command}`, click: () => begin(command, of) }, text)), h("span", { class: "hint", "data-count": kind }, counted(of))) : null,
      kind === "vehicle" ? h("div", { class: "row actions" }, h("a", { href: "#/start?machine", class: "button", "data-key": "make" }, "Make a vehicle file")) : null,
      of.length ? h("div", { class: "listed" }, h("table", { class: "files" }, h("tbody", {}, rows))) : h("p", { class: "hint" }, none),
    );
  }

  function chosen(of: Item[]): string[] {
    const some = of.filter((item) => ticked.has(item.path));
    return (some.length ? some : of).map((item) => item.path);
  }

  function counted(of: Item[]): string {
    const count = of.filter((item) => ticked.has(item.path)).length;
    if (of.length === 1) return "";
    return count ? `the ${count} that ${count === 1 ? "is" : "are"} ticked` : `all ${of.length}; tick some for fewer`;
  }

  function begin(command: string, of: Item[]): void {
    const files = chosen(of);
    if (command === "batch" && files.length === 1) location.hash = pageOf(files[0] as string);
    else ask(dialog, command, files, [...items, ...jobs.pending], (job) => jobs.update(job));
  }

  function tick(item: Item): HTMLElement {
    const box = h("input", { type: "checkbox", checked: ticked.has(item.path), "aria-label": `choose ${item.path}`, "data-key": `tick ${item.path}` });
    box.addEventListener("change", () => {
      if (box.checked) ticked.add(item.path);
      else ticked.delete(item.path);
      const count = lists.querySelector(`[data-count="${item.kind}"]`);
      if (count) count.textContent = counted(items.filter((one) => one.kind === item.kind));
    });
    return box;
  }

  function main_action(item: Item): HTMLElement {
    const key = `open ${item.path}`;
    if (item.kind === "recording") return h("a", { href: pageOf(item.path), "data-key": key }, item.path);
    const view = viewOf(item.kind, item.path);
    if (view) return h("a", { href: view, target: view.startsWith("#") ? null : "_blank", "data-key": key }, item.path);
    return h("a", { href: address("file", { path: item.path }), download: item.path.split("/").at(-1) ?? "", "data-key": key }, item.path);
  }

  function remove_button(item: Item): HTMLElement {
    const remove = async (): Promise<void> => {
      if (!confirm(`Remove ${item.path} from the folder?`)) return;
      await tried(() => send("DELETE", "file", undefined, { path: item.path }));
      await reload();
    };
    return h("button", { type: "button", class: "quiet", "aria-label": `remove ${item.path}`, "data-key": `remove ${item.path}`, click: () => void remove() }, "×");
  }

  const forget = notices.on((notice) => {
    if (notice.kind === "folder") void reload();
  });
  const over = (event: DragEvent): void => {
    event.preventDefault();
    drop.classList.add("over");
  };
  const out = (): void => drop.classList.remove("over");
  const dropped = (event: DragEvent): void => {
    event.preventDefault();
    out();
    take(event.dataTransfer?.files ?? []);
  };
  main.addEventListener("dragover", over);
  main.addEventListener("dragleave", out);
  main.addEventListener("drop", dropped);
  void reload();
  return () => {
    forget();
    jobs.leave();
    main.removeEventListener("dragover", over);
    main.removeEventListener("dragleave", out);
    main.removeEventListener("drop", dropped);
  };
}

function pageOf(log: string): string {
  return `#/start?log=${encodeURIComponent(log)}`;
}

function bytes(size: number): string {
  if (size < 1000) return `${size} B`;
  if (size < 1e6) return `${(size / 1e3).toFixed(0)} kB`;
  return size < 1e9 ? `${(size / 1e6).toFixed(1)} MB` : `${(size / 1e9).toFixed(2)} GB`;
}

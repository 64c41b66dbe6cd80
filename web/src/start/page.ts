/** The start page: what the folder holds, new logs by drop, work under way. */

import { address, get, send, upload, type Item, type Job } from "../ui/api";
import { fill, h } from "../ui/dom";
import { note, tried } from "../ui/notes";
import type { Page } from "../ui/page";
import { Wizard } from "./wizard";

const KINDS: [string, string, string][] = [
  ["recording", "Recordings", "Drop a log here: CSV, Parquet, MAT, bag, MCAP, MF4, CAN …"],
  ["estimates", "Estimates", "None yet: open a recording and estimate it."],
  ["library", "Soil libraries", "None yet: learn one from estimates, or save a curve on the fit page."],
  ["ground", "Ground", "None yet: terragrip ground writes them."],
  ["report", "Reports", "None yet: terragrip report writes them."],
  ["vehicle", "Vehicles", "A vehicle file is needed to estimate; see the tutorial."],
  ["profile", "Profiles", "Only needed for logs with names of their own."],
  ["picture", "Pictures", "Scans of printed curves, for the fit page."],
];

export const page: Page = (main, { notices }) => {
  const lists = h("div", { class: "kinds" });
  const jobs = h("div", { id: "jobs" });
  const input = h("input", { type: "file", multiple: true, id: "new-file", class: "visually-hidden" });
  const drop = h(
    "div",
    { class: "drop", id: "drop" },
    h("p", {}, "Drop logs, vehicles, profiles or libraries here, or ", input, h("label", { for: "new-file", class: "button" }, "choose files")),
    h("div", { id: "uploads" }),
  );
  const title = h("h1", {}, "Folder");
  const dialog = h("dialog", { class: "wizard" });
  main.append(title, drop, jobs, lists, dialog);
  let items: Item[] = [];
  const known = new Map<string, Job>();

  input.addEventListener("change", () => {
    take(input.files ?? []);
    input.value = "";
  });

  function take(files: Iterable<File>): void {
    for (const file of files) void add(file);
  }

  async function add(file: File): Promise<void> {
    const exists = items.some((item) => item.path === file.name);
    if (exists && !confirm(`${file.name} is there already. Replace it?`)) return;
    const bar = h("progress", { max: 1, value: 0, "aria-label": `sending ${file.name}` });
    const line = h("p", {}, file.name, " ", bar);
    drop.querySelector("#uploads")?.append(line);
    const taken = await tried(() => upload(file.name, file, exists, (share) => (bar.value = share)));
    line.remove();
    if (!taken) return;
    note(`${taken.path} taken`);
    await reload();
    if (taken.kind === "recording") open(taken.path);
  }

  function open(recording: string): void {
    const wizard = new Wizard(recording, items, () => dialog.close());
    fill(dialog, wizard.element);
    dialog.showModal();
    void wizard.look();
  }

  async function reload(): Promise<void> {
    const folder = await tried(() => get<{ name: string; items: Item[] }>("folder"));
    if (!folder) return;
    items = folder.items;
    title.textContent = folder.name || "Folder";
    fill(lists, KINDS.map(([kind, name, none]) => section(kind, name, none)));
  }

  function section(kind: string, name: string, none: string): HTMLElement {
    const of = items.filter((item) => item.kind === kind);
    const rows = of.map((item) =>
      h(
        "tr",
        {},
        h("td", {}, main_action(item)),
        h("td", { class: "number" }, bytes(item.size)),
        h("td", {}, new Date(item.modified * 1000).toLocaleString([], { dateStyle: "short", timeStyle: "short" })),
        h("td", {}, other_actions(item)),
      ),
    );
    const learn =
      kind === "estimates" && of.length
        ? h("button", { type: "button", click: () => void learnSoils(of) }, "Learn soils from all")
        : null;
    return h(
      "section",
      { "aria-label": name },
      h("h2", {}, `${name}`, learn),
      of.length ? h("table", { class: "files" }, h("tbody", {}, rows)) : h("p", { class: "hint" }, none),
    );
  }

  function main_action(item: Item): HTMLElement {
    if (item.kind === "recording") return h("button", { type: "button", class: "link", click: () => open(item.path) }, item.path);
    if (item.kind === "estimates" || item.kind === "library") {
      const to = item.kind === "estimates" ? "drive" : "fit";
      return h("a", { href: `#/${to}?path=${encodeURIComponent(item.path)}` }, item.path);
    }
    return h("a", { href: address("file", { path: item.path }), download: item.path.split("/").at(-1) ?? "" }, item.path);
  }

  function other_actions(item: Item): HTMLElement {
    const remove = async (): Promise<void> => {
      if (!confirm(`Remove ${item.path} from the folder?`)) return;
      await tried(() => send("DELETE", "file", undefined, { path: item.path }));
      await reload();
    };
    return h("button", { type: "button", class: "quiet", "aria-label": `remove ${item.path}`, click: () => void remove() }, "×");
  }

  async function learnSoils(of: Item[]): Promise<void> {
    const output = prompt("Soil library to write:", "soils.json");
    if (!output) return;
    const replace = items.some((item) => item.path === output);
    if (replace && !confirm(`Replace ${output}?`)) return;
    await tried(() => send("POST", "jobs/soils", { estimates: of.map((item) => item.path), output, replace }));
  }

  function drawJobs(): void {
    const shown = [...known.values()].slice(-8);
    fill(jobs, shown.length ? h("section", { "aria-label": "Work" }, h("h2", {}, "Work"), shown.map(job_line)) : null);
  }

  function job_line(job: Job): HTMLElement {
    const going = job.state === "running" || job.state === "queued";
    const text = going
      ? h("progress", { max: job.total || 1, value: job.total ? job.done : null, "aria-label": `${job.kind} of ${job.title}` })
      : h("span", { class: `state ${job.state}` }, job.state);
    const cancel = going
      ? h("button", { type: "button", click: () => void tried(() => send("DELETE", `jobs/${job.id}`, undefined)) }, "Cancel")
      : null;
    const details = !going && job.text ? h("details", { open: job.state === "failed" }, h("summary", {}, job.state === "failed" ? "Why" : "Summary"), h("pre", {}, job.text)) : null;
    return h("div", { class: "job" }, h("span", {}, `${job.kind} ${job.title} → ${job.output}`), text, cancel, details);
  }

  const forget = notices.on((notice) => {
    if (notice.kind === "folder") void reload();
    if (notice.kind === "job") {
      known.set(notice.job.id, notice.job);
      drawJobs();
      if (notice.job.state === "failed") note(notice.job.text, "error");
    }
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
  void tried(async () => {
    for (const job of await get<Job[]>("jobs")) known.set(job.id, job);
    drawJobs();
  });
  return () => {
    forget();
    main.removeEventListener("dragover", over);
    main.removeEventListener("dragleave", out);
    main.removeEventListener("drop", dropped);
  };
};

function bytes(size: number): string {
  if (size < 1000) return `${size} B`;
  if (size < 1e6) return `${(size / 1e3).toFixed(0)} kB`;
  return size < 1e9 ? `${(size / 1e6).toFixed(1)} MB` : `${(size / 1e9).toFixed(2)} GB`;
}

/** Work under way and done: progress, cancel, how it ended, its command line for the next time. */

import { get, isGoing, isOlder, send, type Item, type Job, type Notices } from "../ui/api";
import { fill, h } from "../ui/dom";
import { note, tried } from "../ui/notes";
import { onceReleased } from "../ui/press";
import { focusOn } from "../ui/focus";

const SHOWN = 8;
const NAMES: Record<string, string> = { estimate: "Estimate", batch: "Estimate", calibrate: "Calibrate", soils: "Learn soils", ground: "Ground", map: "Map", report: "Report" };

/** A file that does not exist yet: `stem + ending`, or numbered. */
export function freeName(items: Item[], stem: string, ending: string): string {
  const taken = new Set(items.map((item) => item.path));
  for (let i = 1; ; i++) {
    const name = `${stem}${i === 1 ? "" : `-${i}`}${ending}`;
    if (!taken.has(name)) return name;
  }
}

/** A log's name without the suffix of its format. */
export function stemOf(path: string): string {
  return path.replace(/(\.\w{1,8}){1,2}$/, "");
}

/** The page that shows a file of the folder; null where there is none. */
export function viewOf(kind: string, path: string): string | null {
  const query = `path=${encodeURIComponent(path)}`;
  if (kind === "estimates" || kind === "estimate") return `#/drive?${query}`;
  if (kind === "library" || kind === "soils") return `#/fit?${query}`;
  if (kind === "map") return `#/map?map=${encodeURIComponent(path)}`;
  if (kind === "report" && path.endsWith(".html")) return `./api/report?${query}`;
  return null;
}

export class JobList {
  readonly element = h("section", { id: "jobs", "aria-label": "Work", hidden: true });
  private list = h("div");
  private jobs = new Map<string, Job>();
  private lines = new Map<string, { state: string; element: HTMLElement; bar: HTMLProgressElement }>();
  readonly leave: () => void;

  /** `ended` is called when a job ends while the page is open; `listed`: whether a job is shown. */
  constructor(
    notices: Notices,
    private ended: (job: Job) => void = () => {},
    private listed: (job: Job) => boolean = () => true,
  ) {
    this.element.append(h("h2", {}, "Work"), this.list);
    this.leave = notices.on((notice) => {
      if (notice.kind === "job") this.update(notice.job);
      else if (notice.kind === "connection" && notice.up) void this.ask((job) => this.update(job)); // what ended meanwhile was not reported
    });
    void this.ask((job) => void (this.jobs.has(job.id) || this.jobs.set(job.id, job)));
  }

  private async ask(take: (job: Job) => void): Promise<void> {
    (await tried(() => get<Job[]>("jobs")))?.forEach(take);
    this.draw();
  }

  /** What the jobs that wait or run will write: names that are taken. */
  get pending(): Item[] {
    return [...this.jobs.values()].filter(isGoing).map(({ output }) => ({ path: output, kind: "", size: 0, modified: 0 }));
  }

  update(job: Job): void {
    const before = this.jobs.get(job.id);
    if (before && isOlder(job, before)) return;
    this.jobs.set(job.id, job);
    onceReleased(this.list, () => this.draw());
    if (isGoing(job)) return;
    if (job.state === "failed" && this.listed(job)) note(job.text, "error");
    this.ended(job);
  }

  draw(): void {
    const all = [...this.jobs.values()].filter(this.listed);
    const shown = all.filter((job, i) => isGoing(job) || i >= all.length - SHOWN).reverse();
    this.element.hidden = !shown.length;
    const elements = shown.map((job) => this.line(job));
    const known = new Set(shown.map((job) => job.id));
    for (const id of this.lines.keys()) if (!known.has(id)) this.lines.delete(id);
    if (elements.length !== this.list.children.length || elements.some((element, i) => this.list.children[i] !== element)) {
      const active = document.activeElement;
      const inside = this.list.contains(active);
      const key = inside && active instanceof HTMLElement ? active.dataset.key : undefined;
      fill(this.list, elements);
      const same = key ? this.list.querySelector<HTMLElement>(`[data-key="${CSS.escape(key)}"]`) : null;
      if (inside) focusOn(same ?? this.element.querySelector("h2"));
    }
  }

  /** A job's line; while it runs only its bar moves, so that the button to cancel it keeps the focus. */
  private line(job: Job): HTMLElement {
    const old = this.lines.get(job.id);
    if (old && old.state === job.state) {
      progress(old.bar, job);
      return old.element;
    }
    const bar = h("progress", { max: 1, "aria-label": `${NAMES[job.kind] ?? job.kind} of ${job.title}` });
    progress(bar, job);
    const element = h("div", { class: "job" }, this.parts(job, bar));
    this.lines.set(job.id, { state: job.state, element, bar });
    return element;
  }

  private parts(job: Job, bar: HTMLProgressElement): (HTMLElement | null)[] {
    const going = isGoing(job);
    const cancel = (): void => void tried(() => send("DELETE", `jobs/${job.id}`, undefined));
    const view = job.state === "done" ? viewOf(job.kind, job.output) : null;
    const outside = view !== null && !view.startsWith("#");
    const output = view ? h("a", { href: view, target: outside ? "_blank" : null, "data-key": `view ${job.id}` }, job.output) : h("span", {}, job.output);
    const failed = job.state === "failed" || job.state === "interrupted";
    return [
      h("span", { class: "what" }, `${NAMES[job.kind] ?? job.kind}: ${job.title} → `, output),
      job.state === "running" ? bar : h("span", { class: `state ${job.state}` }, job.state === "queued" ? "waits for the one before" : job.state),
      going ? h("button", { type: "button", "data-key": `cancel ${job.id}`, click: cancel }, "Cancel") : null,
      !going && job.text ? h("details", { open: failed }, h("summary", {}, failed ? "Why" : "Summary"), h("pre", { tabindex: "0", class: failed ? "prose" : null }, job.text)) : null,
      h("details", {}, h("summary", {}, "Command line"), commandLine(job.command)),
    ];
  }
}

function progress(bar: HTMLProgressElement, job: Job): void {
  if (job.done) {
    bar.max = job.total;
    bar.value = job.done;
  } else bar.removeAttribute("value"); // it moves, also during the first pass over a long log
}

/** A command line, and a button that copies it. */
export function commandLine(command: string): HTMLElement {
  const copy = h("button", { type: "button", click: () => void navigator.clipboard?.writeText(command).then(() => note("copied")) }, "Copy");
  return h("div", { class: "command" }, h("code", { tabindex: "0" }, command), copy);
}

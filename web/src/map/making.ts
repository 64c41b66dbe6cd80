/** A map made from the page: what it needs is asked, its progress shown, and it is opened when it is there. */

import type { Item, Notices } from "../ui/api";
import { h } from "../ui/dom";
import { ask } from "../start/commands";
import { JobList } from "../start/jobs";
import { addressOf } from "./which";

export class MapMaking {
  readonly button = h("button", { type: "button", id: "map-make", disabled: true, click: () => this.ask(), title: "Cells of adhesion, resistance, slip and efficiency from this run" }, "Make a map …");
  readonly element: HTMLElement;
  private mine = new Set<string>();
  private list: JobList;
  readonly leave: () => void;

  constructor(
    notices: Notices,
    private run: () => string,
    private items: () => Item[],
  ) {
    this.list = new JobList(
      notices,
      (job) => void (job.state === "done" && this.mine.has(job.id) && (location.hash = addressOf(job.output))),
      (job) => this.mine.has(job.id),
    );
    this.element = h("div", { class: "making" }, this.list.element);
    this.leave = this.list.leave;
  }

  private ask(): void {
    const run = this.run();
    if (!run) return;
    const dialog = h("dialog", { class: "wizard" });
    dialog.addEventListener("close", () => dialog.remove());
    this.element.append(dialog);
    ask(dialog, "map", [run], this.items(), (job) => this.mine.add(job.id));
  }
}

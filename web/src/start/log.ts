/** From a stranger's log to estimates, a curve and a report: columns, machine, estimate, and what follows from it. */

import type { Run } from "../drive/run";
import { get, send, SILENT, type Item, type Job } from "../ui/api";
import { fill, h, working } from "../ui/dom";
import { tried } from "../ui/notes";
import { oneAtATime, type Context } from "../ui/page";
import { onceReleased } from "../ui/press";
import { bind, boundTo } from "./bound";
import { choice, reoffer, row } from "./fields";
import { focusOn } from "../ui/focus";
import { refill } from "./focus";
import { verdict, type Inspection } from "./inspection";
import { freeName, JobList, stemOf, viewOf } from "./jobs";
import { MachineMaker } from "./machine";
import { Mapping, type Preview } from "./mapping";
import type { Parts } from "./wheels";

interface Methods {
  default: string;
  methods: Record<string, { smooth: boolean }>;
}

export class LogPage {
  private columns = h("div");
  private machine = h("div");
  private estimate = h("div");
  private next = h("div");
  private profile = "";
  private vehicle = "";
  private isOnly = false; // the vehicle is taken for want of another
  private preview: Preview | undefined;
  private mapping: Mapping | undefined;
  private maker: MachineMaker | undefined;
  private methods: Methods | undefined;
  private items: Item[] = [];
  private key = ""; // the log, in its folder
  private left = ""; // as it was left: what the log is read by and estimated with, in words
  private checks = 0;
  private queueing = false;
  private hasLabels = false;
  private estimates = "";
  private hasAdhesion = true; // of the estimates
  private made = new Map<string, string>(); // by kind of job, what was made of the estimates
  private read = ["", ""]; // the log, and its vehicle and profile, as they were when they were read
  readonly jobs: JobList;
  readonly leave: () => void;

  constructor(
    main: HTMLElement,
    { notices }: Context,
    private log: string,
  ) {
    this.jobs = new JobList(
      notices,
      (job) => void this.ended(job),
      (job) => job.state === "running" || job.state === "queued" || this.isOwn(job), // what runs delays this log's too
    );
    const section = (id: string, title: string, body: HTMLElement): HTMLElement => h("section", { class: "step", "aria-labelledby": id }, h("h2", { id }, title), body);
    main.append(
      h("p", { class: "back" }, h("a", { href: "#/start" }, "← Folder")),
      h("h1", {}, log),
      section("step-columns", "1  Columns", this.columns),
      section("step-machine", "2  Machine", this.machine),
      section("step-estimate", "3  Estimates", this.estimate),
      section("step-next", "4  Curve, ground, report", this.next),
      this.jobs.element,
    );
    const renew = oneAtATime(() => this.renew());
    const forget = notices.on((notice) => notice.kind === "folder" && void renew());
    this.leave = () => {
      forget();
      this.jobs.leave();
    };
    void this.open();
  }

  /** The folder has changed: what is said here must not be of files that are others now. */
  private async renew(): Promise<void> {
    await this.reload();
    const silent = this.mapping?.element.textContent === SILENT;
    if (!this.preview && this.read[0] !== "" && (silent || this.version(this.log) !== this.read[0])) return this.open(); // it could not be read before
    const select = document.getElementById("wizard-vehicle") as HTMLSelectElement | null;
    const found = document.getElementById("wizard-found");
    if (!select || !found) return; // still opening
    reoffer(select, this.of("vehicle"), this.vehicle, "choose the log's vehicle");
    const profile = document.getElementById("wizard-profile") as HTMLSelectElement | null;
    if (profile) reoffer(profile, this.profiles, this.profile, profile.options[0]?.text ?? "");
    if (this.version(this.vehicle, this.profile) !== this.read[1]) await this.inspect();
    if (this.version(this.log) === this.read[0] || document.getElementById("read-again")) return;
    found.prepend(h("p", { class: "bad", role: "alert" }, "The log has changed since it was read. ", h("button", { type: "button", id: "read-again", click: () => void this.open() }, "Read it again")));
  }

  private version(...paths: string[]): string {
    return JSON.stringify(this.items.filter((item) => paths.includes(item.path)));
  }

  private async open(): Promise<void> {
    await this.reload();
    this.read[0] = this.version(this.log);
    let last: Job | undefined; // estimate of this log: with its vehicle and profile one goes on
    for (const job of (await tried(() => get<Job[]>("jobs"))) ?? []) {
      if (this.keep(job) && job.kind === "estimate") last = job;
    }
    const used = (option: string): string => (last?.words.includes(option) ? (last.words[last.words.indexOf(option) + 1] ?? "") : "");
    this.jobs.draw();
    this.methods = await tried(() => get<Methods>("methods"));
    const bound = boundTo(this.key);
    const there = (kind: "profile" | "vehicle", path = ""): string => (this.of(kind).includes(path) ? path : "");
    const own = [bound.profile, last ? used("--profile") : `${stemOf(this.log)}-profile.yaml`];
    this.profile = own.map((path) => there("profile", path)).find(Boolean) ?? "";
    const vehicle = there("vehicle", bound.vehicle) || there("vehicle", used("--vehicle")) || there("vehicle", `${stemOf(this.log)}-vehicle.yaml`);
    this.vehicle = vehicle || this.onlyVehicle();
    this.isOnly = !vehicle && this.vehicle !== "";
    this.mapping = new Mapping(this.log, (profile) => void this.keptProfile(profile));
    this.drawColumns(false); // that the log is read: a long one takes a while
    this.preview = await this.mapping.open(this.free(`${stemOf(this.log)}-profile`, ".yaml"), this.profile);
    this.profile ||= this.preview?.fitting.find((name) => own.includes(name)) ?? "";
    this.left = [this.profile && `read by ${this.profile}`, vehicle && `vehicle ${vehicle}`].filter(Boolean).join(", ");
    this.drawColumns(!this.profile && !this.preview?.ready);
    this.drawMachine();
    this.drawEstimate();
    await this.offerNext();
    await this.parts();
    await this.inspect();
  }

  /** Read the log by another profile, or ("") by none, with what is proposed: the profile before stays in the folder. */
  private async readBy(profile: string): Promise<void> {
    [this.profile, this.left] = [profile, ""];
    this.mapping?.forget();
    bind(this.key, { profile });
    this.preview = await this.mapping?.open(this.free(`${stemOf(this.log)}-profile`, ".yaml"), profile);
    this.drawColumns(profile ? (document.getElementById("choose-columns") as HTMLDetailsElement | null)?.open ?? false : true);
    await this.inspect();
  }

  /** Of several vehicles none is chosen by default: with the wrong one every number would be wrong, without a sign. */
  private onlyVehicle(): string {
    const vehicles = this.of("vehicle");
    return vehicles.length === 1 ? (vehicles[0] as string) : "";
  }

  /** The names of the vehicle's wheels and axles, for the columns. */
  private async parts(): Promise<void> {
    const parts = this.vehicle ? await tried(() => get<Parts>("machines/parts", { path: this.vehicle })) : undefined;
    this.mapping?.names.offer(parts ?? { wheels: [], axles: [] });
  }

  private get profiles(): string[] {
    return [...new Set([...this.of("profile"), ...(this.preview?.fitting ?? [])])];
  }

  private of(kind: string): string[] {
    return this.items.filter((item) => item.kind === kind).map((item) => item.path);
  }

  private async reload(): Promise<void> {
    const folder = await tried(() => get<{ name: string; items: Item[] }>("folder"));
    if (folder) [this.items, this.key] = [folder.items, `${folder.name}/${this.log}`];
  }

  /** Columns: whoever has a profile, or a log with our names, sees one line; else the choice. */
  private drawColumns(choosing: boolean): void {
    if (!this.preview || !this.mapping) {
      fill(this.columns, this.mapping?.element ?? null);
      return;
    }
    const none = this.preview.ready ? "no profile: the columns have Terragrip's names" : "no profile yet: choose the columns below";
    const profile = choice("wizard-profile", this.profiles, this.profile, none);
    profile.addEventListener("change", () => void this.readBy(profile.value));
    const back = this.profile ? h("button", { type: "button", id: "propose", click: () => void this.readBy("") }, "Back to the proposals") : null;
    refill(this.columns, [
      this.left ? h("p", { class: "hint", id: "as-left" }, `As you left it: ${this.left}. `, back) : null,
      row("Read by", profile),
      h("details", { open: choosing, id: "choose-columns" }, h("summary", {}, "Choose the columns"), this.mapping.element),
    ]);
  }

  private async keptProfile(profile: string): Promise<void> {
    await this.reload();
    this.profile = profile;
    this.left = "";
    bind(this.key, { profile });
    this.drawColumns(false);
    this.maker?.measures(this.mapping?.signals ?? "torque");
    focusOn(document.getElementById(this.vehicle ? "step-estimate" : "step-machine"));
    await this.inspect();
  }

  private drawMachine(): void {
    const vehicles = this.of("vehicle");
    const select = choice("wizard-vehicle", vehicles, this.vehicle, vehicles.length ? "choose the log's vehicle" : "no vehicle file yet: make one below");
    select.addEventListener("change", () => {
      this.vehicle = select.value;
      only.remove();
      bind(this.key, { vehicle: this.vehicle });
      void this.parts().then(() => this.inspect());
    });
    const maker = (this.maker = new MachineMaker(this.free(`${stemOf(this.log)}-vehicle`, ".yaml"), this.mapping?.signals ?? "torque", (path) => void this.keptVehicle(path)));
    const only = h("p", { class: "hint", id: "only-vehicle", hidden: !this.isOnly }, "The folder has no other vehicle file. If the log is of another machine, make that one’s below.");
    const command = h("div");
    maker.element.addEventListener("kept", (event) => fill(command, h("details", {}, h("summary", {}, "Command line that makes this vehicle file"), (event as CustomEvent<HTMLElement>).detail)));
    refill(this.machine, [
      row("Vehicle", select),
      only,
      h("details", { open: !vehicles.length, id: "make-machine" }, h("summary", {}, "Make a vehicle file from known numbers"), maker.element),
      command,
    ]);
  }

  private async keptVehicle(path: string): Promise<void> {
    await this.reload();
    this.vehicle = path;
    document.getElementById("only-vehicle")?.remove();
    bind(this.key, { vehicle: path });
    const select = document.getElementById("wizard-vehicle") as HTMLSelectElement;
    fill(select, this.of("vehicle").map((name) => h("option", { value: name, selected: name === path }, name)));
    (document.getElementById("make-machine") as HTMLDetailsElement).open = false;
    focusOn(document.getElementById("step-estimate"));
    await this.parts();
    await this.inspect();
  }

  private drawEstimate(): void {
    const method = h("select", { id: "wizard-method" });
    for (const name of Object.keys(this.methods?.methods ?? {})) method.append(h("option", { value: name, selected: name === this.methods?.default }, name));
    const smooth = h("input", { type: "checkbox", id: "wizard-smooth" });
    const limits = (): void => {
      const able = this.methods?.methods[method.value]?.smooth ?? false;
      smooth.disabled = !able;
      if (!able) smooth.checked = false;
    };
    limits();
    method.addEventListener("change", () => {
      limits();
      void this.inspect();
    });
    const output = h("input", { type: "text", id: "wizard-output", value: this.free(`${stemOf(this.log)}-estimates`, ".parquet"), required: true });
    const go = h("button", { type: "submit", class: "primary", id: "wizard-go", disabled: true }, "Estimate");
    const form = h(
      "form",
      {},
      h("div", { id: "wizard-found", "aria-live": "polite" }),
      h("details", {}, h("summary", {}, "Method and file"), row("Method", method), h("label", { class: "check" }, smooth, "smooth (run it backwards too)"), row("Write to", output)),
      h("div", { class: "row" }, go),
    );
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      if (this.mapping?.isUnsaved && !confirm(`The columns were changed, and the change is not used yet. Estimate ${this.profile ? `by ${this.profile} as it is` : "without it"}?`)) return;
      const wanted = { recording: this.log, vehicle: this.vehicle, profile: this.profile || null, method: method.value, smooth: smooth.checked };
      void this.queue("estimate", wanted, output.value.trim());
    });
    fill(this.estimate, form);
  }

  /** Begin an estimate with what is chosen, without keeping it: "ready" is said only where it ran. */
  private async inspect(): Promise<void> {
    const found = document.getElementById("wizard-found");
    const go = document.getElementById("wizard-go") as HTMLButtonElement | null;
    if (!found || !go) return;
    const turn = ++this.checks;
    const method = (document.getElementById("wizard-method") as HTMLSelectElement).value || undefined;
    go.disabled = true;
    this.read[1] = this.version(this.vehicle, this.profile);
    const nothing = !this.profile && !this.preview?.ready;
    if (nothing) {
      fill(found, h("p", { class: "hint" }, this.preview ? "Not ready: choose the columns first." : "Not ready: the log cannot be read."));
      return;
    }
    fill(found, working(this.vehicle ? "Trying an estimate …" : "Reading the log …"));
    try {
      const result = await get<Inspection>("inspect", { path: this.log, profile: this.profile || undefined, vehicle: this.vehicle || undefined, method });
      if (turn !== this.checks) return;
      const ready = result.ready && this.vehicle !== "";
      this.hasLabels = "soil" in result.recognised;
      fill(
        found,
        h("p", { class: ready ? "good" : "bad" }, verdict(result, this.vehicle !== "", this.of("vehicle").length > 0)),
        ready ? null : this.namesMissing(),
        result.warnings.filter((text) => !result.problem?.endsWith(text)).map((text) => h("p", { class: "hint" }, text)),
        h("details", {}, h("summary", {}, "Contents"), h("pre", { tabindex: "0" }, result.text)),
      );
      go.disabled = !ready;
      this.drawNext();
    } catch (error) {
      if (turn !== this.checks) return;
      const text = error instanceof Error ? error.message : String(error);
      if (text === SILENT) this.read[1] = ""; // asked again as soon as the studio responds
      fill(found, h("p", { class: "bad", role: "alert" }, text));
    }
  }

  /** A way to the names, where the log's wheels are not the vehicle's. */
  private namesMissing(): HTMLElement | null {
    const [first] = this.mapping?.strangers ?? [];
    if (first === undefined) return null;
    const go = (): void => {
      (document.getElementById("choose-columns") as HTMLDetailsElement).open = true;
      this.mapping?.names.focus(first);
    };
    return h("p", {}, h("button", { type: "button", id: "name-wheels", click: go }, "Assign the wheels"));
  }

  private async queue(kind: string, wanted: Record<string, unknown>, output: string): Promise<void> {
    const replace = this.items.some((item) => item.path === output);
    if (this.queueing || (replace && !confirm(`Replace ${output}?`))) return;
    this.queueing = true; // a second click would ask for the same file again
    const job = await tried(() => send<Job>("POST", `jobs/${kind}`, { ...wanted, output, replace }), "job");
    this.queueing = false;
    if (!job) return;
    this.jobs.update(job);
    if (kind === "estimate") this.proposeOutput();
  }

  /** A name for a new file: neither of the folder, nor what a job will write. */
  private free(name: string, ending: string): string {
    return freeName([...this.items, ...this.jobs.pending], name, ending);
  }

  private proposeOutput(): void {
    const output = document.getElementById("wizard-output") as HTMLInputElement | null;
    if (output) output.value = this.free(`${stemOf(this.log)}-estimates`, ".parquet");
  }

  /** As `drawNext`, of the estimates as they are now. */
  private async offerNext(): Promise<void> {
    const path = this.estimates;
    const about = path ? await tried(() => get<Run>("drive", { path })) : undefined;
    this.hasAdhesion = about?.columns.some((name) => name.startsWith("adhesion_")) ?? this.hasAdhesion; // a request that failed says nothing
    onceReleased(this.next, () => this.drawNext());
  }

  /** What follows from the estimates; until there are any, what would. */
  private drawNext(): void {
    if (!this.estimates) {
      fill(this.next, h("p", { class: "hint" }, "After estimating: the drive on a page, the adhesion curve of the ground, where the ground changes, and a report."));
      return;
    }
    const old = document.getElementById("next-soil") as HTMLInputElement | null;
    const soil = h("input", { type: "text", id: "next-soil", value: old?.value ?? (this.hasLabels ? "" : "field"), placeholder: this.hasLabels ? "as labelled in the log" : "" });
    const stem = stemOf(this.log);
    const library = this.made.get("soils") ?? null;
    const ground = this.made.get("ground") ?? null;
    const runs = { estimates: [this.estimates] };
    const button = (kind: string, text: string, work: () => void): HTMLElement => {
      const path = this.made.get(kind);
      const view = path ? (kind === "ground" ? viewOf("estimates", this.estimates) : viewOf(kind, path)) : null; // a ground is seen on its drive
      const outside = view !== null && !view.startsWith("#");
      return h("li", {}, h("button", { type: "button", id: `next-${kind}`, click: work }, text), path ? (view ? h("a", { href: view, id: `see-${kind}`, target: outside ? "_blank" : null }, `See ${path}`) : h("span", { class: "good" }, path)) : null);
    };
    refill(this.next, [
      h("ul", { class: "next" },
        h("li", {}, h("a", { href: viewOf("estimates", this.estimates), id: "see-estimate" }, `See the drive: ${this.estimates}`)),
        ...(this.hasAdhesion
          ? [
              button("soils", "Learn the curve", () => void this.queue("soils", { ...runs, soil: soil.value.trim() || null }, this.free(`${stem}-soils`, ".json"))),
              h("li", { class: "of" }, h("label", { for: soil.id }, "for the ground named"), soil),
              button("ground", "Find changes of the ground", () => void this.queue("ground", { ...runs, library }, this.free(`${stem}-ground`, ".json"))),
            ]
          : [h("li", { class: "hint", id: "no-adhesion" }, "The log has no torque, so there is slip and no adhesion: no curve can be learned, and no change of the ground be found.")]),
        button("report", "Write the report", () => void this.queue("report", { ...runs, library, ground }, this.free(`${stem}-report`, ".html"))),
      ),
    ]);
  }

  /** Whether a job reads this log or its estimates. */
  private isOwn({ words }: Job): boolean {
    return words.includes(this.log) || words.includes(this.estimates);
  }

  /** What a job made of this log, now or before the page was opened; false where it made nothing of it that is still there. */
  private keep(job: Job): boolean {
    if (job.state !== "done" || !this.items.some((item) => item.path === job.output)) return false;
    if (job.kind === "estimate" && job.title === this.log) {
      this.estimates = job.output;
      this.made.clear(); // of the estimates before, perhaps by another vehicle
    } else if (job.words.includes(this.estimates)) this.made.set(job.kind, job.output);
    else return false;
    return true;
  }

  private async ended(job: Job): Promise<void> {
    await this.reload();
    if (!this.keep(job)) return;
    await this.offerNext();
    this.proposeOutput();
  }
}

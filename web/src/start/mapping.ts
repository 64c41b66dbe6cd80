/** The columns of a foreign log, and which channel each becomes: proposals with their reason, unit, sign and a small plot. */

import { get, send } from "../ui/api";
import { fill, h, working } from "../ui/dom";
import { note, tried } from "../ui/notes";
import { numberField } from "../ui/number";
import { chosenByHand, plot, rangeOf, type Column } from "./column";
import { draftOf, keepDraft } from "./draft";
import { WheelNames } from "./wheels";

type Entry = Record<string, unknown>;

interface Proposal {
  entry: Entry;
  columns: string[];
  unit: string | null;
  confidence: number;
  evidence: string[];
  doubt: string;
  give: string;
}

interface Channel {
  name: string;
  title: string;
  wheel: string;
  unit: string | null;
  proposals: Proposal[];
}

export interface Preview {
  kept: { time?: Entry; channels: Record<string, Entry> } | null; // what a profile chose
  unread: string; // why it cannot be read
  rows: number;
  ready: boolean;
  fitting: string[];
  refused: string;
  remarks: string[]; // of inspect, on the whole log: a unit of time that nobody stated, a second clock
  time: Entry | null;
  columns: Column[];
  channels: Channel[];
}

/** What a channel is made of now; `column` "" is nothing. A proposal of several columns has its own entry. */
interface Choice {
  column: string;
  entry: Entry;
}

/** What was chosen and not saved yet: of the log with these rows and columns, from the choice of this profile on. */
interface Draft {
  of: string;
  profile: string;
  chosen: [string, Choice][];
  time: Entry | null;
  names: [string, string][];
}

export const SIGNALS = { torque: "drive_torque_", wheels: "wheel_speed_" };

export class Mapping {
  readonly element = h("div", { class: "mapping" });
  private preview: Preview | undefined;
  private chosen = new Map<string, Choice>();
  private rows = new Map<string, HTMLElement>();
  private readonly refused = h("p", { class: "bad" });
  private wheels: string[] = [];
  private own = ""; // the profile written by this page, which it may overwrite
  private kept = new Map<string, Choice>(); // what the profile has that the choice began with
  private profile = "";
  private turn = 0;
  private began = ""; // the choice as it was opened or saved
  readonly names = new WheelNames(() => this.nameRows());

  constructor(
    private log: string,
    private saved: (profile: string) => void,
  ) {
    for (const event of ["change", "click"]) this.element.addEventListener(event, () => this.keep());
  }

  private keep(): void {
    if (!this.preview) return;
    const draft: Draft = { of: contents(this.preview), profile: this.profile, chosen: [...this.chosen], time: this.preview.time, names: [...this.names.given] };
    keepDraft(this.log, draft);
  }

  /** Whether the choice differs from what the profile has, or from what was proposed. */
  get isUnsaved(): boolean {
    return this.state() !== this.began;
  }

  private state(): string {
    return JSON.stringify([[...this.chosen].sort(), this.preview?.time, [...this.names.given]]);
  }

  /** Give up what was not saved. */
  forget(): void {
    keepDraft(this.log, null);
  }

  /** Go on with what was not saved; whether there was such a thing. */
  private takeUp(preview: Preview): boolean {
    const draft = draftOf<Draft>(this.log);
    if (!draft || draft.of !== contents(preview) || draft.profile !== this.profile) return false;
    this.chosen = new Map(draft.chosen);
    preview.time = draft.time;
    this.names.given = new Map(draft.names);
    return true;
  }

  /** Preview the log, with the choice that a `profile` has, else what is proposed; `output` is the profile to write in place of it. */
  async open(output: string, profile = ""): Promise<Preview | undefined> {
    const turn = ++this.turn;
    fill(this.element, working("Reading the log …"));
    try {
      const preview = await get<Preview>("columns", { path: this.log, profile: profile || undefined });
      if (turn !== this.turn) return this.preview; // another profile was chosen meanwhile
      this.preview = preview;
    } catch (error) {
      fill(this.element, h("p", { class: "bad", role: "alert" }, error instanceof Error ? error.message : String(error)));
      return undefined;
    }
    const kept = this.preview.kept;
    this.profile = kept ? profile : "";
    this.chosen.clear();
    this.kept.clear();
    for (const channel of this.preview.channels) {
      const best = channel.proposals[0];
      const entry = kept?.channels[channel.name];
      if (entry) this.take(channel, entry);
      else if (best && !kept) this.chosen.set(channel.name, { column: keyOf(best), entry: entryOf(best) });
    }
    this.wheels = [...new Set(this.preview.channels.map((channel) => channel.wheel).filter(Boolean))];
    if (!this.wheels.length && !this.chosen.has("wheel_based_speed")) this.addWheels(["fl", "fr", "rl", "rr"]);
    if (kept?.time) this.preview.time = kept.time;
    const { unread } = this.preview;
    const hint = this.profile ? `The choice saved in ${this.profile}.` : unread ? `${unread}. These are the proposals.` : profile ? `${profile} has more than a choice of columns. These are the proposals.` : "Assign the columns. The likeliest is chosen, with its reason; check those marked “?”.";
    this.began = this.state();
    const unsaved = this.takeUp(this.preview);
    this.names.of(this.preview.channels);
    this.draw(this.profile || output, unsaved ? "Your choice as you left it, not saved yet." : hint);
    return this.preview;
  }

  /** Choose what the profile has for a channel: a proposal, a column, or what it makes of several. */
  private take(channel: Channel, entry: Entry): void {
    const proposal = channel.proposals.find((one) => entry.from !== undefined && one.entry.from === entry.from);
    const column = proposal ? keyOf(proposal) : typeof entry.from === "string" ? entry.from : `as in ${this.profile}`;
    this.kept.set(channel.name, { column, entry });
    this.chosen.set(channel.name, { column, entry: { ...entry } });
  }

  /** Wheels and axles of the log that the vehicle does not have. */
  get strangers(): string[] {
    return this.names.strangers((channel) => this.chosen.has(channel));
  }

  private nameRows(): void {
    for (const channel of this.preview?.channels ?? []) {
      const label = this.rows.get(channel.name)?.querySelector(".channel");
      if (label) label.textContent = this.titleOf(channel);
    }
  }

  private titleOf(channel: Channel): string {
    return channel.wheel ? `${this.names.nameOf(channel.wheel)}: ${channel.title}` : channel.title;
  }

  /** What the chosen channels measure, in the vehicle maker's terms. */
  get signals(): string {
    const names = [...this.chosen.keys()];
    if (names.some((name) => name.startsWith(SIGNALS.torque))) return "torque";
    return names.some((name) => name.startsWith(SIGNALS.wheels)) ? "wheel-speeds" : "bus-speed";
  }

  private addWheels(wheels: string[]): void {
    const extra = wheels.flatMap((wheel) => [
      { name: `wheel_speed_${wheel}`, title: "turning speed", wheel, unit: "rad/s", proposals: [] },
      { name: `drive_torque_${wheel}`, title: "drive torque, at the wheel", wheel, unit: "N m", proposals: [] },
    ]);
    this.preview?.channels.unshift(...extra);
    this.wheels.push(...wheels);
  }

  private draw(output: string, hint: string): void {
    const preview = this.preview as Preview;
    const name = h("input", { type: "text", id: "profile-output", value: output });
    const use = h("button", { type: "button", class: "primary", id: "use-columns", click: () => void this.save(name.value.trim()) }, "Use these columns");
    const needed = preview.channels.filter((channel) => channel.wheel || this.chosen.has(channel.name) || ["ground_speed", "wheel_based_speed", "drawbar_force"].includes(channel.name));
    const other = preview.channels.filter((channel) => !needed.includes(channel));
    this.sayRefused();
    fill(
      this.element,
      this.refused,
      h("p", { class: "hint" }, hint),
      preview.remarks.map((text) => h("p", { class: "hint" }, text)),
      this.names.element,
      this.timeRow(preview),
      h("div", { class: "map-rows", role: "group", "aria-label": "Channels" }, needed.map((channel) => this.row(channel))),
      h("details", {}, h("summary", {}, `${other.length} more channels that help, if the log has them`), h("div", { class: "map-rows" }, other.map((channel) => this.row(channel)))),
      h("div", { class: "row" }, h("label", { for: name.id }, "Save as"), name, use),
    );
  }

  /** What the log lacked as it was proposed, until a speed of the wheels is chosen. */
  private sayRefused(): void {
    const refused = this.preview?.refused && this.signals === "bus-speed" && !this.chosen.has("wheel_based_speed") ? this.preview.refused : "";
    fill(this.refused, refused ? `This log ${refused}. If it has a wheel's speed by another name, choose it.` : null);
  }

  private timeRow(preview: Preview): HTMLElement {
    const time = preview.time ?? { from: "" };
    const isOwn = Boolean(time.from) && !preview.columns.some((column) => column.name === time.from); // each signal was stamped: MATLAB, CAN, ROS
    const select = h("select", { id: "time-column" }, isOwn ? h("option", { value: String(time.from), selected: true }, "the log's own times") : h("option", { value: "" }, "– choose –"), preview.columns.filter((column) => column.kind !== "text").map((column) => h("option", { value: column.name, selected: column.name === time.from }, column.name)));
    const unit = h("input", { type: "text", id: "time-unit", class: "unit", value: String(time.unit ?? "s"), "aria-label": "Unit of the time" });
    const why = h("p", { class: "why hint" }, isOwn ? "each signal has its times in the log" : preview.time ? "runs forward" : "No column looks like time: choose it.");
    const update = (): void => {
      preview.time = { ...(preview.time ?? {}), from: select.value };
      if (unit.value.trim() && unit.value.trim() !== "s") preview.time.unit = unit.value.trim();
      else delete preview.time.unit;
    };
    select.addEventListener("change", () => {
      const column = preview.columns.find((one) => one.name === select.value);
      unit.value = column?.unit ?? "s"; // not that of the column before
      why.textContent = column ? chosenByHand(column, "s") : "";
      update();
    });
    unit.addEventListener("change", update);
    return h("div", { class: "map-row" }, h("label", { for: select.id, class: "channel" }, "time"), select, unit, h("span"), h("span"), why);
  }

  private row(channel: Channel): HTMLElement {
    const box = h("div", { class: "map-row", "data-channel": channel.name });
    this.rows.set(channel.name, box);
    this.fillRow(channel, box);
    return box;
  }

  private fillRow(channel: Channel, box: HTMLElement): void {
    const preview = this.preview as Preview;
    const choice = this.chosen.get(channel.name);
    const proposal = channel.proposals.find((one) => keyOf(one) === choice?.column);
    const select = h("select", { id: `column-${channel.name}` }, h("option", { value: "" }, "– none –"));
    if (channel.proposals.length) {
      const group = h("optgroup", { label: "Likely" });
      for (const one of channel.proposals) group.append(option(keyOf(one), `${one.doubt || one.give ? "? " : ""}${keyOf(one)}`, keyOf(one) === choice?.column));
      select.append(group);
    }
    const likely = new Set(channel.proposals.map(keyOf));
    const kept = this.kept.get(channel.name);
    if (kept && !likely.has(kept.column)) {
      select.append(option(kept.column, kept.column, kept.column === choice?.column));
      likely.add(kept.column);
    }
    const rest = preview.columns.filter((column) => !likely.has(column.name) && column.kind === (channel.name === "soil" ? "text" : "number"));
    const group = h("optgroup", { label: "Any other column" });
    for (const column of rest) group.append(option(column.name, column.name, column.name === choice?.column));
    select.append(group);
    select.addEventListener("change", () => {
      this.choose(channel, select.value);
      this.sayRefused();
      this.fillRow(channel, box);
      document.getElementById(select.id)?.focus();
    });
    const column = preview.columns.find((one) => one.name === (proposal?.columns[0] ?? choice?.column));
    fill(
      box,
      h("label", { for: select.id, class: "channel" }, this.titleOf(channel)),
      select,
      choice && channel.unit ? this.unit(channel, choice, proposal, column) : h("span"),
      choice && channel.unit ? this.sign(channel, choice) : h("span"),
      column ? plot(column, choice?.entry.sign === -1) : h("span"),
      h("p", { class: "why hint" }, reason(choice, proposal, column, channel.unit, choice && kept?.column === choice.column ? this.profile : "")),
    );
  }

  private unit(channel: Channel, choice: Choice, proposal: Proposal | undefined, column: Column | undefined): HTMLElement {
    const field = h("input", { type: "text", class: "unit", value: String(choice.entry.unit ?? proposal?.unit ?? column?.unit ?? channel.unit ?? ""), "aria-label": `Unit of ${channel.name}` });
    field.addEventListener("change", () => {
      if (field.value.trim()) choice.entry.unit = field.value.trim();
      else delete choice.entry.unit;
    });
    if (!proposal?.give && choice.entry.scale === undefined) return field;
    const known = choice.entry.scale ?? (this.kept.get(channel.name)?.column === choice.column ? 1 : "");
    const placeholder = String(proposal?.entry.scale ?? "");
    const scale = numberField({ class: "unit", value: String(known), placeholder, required: true, "aria-label": `Scale of ${channel.name}` }, (typed) => (choice.entry.scale = typed));
    return h("span", { class: "two" }, h("span", {}, "×"), scale, field);
  }

  private sign(channel: Channel, choice: Choice): HTMLElement {
    const turned = choice.entry.sign === -1;
    const button = h("button", { type: "button", class: "sign", "aria-pressed": String(turned), "aria-label": `Change the sign of ${channel.name}`, title: "Change the sign" }, turned ? "−" : "+");
    button.addEventListener("click", () => {
      if (choice.entry.sign === -1) delete choice.entry.sign;
      else choice.entry.sign = -1;
      const box = this.rows.get(channel.name) as HTMLElement;
      this.fillRow(channel, box);
      box.querySelector<HTMLElement>(".sign")?.focus();
    });
    return button;
  }

  private choose(channel: Channel, column: string): void {
    if (!column) {
      this.chosen.delete(channel.name);
      return;
    }
    const proposal = channel.proposals.find((one) => keyOf(one) === column);
    const unit = this.preview?.columns.find((one) => one.name === column)?.unit;
    const kept = this.kept.get(channel.name);
    const entry = kept?.column === column ? { ...kept.entry } : proposal ? entryOf(proposal) : { from: column, ...(unit && channel.unit ? { unit } : {}) };
    this.chosen.set(channel.name, { column, entry });
    this.release(channel, column);
  }

  /** A doubtful proposal of another quantity gives up the column that was chosen for `channel`. */
  private release(channel: Channel, column: string): void {
    for (const other of this.preview?.channels ?? []) {
      const isGuess = other.proposals.some((one) => one.doubt !== "" && keyOf(one) === column) && this.chosen.get(other.name)?.column === column;
      if (!isGuess || other.title === channel.title) continue;
      this.chosen.delete(other.name);
      const box = this.rows.get(other.name);
      if (box) this.fillRow(other, box);
    }
  }

  private async save(output: string): Promise<void> {
    const twice = this.names.twice();
    if (twice) {
      note(`${twice.join(" and ")} have the same name: ${this.names.nameOf(twice[0])}. Each must be a different wheel or axle.`, "error");
      this.names.focus(twice[1]);
      return;
    }
    const wrong = this.element.querySelector<HTMLInputElement>("input:invalid");
    if (wrong) {
      wrong.closest("details:not([open])")?.setAttribute("open", "");
      wrong.reportValidity();
      return;
    }
    const isOld = output === this.profile && output !== this.own;
    if (isOld && !confirm(`Replace ${output}?`)) return;
    const named = new Map(this.preview?.channels.map((channel) => [channel.name, this.names.channel(channel)]));
    const channels = Object.fromEntries([...this.chosen].map(([name, choice]) => [named.get(name) ?? name, choice.entry]));
    const wanted = { log: this.log, output, time: this.preview?.time ?? { from: "time" }, channels, replace: isOld || output === this.own };
    const kept = await tried(() => send<{ path: string }>("POST", "profile", wanted), "columns");
    if (!kept) return;
    this.own = this.profile = kept.path;
    this.began = this.state();
    this.forget();
    this.saved(kept.path);
  }
}

function contents(preview: Preview): string {
  return [preview.rows, ...preview.columns.map((column) => column.name)].join("\n");
}

function option(value: string, text: string, selected: boolean): HTMLElement {
  return h("option", { value, selected }, text);
}

/** What a proposal makes of a channel; not the scale that only the user can know. */
function entryOf({ entry, give }: Proposal): Entry {
  const { scale, ...rest } = entry;
  return give ? rest : { ...entry };
}

/** What a proposal is called: its column, or what is made of several. */
function keyOf(proposal: Proposal): string {
  return proposal.columns.length === 1 && "from" in proposal.entry ? (proposal.columns[0] as string) : `from ${proposal.columns.join(", ")}`;
}

function reason(choice: Choice | undefined, proposal: Proposal | undefined, column: Column | undefined, unit: string | null, profile: string): string {
  if (!choice) return "";
  const range = rangeOf(column);
  if (profile) return `as saved in ${profile}${range && `; ${range}`}`;
  if (!proposal) return chosenByHand(column, unit);
  const words = [...proposal.evidence, ...(proposal.doubt && !proposal.evidence.includes(proposal.doubt) ? [`? ${proposal.doubt}`] : []), ...(proposal.give ? [`? ${proposal.give}`] : [])];
  return `${Math.round(100 * proposal.confidence)} %: ${words.join("; ").replace(/\?$/, "")}. ${range}`;
}

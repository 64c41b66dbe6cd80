/** Thresholds that ring: slip and grip over a limit, a warning, a source that falls silent. Set once in a browser. */

import { digits, fill, h } from "../ui/dom";
import { numberField } from "../ui/number";
import { fixed, onUnits, unitFor, withUnit } from "../ui/units";
import { STANDING, WARNING, type Reading } from "./numbers";

const KEY = "terragrip-alarms";
/** Seconds between two rings while it lasts; and of one ring. */
const [EVERY, LENGTH] = [1, 0.25];

/** Limits in per cent, whatever unit is shown. */
interface Settings {
  slip: number | null;
  grip: number | null;
  sound: boolean;
}

function kept(): Settings {
  const none = { slip: null, grip: null, sound: false };
  try {
    return { ...none, ...(JSON.parse(localStorage.getItem(KEY) ?? "{}") as Partial<Settings>) };
  } catch {
    return none; // written by something else
  }
}

export class Alarms {
  /** What is over its limit now. */
  readonly element = h("p", { class: "alarm", role: "alert", hidden: true });
  readonly settings = h("details", { class: "chooser", id: "alarms" });
  /** Rings so far. */
  rings = 0;
  private set = kept();
  private audio: AudioContext | null = null;
  private rang = -Infinity;
  private causes = "";
  private blind = ""; // limits that nothing can be compared with
  private isSilent = false;
  private mute = h("span", { class: "bad" });
  private forget = onUnits(() => this.draw());

  constructor() {
    this.draw();
    if (this.set.sound) void this.open();
  }

  close(): void {
    this.forget();
    void this.audio?.close();
  }

  /** Check the newest measured row. */
  check(now: Reading, event: string): void {
    const unit = unitFor("share");
    const over = (name: string, value: number, limit: number | null): string | false =>
      limit !== null && 100 * value > limit && `${name} ${withUnit(fixed(value, unit), unit)} is over ${withUnit(digits((limit / 100) * unit.scale), unit)}`;
    const causes = [over("Slip", now.slip.value, this.set.slip), over("Grip in use", now.grip.value, this.set.grip)].filter((one) => one !== false);
    const isBlind = this.set.slip !== null && Number.isNaN(now.slip.value) && Math.abs(now.speed.value) > STANDING;
    this.blind = isBlind ? "Slip is not known: its alarm cannot sound" : "";
    this.show(causes.join("; "), false);
    if (this.causes || event in WARNING) this.ring(880);
  }

  /** The source has fallen silent, or speaks again. What was over its limit in the last measured row stays, as that. */
  silent(is: boolean): void {
    this.show(this.causes, is);
    if (is) this.ring(440);
    this.isSilent = is;
  }

  private show(causes: string, isOld: boolean): void {
    this.causes = causes;
    const text = [causes && isOld ? `${causes} in the last measurement` : causes, this.blind].filter(Boolean).join("; ");
    if (this.element.textContent !== text) fill(this.element, text);
    this.element.hidden = !text;
  }

  private ring(pitch: number): void {
    const now = performance.now() / 1000;
    if (now - this.rang < EVERY && !(pitch === 440 && !this.isSilent)) return;
    this.rang = now;
    this.rings++;
    this.showMuted();
    if (!this.set.sound || !this.audio || this.audio.state !== "running") return;
    const tone = this.audio.createOscillator();
    const volume = this.audio.createGain();
    tone.frequency.value = pitch;
    volume.gain.value = 0.3;
    tone.connect(volume).connect(this.audio.destination);
    tone.start();
    tone.stop(this.audio.currentTime + LENGTH);
  }

  private async open(): Promise<void> {
    this.audio ??= new AudioContext();
    this.audio.onstatechange = () => this.showMuted();
    this.showMuted();
    await this.audio.resume(); // waits for a click where the browser wants one
  }

  /** A browser is mute until someone has clicked the page: that is said, so that nobody relies on it. */
  private showMuted(): void {
    this.mute.textContent = this.set.sound && this.audio?.state !== "running" ? "No sound yet: click or tap anywhere." : "";
    if (this.mute.textContent) addEventListener("pointerdown", () => void this.audio?.resume(), { once: true });
  }

  private draw(): void {
    const unit = unitFor("share");
    const shown = unit.scale / 100;
    const limit = (name: "slip" | "grip", label: string): HTMLElement => {
      const value = this.set[name] === null ? "" : digits(this.set[name] * shown, 6);
      const field = numberField({ id: `alarm-${name}`, least: 0, most: 1000 * shown, value }, (typed) => {
        this.set[name] = Number.isFinite(typed) ? typed / shown : null;
        this.keep();
      });
      return h("label", { class: "field" }, `${label} [${unit.name}]`, field);
    };
    const sound = h("input", { type: "checkbox", id: "alarm-sound", checked: this.set.sound });
    sound.addEventListener("change", () => {
      this.set.sound = sound.checked;
      this.keep();
      if (sound.checked) void this.open();
      else this.showMuted();
    });
    fill(
      this.settings,
      h("summary", {}, "Alarms"),
      h(
        "div",
        { class: "menu" },
        limit("slip", "Slip above"),
        limit("grip", "Grip above"),
        h("label", { class: "check" }, sound, "Sound (also on warnings, and when the source stops)"),
        this.mute,
      ),
    );
  }

  private keep(): void {
    localStorage.setItem(KEY, JSON.stringify(this.set));
  }
}

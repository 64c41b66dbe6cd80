/** The set-point of slip that a live service publishes: advice, and said to be no more. */

import { digits, fill, h } from "../ui/dom";
import { onUnits, unitFor, withUnit } from "../ui/units";

export interface Setpoint {
  state: "follow" | "slow" | "stop";
  why: string;
  slip: number;
  speed: number;
  wheel_speed: Record<string, number>;
}

export class SetpointLine {
  readonly element = h("p", { class: "setpoint", id: "setpoint", hidden: true });
  private last: Setpoint | null = null;
  readonly close = onUnits(() => this.last && this.show(this.last));

  show(given: Setpoint | null): void {
    this.last = given;
    this.element.hidden = given === null;
    if (!given) return;
    const [rotation, share] = [unitFor("rotation"), unitFor("share")];
    const speeds = Object.entries(given.wheel_speed).map(([wheel, speed]) => `${wheel} ${(rotation.scale * speed).toFixed(rotation.decimals)}`);
    const slip = withUnit(digits(share.scale * given.slip, 3), share);
    fill(this.element, h("strong", {}, "Set-point, advice only: "), `${given.state}${given.why ? ` (${given.why})` : ""}, slip up to ${slip}; wheels ${speeds.join(", ")} ${rotation.name}`);
  }
}

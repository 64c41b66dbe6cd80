/** The times that were shown before, to go back to. */

import type { Range } from "./gestures";

/** A view counts once it has stood so long [ms]: a zoom by the wheel is one step. */
const SETTLED = 400;
const DEEP = 100;

export class Views {
  private past: Range[] = [];
  private future: Range[] = [];
  private now: Range | null = null;
  private waiting: Range | null = null;
  private timer = 0;
  private moving = false;

  /** `show` applies a view; `changed` is called when the history changes. */
  constructor(
    private show: (range: Range) => void,
    private changed: () => void,
  ) {}

  get canBack(): boolean {
    return this.past.length > 0;
  }

  get canForward(): boolean {
    return this.future.length > 0;
  }

  /** Begin with a run. */
  start(range: Range): void {
    clearTimeout(this.timer);
    this.waiting = null;
    [this.past, this.future, this.now] = [[], [], [...range]];
    this.changed();
  }

  /** Other times are shown. */
  seen(range: Range): void {
    if (this.moving) return;
    clearTimeout(this.timer);
    this.waiting = [...range];
    this.timer = window.setTimeout(() => this.settleNow(), SETTLED);
  }

  back(): void {
    this.settleNow();
    this.go(this.past, this.future);
  }

  forward(): void {
    this.go(this.future, this.past);
  }

  close(): void {
    clearTimeout(this.timer);
  }

  private settle(range: Range): void {
    this.waiting = null;
    if (this.now && range.join() !== this.now.join()) {
      this.past.push(this.now);
      if (this.past.length > DEEP) this.past.shift();
      this.future = [];
    }
    this.now = range;
    this.changed();
  }

  private settleNow(): void {
    if (!this.waiting) return;
    clearTimeout(this.timer);
    this.settle(this.waiting);
  }

  private go(from: Range[], to: Range[]): void {
    const next = from.pop();
    if (!next) return;
    if (this.now) to.push(this.now);
    this.now = next;
    this.moving = true;
    this.show(next);
    this.moving = false;
    this.changed();
  }
}

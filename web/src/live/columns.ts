/** A column of the ring by columns of pixels: minutes at 100 Hz are more rows than pixels, and a line through them would cost a frame. */

import { RING, type Ring } from "./feed";

/** What a column of pixels holds: no row, values, or only rows whose value is not known or not asked for. */
const enum Holds {
  Nothing,
  Values,
  Gap,
}

/** The part of the ring that is shown: from `first` of its rows, between two times [s], over so many pixels of the screen. */
export interface Window {
  first: number;
  begin: number;
  end: number;
  pixels: number;
}

export class Columns {
  private low = new Float64Array(0);
  private high = new Float64Array(0);
  private holds = new Uint8Array(0);
  private pixels = 0;
  /** Rows of the window. */
  rows = 0;
  least = Infinity;
  most = -Infinity;

  /** Add one column's rows, those measured (0) or those predicted (1). */
  take(ring: Ring, values: Float64Array, predicted: 0 | 1, { first, begin, end, pixels }: Window): void {
    if (this.low.length < pixels) [this.low, this.high, this.holds] = [new Float64Array(pixels), new Float64Array(pixels), new Uint8Array(pixels)];
    const { low, high, holds } = this;
    holds.fill(Holds.Nothing, 0, pixels);
    [this.pixels, this.rows, this.least, this.most] = [pixels, 0, Infinity, -Infinity];
    const scale = pixels / (end - begin);
    const { count, time } = ring;
    for (let i = first, at = ring.place(first); i < count; i++, at = at + 1 === RING ? 0 : at + 1) {
      const t = time[at] as number;
      if (t > end) break;
      this.rows++;
      const c = Math.min(Math.max(Math.floor((t - begin) * scale), 0), pixels - 1);
      const v = values[at] as number;
      if (v !== v || ring.predicted[at] !== predicted) {
        if (holds[c] === Holds.Nothing) holds[c] = Holds.Gap;
        continue;
      }
      if (holds[c] !== Holds.Values) {
        holds[c] = Holds.Values;
        low[c] = high[c] = v;
      } else if (v < (low[c] as number)) low[c] = v;
      else if (v > (high[c] as number)) high[c] = v;
      if (v < this.least) this.least = v;
      if (v > this.most) this.most = v;
    }
  }

  /** Fill each column of pixels from its smallest to its largest value, joined to the one before; `x`: the first pixel, `y`: of a value,
   * `least`: the height of a column at least, `dots`: only so many pixels of twice as many. All in pixels of the screen. */
  draw(pen: CanvasRenderingContext2D, x: number, y: (value: number) => number, least: number, dots = 0): void {
    let [above, below] = [NaN, NaN]; // of the column before
    for (let c = 0; c < this.pixels; c++) {
      if (this.holds[c] === Holds.Gap) [above, below] = [NaN, NaN];
      if (this.holds[c] !== Holds.Values) continue;
      const [top, bottom] = [y(this.high[c] as number), y(this.low[c] as number)];
      const from = top > below ? below : top;
      const to = bottom < above ? above : bottom;
      [above, below] = [top, bottom];
      let width = 1;
      while (c + width < this.pixels && this.holds[c + width] === Holds.Nothing && width < 4) width++;
      if (dots && c % (2 * dots) >= dots) continue;
      const more = Math.max(least - (to - from), 0);
      pen.fillRect(x + c, from - more / 2, width, to - from + more);
    }
  }
}

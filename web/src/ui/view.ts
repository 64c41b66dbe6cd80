/** The part of the plane that is shown, its place on the screen, and round ticks. */

export interface Range {
  low: number;
  high: number;
}

export class View {
  left = 56;
  right = 14;
  top = 12;
  bottom = 44;

  constructor(
    public x: Range = { low: 0, high: 0.7 },
    public y: Range = { low: 0, high: 0.8 },
    public width = 800,
    public height = 500,
  ) {}

  /** The part of the screen inside the axes. */
  get box(): { x: number; y: number; width: number; height: number } {
    return { x: this.left, y: this.top, width: this.width - this.left - this.right, height: this.height - this.top - this.bottom };
  }

  px(x: number): number {
    return this.left + ((x - this.x.low) / (this.x.high - this.x.low)) * (this.width - this.left - this.right);
  }

  py(y: number): number {
    return this.height - this.bottom - ((y - this.y.low) / (this.y.high - this.y.low)) * (this.height - this.top - this.bottom);
  }

  x_of(px: number): number {
    return this.x.low + ((px - this.left) / (this.width - this.left - this.right)) * (this.x.high - this.x.low);
  }

  y_of(py: number): number {
    return this.y.low + ((this.height - this.bottom - py) / (this.height - this.top - this.bottom)) * (this.y.high - this.y.low);
  }

  inside(px: number, py: number): boolean {
    return px >= this.left && px <= this.width - this.right && py >= this.top && py <= this.height - this.bottom;
  }

  /** Magnify by `factor` about a point of the screen. */
  zoom(factor: number, px: number, py: number): void {
    const x = this.x_of(px);
    const y = this.y_of(py);
    this.x = { low: x + (this.x.low - x) * factor, high: x + (this.x.high - x) * factor };
    this.y = { low: y + (this.y.low - y) * factor, high: y + (this.y.high - y) * factor };
  }

  pan(dx: number, dy: number): void {
    const x = this.x_of(0) - this.x_of(dx);
    const y = this.y_of(0) - this.y_of(dy);
    this.x = { low: this.x.low + x, high: this.x.high + x };
    this.y = { low: this.y.low + y, high: this.y.high + y };
  }
}

/** Round numbers within a range, about `count` of them. */
export function ticks({ low, high }: Range, count: number): number[] {
  const rough = (high - low) / Math.max(count, 1);
  if (!(rough > 0) || !Number.isFinite(rough)) return [];
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= rough) ?? 10 * power;
  const found: number[] = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + step * 1e-9; i++) found.push(Number((i * step).toPrecision(12)));
  return found.length < 2 && count < 16 ? ticks({ low, high }, 2 * count) : found; // one number gives no scale
}

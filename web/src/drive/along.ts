/** What runs are drawn over: time as recorded, time since the start, distance driven; and the way between time and place on it. */

import { get } from "../ui/api";
import { lapse, timeAxis, type TimeAxis } from "../ui/clock";
import { columns } from "../ui/columns";
import type { Range } from "./gestures";
import type { Run } from "./run";

export type Axis = "time" | "elapsed" | "distance";

/** Heading of each axis, and its unit. */
export const AXES: Record<Axis, { title: string; unit: string }> = {
  time: { title: "time", unit: "s" },
  elapsed: { title: "time since start", unit: "s" },
  distance: { title: "distance", unit: "m" },
};

/** A run that is shown: the first is the main one, the others lie over it. */
export interface Layer {
  path: string;
  run: Run;
  /** A short name that distinguishes it from the others. */
  label: string;
  way: Way;
  /** By formula: why this run cannot be given it; null where it can. */
  faults?: Map<string, string | null>;
}

/** The value at `x` of a line through points that ascend; their ends beyond them. */
export function between(xs: ArrayLike<number>, ys: ArrayLike<number>, x: number): number {
  let [low, high] = [0, xs.length - 1];
  if (high < 0) return NaN;
  if (x <= (xs[0] as number)) return ys[0] as number;
  if (x >= (xs[high] as number)) return ys[high] as number;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if ((xs[middle] as number) <= x) low = middle;
    else high = middle;
  }
  const [a, b] = [xs[low] as number, xs[high] as number];
  const share = b > a ? (x - a) / (b - a) : 0;
  return (ys[low] as number) + share * ((ys[high] as number) - (ys[low] as number));
}

interface Points {
  time: ArrayLike<number>;
  place: ArrayLike<number>;
}

/** The way of one run between time and its place on the axis. */
export class Way {
  private rows: Points | null = null;

  constructor(
    readonly axis: Axis,
    private run: Run,
    /** Of distance: some rows of the whole run. */
    private coarse: Points | null = null,
  ) {}

  /** Rows at hand, finer than those of the whole run. */
  fine(rows: Points | null): void {
    this.rows = rows?.time.length ? rows : null;
  }

  get whole(): Range {
    return [this.place(this.run.start), this.place(this.run.end)];
  }

  place(time: number): number {
    if (this.axis === "time") return time;
    if (this.axis === "elapsed") return time - this.run.start;
    return this.of("time", "place", time);
  }

  time(place: number): number {
    if (this.axis === "time") return place;
    if (this.axis === "elapsed") return place + this.run.start;
    return this.of("place", "time", place);
  }

  /** Marks of the axis where it is of minutes and hours, or of the time of day; null where it is one of plain numbers. */
  get marked(): TimeAxis | null {
    return this.axis === "distance" ? null : timeAxis(this.run, this.axis === "time");
  }

  /** A place on the axis, for the reader. */
  said(place: number): string {
    return this.axis === "distance" ? `${place.toFixed(2)} m` : lapse(this.run, place);
  }

  private of(from: keyof Points, to: keyof Points, at: number): number {
    const { rows } = this;
    const inside = rows && at >= (rows[from][0] as number) && at <= (rows[from][rows[from].length - 1] as number);
    const points = inside ? rows : this.coarse;
    return points ? between(points[from], points[to], at) : NaN;
  }
}

/** A run as a layer; raises the server's message where it cannot be read or has no such axis. */
export async function layerOf(path: string, axis: Axis, run?: Run): Promise<Layer> {
  const about = run ?? (await get<Run>("drive", { path }));
  let coarse: Points | null = null;
  if (axis === "distance") {
    const { data } = await columns("drive/way", { path, axis, version: about.version }, []);
    coarse = { time: data[0] as Float64Array, place: data[1] as Float64Array };
  }
  return { path, run: about, label: path, way: new Way(axis, about, coarse) };
}

/** Short names that distinguish paths: without the suffix, and without the folders and last words that all share. */
export function shortNames(paths: string[]): string[] {
  const parts = paths.map((path) => path.replace(/\.parquet$/, "").split(/(?<=[/_-])/));
  const same = (pick: (one: string[]) => string | undefined): boolean => parts.length > 1 && parts.every((one) => one.length > 1 && pick(one) === pick(parts[0] as string[]));
  while (same((one) => (one[0]?.endsWith("/") ? one[0] : undefined)) && parts[0]?.[0]?.endsWith("/")) parts.forEach((one) => one.shift());
  while (same((one) => one.at(-1))) parts.forEach((one) => one.pop());
  return parts.map((one) => one.join("").replace(/[/_-]$/, ""));
}

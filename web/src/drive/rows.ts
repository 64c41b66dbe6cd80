/** Rows from the server: a little more than is shown, fetched again only where they run out or are too coarse. */

import { columns } from "../ui/columns";
import { tried } from "../ui/notes";
import type { Layer } from "./along";
import type { Range } from "./gestures";
import type { Panel, Trace } from "./run";

/** Rows are fetched for more than is shown, this share of it on either side, so that a pan finds them there. */
const MARGIN = 0.5;
/** Rows fetched for more than so many times what is shown are too coarse. */
const COARSE = 3;
const MOST = 5000; // columns of pixels

export type Values = ArrayLike<number | null | undefined>;

/** A trace with its rows, in the unit that is shown: NaN where one is unknown. Where rows were cut, a bucket is two of them. */
export interface Drawn {
  trace: Trace;
  x: ArrayLike<number>;
  values: Values;
  low?: Values;
  high?: Values;
  cut: boolean;
}

interface Fetched {
  range: Range;
  cut: boolean;
  width: number;
  /** By layer: places, and columns by name. */
  layers: { x: Float64Array; cut: boolean; columns: Map<string, Float64Array> }[];
}

export class Rows {
  /** A file was replaced while it was open. */
  onReplaced: (() => void) | null = null;
  count = 0;
  private layers: Layer[] = [];
  private names: string[][] = [];
  private fetched: Fetched | null = null;
  private pending: AbortController | null = null;

  constructor(private arrived: () => void) {}

  show(layers: Layer[], panels: Panel[]): void {
    this.close();
    this.fetched = null;
    this.layers = layers;
    const asked = layers.map((layer) => new Set<string>(layer.way.axis === "distance" ? ["axis:time"] : []));
    for (const t of panels.flatMap((panel) => panel.traces)) {
      const names = asked[t.layer ?? 0]?.add(t.column);
      if (t.band) names?.add(`${t.band}:low`).add(`${t.band}:high`);
    }
    this.names = asked.map((names) => [...names]);
  }

  close(): void {
    this.pending?.abort();
    this.pending = null;
  }

  /** Whether the rows at hand are enough for what is shown. */
  private serve(shown: Range, whole: Range, width: number): boolean {
    const has = this.fetched;
    if (!has || has.width !== width) return false;
    const [low, high] = shown;
    const inside = has.range[0] <= Math.max(low, whole[0]) && has.range[1] >= Math.min(high, whole[1]);
    return inside && (!has.cut || has.range[1] - has.range[0] <= COARSE * (high - low));
  }

  /** Fetch rows for what is shown where those at hand do not do. */
  async need([low, high]: Range, whole: Range, width: number): Promise<void> {
    if (this.pending || !this.names.some((names) => names.length) || this.serve([low, high], whole, width)) return;
    const [start, end] = [Math.max(low - MARGIN * (high - low), whole[0]), Math.min(high + MARGIN * (high - low), whole[1])];
    const buckets = Math.min(Math.ceil((width * (end - start)) / (high - low)), MOST);
    const pending = (this.pending = new AbortController());
    const answers = await tried(async () => {
      try {
        return await Promise.all(
          this.layers.map(({ path, run, way }, i) => columns("drive/window", { path, start, end, width: buckets, version: run.version, axis: way.axis }, this.names[i]?.length ? this.names[i] : ["axis:time"], pending.signal)),
        );
      } catch (error) {
        if (error instanceof DOMException && error.name === "AbortError") return undefined;
        if (this.onReplaced && error instanceof Error && error.message.includes("was replaced since")) {
          this.onReplaced();
          return undefined;
        }
        throw error;
      }
    });
    if (this.pending !== pending) return; // other rows are asked for by now
    this.pending = null;
    if (!answers) return;
    const layers = answers.map(({ data, names, cut }) => ({ x: data[0] as Float64Array, cut, columns: new Map(names.map((name, i) => [name, data[i] as Float64Array])) }));
    this.fetched = { range: [start, end], cut: answers.some((one) => one.cut), width, layers };
    this.count = answers.reduce((sum, one) => sum + one.count, 0);
    layers.forEach(({ x, cut, columns: at }, i) => {
      const time = at.get("axis:time");
      if (!time) return;
      const starts = (_: number, k: number): boolean => !cut || k % 2 === 0; // where each bucket begins
      this.layers[i]?.way.fine({ time: time.filter(starts), place: x.filter(starts) });
    });
    this.arrived();
  }

  /** The traces of a panel with the rows at hand. */
  of(panel: Panel): Drawn[] {
    const found: Drawn[] = [];
    for (const trace of panel.traces) {
      const layer = this.fetched?.layers[trace.layer ?? 0];
      const values = layer?.columns.get(trace.column);
      if (!layer || !values) continue;
      const { x, cut, columns: at } = layer;
      const [low, high] = trace.band ? [at.get(`${trace.band}:low`), at.get(`${trace.band}:high`)] : [];
      found.push({ trace, x, cut, values: scaled(values, trace.scale), ...(low && high ? { low: scaled(low, trace.scale), high: scaled(high, trace.scale) } : {}) });
    }
    return found;
  }
}

const scaled = (values: Float64Array, scale: number): Float64Array => (scale === 1 ? values : values.map((v) => v * scale));

/** The rows of a range and one on either side: first, and one past the last. */
export function within(x: ArrayLike<number>, [low, high]: Range): [number, number] {
  return [Math.max(firstFrom(x, low) - 1, 0), Math.min(firstFrom(x, high) + 1, x.length)];
}

/** The first place in ascending numbers that is not below `wanted`. */
export function firstFrom(x: ArrayLike<number>, wanted: number): number {
  let [low, high] = [0, x.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if ((x[middle] as number) < wanted) low = middle + 1;
    else high = middle;
  }
  return low;
}

/** Curves as samples from the server, which alone has the models. */

import { send } from "../ui/api";

export type Parameters = Record<string, number>;

export interface Handle {
  name: "zero" | "rise" | "peak" | "level";
  slip: number;
  value: number;
}

export interface Samples {
  slip: number[];
  value: (number | null)[];
  /** Slip and value of the largest value, without an intercept. */
  peak: [number, number];
  /** Slope at zero slip. */
  initial_slope: number;
  /** Points of the curve that can be dragged. */
  handles: Handle[];
}

export interface Form {
  model: string;
  parameters: Parameters;
  /** Parameters that a drag leaves as they are. */
  held?: string[];
}

const keyOf = ({ model, parameters, held }: Form): string => JSON.stringify([model, parameters, held]);

export const sampled = ({ model, parameters, held }: Form): Promise<Samples> => send<Samples>("POST", "curve", { model, parameters, held });

/** Value at a slip, on straight lines between the samples; NaN beyond them. */
export function at(samples: Samples, slip: number): number {
  const { slip: grid, value } = samples;
  const last = grid.length - 1;
  const place = ((slip - (grid[0] ?? NaN)) / ((grid[last] ?? NaN) - (grid[0] ?? NaN))) * last;
  if (!(place >= -1e-9 && place <= last + 1e-9)) return NaN;
  const first = Math.min(Math.max(Math.floor(place + 1e-9), 0), last);
  const share = Math.max(place - first, 0);
  const low = value[first] ?? NaN;
  return share < 1e-9 ? low : low + share * ((value[first + 1] ?? NaN) - low);
}

/** Where two curves lie farthest apart over slips of 5 to 60 %: that slip, and the first's value less the second's. */
export function farthest(one: Samples, other: Samples): [number, number] {
  let found: [number, number] = [NaN, 0];
  one.slip.forEach((s, i) => {
    const off = (one.value[i] ?? NaN) - (other.value[i] ?? NaN);
    if (s > 0.0499 && s < 0.6001 && Math.abs(off) > Math.abs(found[1])) found = [s, off];
  });
  return found;
}

interface Known {
  key: string;
  samples: Samples | null;
  asking: boolean;
}

/** The newest samples of curves that change while a slider moves: one request at a time for each, the last one counts. */
export class Sampler {
  private known = new Map<string | number, Known>();

  constructor(
    private ready: () => void,
    private ask: (form: Form) => Promise<Samples> = sampled,
  ) {}

  /** The last samples of the curve `id`, perhaps of a moment ago; requests new ones where needed. */
  of(id: string | number, form: Form): Samples | null {
    const key = keyOf(form);
    const known = this.known.get(id) ?? { key: "", samples: null, asking: false };
    this.known.set(id, known);
    if (known.key !== key && !known.asking) void this.renew(known, key, form);
    return known.samples;
  }

  /** Whether the samples of a curve are those of its parameters. */
  isCurrent(id: string | number, form: Form): boolean {
    return this.known.get(id)?.key === keyOf(form);
  }

  /** Samples of a curve that came with its parameters. */
  put(id: string | number, form: Form, samples: Samples): void {
    this.known.set(id, { key: keyOf(form), samples, asking: false });
  }

  private async renew(known: Known, key: string, form: Form): Promise<void> {
    known.asking = true;
    const asked = { model: form.model, parameters: { ...form.parameters }, ...(form.held ? { held: [...form.held] } : {}) };
    try {
      known.samples = await this.ask(asked);
    } catch {
      known.samples = null; // a curve unknown to the server is not drawn
    }
    known.key = key;
    known.asking = false;
    this.ready();
  }
}

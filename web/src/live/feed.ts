/** The stream of the live page: rows into a ring, everything else to listeners, back-off after a loss. */

import { socketAddress } from "../ui/api";

export interface Hello {
  kind: "hello";
  vehicle: string;
  columns: string[];
  wheels: string[];
  /** Of a service before 29 November 2026 not known. */
  driven?: string[];
  events: string[];
  replay?: { start: number; end: number };
  /** Of a service of many: which this is, and all that send. */
  name?: string;
  vehicles?: string[];
}

export interface Said {
  kind: string;
  time: number | null;
  text?: string;
  source?: string;
  soil?: string;
  probability?: number | null;
  labelled?: boolean;
  counts?: Record<string, Record<string, number>>;
  row_rate?: number;
  delay?: number;
  waiting?: number;
  /** Sources of which nothing came lately, a sentence each. */
  silent?: string[];
}

/** The query for a vehicle of many; empty for the first. */
export function of(vehicle: string): Record<string, string> {
  return vehicle ? { vehicle } : {};
}

export type State = "connecting" | "connected" | "lost" | "ended";

/** Rows that the ring holds: 10 minutes at 100 Hz, to look back at while it records. */
export const RING = 60_000;
const HEAD = 3;

/** The last rows, column by column. */
export class Ring {
  readonly time = new Float64Array(RING);
  readonly event = new Uint8Array(RING);
  readonly predicted = new Uint8Array(RING);
  columns: Float64Array[] = [];
  names: string[] = [];
  /** Rows ever taken. */
  taken = 0;

  start(names: string[]): void {
    this.names = names;
    this.columns = names.map(() => new Float64Array(RING));
    this.taken = 0;
  }

  /** Add the rows of one message; returns how many. */
  take(buffer: ArrayBuffer): number {
    const values = new Float64Array(buffer);
    const width = HEAD + this.names.length;
    const rows = Math.floor(values.length / width);
    for (let r = 0; r < rows; r++) {
      const at = this.taken % RING;
      const from = r * width;
      this.time[at] = values[from] as number;
      this.predicted[at] = values[from + 1] as number;
      this.event[at] = values[from + 2] as number;
      for (let c = 0; c < this.columns.length; c++) (this.columns[c] as Float64Array)[at] = values[from + HEAD + c] as number;
      this.taken++;
    }
    return rows;
  }

  get count(): number {
    return Math.min(this.taken, RING);
  }

  /** The i-th of the held rows, the oldest first: its place in the arrays. */
  place(i: number): number {
    return this.taken <= RING ? i : (this.taken + i) % RING;
  }

  last(name: string): number {
    const column = this.columns[this.names.indexOf(name)];
    return column && this.taken ? (column[(this.taken - 1) % RING] as number) : NaN;
  }

  /** The time of the oldest row held. */
  get oldest(): number {
    return this.taken ? (this.time[this.place(0)] as number) : NaN;
  }

  get now(): number {
    return this.taken ? (this.time[(this.taken - 1) % RING] as number) : NaN;
  }

  /** Whether nothing was measured for the last row: the filter went on alone. */
  get isPredicted(): boolean {
    return this.taken > 0 && this.predicted[(this.taken - 1) % RING] === 1;
  }

  /** Seconds from one measured row to the next, the median of the newest; NaN before there are two. */
  get period(): number {
    const steps: number[] = [];
    let later = NaN;
    for (let i = this.count - 1; i >= 0 && steps.length < 50; i--) {
      const at = this.place(i);
      if (this.predicted[at]) continue;
      const time = this.time[at] as number;
      if (later > time) steps.push(later - time);
      later = time;
    }
    return steps.sort((a, b) => a - b)[steps.length >> 1] ?? NaN;
  }
}

/** Seconds of silence that are never called old: rows come in bundles, and a reader sees nothing faster. */
export const LEAST_AGE = 0.5;

/** Seconds after which what is shown is old: twice the time from row to row. */
export function oldAfter(period: number): number {
  return Math.max(Number.isFinite(period) ? 2 * period : 0, LEAST_AGE);
}

export class Feed {
  readonly ring = new Ring();
  hello: Hello | null = null;
  state: State = "connecting";
  messages = 0;
  /** When the last row, the last measured one and the last status came [ms of performance.now()]; NaN: none yet. */
  arrived = { row: NaN, measured: NaN, status: NaN };
  onRows: (() => void) | null = null;
  onSaid: ((said: Said) => void) | null = null;
  onState: ((state: State, why: string) => void) | null = null;
  private socket: WebSocket | null = null;
  private pause = 500;
  private timer = 0;
  private closed = false;
  private ended = false;

  constructor(private query: () => string) {
    this.open();
  }

  close(): void {
    this.closed = true;
    clearTimeout(this.timer);
    this.socket?.close();
  }

  /** Restart, with the present `query`. */
  again(): void {
    clearTimeout(this.timer);
    const old = this.socket;
    this.socket = null;
    old?.close();
    this.pause = 500;
    this.open();
  }

  /** Seconds since the last row and since the last measured one came; NaN before the first. */
  age(what: "row" | "measured" | "status"): number {
    return (performance.now() - this.arrived[what]) / 1000;
  }

  private set(state: State, why = ""): void {
    this.state = state;
    this.onState?.(state, why);
  }

  private open(): void {
    this.set("connecting");
    this.ended = false;
    let why = "";
    const socket = new WebSocket(socketAddress(`live?${this.query()}`));
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.onmessage = (event) => {
      if (socket !== this.socket) return;
      if (typeof event.data !== "string") {
        this.messages++;
        const before = this.ring.taken;
        const rows = this.ring.take(event.data as ArrayBuffer);
        const now = performance.now();
        if (rows) this.arrived.row = now;
        for (let i = 0; i < rows; i++) if (!this.ring.predicted[(before + i) % RING]) this.arrived.measured = now;
        this.onRows?.();
        return;
      }
      const said = JSON.parse(event.data) as Said & Hello;
      if (said.kind === "hello") {
        this.hello = said;
        this.ring.start(said.columns);
        this.arrived = { row: NaN, measured: NaN, status: NaN };
        this.pause = 500;
        this.set("connected");
      } else if (said.kind === "end") this.ended = true;
      else if (said.kind === "problem") why = said.text ?? "";
      else {
        if (said.kind === "status") this.arrived.status = performance.now();
        this.onSaid?.(said);
      }
    };
    socket.onclose = () => {
      if (this.closed || socket !== this.socket) return;
      if (this.ended && this.hello?.replay) {
        this.set("ended");
        return;
      }
      this.set("lost", why || "the connection was lost; trying again");
      this.timer = window.setTimeout(() => this.open(), this.pause);
      this.pause = Math.min(this.pause * 2, 8000);
    };
  }
}

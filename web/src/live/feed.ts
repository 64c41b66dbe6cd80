/** The stream of the live page: rows into a ring, everything else to listeners, back-off after a loss. */

import { socketAddress } from "../ui/api";

export interface Hello {
  kind: "hello";
  vehicle: string;
  columns: string[];
  wheels: string[];
  events: string[];
  replay?: { start: number; end: number };
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
}

export type State = "connecting" | "connected" | "lost" | "ended";

/** Rows that the ring holds: 100 s at 100 Hz. */
const RING = 10_000;
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

  /** Take the rows of one message; returns how many. */
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

  get now(): number {
    return this.taken ? (this.time[(this.taken - 1) % RING] as number) : NaN;
  }
}

export class Feed {
  readonly ring = new Ring();
  hello: Hello | null = null;
  state: State = "connecting";
  messages = 0;
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

  /** Begin anew, with what `query` says now. */
  again(): void {
    clearTimeout(this.timer);
    const old = this.socket;
    this.socket = null;
    old?.close();
    this.pause = 500;
    this.open();
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
        this.ring.take(event.data as ArrayBuffer);
        this.onRows?.();
        return;
      }
      const said = JSON.parse(event.data) as Said & Hello;
      if (said.kind === "hello") {
        this.hello = said;
        this.ring.start(said.columns);
        this.pause = 500;
        this.set("connected");
      } else if (said.kind === "end") this.ended = true;
      else if (said.kind === "problem") why = said.text ?? "";
      else this.onSaid?.(said);
    };
    socket.onclose = () => {
      if (this.closed || socket !== this.socket) return;
      if (this.ended && this.hello?.replay) {
        this.set("ended");
        return;
      }
      this.set("lost", why || "the stream stopped; trying again");
      this.timer = window.setTimeout(() => this.open(), this.pause);
      this.pause = Math.min(this.pause * 2, 8000);
    };
  }
}

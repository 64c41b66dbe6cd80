/** The server's interface. Every failure becomes an Error whose message is the server's one line. */

/** The error of a request that nobody answers; withdrawn when the studio responds again. */
export const SILENT = "The studio does not respond; is it still running?";

export interface Item {
  path: string;
  kind: string;
  size: number;
  modified: number;
}

export interface Job {
  id: string;
  kind: string;
  title: string;
  output: string;
  state: "queued" | "running" | "done" | "failed" | "cancelled" | "interrupted";
  done: number;
  total: number;
  text: string;
  /** Its command line, word by word. */
  words: string[];
  /** What would do the same on a command line in the folder. */
  command: string;
}

const ORDER = ["queued", "running"];

/** Whether a job waits or runs. */
export function isGoing({ state }: Job): boolean {
  return ORDER.includes(state);
}

/** Whether a report of a job is older than what is known: answers and notices overtake each other, and what has ended stays so. */
export function isOlder(report: Job, known: Job): boolean {
  return !isGoing(known) || (isGoing(report) && ORDER.indexOf(report.state) < ORDER.indexOf(known.state));
}

export type Query = Record<string, string | number | boolean | undefined>;

export function address(path: string, query: Query = {}): string {
  const words = new URLSearchParams();
  for (const [key, value] of Object.entries(query)) if (value !== undefined) words.set(key, String(value));
  const text = words.toString();
  return `./api/${path}${text ? `?${text}` : ""}`;
}

export async function request(path: string, query: Query = {}, options: RequestInit = {}, more = ""): Promise<Response> {
  let answer: Response;
  try {
    const plain = address(path, query);
    answer = await fetch(more ? `${plain}${plain.includes("?") ? "&" : "?"}${more}` : plain, options);
  } catch (error) {
    if (error instanceof DOMException && error.name === "AbortError") throw error;
    throw new Error(SILENT);
  }
  if (!answer.ok) throw new Error(await reason(answer));
  return answer;
}

async function reason(answer: Response): Promise<string> {
  const text = await answer.text();
  try {
    return String(JSON.parse(text).detail);
  } catch {
    return text || `${answer.status} ${answer.statusText}`;
  }
}

export async function get<T>(path: string, query: Query = {}): Promise<T> {
  return (await (await request(path, query)).json()) as T;
}

export async function send<T>(method: string, path: string, body: unknown, query: Query = {}): Promise<T> {
  const options = { method, headers: { "content-type": "application/json" }, body: JSON.stringify(body) };
  const answer = await request(path, query, options);
  return (answer.status === 204 ? undefined : await answer.json()) as T;
}

/** Upload with progress; `fetch` does not report how much was sent. */
export function upload(path: string, content: Blob, replace: boolean, progress: (share: number) => void): Promise<{ path: string; kind: string }> {
  return new Promise((resolve, reject) => {
    const call = new XMLHttpRequest();
    call.open("PUT", address("file", { path, replace }));
    call.upload.onprogress = (event) => event.lengthComputable && progress(event.loaded / event.total);
    call.onerror = () => reject(new Error(`${path}: was not uploaded, since the studio stopped to respond; upload it again`));
    call.onload = () => {
      let said: { detail?: string } = {};
      try {
        said = JSON.parse(call.responseText);
      } catch {
        said = { detail: call.responseText };
      }
      if (call.status < 300) resolve(said as { path: string; kind: string });
      else reject(new Error(said.detail || call.statusText));
    };
    call.send(content);
  });
}

export function socketAddress(path: string): string {
  const base = new URL(`./api/${path}`, location.href);
  base.protocol = base.protocol === "https:" ? "wss:" : "ws:";
  base.hash = "";
  return base.href;
}

/** This page among all that are open. */
export const ME = crypto.getRandomValues(new Uint32Array(2)).join("-");

export type Notice = { kind: "folder" } | { kind: "job"; job: Job } | { kind: "picture"; path: string; by: string } | { kind: "connection"; up: boolean };

/** Listen to the server's notices; reconnects with growing pauses, of at most two seconds, when the connection drops. */
export class Notices {
  private listeners = new Set<(notice: Notice) => void>();
  private pause = 500;

  constructor() {
    this.open();
  }

  on(listener: (notice: Notice) => void): () => void {
    this.listeners.add(listener);
    return () => this.listeners.delete(listener);
  }

  private tell(notice: Notice): void {
    for (const listener of this.listeners) listener(notice);
  }

  private open(): void {
    const socket = new WebSocket(socketAddress("notices"));
    socket.onopen = () => {
      this.pause = 500;
      this.tell({ kind: "connection", up: true });
      this.tell({ kind: "folder" });
    };
    socket.onmessage = (event) => this.tell(JSON.parse(event.data as string) as Notice);
    socket.onclose = () => {
      this.tell({ kind: "connection", up: false });
      setTimeout(() => this.open(), this.pause);
      this.pause = Math.min(this.pause * 2, 2000);
    };
  }
}

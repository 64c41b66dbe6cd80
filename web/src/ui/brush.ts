/** The run and the times that Drive and Map show: kept from page to page, and shared with the browser's other tabs. */

export interface Brush {
  path: string;
  range: [number, number];
}

const channel = new BroadcastChannel("terragrip-brush");
const listeners = new Set<(brush: Brush) => void>();
let now: Brush | null = null;

/** What was brushed last, here or in another tab. */
export function brushed(): Brush | null {
  return now;
}

/** Other times are shown. */
export function brush(path: string, range: [number, number]): void {
  if (now && now.path === path && now.range[0] === range[0] && now.range[1] === range[1]) return; // also what another tab has just set
  now = { path, range };
  channel.postMessage(now);
}

/** Calls back with what other tabs brush, until the returned function is called. */
export function onBrush(listener: (brush: Brush) => void): () => void {
  listeners.add(listener);
  return () => listeners.delete(listener);
}

channel.addEventListener("message", (event: MessageEvent<Brush>) => {
  now = event.data;
  for (const listener of listeners) listener(event.data);
});

/** The time under the cursor, null where it has left; of a run. */
type Pointed = { path: string; time: number | null };

const cursor = new BroadcastChannel("terragrip-cursor");
const followers = new Set<(path: string, time: number | null) => void>();

/** The cursor is at a time here. */
export function point(path: string, time: number | null): void {
  cursor.postMessage({ path, time } satisfies Pointed);
}

/** Calls back with the cursor of other tabs, until the returned function is called. */
export function onPoint(follower: (path: string, time: number | null) => void): () => void {
  followers.add(follower);
  return () => followers.delete(follower);
}

cursor.addEventListener("message", ({ data }: MessageEvent<Pointed>) => {
  for (const follower of followers) follower(data.path, data.time);
});

/** The profile and vehicle chosen last for a log, in this browser. */

const KEY = "terragrip-logs";

interface Bound {
  profile?: string;
  vehicle?: string;
}

function all(): Record<string, Bound> {
  try {
    return (JSON.parse(localStorage.getItem(KEY) ?? "{}") as Record<string, Bound> | null) ?? {};
  } catch {
    return {}; // written by something else
  }
}

/** `log` with its folder's name before it. */
export const boundTo = (log: string): Bound => all()[log] ?? {};

export function bind(log: string, change: Bound): void {
  const kept = all();
  localStorage.setItem(KEY, JSON.stringify({ ...kept, [log]: { ...kept[log], ...change } }));
}

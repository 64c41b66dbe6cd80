/** What the server says of a log before it is estimated. */

export interface Inspection {
  rows: number;
  ready: boolean;
  /** Why an estimate cannot run, though the log is whole; null where nothing is known against it. */
  problem: string | null;
  missing: string[];
  warnings: string[];
  recognised: Record<string, string[]>;
  text: string;
}

/** Whether an estimate will run, in a line: with a vehicle chosen, or with none, of which the folder may have some. */
export function verdict(found: Inspection, chosen: boolean, some: boolean): string {
  const rows = `${found.rows.toLocaleString()} rows`;
  if (found.ready) return chosen ? `${rows}, ready to estimate.` : `${rows}; ${some ? "choose the vehicle" : "a vehicle file is missing"}.`;
  return found.problem ? `Not ready: ${found.problem}` : `Not ready: ${found.missing.join("; ") || "choose the columns"}.`;
}

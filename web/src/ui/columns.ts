/** Binary columns from the server: a JSON head, then float64 arrays (terragrip.studio.tables.packed). */

import { request, type Query } from "./api";

export interface Columns {
  names: string[];
  count: number;
  cut: boolean;
  data: Float64Array[];
  /** The number of rows, where the server reports it. */
  of?: number;
}

export async function columns(path: string, query: Query, many: string[], signal?: AbortSignal): Promise<Columns> {
  const list = many.map((name) => `column=${encodeURIComponent(name)}`).join("&");
  const answer = await request(path, query, { signal: signal ?? null }, list);
  return unpack(await answer.arrayBuffer());
}

export function unpack(buffer: ArrayBuffer): Columns {
  const size = new DataView(buffer).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, size))) as { columns: string[]; count: number; cut: boolean; of?: number };
  const data = head.columns.map((_, i) => new Float64Array(buffer, 4 + size + 8 * i * head.count, head.count));
  return { names: head.columns, count: head.count, cut: head.cut, data, ...(head.of === undefined ? {} : { of: head.of }) };
}

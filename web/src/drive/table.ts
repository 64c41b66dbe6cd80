/** The rows of what is shown, as the server's CSV. */

import { request } from "../ui/api";
import { AXES, type Layer } from "./along";
import type { Charts } from "./charts";
import type { Trace } from "./run";

interface Column {
  name: string;
  heading: string;
  scale: number;
}

/** The columns of the shown charts, with their 95 % limits, a heading with the unit each. */
export function columnsOf(charts: Pick<Charts, "shown">): Column[] {
  const found = new Map<string, Column>();
  const add = (name: string, title: string, unit: string, scale: number): void => {
    const heading = `${title} [${unit === "–" ? "-" : unit}]`;
    if (!found.has(heading)) found.set(heading, { name, heading, scale });
  };
  for (const { panel } of charts.shown) {
    for (const trace of panel.traces) {
      const title = titleOf(trace, panel.title, panel.scale);
      add(trace.column, title, panel.unit, trace.scale);
      for (const side of trace.band ? ["low", "high"] : []) add(`${trace.band}:${side}`, `${title} 95 % ${side}`, panel.unit, trace.scale);
    }
  }
  return [...found.values()];
}

/** The column's own name; of a formula the name that it was given, and of a rim's speed another than that of its turning. */
function titleOf({ column, scale }: Trace, panel: string, own: number): string {
  if (column.startsWith("=")) return panel;
  const plain = column.replace("measured:", "measured ").replace(":", " ");
  return column.startsWith("wheel_speed_") && scale !== own ? plain.replace("wheel_speed", "rim_speed") : plain;
}

export async function tableOf(charts: Charts, layers: Layer[]): Promise<Blob | undefined> {
  const columns = columnsOf(charts);
  if (!layers.length || !columns.length) return undefined;
  const [start, end] = charts.range;
  const { title, unit } = AXES[charts.axis];
  const runs = layers.map(({ path, run, label }) => ({ path, label, version: run.version }));
  const body = JSON.stringify({ runs, columns, axis: charts.axis, heading: `${title} [${unit}]`, start, end });
  return (await request("drive/table", {}, { method: "POST", headers: { "content-type": "application/json" }, body })).blob();
}

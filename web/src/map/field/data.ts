/** A map of cells as the server sends it (terragrip.studio.api.maps). */

import { get, request } from "../../ui/api";

export type Place = [longitude: number, latitude: number];

export interface Tile {
  /** First column and row of the grid. */
  column: number;
  row: number;
  wide: number;
  high: number;
  /** North-west, north-east, south-east, south-west. */
  corners: [Place, Place, Place, Place];
}

export interface Area {
  cells: number;
  low: number;
  middle: number;
  high: number;
}

export interface Mapped {
  name: string;
  areas: { field: Area | null; headland: Area | null };
  /** Between which runs how many cells were driven again, and how many changed. */
  changes: { first: string; last: string; cells: number; significant: number }[];
}

export interface Anomaly {
  quantity: string;
  kind: string;
  value: number;
  around: number;
  difference: number;
  difference_std: number;
  p: number;
  /** [m²] */
  area: number;
  place: Place;
  rings: Place[][];
}

export interface Field {
  version: string;
  /** [m] */
  cell: number;
  epsg: number;
  datum: string;
  reference_slip: number;
  runs: string[];
  notes: string[];
  cells: number;
  soils: boolean;
  points: number;
  tiles: Tile[];
  quantities: Mapped[];
  anomalies: Anomaly[];
}

type Whole = Int32Array;
type Real = Float32Array;

/** The cells of one quantity (n,); `first` to `significant` only where something was driven again. */
export interface Cells {
  count: number;
  soils: string[];
  column: Whole;
  row: Whole;
  value: Real;
  std: Real;
  rows: Whole;
  passes: Whole;
  headland: Real;
  soil: Whole;
  soil_probability: Real;
  first?: Real;
  last?: Real;
  difference?: Real;
  difference_std?: Real;
  significant?: Whole;
}

export const fieldOf = (path: string): Promise<Field> => get<Field>("map", { path });

export async function cellsOf(path: string, version: string, quantity: string): Promise<Cells> {
  const answer = await request("map/cells", { path, version, quantity });
  return cellsIn(await answer.arrayBuffer());
}

export function cellsIn(buffer: ArrayBuffer): Cells {
  const size = new DataView(buffer).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, size))) as { columns: string[]; types: string[]; count: number; soils: string[] };
  const column = (i: number): Whole | Real => new (head.types[i] === "int32" ? Int32Array : Float32Array)(buffer, 4 + size + 4 * i * head.count, head.count);
  // "count" is the length here: the rows that a cell was made of are `rows`
  const named = head.columns.map((name, i) => [name === "count" ? "rows" : name, column(i)] as const);
  return { ...(Object.fromEntries(named) as unknown as Cells), count: head.count, soils: head.soils };
}

/** Cells by their place on the grid. */
export class Index {
  private by = new Map<number, number>();
  private low = Infinity;
  private span = 1;

  constructor(private cells: Cells, shown: (i: number) => boolean) {
    let high = -Infinity;
    for (let i = 0; i < cells.count; i++) {
      this.low = Math.min(this.low, cells.row[i] as number);
      high = Math.max(high, cells.row[i] as number);
    }
    this.span = high - this.low + 1;
    for (let i = 0; i < cells.count; i++) if (shown(i)) this.by.set(this.key(cells.column[i] as number, cells.row[i] as number), i);
  }

  get size(): number {
    return this.by.size;
  }

  private key(column: number, row: number): number {
    return column * this.span + (row - this.low);
  }

  /** The cell at a place; undefined where there is none that is shown. */
  at(column: number, row: number): number | undefined {
    return row < this.low || row >= this.low + this.span ? undefined : this.by.get(this.key(column, row));
  }

  /** The nearest cell in a direction of the grid, within 45° of it; undefined at the edge. */
  next(from: number, [east, north]: [number, number]): number | undefined {
    const [column, row] = [this.cells.column[from] as number, this.cells.row[from] as number];
    const beside = this.at(column + east, row + north);
    if (beside !== undefined) return beside;
    return this.least((c, r) => {
      const along = (c - column) * east + (r - row) * north;
      const aside = Math.abs((c - column) * north) + Math.abs((r - row) * east);
      return along > 0 && aside <= along ? along + 2 * aside : Infinity;
    });
  }

  /** The cell nearest to a place of the grid. */
  nearest(column: number, row: number): number | undefined {
    return this.least((c, r) => (c - column) ** 2 + (r - row) ** 2);
  }

  private least(cost: (column: number, row: number) => number): number | undefined {
    let best: number | undefined;
    let least = Infinity;
    for (const i of this.by.values()) {
      const now = cost(this.cells.column[i] as number, this.cells.row[i] as number);
      if (now < least) [least, best] = [now, i];
    }
    return best;
  }
}

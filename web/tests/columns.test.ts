import { describe, expect, it } from "vitest";
import { Columns } from "../src/live/columns";
import { Ring, RING } from "../src/live/feed";

/** A ring with one column at 100 Hz; `value` and `predicted` of the row's number. */
function ring(rows: number, value: (i: number) => number, predicted: (i: number) => boolean = () => false): Ring {
  const made = new Ring();
  made.start(["v"]);
  for (let i = 0; i < rows; i++) made.take(new Float64Array([i / 100, predicted(i) ? 1 : 0, 0, value(i)]).buffer);
  return made;
}

/** The rectangles drawn of 30 s on 300 pixels up to the newest row: left, lowest value, right, largest value. */
function drawn(of: Ring, predicted: 0 | 1 = 0): { rects: number[][]; columns: Columns } {
  const columns = new Columns();
  let first = 0;
  while (first < of.count && (of.time[of.place(first)] as number) < of.now - 30) first++;
  columns.take(of, of.columns[0] as Float64Array, predicted, { first, begin: of.now - 30, end: of.now, pixels: 300 });
  const rects: number[][] = [];
  const pen = { fillRect: (x: number, y: number, w: number, h: number) => rects.push([x, -(y + h), x + w, -y]) };
  columns.draw(pen as unknown as CanvasRenderingContext2D, 0, (v) => -v, 0);
  return { rects, columns };
}

describe("live traces by columns of pixels", () => {
  it("keep a spike of one row", () => {
    const { rects, columns } = drawn(ring(3001, (i) => (i === 1234 ? 50 : 1)));
    expect(columns.most).toBe(50);
    const high = rects.filter(([, , , top]) => top === 50);
    expect(high.map(([left]) => left)).toEqual([123]);
  });

  it("leave no hole between neighbours, also of a slope", () => {
    const { rects } = drawn(ring(3001, (i) => i));
    for (let c = 1; c < rects.length; c++) {
      expect(rects[c]?.[0]).toBe(rects[c - 1]?.[2]);
      expect(rects[c]?.[1]).toBeLessThanOrEqual(rects[c - 1]?.[3] as number);
    }
    expect(rects.at(-1)?.[2]).toBe(300);
  });

  it("break where a value is not known", () => {
    const { rects } = drawn(ring(3001, (i) => (i >= 1000 && i < 2000 ? NaN : 1)));
    expect(rects.some(([left, , right]) => (right as number) > 101 && (left as number) < 199)).toBe(false);
    expect(rects.length).toBeGreaterThan(195);
  });

  it("part what was measured from what was predicted", () => {
    const mixed = ring(3001, () => 1, (i) => i >= 1500);
    expect(Math.max(...drawn(mixed).rects.map(([left]) => left as number))).toBe(149);
    expect(Math.min(...drawn(mixed, 1).rects.map(([left]) => left as number))).toBe(150);
  });

  it("are the newest rows where the ring has begun anew", () => {
    const { columns } = drawn(ring(RING + 500, (i) => i));
    expect([columns.least, columns.most]).toEqual([RING + 500 - 3001, RING + 499]);
  });
});

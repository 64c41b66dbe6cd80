import { describe, expect, test } from "vitest";
import { type Cells, cellsIn, Index } from "../src/map/field/data";
import { degrees, withStd } from "../src/map/field/reading";

function cells(places: [number, number][]): Cells {
  const column = Int32Array.from(places.map(([c]) => c));
  const row = Int32Array.from(places.map(([, r]) => r));
  return { count: places.length, column, row } as unknown as Cells;
}

describe("cells by their place", () => {
  const grid = new Index(cells([[10, -3], [11, -3], [14, -3], [12, -1], [11, 4]]), () => true);

  test("a place without a cell has none, below zero too", () => {
    expect(grid.at(11, -3)).toBe(1);
    expect(grid.at(12, -3)).toBeUndefined();
    expect(grid.at(10, -4)).toBeUndefined();
  });

  test("an arrow goes to the neighbour, over a hole to the next one that way, and stays at the edge", () => {
    expect(grid.next(0, [1, 0])).toBe(1);
    expect(grid.next(1, [1, 0])).toBe(2);
    expect(grid.next(1, [0, 1])).toBe(3);
    expect(grid.next(4, [0, 1])).toBeUndefined();
    expect(grid.next(0, [-1, 0])).toBeUndefined();
  });

  test("what is not shown is not reached", () => {
    const part = new Index(cells([[0, 0], [1, 0], [2, 0]]), (i) => i !== 1);
    expect(part.size).toBe(2);
    expect(part.next(0, [1, 0])).toBe(2);
  });
});

test("columns of four bytes, whole and real, after a head of any length", () => {
  const head = new TextEncoder().encode(`${JSON.stringify({ columns: ["column", "count", "value"], types: ["int32", "int32", "float32"], count: 2, soils: ["", "sand"] })}  `.padEnd(124));
  const buffer = new ArrayBuffer(4 + head.length + 24);
  new DataView(buffer).setUint32(0, head.length, true);
  new Uint8Array(buffer, 4).set(head);
  new Int32Array(buffer, 4 + head.length, 4).set([-5, 6, 70, 80]);
  new Float32Array(buffer, 4 + head.length + 16, 2).set([0.5, NaN]);
  const found = cellsIn(buffer);
  expect([found.count, [...found.column], [...found.rows], [...found.value], found.soils]).toEqual([2, [-5, 6], [70, 80], [0.5, NaN], ["", "sand"]]);
});

test("a value is read to the place that its standard deviation bears", () => {
  const ratio = { scale: 1, name: "–" };
  expect(withStd(0.40312, 0.0231, ratio)).toBe("0.403 ± 0.023");
  expect(withStd(0.1, 0.0021, { scale: 100, name: "%" })).toBe("10.00 ± 0.21 %");
  expect(withStd(0.5, 0.95, ratio)).toBe("0.50 ± 0.95");
  expect(withStd(0.5, NaN, ratio)).toBe("0.500 ± ?");
});

test("places south and west", () => expect(degrees([-13.5, -51.25], 2)).toBe("51.25° S 13.50° W"));

import { expect, test } from "vitest";
import { oldAfter, Ring } from "../src/live/feed";

function rows(...all: [number, number, number][]): ArrayBuffer {
  return new Float64Array(all.flatMap(([time, predicted, v]) => [time, predicted, 0, v])).buffer;
}

test("the period is that of measured rows, whatever is predicted between", () => {
  const ring = new Ring();
  ring.start(["v"]);
  expect(ring.period).toBeNaN();
  ring.take(rows([0, 0, 1], [1, 0, 1], [2, 0, 1], [3, 0, 1]));
  expect(ring.period).toBe(1);
  ring.take(rows([3.3, 1, 1], [3.4, 1, 1], [3.5, 1, 1]));
  expect(ring.period).toBe(1);
  expect(ring.isPredicted).toBe(true);
});

test("rows are old after twice their period, and never before half a second", () => {
  expect(oldAfter(1)).toBe(2);
  expect(oldAfter(0.01)).toBe(0.5);
  expect(oldAfter(NaN)).toBe(0.5);
});

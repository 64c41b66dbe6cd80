import { expect, it } from "vitest";
import { View, ticks } from "../src/ui/view";

it("keeps the point under the pointer where it is while zooming", () => {
  const view = new View({ low: 0, high: 1 }, { low: -1, high: 2 }, 900, 500);
  const before = [view.x_of(400), view.y_of(200)];
  view.zoom(0.5, 400, 200);
  expect(view.x_of(400)).toBeCloseTo(before[0] as number, 12);
  expect(view.y_of(200)).toBeCloseTo(before[1] as number, 12);
  expect(view.x.high - view.x.low).toBeCloseTo(0.5, 12);
});

it("puts ticks on round numbers inside the range", () => {
  expect(ticks({ low: -0.03, high: 0.71 }, 7)).toEqual([0, 0.2, 0.4, 0.6]);
  expect(ticks({ low: 0, high: 1 }, 10)).toHaveLength(11);
  expect(ticks({ low: 1, high: 1 }, 5)).toEqual([]);
  expect(ticks({ low: 0.0758, high: 0.0842 }, 4)).toEqual([0.076, 0.078, 0.08, 0.082, 0.084]);
});

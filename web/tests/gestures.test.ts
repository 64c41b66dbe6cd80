import { describe, expect, it } from "vitest";
import { panned, pinched, zoomed } from "../src/drive/gestures";

describe("ranges", () => {
  it("keeps the time under the pointer where it is while zooming", () => {
    const [low, high] = zoomed([10, 30], 15, 0.5);
    expect([low, high]).toEqual([12.5, 22.5]);
    expect((15 - low) / (high - low)).toBeCloseTo((15 - 10) / 20);
  });

  it("pans to the ends of the run and no farther", () => {
    expect(panned([10, 20], 0.1, [0, 100])).toEqual([11, 21]);
    expect(panned([95, 99], 10, [0, 100])).toEqual([96, 100]);
    expect(panned([1, 3], -10, [0, 100])).toEqual([0, 2]);
    expect(panned([0, 100], 0.5, [0, 100])).toEqual([0, 100]);
  });

  it("keeps under both fingers what they took hold of", () => {
    const before: [number, number] = [0.2, 0.6];
    const now: [number, number] = [0.1, 0.9];
    const [low, high] = pinched([50, 150], before, now);
    for (const k of [0, 1] as const) expect(low + now[k] * (high - low)).toBeCloseTo(50 + before[k] * 100);
    expect(pinched([50, 150], before, [0.5, 0.5])).toEqual([50, 150]);
  });
});

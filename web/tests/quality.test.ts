import { expect, test } from "vitest";
import { quality } from "../src/fit/quality";
import type { Samples } from "../src/fit/samples";

const slip = Array.from({ length: 401 }, (_, i) => -1 + i / 200);
const line: Samples = { slip, value: slip.map((s) => 2 * s), peak: [1, 2], initial_slope: 2, handles: [] };

test("R² and residuals of a curve are those of its bins; what lies beyond the samples does not count", () => {
  const bins = [0.1, 0.2, 0.3, 1.5].map((s, i) => ({ slip: s, mean: 2 * s + (i === 1 ? 0.03 : 0) }));
  const found = quality(bins, line);
  expect(found.count).toBe(3);
  expect(found.largest).toBeCloseTo(0.03, 9);
  expect(found.rms).toBeCloseTo(0.03 / Math.sqrt(3), 9);
  expect(found.r2).toBeCloseTo(1 - 0.0009 / (0.21 ** 2 + 0.02 ** 2 + 0.19 ** 2), 9);
});

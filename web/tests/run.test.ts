import { expect, it } from "vitest";
import { nisLevels } from "../src/drive/run";

it("puts the bounds of NIS where chi-squared has them", () => {
  // Tables of chi-squared: 5 degrees of freedom 0.831 and 12.833; 10 degrees 3.247 and 20.483.
  for (const [n, low, high] of [[5, 0.831, 12.833], [10, 3.247, 20.483]] as const) {
    const [lower, middle, upper] = nisLevels(n).map((level) => level.value);
    expect(Math.abs((lower as number) - low)).toBeLessThan(0.05);
    expect(middle).toBe(n);
    expect(Math.abs((upper as number) - high)).toBeLessThan(0.05);
  }
});

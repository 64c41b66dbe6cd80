import { describe, expect, it } from "vitest";
import { extent, limits, outsideOf } from "../src/drive/axes";
import type { Drawn } from "../src/drive/rows";
import type { Panel } from "../src/drive/run";

const x = Array.from({ length: 100 }, (_, i) => i);

function drawn(values: number[], half: number[]): Drawn {
  return { trace: { column: "slip_rr", label: "rr", color: "blue", scale: 1 }, x, values, low: values.map((v, i) => v - (half[i] ?? 0)), high: values.map((v, i) => v + (half[i] ?? 0)), cut: false } as unknown as Drawn;
}

describe("the vertical axis", () => {
  const panel = { key: "slip", title: "", unit: "%", traces: [], low: -20, high: 100, least: -150, most: 200 } as unknown as Panel;
  const slip = x.map((i) => (i < 2 ? 90 : 5 + (i % 3)));
  it("follows what is known, and says what lies beyond: two rows after a standstill pressed all others flat", () => {
    const found = extent([drawn(slip, x.map((i) => (i < 2 ? 100 : 2)))], [0, 99]);
    const [low, high] = limits(found, panel);
    expect(high).toBeLessThan(12);
    expect(low).toBeGreaterThan(0);
    expect(outsideOf(found, panel, [low, high])).toEqual(["▲ up to 90 %", ""]);
  });
  it("follows a spike that is known", () => {
    expect(limits(extent([drawn(slip, x.map(() => 2))], [0, 99]), panel)[1]).toBeGreaterThan(90);
  });
});

import { describe, expect, it } from "vitest";
import { read, written } from "../src/drive/link";
import { nearestKnown, valueAt } from "../src/drive/readout";

const known = (values: (number | null)[]) => (i: number): boolean => values[i] !== null;

describe("the value under the cursor", () => {
  it("is that of the nearest sample, with half its interval", () => {
    expect(valueAt([0, 1, 2], [0.1, 0.2, 0.3], [0.05, 0.1, 0.2], [0.15, 0.3, 0.4], 1.1, false, 0.01)).toBe("0.2 ± 0.1");
  });
  it("is the smallest and the largest of a bucket where rows were cut", () => {
    expect(valueAt([0, 1, 2, 3], [1, 5, 2, 9], undefined, undefined, 2.2, true, 0.01)).toBe("2 … 9");
  });
  it("is not that of a far sample", () => {
    const values = [1, null, null, null, null, 2];
    expect(nearestKnown([0, 1, 2, 3, 4, 5], known(values), 2.4, 0.1)).toBe(-1);
    expect(nearestKnown([0, 1, 2, 3, 4, 5], known(values), 1.9, 2)).toBe(0);
    expect(nearestKnown([0, 1, 2, 3, 4, 5], known(values), 4.5, 0.1)).toBe(5);
  });
  it("is none in a hole of the log, whether rows were cut or not", () => {
    const hole = [0, 1, 2, 2, 900, 901];
    for (const at of [300, 800]) expect(valueAt(hole, [3, 3, 3, NaN, 3, 3], undefined, undefined, at, false, 0.5)).toBe("–");
    const buckets = [0, 1, 2, 2.5, 3, 450, 900, 901];
    expect(valueAt(buckets, [3, 3, 3, 3, NaN, NaN, 3, 3], undefined, undefined, 420, true, 0.5)).toBe("–");
  });
});

describe("a link", () => {
  it("gives back the view that it was written from", () => {
    const view = { path: "a b/c&d.parquet", range: [1.25, 7.5] as [number, number], wheels: ["rl"], panels: ["slip", "nis"], at: 3.125, uprights: { slip: [-5, 40] as [number, number] }, axis: "distance" as const, others: ["d/b.parquet", "c.parquet"], formulas: [{ name: "Slip difference", unit: "%", text: "100 * (slip_rl - slip_rr)" }, { name: "µ sum", unit: "", text: "a + b" }], pair: ["=a + b", "slip_rl"] as [string, string] };
    expect(read(new URLSearchParams(written(view)))).toEqual(view);
  });
  it("with nonsense in it is the whole run", () => {
    const view = read(new URLSearchParams("path=a.parquet&from=9&to=2&at=x&y.slip=3"));
    expect(view).toEqual({ path: "a.parquet", range: null, wheels: null, panels: null, at: null, uprights: {}, axis: "time", others: [], formulas: [], pair: null });
  });
});

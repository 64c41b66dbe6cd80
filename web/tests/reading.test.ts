import { expect, it } from "vitest";
import { Ring, type Hello } from "../src/live/feed";
import { reading } from "../src/live/numbers";

const columns = ["slip_fl", "slip_fl_std", "slip_rl", "slip_rl_std", "slip_rr", "slip_rr_std", "ground_speed", "ground_speed_std"];

function slip(driven: string[] | undefined, ...values: number[]): { value: number; shown: [string, string] } {
  const ring = new Ring();
  ring.start(columns);
  ring.take(new Float64Array([1, 0, 0, ...values]).buffer as ArrayBuffer);
  return reading(ring, { wheels: ["fl", "rl", "rr"], driven } as Hello, NaN).slip;
}

it("gives no slip where only a free wheel's is known", () => {
  const { value, shown } = slip(["rl", "rr"], 0, 0.1, NaN, NaN, NaN, NaN, 2, 0.02);
  expect(value).toBeNaN();
  expect(shown).toEqual(["–", "not known"]);
});

it("names the driven wheels that it lacks beside the largest slip of the others", () => {
  const { value, shown } = slip(["rl", "rr"], 0.5, 0.1, 0.2, 0.05, NaN, NaN, 2, 0.02);
  expect(value).toBe(0.2);
  expect(shown[1]).toContain("; rr not known");
});

import { expect, it } from "vitest";
import { nisLevels, panelsOf, type Run } from "../src/drive/run";

it("puts the bounds of NIS where chi-squared has them", () => {
  // Tables of chi-squared: 5 degrees of freedom 0.831 and 12.833; 10 degrees 3.247 and 20.483.
  for (const [n, low, high] of [[5, 0.831, 12.833], [10, 3.247, 20.483]] as const) {
    const [lower, middle, upper] = nisLevels(n).map((level) => level.value);
    expect(Math.abs((lower as number) - low)).toBeLessThan(0.05);
    expect(middle).toBe(n);
    expect(Math.abs((upper as number) - high)).toBeLessThan(0.05);
  }
});

const WHEELS = ["rl", "rr"];
const STATES = [...WHEELS.map((w) => `wheel_speed_${w}`), "ground_speed", ...WHEELS.map((w) => `adhesion_${w}`), "soil_resistance"];

function run(method: string, columns: string[]): Run {
  const nothing = { notes: [], events: [], soils: [], ground: null, recording: null, measured: [] };
  return { ...nothing, rows: 9, start: 0, end: 1, columns, wheels: WHEELS, method, vehicle: "robot", radius: { rl: 0.2, rr: 0.2 } };
}

it("shows the filter's honesty: NIS against its band, gamma, and each factor of A of the chosen wheels", () => {
  const columns = ["nis", "channels", "supervisor", ...STATES.map((state) => `adaptation_${state}`)];
  const panels = new Map(panelsOf(run("aukf-fs", columns), ["rr"]).map((panel) => [panel.key, panel]));
  expect(panels.get("nis")?.traces.map((t) => [t.column, t.band])).toEqual([["nis:mean", "nis"]]);
  expect(panels.get("supervisor")?.title).toBe("Supervisor γ");
  const drawn = panels.get("adaptation")?.traces.map((t) => [t.column, t.label]);
  expect(drawn).toEqual([
    ["adaptation_adhesion_rr", "µ rr"],
    ["adaptation_soil_resistance", "ρs"],
    ["adaptation_wheel_speed_rr", "ω rr"],
    ["adaptation_ground_speed", "v"],
  ]);
  const [low, high] = panels.get("adaptation")?.log ?? [1, 1];
  expect(low).toBeLessThan(0.05); // the bounds of a factor
  expect(high).toBeGreaterThan(50);
});

it("has no panel for what a method does not estimate", () => {
  const keys = panelsOf(run("bank", ["nis", "channels", "supervisor"]), WHEELS).map((panel) => panel.key);
  expect(keys).toEqual(["nis", "supervisor"]);
});

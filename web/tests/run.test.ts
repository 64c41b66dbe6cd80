import { expect, it } from "vitest";
import { during, panelsOf, soilColor, soilsOf, type Run } from "../src/drive/run";

const WHEELS = ["rl", "rr"];
const STATES = [...WHEELS.map((w) => `wheel_speed_${w}`), "ground_speed", ...WHEELS.map((w) => `adhesion_${w}`), "soil_resistance"];

function run(method: string, columns: string[]): Run {
  const nothing = { began: null, notes: [], version: "1-1", events: [], soils: [], ground: null, recording: null, measured: [] };
  return { ...nothing, rows: 9, start: 0, end: 1, distance: 2, columns, wheels: WHEELS, method, vehicle: "robot", radius: { rl: 0.2, rr: 0.2 } };
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

it("tells soils from labels, else from what was recognised, and which stretch holds a time", () => {
  const sections = [{ start: 0, end: 2, soil: "fine", probabilities: {} }, { start: 2, end: 4, soil: "grass", probabilities: {} }];
  const recognised = { ...run("bank", []), ground: { path: "ground.json", sections, changes: [] } };
  expect(soilsOf(recognised).map((s) => s.name)).toEqual(["fine", "grass"]);
  const labels = [{ start: 1, end: 3, name: "hard" }];
  expect(soilsOf({ ...recognised, soils: labels })).toEqual(labels);
  expect([-1, 0, 3, 5].map((t) => during(sections, t)?.soil)).toEqual([undefined, "fine", "grass", undefined]);
});

it("has no panel for what a method does not estimate", () => {
  const keys = panelsOf(run("bank", ["nis", "channels", "supervisor"]), WHEELS).map((panel) => panel.key);
  expect(keys).toEqual(["nis", "supervisor"]);
});

it("gives each ground of a field a colour of its own", () => {
  const names = ["stubble", "ploughed", "grass", "clay", "headland", "wet"]; // some had one colour: their borders could not be seen
  expect(new Set(names.map(soilColor)).size).toBe(names.length);
  expect(names.map(soilColor)).toEqual(names.map(soilColor));
});

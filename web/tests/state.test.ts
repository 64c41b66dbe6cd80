import { expect, test } from "vitest";
import { State, type Soil } from "../src/fit/state";

function soil(key: string): Soil {
  return { key, path: "soils.json", name: key, soil: key, color: "blue", shown: true, points: { slip: [], adhesion: [] }, bins: [], count: 0, note: "" };
}

test("a fit of a chosen curve uses the soil that it was fitted to, not the one chosen before", () => {
  const state = new State();
  state.soils = [soil("clay"), soil("sand")];
  state.target = "clay";
  const curve = state.addCurve("exponential", {}, "sand");
  curve.data = "sand";
  state.choose(curve);
  expect([state.active?.name, state.target]).toEqual(["sand", "sand"]);
  state.choose(state.addCurve("exponential")); // drawn by hand: goes through what was chosen
  expect(state.target).toBe("sand");
  state.remove(state.soils[1] as Soil);
  expect(state.target).toBe("clay");
});

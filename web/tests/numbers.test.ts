import { expect, it } from "vitest";
import { brief, instant } from "../src/live/numbers";
import { fixed } from "../src/ui/units";

it("does not repeat a warning that stands beside its text", () => {
  expect(brief("stuck: ground speed 0.01 m/s, slip up to 98 % (fr)")).toBe("ground speed 0.01 m/s, slip up to 98 % (fr)");
  expect(brief("The wheels begin to dig: mean slip of the wheels is 73%")).toBe("The wheels begin to dig");
});

it("shows no minus before a zero", () => {
  const unit = { name: "m/s", scale: 1, decimals: 2 } as Parameters<typeof fixed>[1];
  expect([-0.001, 0.001, -0.01, -10].map((value) => fixed(value, unit))).toEqual(["0.00", "0.00", "-0.01", "-10.00"]);
});

it("reads a time since 1970 by the clock", () => {
  expect([12.34, 1795888592.7, 1e15].map(instant)).toEqual(["12.3 s", "17:56:32 UTC", "1000000000000000.0 s"]);
});

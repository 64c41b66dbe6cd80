import { expect, it } from "vitest";
import { numberOf } from "../src/ui/number";

it("reads a decimal comma as a point", () => {
  expect(["2,079", "0,55", "2.079", "−11,36", "1e-7", ",5", " 3 "].map(numberOf)).toEqual([NaN, 0.55, 2.079, -11.36, 1e-7, 0.5, 3]);
});

it("takes no text for a number", () => {
  expect(["", "0.5.5", "1.234,5", "2 m", "0x1f", "Infinity"].map(numberOf)).toEqual(Array(6).fill(NaN));
});

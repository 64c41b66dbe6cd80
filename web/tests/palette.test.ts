import { readFileSync } from "node:fs";
import { expect, test } from "vitest";
import { CURVE_COLORS } from "../src/ui/theme";

type Triple = [number, number, number];
const times = (m: Triple[], v: Triple): Triple => m.map((row) => row[0] * v[0] + row[1] * v[1] + row[2] * v[2]) as Triple;
/** What a reader without the green or the red cones sees, in linear sRGB: Machado, Oliveira and Fernandes 2009, severity 1. */
const SEEN: Triple[][] = [
  [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.01182, 0.04294, 0.968881]],
  [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
];
const XYZ: Triple[] = [[0.4124 / 0.9505, 0.3576 / 0.9505, 0.1805 / 0.9505], [0.2126, 0.7152, 0.0722], [0.0193 / 1.089, 0.1192 / 1.089, 0.9505 / 1.089]];

const linear = (hex: string): Triple => [1, 3, 5].map((i) => (parseInt(hex.slice(i, i + 2), 16) / 255 + 0.055) / 1.055).map((v) => v ** 2.4) as Triple;
function lab(rgb: Triple): Triple {
  const [x, y, z] = times(XYZ, rgb.map((v) => Math.min(Math.max(v, 0), 1)) as Triple).map((v) => Math.cbrt(Math.max(v, 1e-6))) as Triple;
  return [116 * y - 16, 500 * (x - y), 200 * (y - z)];
}

test("readers who lack the green or the red cones can tell all curve colours apart, in both themes", () => {
  const css = readFileSync(new URL("../src/styles.css", import.meta.url), "utf8");
  for (const theme of css.split(":root").slice(1, 3)) {
    const colors = CURVE_COLORS.map((name) => linear(new RegExp(`--${name}: (#[0-9a-f]{6})`).exec(theme)?.[1] ?? ""));
    for (const seen of SEEN) {
      const labs = colors.map((color) => lab(times(seen, color)));
      const apart = labs.flatMap((one, i) => labs.slice(i + 1).map((other) => Math.hypot(...one.map((v, k) => v - (other[k] as number)))));
      expect(Math.min(...apart)).toBeGreaterThan(18); // CIE 1976; 2.3 is just noticeable on large patches side by side, lines and dots need more
    }
  }
});

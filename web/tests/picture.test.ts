import { describe, expect, it } from "vitest";
import { mapOf, slipDoubt, type Axis, type Pixel } from "../src/fit/picture";

/** A printed diagram: rotated, skewed, scaled. Pixels of a point are made here by hand, not by the code under test. */
function printed(turn: number, skew: number, sLog = false, muLog = false) {
  const along: Pixel = [900 * Math.cos(turn), 900 * Math.sin(turn)];
  const up: Pixel = [-600 * Math.sin(turn + skew) * -1, -600 * Math.cos(turn + skew)];
  const sShare = (s: number): number => (sLog ? Math.log10(s / 0.01) / 2 : s);
  const muShare = (mu: number): number => (muLog ? Math.log10(mu / 0.01) / 2 : mu);
  return ([s, mu]: Pixel): Pixel => [
    120 + sShare(s) * along[0] + muShare(mu) * up[0],
    700 + sShare(s) * along[1] + muShare(mu) * up[1],
  ];
}

function calibrated(at: (value: Pixel) => Pixel, sLog: boolean, muLog: boolean): { slip: Axis; adhesion: Axis } {
  // The marks need not share an origin: the slip axis is read at mu = .3, the adhesion axis at s = .2.
  const mark = (value: Pixel, axis: 0 | 1) => ({ pixel: at(value), value: value[axis] });
  return {
    slip: { marks: [mark([0.1, 0.3], 0), mark([0.8, 0.3], 0)], log: sLog },
    adhesion: { marks: [mark([0.2, 0.05], 1), mark([0.2, 0.9], 1)], log: muLog },
  };
}

describe("a calibrated picture", () => {
  for (const [turn, skew] of [[0, 0], [0.4, 0], [-1.2, 0.3], [3, -0.5]] as const) {
    for (const [sLog, muLog] of [[false, false], [true, false], [false, true], [true, true]] as const) {
      it(`gives every point back: turned ${turn}, skewed ${skew}, logarithmic ${sLog} ${muLog}`, () => {
        const at = printed(turn, skew, sLog, muLog);
        const map = mapOf(calibrated(at, sLog, muLog));
        if (typeof map === "string") throw new Error(map);
        for (const value of [[0.05, 0.1], [0.5, 0.7], [0.95, 0.02]] as Pixel[]) {
          const [s, mu] = map.toValue(at(value));
          expect(s).toBeCloseTo(value[0], 9);
          expect(mu).toBeCloseTo(value[1], 9);
          const [x, y] = map.toPixel(value);
          expect(x).toBeCloseTo(at(value)[0], 6);
          expect(y).toBeCloseTo(at(value)[1], 6);
        }
      });
    }
  }

  it("says why a calibration is none", () => {
    const good = calibrated(printed(0, 0), false, false);
    expect(mapOf({ slip: null, adhesion: good.adhesion })).toContain("two points");
    const same = { marks: [good.slip.marks[0], { ...good.slip.marks[1], value: good.slip.marks[0].value }], log: false } as Axis;
    expect(mapOf({ ...good, slip: same })).toContain("differ");
    expect(mapOf({ slip: good.slip, adhesion: good.slip })).toContain("same direction");
    const zero = { marks: [{ pixel: [0, 0], value: 0 }, { pixel: [9, 9], value: 1 }], log: true } as Axis;
    expect(mapOf({ ...good, slip: zero })).toContain("positive");
  });
});

describe("slip values of an axis", () => {
  it("are doubted where they were typed in the other unit", () => {
    expect(slipDoubt([0, 0.006], true)).toContain("0.6 % of slip. Is it printed as a ratio, so that this is 60 %?");
    expect(slipDoubt([0, 60], false)).toContain("6000 % of slip. Is it printed in per cent, so that this is 60 %?");
    expect([slipDoubt([0, 0.05], true), slipDoubt([0, 1], false), slipDoubt([-0.2, 0.8], false)]).toEqual(["", "", ""]);
  });
});

import { expect, test } from "vitest";
import { hms, moment, timeAxis } from "../src/ui/clock";

const hours = { start: 0, end: 14_400, began: null };
const dated = { start: 0, end: 40, began: "2026-10-14T07:59:50.500000+00:00" };

test("long runs are read in hours and minutes, short ones in seconds", () => {
  expect(hms(3725.456, 2)).toBe("1:02:05.46");
  expect(hms(59.999, 2)).toBe("0:01:00.00");
  expect(hms(-5)).toBe("−0:00:05");
  expect(moment(hours, 3725.456)).toBe("1:02:05.46");
  expect(moment({ ...hours, end: 40 }, 12.3456)).toBe("12.35 s");
  expect(timeAxis({ ...hours, end: 40 }, true)).toBeNull();
  const axis = timeAxis(hours, false);
  expect(axis?.marks(0, 14_400, 9).map((v) => axis.text(v, 1800))).toEqual(["0:00:00", "0:30:00", "1:00:00", "1:30:00", "2:00:00", "2:30:00", "3:00:00", "3:30:00", "4:00:00"]);
});

test("a log with a date is read by the clock, at round times of day", () => {
  expect(moment(dated, 10.126)).toBe("2026-10-14 08:00:00.63 UTC");
  expect(moment({ ...dated, began: "2026-10-14T09:59:50" }, 10, 0)).toBe("2026-10-14 10:00:00");
  const axis = timeAxis(dated, true);
  expect(axis?.unit).toBe("UTC");
  expect(axis?.marks(0, 40, 5).map((v) => axis.text(v, 10))).toEqual(["08:00:00", "08:00:10", "08:00:20", "08:00:30"]);
  expect(axis?.marks(0, 40, 5)[0]).toBeCloseTo(9.5, 6);
});

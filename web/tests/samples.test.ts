import { expect, test } from "vitest";
import { at, farthest, Sampler, type Form, type Samples } from "../src/fit/samples";

const slip = Array.from({ length: 401 }, (_, i) => -1 + i / 200);
const line = (a: number): Samples => ({ slip, value: slip.map((s) => a * s), peak: [1, a], initial_slope: a, handles: [] });

test("values stand on straight lines between samples, none beyond them", () => {
  for (const s of [-1, -0.3333, 0, 0.1234, 1]) expect(at(line(2), s)).toBeCloseTo(2 * s, 12);
  expect(at(line(2), 1.01)).toBeNaN();
  expect(at({ ...line(2), value: slip.map(() => null) }, 0.1)).toBeNaN();
});

test("two curves are compared from 5 to 60 % of slip", () => {
  const [where, off] = farthest(line(2), line(1));
  expect(where).toBeCloseTo(0.6, 9);
  expect(off).toBeCloseTo(0.6, 9);
});

test("while a curve changes one request is under way, and the last one counts", async () => {
  const asked: number[] = [];
  const waiting: (() => void)[] = [];
  const sampler = new Sampler(
    () => sampler.of(1, form),
    (wanted: Form) => {
      asked.push(wanted.parameters["a"] as number);
      return new Promise((resolve) => waiting.push(() => resolve(line(wanted.parameters["a"] as number))));
    },
  );
  const form: Form = { model: "exponential", parameters: { a: 1 } };
  expect(sampler.of(1, form)).toBeNull();
  for (const a of [2, 3, 4]) {
    form.parameters["a"] = a;
    sampler.of(1, form);
  }
  expect(asked).toEqual([1]);
  waiting.shift()?.();
  await new Promise((done) => setTimeout(done));
  expect(asked).toEqual([1, 4]);
  waiting.shift()?.();
  await new Promise((done) => setTimeout(done));
  expect(asked).toEqual([1, 4]);
  expect(sampler.of(1, form)?.peak[1]).toBe(4);
  expect(sampler.isCurrent(1, form)).toBe(true);
});

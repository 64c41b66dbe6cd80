import { describe, expect, it } from "vitest";
import { oneAtATime } from "../src/ui/page";

function gate(): { open: () => void; closed: Promise<void> } {
  let open = (): void => undefined;
  const closed = new Promise<void>((resolve) => (open = resolve));
  return { open, closed };
}

describe("oneAtATime", () => {
  it("runs once more, and not beside itself, for all that is asked meanwhile", async () => {
    const gates = [gate(), gate()];
    let [runs, beside, most] = [0, 0, 0];
    const ask = oneAtATime(async () => {
      most = Math.max(most, ++beside);
      await gates[runs++]?.closed;
      beside--;
    });
    const [first, second, third] = [ask(), ask(), ask()];
    gates[0]?.open();
    await first;
    gates[1]?.open();
    await Promise.all([second, third]);
    expect([runs, most]).toEqual([2, 1]);
  });

  it("runs again after a run that failed, whose asker is told", async () => {
    let runs = 0;
    const ask = oneAtATime(async () => {
      if (++runs === 1) throw new Error("gone");
    });
    const [first, second] = [ask(), ask()];
    await expect(first).rejects.toThrow("gone");
    await second;
    await ask();
    expect(runs).toBe(3);
  });
});

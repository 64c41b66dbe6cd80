import { expect, it } from "vitest";
import { isOlder, type Job } from "../src/ui/api";

it("keeps what is newest of a job, whichever of an answer and a notice comes first", () => {
  const job = (state: Job["state"]): Job => ({ id: "1", kind: "soils", title: "", output: "", state, done: 0, total: 0, text: "", words: [], command: "" });
  const older = (told: Job["state"], known: Job["state"]): boolean => isOlder(job(told), job(known));
  expect([older("queued", "running"), older("running", "done"), older("done", "done")]).toEqual([true, true, true]);
  expect([older("running", "queued"), older("running", "running"), older("interrupted", "running")]).toEqual([false, false, false]);
});

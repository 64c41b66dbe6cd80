import type { Notices } from "./api";

export interface Context {
  notices: Notices;
  query: URLSearchParams;
}

/** Draw a page into `main`; what it returns is called when the page is left. */
export type Page = (main: HTMLElement, context: Context) => (() => void) | void;

/** `work`, never twice at once: what is asked for while it runs is done once more after it. Each promise ends with a run begun after its call. */
export function oneAtATime(work: () => Promise<void>): () => Promise<void> {
  let running: Promise<void> | null = null;
  let next: Promise<void> | null = null;
  const begin = (): Promise<void> => {
    running = work().finally(() => (running = null));
    return running;
  };
  return () => {
    if (next) return next;
    if (!running) return begin();
    next = running.catch(() => undefined).then(() => {
      next = null;
      return begin();
    });
    return next;
  };
}

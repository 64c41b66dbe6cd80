import type { Notices } from "./api";

export interface Context {
  notices: Notices;
  query: URLSearchParams;
}

/** Draw a page into `main`; what it returns is called when the page is left. */
export type Page = (main: HTMLElement, context: Context) => (() => void) | void;

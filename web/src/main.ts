import { Notices, SILENT } from "./ui/api";
import { foldChoosers } from "./ui/choosers";
import { fill, h } from "./ui/dom";
import { focusOn, keepFocus } from "./ui/focus";
import { SHOWN, withdraw } from "./ui/notes";
import { startTheme, switchTheme } from "./ui/theme";
import { startUnits, unitsChooser } from "./ui/units";
import type { Page } from "./ui/page";

const PAGES: Record<string, { title: string; load: () => Promise<{ page: Page }>; unlisted?: true }> = {
  start: { title: "Folder", load: () => import("./start/page") },
  drive: { title: "Drive", load: () => import("./drive/page") },
  live: { title: "Live", load: () => import("./live/page") },
  cab: { title: "Cab", load: () => import("./live/cab"), unlisted: true },
  map: { title: "Map", load: () => import("./map/page") },
  fit: { title: "Fit", load: () => import("./fit/page") },
};

const notices = new Notices();
const main = document.getElementById("main") as HTMLElement;
const bar = document.getElementById("bar") as HTMLElement;
let leave: (() => void) | void;
let opened = 0;
let unloaded = false;

function route(): { name: string; query: URLSearchParams } {
  const [path = "", query = ""] = location.hash.replace(/^#\/?/, "").split("?");
  return { name: path in PAGES ? path : "start", query: new URLSearchParams(query) };
}

async function open(): Promise<void> {
  const { name, query } = route();
  const turn = ++opened;
  const chosen = PAGES[name];
  if (!chosen) return;
  if (chosen.unlisted) fill(bar); // such a page lies over it, and its links would still be reached by Tab
  else drawBar(name);
  document.title = `${chosen.title} · Terragrip studio`;
  const page = await chosen.load().then((loaded) => loaded.page, () => missing);
  if (turn !== opened) return;
  unloaded = page === missing;
  leave?.();
  withdraw(undefined, SHOWN);
  const focused = document.activeElement?.id ?? "";
  main.className = `page-${unloaded ? "start" : name}`;
  fill(main);
  leave = page(main, { notices, query });
  if (!main.querySelector("h1")) main.prepend(h("h1", { class: "visually-hidden" }, chosen.title));
  // Of a page that was gone to from another, a control that both have, or its heading: who reads by ear hears which page it is.
  if (turn > 1 && document.activeElement === document.body) focusOn(document.getElementById(focused) ?? main.querySelector("h1"));
}

/** In place of a page that could not be loaded: no studio answers, or one of another version, which has other files. */
const missing: Page = (main) => {
  const reload = h("button", { type: "button", click: () => location.reload() }, "Reload");
  main.append(h("p", { class: "bad", role: "alert" }, "This page could not be loaded. It opens when the studio responds again; if it was updated meanwhile, reload. ", reload));
};

function drawBar(current: string): void {
  const links = Object.entries(PAGES).filter(([, { unlisted }]) => !unlisted).map(([name, { title }]) =>
    h("a", { href: `#/${name}`, "aria-current": name === current ? "page" : null }, title),
  );
  const state = h("span", { id: "connection", role: "status" });
  fill(
    bar,
    h("a", { href: "#/start", class: "brand" }, "Terragrip"),
    h("nav", { "aria-label": "Pages" }, links),
    state,
    unitsChooser(),
    h("button", { type: "button", class: "quiet", click: switchTheme, "aria-label": "Switch between light and dark" }, "◐"),
  );
}

notices.on((notice) => {
  if (notice.kind !== "connection") return;
  const state = document.getElementById("connection");
  if (state) state.textContent = notice.up ? "" : "The studio does not respond; trying again …";
  if (notice.up) withdraw(SILENT);
  if (notice.up && unloaded) void open();
});

document.querySelector(".skip")?.addEventListener("click", (event) => {
  event.preventDefault(); // the part of the address after "#" names the page
  main.focus();
});
startTheme();
startUnits();
keepFocus();
foldChoosers();
addEventListener("hashchange", () => void open());
void open();

/** The text in place of a map that cannot be drawn: why, and what to do. */

import { h } from "../ui/dom";

/** A run without positions; `recording`: the log that it is of, where the folder has it. */
export function noPositions(recording: string | null): HTMLElement {
  const columns = recording ? h("a", { href: `#/start?log=${encodeURIComponent(recording)}` }, "the log's page") : "the log's page";
  return h(
    "div",
    { class: "map-empty", id: "map-empty" },
    h("h2", {}, "This run has no positions, so it cannot be drawn on a map"),
    h("ul", {}, h("li", {}, "If the log has them under other names: choose its columns for latitude and longitude on ", columns, ", and estimate it again."), h("li", {}, "If a receiver wrote them to its own file (NMEA, CSV): give both files to ", h("code", {}, "terragrip estimate"), " (", h("code", {}, "--with"), ")."), h("li", {}, "If nothing recorded them: log a GNSS receiver on the next drive; once a second is enough.")),
  );
}

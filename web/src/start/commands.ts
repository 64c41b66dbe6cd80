/** One command over chosen files: what it needs is asked in a dialog, then it is a job. */

import { send, type Item, type Job } from "../ui/api";
import { fill, h } from "../ui/dom";
import { tried } from "../ui/notes";
import { numberField, numberOf } from "../ui/number";
import { row } from "./fields";
import { freeName, stemOf } from "./jobs";

type Ask = "vehicle" | "profile" | "library" | "ground" | "soil" | "title" | "smooth" | "cell" | "slip" | "datum";

interface Command {
  kind: string;
  title: string;
  /** The request's name of the chosen files. */
  files: string;
  asks: Ask[];
  ending: string;
  about: string;
}

const COMMANDS: Record<string, Command> = {
  batch: { kind: "batch", title: "Estimate", files: "recordings", asks: ["vehicle", "profile", "smooth"], ending: "", about: "Estimates of each log, in one folder; a log that cannot be read does not stop the others." },
  calibrate: { kind: "calibrate", title: "Calibrate a vehicle", files: "recordings", asks: ["vehicle", "profile"], ending: ".yaml", about: "Zeros from standstill, radii from straight passes without load, torque gains by comparing the wheels." },
  soils: { kind: "soils", title: "Learn soils", files: "estimates", asks: ["soil"], ending: ".json", about: "The adhesion curve of each soil that the logs name, with its interval." },
  ground: { kind: "ground", title: "Find changes of the ground", files: "estimates", asks: ["library"], ending: ".json", about: "Where the ground changes, which soil it is, and the events on it." },
  map: { kind: "map", title: "Map the ground", files: "estimates", asks: ["cell", "slip", "datum", "library", "ground"], ending: ".gpkg", about: "Cells of adhesion, soil resistance, slip and efficiency with their standard deviations; what changed between passes and runs, patches that differ from their surroundings. Runs are ordered by date." },
  report: { kind: "report", title: "Write a report", files: "estimates", asks: ["title", "library", "ground"], ending: ".html", about: "A page with figures and tables, and the same as PDF." },
};

/** The commands that files of a kind can be given to. */
export const ACTIONS: Record<string, [string, string][]> = {
  recording: [["batch", "Estimate"], ["calibrate", "Calibrate"]],
  estimates: [["soils", "Learn soils"], ["ground", "Ground"], ["map", "Map"], ["report", "Report"]],
};

/** The value for the server in place of the typed one, where they differ. */
const SENT: Partial<Record<Ask, (text: string) => unknown>> = { slip: (text) => numberOf(text) / 100, cell: numberOf };

/** Ask the user for what a command over `files` needs, and queue it; `queued` is called with its job. */
export function ask(dialog: HTMLDialogElement, name: string, files: string[], items: Item[], queued: (job: Job) => void = () => {}): void {
  const command = COMMANDS[name] as Command;
  const fields = new Map<Ask, HTMLInputElement | HTMLSelectElement>();
  const of = (kind: string): string[] => items.filter((item) => item.kind === kind).map((item) => item.path);
  const select = (kind: Ask, none: string): HTMLElement => {
    const paths = of(kind);
    const field = h("select", { id: `job-${kind}` }, none || !paths.length ? h("option", { value: "" }, paths.length ? none : none || `no ${kind} file in the folder: make one first`) : null, paths.map((path) => h("option", { value: path }, path)));
    fields.set(kind, field);
    return row(NAMES[kind], field);
  };
  const text = (kind: Ask, value: string, placeholder: string): HTMLElement => {
    const field = h("input", { type: "text", id: `job-${kind}`, value, placeholder });
    fields.set(kind, field);
    return row(NAMES[kind], field);
  };
  const number = (kind: Ask, least: number, most: number, placeholder: string): HTMLElement => {
    const field = numberField({ id: `job-${kind}`, placeholder, least, most });
    fields.set(kind, field);
    return row(NAMES[kind], field);
  };
  const forms: Record<Ask, () => HTMLElement> = {
    cell: () => number("cell", 0.05, 1000, "by the machine's mass: 1 m, above a tonne 3 m"),
    slip: () => number("slip", 2, 90, "20: the slip at which adhesion is given"),
    datum: () => text("datum", "", "EPSG:4326 (WGS 84), what GNSS receivers give"),
    vehicle: () => select("vehicle", of("vehicle").length > 1 ? "choose one" : ""),
    profile: () => select("profile", "none: the columns have Terragrip's names"),
    library: () => select("library", NO_SOILS[command.kind] ?? "none: soils are not named"),
    ground: () => select("ground", "none"),
    soil: () => text("soil", "", "as the logs' labels say"),
    title: () => text("title", "Traction report", ""),
    smooth: () => {
      const field = h("input", { type: "checkbox", id: "job-smooth" });
      fields.set("smooth", field);
      return h("label", { class: "check" }, field, "smooth (run them backwards too)");
    },
  };
  const output = h("input", { type: "text", id: "job-output", value: freeName(items, proposed(command, files), command.ending), required: true });
  const go = h("button", { type: "submit", class: "primary", id: "job-go" }, "Start");
  const form = h(
    "form",
    { method: "dialog" },
    h("h2", { id: "job-heading" }, `${command.title}: ${files.length === 1 ? files[0] : `${files.length} files`}`),
    h("p", { class: "hint" }, command.about),
    files.length > 1 ? h("details", {}, h("summary", {}, "Which"), h("ul", {}, files.map((file) => h("li", {}, file)))) : null,
    command.asks.map((one) => forms[one]()),
    row(command.ending ? "Write to" : "Folder", output),
    h("div", { class: "row end" }, h("button", { type: "button", click: () => dialog.close() }, "Cancel"), go),
  );
  const vehicle = fields.get("vehicle");
  const allowed = (): void => void (go.disabled = vehicle !== undefined && !vehicle.value);
  vehicle?.addEventListener("change", allowed);
  allowed();
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    if (go.disabled) return; // a second click would ask for the same file again
    void tried(async () => {
      const path = output.value.trim();
      const replace = items.some((item) => item.path === path || item.path.startsWith(`${path}/`));
      if (replace && !confirm(`Replace ${path}?`)) return;
      const wanted: Record<string, unknown> = { [command.files]: files, output: path, replace };
      for (const [key, field] of fields) wanted[key] = field instanceof HTMLInputElement && field.type === "checkbox" ? field.checked : field.value.trim() ? (SENT[key] ?? String)(field.value) : null;
      go.disabled = true;
      queued(await send<Job>("POST", `jobs/${command.kind}`, wanted).finally(allowed));
      dialog.close();
    }, "job");
  });
  dialog.setAttribute("aria-labelledby", "job-heading");
  fill(dialog, form);
  dialog.showModal();
}

const NAMES: Record<Ask, string> = { vehicle: "Vehicle", profile: "Profile", library: "Soils", ground: "Ground", soil: "One soil", title: "Title", smooth: "", cell: "Cell [m]", slip: "Slip [%]", datum: "Datum" };
const NO_SOILS: Record<string, string> = { report: "none: curves are learned from these runs", map: "none: adhesion is converted to that slip by the paper's curve" };

function proposed(command: Command, files: string[]): string {
  const one = files.length === 1 ? `${stemOf(files[0] as string).replace(/-estimates$/, "")}-` : "";
  return { batch: "estimates", calibrate: "calibrated-vehicle", soils: `${one}soils`, ground: `${one}ground`, map: `${one}map`, report: `${one}report` }[command.kind] as string;
}

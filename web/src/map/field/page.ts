/** A map of cells: a quantity's layers, what is uncertain paler, each cell to be read, anomalies listed. */

import * as maplibre from "maplibre-gl";
import { address } from "../../drive/link";
import { refill } from "../../start/focus";
import { get, type Item, type Job } from "../../ui/api";
import { columns } from "../../ui/columns";
import { fill, h } from "../../ui/dom";
import { CanvasInk, type Ink } from "../../ui/ink";
import { note, tried } from "../../ui/notes";
import { oneAtATime, type Page } from "../../ui/page";
import { saveMenu, type Sheet } from "../../ui/sheet";
import { color, onTheme } from "../../ui/theme";
import { onUnits } from "../../ui/units";
import { sheetOf, type Project } from "../figure";
import { showLegend } from "../quantities";
import { UnderMap } from "../under";
import { isElsewhere, listed, mapsOf } from "../which";
import { type Anomaly, type Cells, cellsOf, type Field, fieldOf, Index, type Mapped, type Place } from "./data";
import { type AreaName, inArea, type LayerName, layersOf, painted, type Painted, titleOf } from "./layers";
import { panelOf } from "./panel";
import { Raster } from "./raster";
import { reading, tableOf } from "./reading";

const AREAS: [AreaName, string][] = [["all", "Whole field"], ["field", "Without headland"], ["headland", "Headland"]];
const ARROWS: Record<string, [number, number]> = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
const NUMBERED = 40; // anomalies; more numbers would hide the map
const SHARP = 2; // pixels of a saved map's cells a point

interface Shown {
  field: Field;
  mapped: Mapped;
  cells: Cells;
  raster: Raster;
  index: Index;
  painting: Painted;
}

export const page: Page = (main, { notices, query }) => {
  const choice = h("select", { id: "map-run", "aria-label": "Run or map" });
  const quantity = h("select", { id: "field-quantity", "aria-label": "Quantity" });
  const layer = h("select", { id: "field-layer", "aria-label": "Layer" });
  const area = h("select", { id: "field-area", "aria-label": "Area" }, AREAS.map(([value, text]) => h("option", { value }, text)));
  const fade = h("input", { type: "checkbox", id: "field-fade", checked: true });
  const showWay = h("input", { type: "checkbox", id: "field-way" });
  const legend = h("div", { class: "legend-row chips" });
  const panel = h("aside", { class: "panel", "aria-label": "Results of the map", id: "field-panel" });
  const readout = h("output", { class: "line" });
  const under = new UnderMap("", false);
  const { map, box } = under;
  const over = h("canvas", { class: "over", "aria-hidden": "true" });
  main.append(
    h(
      "div",
      { class: "tools" },
      choice, quantity, layer, area,
      h("label", { class: "check", title: "The wider the 95 % interval, the paler" }, fade, "fade uncertain"),
      h("label", { class: "check", title: "The machine's track" }, showWay, "way"),
      under.choice, under.edges,
      h("span", { class: "spring" }),
      saveMenu(() => `${path.replace(/\.gpkg$/i, "")}-${quantity.value}-${layer.value}`, sheet, table),
      h("button", { type: "button", click: () => frame(), title: "Show the whole map" }, "All"),
    ),
    legend,
    h("div", { class: "field-map" }, box, panel),
    h("div", { class: "foot" }, readout),
  );
  map.getCanvasContainer().append(over);
  map.resize(); // it was made before it had a place

  let path = query.get("map") ?? "";
  let seen = ""; // size and time of change of what is open
  let opened: Field | null = null;
  let shown: Shown | null = null;
  let picked: number | null = null; // the cell that is read
  let wanted = query.get("cell"); // by a link, until its cell is there
  let way: number[][] | null = null;
  let jobs: Job[] = [];
  let turn = 0;
  const kept = new Map<string, Cells>(); // by quantity, of what is open
  fade.checked = query.get("fade") !== "0";
  area.value = AREAS.some(([name]) => name === query.get("area")) ? (query.get("area") as string) : "all";

  const project: Project = (place) => {
    const { x, y } = map.project(place);
    return [x, y];
  };

  async function open(): Promise<void> {
    const found = await tried(() => fieldOf(path));
    if (!found) return leave(`${path} cannot be read as a map, or is not in this folder. Choose another.`);
    box.querySelector(".map-empty")?.remove();
    opened = found;
    bare(false);
    picked = null;
    way = null;
    kept.clear();
    const before = quantity.value || query.get("quantity") || "";
    fill(quantity, found.quantities.map(({ name }) => h("option", { value: name }, titleOf(name, found))));
    quantity.value = found.quantities.some(({ name }) => name === before) ? before : (found.quantities[0]?.name ?? "");
    frame();
    await load();
  }

  function leave(why: string): void {
    opened = shown = null;
    bare(true);
    fill(legend);
    fill(panel);
    readout.value = "";
    box.querySelector(".map-empty")?.remove();
    box.append(h("div", { class: "map-empty", id: "map-empty" }, h("h2", {}, why), h("p", {}, "A map is made from estimates with positions: ", h("a", { href: "#/start" }, "Folder"), " → Estimates → Map, or ", h("code", {}, "terragrip map estimates.parquet -o map.gpkg"), ".")));
    delete box.dataset.cells;
    draw();
  }

  /** Without what speaks of cells, where there are none. */
  function bare(without: boolean): void {
    for (const one of [quantity, layer, area, panel, fade.parentElement, showWay.parentElement]) if (one) one.hidden = without;
    under.box.parentElement?.classList.toggle("alone", without);
  }

  /** Have the chosen quantity's cells, then show its layer. */
  async function load(): Promise<void> {
    const field = opened;
    const mapped = field?.quantities.find(({ name }) => name === quantity.value);
    if (!field || !mapped) return;
    const mine = ++turn;
    const cells = kept.get(mapped.name) ?? (await tried(() => cellsOf(path, field.version, mapped.name)));
    if (!cells || mine !== turn) return;
    kept.set(mapped.name, cells);
    const layers = layersOf(field, mapped);
    const before = layer.value || query.get("layer") || "";
    fill(layer, layers.map(({ value, title, none }) => h("option", { value, disabled: none !== undefined }, none ? `${title} (${none})` : title)));
    layer.value = layers.some(({ value, none }) => value === before && !none) ? before : "value";
    const at = picked !== null && shown ? ([shown.cells.column[picked], shown.cells.row[picked]] as [number, number]) : placeIn(wanted);
    wanted = null;
    const raster = new Raster(field);
    const inside = inArea(cells, area.value as AreaName);
    const index = new Index(cells, inside);
    const painting = painted(layer.value as LayerName, cells, field, mapped, area.value as AreaName, fade.checked);
    shown = { field, mapped, cells, raster, index, painting };
    picked = at ? (index.at(...at) ?? null) : null;
    box.dataset.cells = String(raster.paint(cells, inside, painting));
    fade.disabled = layer.value !== "value" && layer.value !== "soil";
    showLegend(legend, painting.legend);
    refill(panel, panelOf(field, mapped, anomaliesHere(), goTo, jobs.findLast((job) => job.kind === "map" && job.output === path && job.state === "done")));
    map.getCanvas().setAttribute("aria-label", `${titleOf(mapped.name, field)} by cell: the arrow keys go from cell to cell, + and − zoom, 0 shows all`);
    tell(picked);
    draw();
  }

  const placeIn = (text: string | null): [number, number] | null => {
    const [column, row] = (text ?? "").split(",").map(Number);
    return text && Number.isInteger(column) && Number.isInteger(row) ? [column as number, row as number] : null;
  };
  const anomaliesHere = (): Anomaly[] => (opened?.anomalies ?? []).filter((one) => one.quantity === quantity.value);

  function draw(): void {
    const { clientWidth: width, clientHeight: height } = map.getContainer();
    const sharp = window.devicePixelRatio || 1;
    if (over.width !== Math.round(width * sharp) || over.height !== Math.round(height * sharp)) [over.width, over.height] = [Math.round(width * sharp), Math.round(height * sharp)];
    const pen = over.getContext("2d");
    if (!pen) return;
    pen.setTransform(sharp, 0, 0, sharp, 0, 0);
    pen.clearRect(0, 0, width, height);
    if (!shown) return;
    shown.raster.draw(pen, project);
    drawLines(new CanvasInk(pen), project);
  }

  /** What lies over the cells: the way, outlines of anomalies with their numbers, the cell that is read. */
  function drawLines(ink: Ink, to: Project): void {
    const around = (points: Place[]): number[] => points.flatMap((place) => to(place));
    if (showWay.checked) for (const line of way ?? []) ink.line(chunked(line).flatMap((place) => to(place)), { color: color("ink"), width: 1, alpha: 0.6 });
    const found = anomaliesHere();
    found.forEach((one, i) => {
      for (const ring of one.rings) {
        ink.line(around(ring), { color: color("paper"), width: 4.5, alpha: 0.9 });
        ink.line(around(ring), { color: color("ink"), width: 2 });
      }
      const [x, y] = to(one.place);
      if (i < NUMBERED) {
        ink.dots([x, y], 8.5, color("paper"), 0.9);
        ink.text(String(i + 1), x, y, color("ink"), "middle", { bold: true });
      }
    });
    if (picked === null || !shown) return;
    const [column, row] = [shown.cells.column[picked] as number, shown.cells.row[picked] as number];
    const corners = [[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]].map(([x, y]) => shown?.raster.placeOf(column + (x as number), row + (y as number)) as Place);
    ink.line(around(corners), { color: color("paper"), width: 5 });
    ink.line(around(corners), { color: color("accent"), width: 2.5 });
  }

  function tell(i: number | null): void {
    readout.value = shown && i !== null ? reading(i, shown.cells, shown.field, shown.mapped, placeOf(i)) : shown ? "Point at a cell, or move with the arrow keys, to read it." : "";
  }

  const placeOf = (i: number): Place => (shown ? shown.raster.placeOf((shown.cells.column[i] as number) + 0.5, (shown.cells.row[i] as number) + 0.5) : [NaN, NaN]);

  /** The cell that is read from now on; the map follows where it is out of sight. */
  function pick(i: number | null): void {
    picked = i;
    if (i !== null && !map.getBounds().contains(placeOf(i))) map.jumpTo({ center: placeOf(i) });
    tell(i);
    draw();
    remember();
  }

  function pointedAt(point: { x: number; y: number }): number | null {
    const at = shown?.raster.cellAt([point.x, point.y], project);
    return at ? (shown?.index.at(...at) ?? null) : null;
  }

  function goTo(one: Anomaly): void {
    const bounds = new maplibre.LngLatBounds();
    for (const ring of one.rings) for (const place of ring) bounds.extend(place);
    map.fitBounds(bounds, { padding: 120, duration: 0, maxZoom: 22 });
    const at = shown?.raster.cellAt(project(one.place), project);
    pick(at ? (shown?.index.nearest(...at) ?? null) : null);
  }

  function frame(): void {
    if (!opened?.tiles.length) return;
    const bounds = new maplibre.LngLatBounds();
    for (const { corners } of opened.tiles) for (const corner of corners) bounds.extend(corner);
    map.fitBounds(bounds, { padding: 30, duration: 0, maxZoom: 22 });
  }

  function remember(): void {
    const cell = shown && picked !== null ? `${shown.cells.column[picked]},${shown.cells.row[picked]}` : "";
    address("map", () => new URLSearchParams({ map: path, quantity: quantity.value, layer: layer.value, ...(area.value === "all" ? {} : { area: area.value }), ...(fade.checked ? {} : { fade: "0" }), ...(cell ? { cell } : {}) }).toString().replaceAll("%2C", ","));
  }

  async function loadWay(): Promise<void> {
    const field = opened;
    if (!way && field && showWay.checked) {
      const found = await tried(() => columns("map/way", { path, version: field.version }, []));
      if (!found || opened !== field) return;
      way = linesOf(found.data as [Float64Array, Float64Array]);
      if (found.of && found.of > found.count) note(`The track is thinned to ${found.count} of ${found.of} points.`);
    }
    draw();
  }

  async function sheet(): Promise<Sheet | undefined> {
    if (!shown) return undefined;
    const { raster, painting } = shown;
    const { clientWidth: width, clientHeight: height } = map.getContainer();
    const canvas = h("canvas", { width: SHARP * width, height: SHARP * height });
    const pen = canvas.getContext("2d");
    if (!pen) return undefined;
    pen.scale(SHARP, SHARP);
    raster.draw(pen, project);
    const cells = new Image();
    cells.src = canvas.toDataURL();
    await cells.decode();
    return sheetOf({
      map,
      title: path,
      legend: painting.legend,
      base: await under.picture(),
      draw: (ink, to, { x, y }) => {
        ink.picture(cells, [1 / SHARP, 0, 0, 1 / SHARP, x, y]);
        drawLines(ink, to);
      },
    });
  }

  async function table(): Promise<Blob | undefined> {
    return shown ? tableOf(shown.cells, shown.field, shown.mapped, inArea(shown.cells, area.value as AreaName), (column, row) => (shown as Shown).raster.placeOf(column, row)) : undefined;
  }

  map.on("move", draw);
  map.on("resize", draw);
  map.on("mousemove", (event) => tell(pointedAt(event.point) ?? picked));
  map.on("click", (event) => pick(pointedAt(event.point)));
  map.getCanvas().addEventListener("mouseleave", () => tell(picked));
  map.getCanvas().addEventListener("keydown", (event) => {
    if (!shown || event.ctrlKey || event.metaKey || event.altKey) return;
    const arrow = ARROWS[event.key];
    if (arrow) {
      const centre = shown.raster.cellAt(project(map.getCenter().toArray() as Place), project) ?? [0, 0];
      pick((picked === null ? shown.index.nearest(...centre) : (shown.index.next(picked, arrow) ?? picked)) ?? null);
    } else if (event.key === "+" || event.key === "=") map.zoomIn({ duration: 0 });
    else if (event.key === "-") map.zoomOut({ duration: 0 });
    else if (event.key === "0") frame();
    else if (event.key === "Escape") pick(null);
    else return;
    event.preventDefault();
  });
  choice.addEventListener("change", () => {
    if (isElsewhere(choice.value, "map")) return;
    path = choice.value;
    seen = "";
    void reload();
  });
  for (const one of [quantity, layer, area, fade]) {
    one.addEventListener("change", () => {
      remember();
      void load();
    });
  }
  showWay.addEventListener("change", () => void loadWay());

  const reload = oneAtATime(async () => {
    const [folder, known] = await Promise.all([tried(() => get<{ items: Item[] }>("folder")), tried(() => get<Job[]>("jobs"))]);
    if (!folder) return;
    jobs = known ?? [];
    const maps = mapsOf(folder.items);
    path ||= [...maps.keys()][0] ?? "";
    const now = maps.get(path) ?? "";
    fill(choice, listed(folder.items, path));
    under.offer(folder.items);
    if (!now) leave(path ? (opened ? `${path} was removed from the folder. Choose another.` : `${path} cannot be read as a map, or is not in this folder. Choose another.`) : "There is no map in this folder yet");
    else if (now !== seen || !opened) {
      if (opened && seen) note(`${path} was replaced: reloaded`);
      seen = now;
      await open();
    }
  });

  const forgets = [notices.on((notice) => notice.kind === "folder" && void reload()), onUnits(() => void load()), onTheme(() => void load())];
  void reload();
  Object.assign(window, { terragripField: { map, read: () => shown, picked: () => picked, pixelOf: (column: number, row: number) => (shown ? project(shown.raster.placeOf(column + 0.5, row + 0.5)) : null), ink: over } });
  return () => {
    turn++;
    forgets.forEach((forget) => forget());
    under.leave();
  };
};

/** Lines between the gaps, each longitude and latitude one after the other. */
function linesOf([longitude, latitude]: [Float64Array, Float64Array]): number[][] {
  const lines: number[][] = [[]];
  longitude.forEach((east, i) => {
    if (Number.isNaN(east)) lines.push([]);
    else lines.at(-1)?.push(east, latitude[i] as number);
  });
  return lines.filter((line) => line.length > 2);
}

function chunked(line: number[]): Place[] {
  return Array.from({ length: line.length / 2 }, (_, i) => [line[2 * i] as number, line[2 * i + 1] as number]);
}

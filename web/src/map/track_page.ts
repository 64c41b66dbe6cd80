/** The map: the track coloured by any quantity, soils and events, a picture as basemap, brushed together with a chart. */

import * as maplibre from "maplibre-gl";
import { Way } from "../drive/along";
import { Charts } from "../drive/charts";
import { address, read, written, type View } from "../drive/link";
import { during, EVENT_COLORS, panelsOf, soilColor, type Run } from "../drive/run";
import { get, type Item } from "../ui/api";
import { brushed } from "../ui/brush";
import { moment } from "../ui/clock";
import { columns, type Columns } from "../ui/columns";
import { digits, fill, h } from "../ui/dom";
import { note, tried } from "../ui/notes";
import { oneAtATime, type Page } from "../ui/page";
import { notHere, runsOf } from "../ui/runs";
import { color, onTheme } from "../ui/theme";
import { saveMenu, type Sheet } from "../ui/sheet";
import { onUnits, unitOf, withUnit } from "../ui/units";
import { sheetOf } from "./figure";
import { isNamed, quantitiesOf, showLegend, soilAt, wordsOf, type Legend, type Quantity } from "./quantities";
import { shade } from "./shade";
import { opacity, outliers, outside, spread, UNLABELLED } from "./scale";
import { noPositions } from "./empty";
import { MapMaking } from "./making";
import { drawTrack, linesOf, tableOf } from "./track";
import { UnderMap } from "./under";
import { isElsewhere, listed } from "./which";

export const page: Page = (main, { notices, query }) => {
  const choice = h("select", { id: "map-run", "aria-label": "Run or map" });
  const quantity = h("select", { id: "map-quantity", "aria-label": "Coloured by" });
  const doubt = h("input", { type: "checkbox", id: "map-doubt" });
  const legend = h("div", { class: "legend-row chips" });
  const under = new UnderMap("track-rim", true);
  const { map, ready, box } = under;
  let items: Item[] = [];
  const making = new MapMaking(notices, () => (hasPlaces() ? path : ""), () => items);
  const charts = new Charts();
  const readout = h("output", { class: "line" });
  main.append(
    h("div", { class: "tools" }, choice, quantity, h("label", { class: "check", title: "The wider the 95 % interval, the paler" }, doubt, "fade uncertain values"), under.choice, under.edges, h("span", { class: "spring" }), making.button, saveMenu(() => `map-${path.replace(/\.parquet$/, "")}-${quantity.value}`, sheet, table), h("button", { type: "button", click: () => frame() }, "Whole track")),
    making.element,
    legend,
    box,
    charts.element,
    h("div", { class: "foot" }, readout),
  );
  map.resize(); // it was made before it had a place
  let run: Run | null = null;
  let path = "";
  let seen = ""; // size and time of change of what is open
  let track: Columns | null = null;
  let key: Legend | null = null; // of the colours
  let here: number | null = null; // the time under the cursor
  let picked: number | null = null;
  let linked: View | null = read(query); // until its run is open

  const forgetTheme = onTheme(() => {
    if (map.getLayer("brushed")) map.setPaintProperty("brushed", "line-color", color("accent"));
    if (map.getLayer("track-rim")) map.setPaintProperty("track-rim", "line-color", color("muted"));
    void draw();
  });

  const names = (): Quantity[] => (run ? quantitiesOf(run) : []);

  async function open(wanted: string): Promise<void> {
    const found = await tried(() => get<Run>("drive", { path: wanted }));
    if (!found) return leave(wanted, notHere(wanted));
    path = wanted;
    run = found;
    choice.value = wanted;
    const link = linked?.path === wanted ? linked : null;
    const before = (link && query.get("quantity")) || quantity.value;
    linked = null;
    picked = link?.at ?? null;
    if (link) charts.uprights = { ...link.uprights };
    fill(quantity, names().map((n) => h("option", { value: n.value }, n.title)));
    quantity.value = names().some((n) => n.value === before) ? before : `slip_${found.wheels.at(-1)}`;
    showChart(found);
    charts.mark(picked);
    await draw();
    frame();
    if (link?.range) charts.zoom(link.range);
    else charts.follow();
    remember();
  }

  function showChart(of: Run): void {
    charts.show([{ path, run: of, label: path, way: new Way("time", of) }], panelsOf(of, of.wheels.slice(-1)).filter((p) => p.key === "slip"));
  }

  /** No run is shown, and why. */
  function leave(wanted: string, why: string): void {
    path = wanted;
    run = null;
    making.button.disabled = true;
    track = null;
    charts.clear(why);
    fill(legend);
    readout.value = "";
    void ready.then(() => run ?? replace("track", [], "line"));
  }

  const hasPlaces = (): boolean => ["latitude", "longitude"].every((name) => run?.columns.includes(name));

  /** Whether the quantity has an interval and is to fade by it. */
  function fades(): boolean {
    return doubt.checked && (run?.columns.includes(`${quantity.value}_std`) ?? false);
  }

  async function draw(): Promise<void> {
    if (!run) return;
    doubt.disabled = !run.columns.includes(`${quantity.value}_std`);
    const asked = names().find((n) => n.value === quantity.value);
    const named = isNamed(quantity.value);
    box.querySelector(".map-empty")?.remove();
    making.button.disabled = !hasPlaces();
    if (!hasPlaces()) {
      track = null;
      fill(legend);
      replace("track", [], "line");
      box.append(noPositions(run.recording));
      return;
    }
    track = (await tried(() => columns("drive/track", { path, version: run?.version }, named ? [] : [quantity.value, ...(fades() ? [`${quantity.value}_std`] : [])]))) ?? null;
    await ready;
    if (!track?.count) {
      replace("track", [], "line");
      if (track) box.append(noPositions(run.recording)); // the columns are there, and empty
      return;
    }
    const [time, , , values, stds] = track.data as [Float64Array, Float64Array, Float64Array, Float64Array | undefined, Float64Array | undefined];
    // A stuck wheel's slip must not wash out the rest of the scale.
    const [low, high] = values ? spread(values.filter((_, i) => !eventAt(time[i] as number))) : [0, 1];
    const beyond = outliers(values, low, high);
    const paint = (i: number): string => {
      const t = time[i] as number;
      if (quantity.value === "soil") return color(soilAt(run, t) ? soilColor(soilAt(run, t)) : UNLABELLED);
      if (quantity.value === "event") return color(EVENT_COLORS[eventAt(t)?.kind ?? ""] ?? "line");
      const v = values?.[i] ?? NaN;
      return Number.isNaN(v) ? color("line") : shade((v - low) / (high - low));
    };
    const features = linesOf(track, paint, (i) => (stds ? opacity(1.96 * (stds[i] as number), high - low) : 1));
    replace("track", features, "line");
    drawPicked();
    drawBrushed();
    const unit = unitOf(quantity.value);
    const about = `5 % to 95 % of the run, rows with events left out${outside(beyond, unit.scale, unit.name)}${fades() ? "; paler where the 95 % interval is wider, palest where it is as wide as the scale" : ""}`;
    key = named && asked ? wordsOf(run, asked, time) : { title: asked?.title ?? "", unit, low, high, about };
    showLegend(legend, key);
  }

  function eventAt(t: number) {
    return during(run?.events, t);
  }

  /** The map that is shown, as a sheet. */
  async function sheet(): Promise<Sheet | undefined> {
    if (!track?.count || !key) return undefined;
    const drawn = { track: featuresOf("track"), brushed: featuresOf("brushed"), picked: picked === null ? null : placeOf(picked) };
    return sheetOf({ map, title: path, legend: key, base: await under.picture(), draw: (ink, project) => drawTrack(ink, project, drawn) });
  }

  function featuresOf(id: string): GeoJSON.Feature[] {
    const data = (map.getSource(id) as maplibre.GeoJSONSource | undefined)?.serialize().data;
    return typeof data === "object" && data.type === "FeatureCollection" ? data.features : [];
  }

  async function table(): Promise<Blob | undefined> {
    return track?.count && run && key ? tableOf(track, run, key, charts.isWhole ? null : charts.range) : undefined;
  }

  function replace(id: string, features: GeoJSON.Feature[], type: "line" | "circle"): void {
    const data: GeoJSON.FeatureCollection = { type: "FeatureCollection", features };
    const source = map.getSource(id) as maplibre.GeoJSONSource | undefined;
    if (source) {
      source.setData(data);
      return;
    }
    map.addSource(id, { type: "geojson", data });
    if (type === "line") {
      // A rim, so that the dark end of the scale stands out on a dark ground too.
      map.addLayer({ id: `${id}-rim`, source: id, type: "line", layout: { "line-cap": "round", "line-join": "round" }, paint: { "line-color": color("muted"), "line-width": 8 } });
    }
    if (type === "line") map.addLayer({ id, source: id, type: "line", layout: { "line-cap": "round", "line-join": "round" }, paint: { "line-color": ["get", "shade"], "line-opacity": ["coalesce", ["get", "ink"], 1], "line-width": 5 } });
    else map.addLayer({ id, source: id, type: "circle", paint: { "circle-radius": 7, "circle-color": color("paper"), "circle-stroke-width": 3, "circle-stroke-color": color("ink") } });
  }

  function frame(): void {
    if (!track?.count) return;
    map.resize(); // without a run it was hidden
    const [, lon, lat] = track.data as [Float64Array, Float64Array, Float64Array];
    const bounds = new maplibre.LngLatBounds();
    for (let i = 0; i < lon.length; i++) bounds.extend([lon[i] as number, lat[i] as number]);
    map.fitBounds(bounds, { padding: 40, duration: 0, maxZoom: 24 });
  }

  /** Mark a time on the track and in the chart, for Drive too: the address holds it. */
  function pick(time: number): void {
    picked = time;
    charts.mark(time);
    drawPicked();
    remember();
  }

  function drawPicked(): void {
    if (!under.loaded) return;
    const at = track?.count && picked !== null ? placeOf(picked) : null;
    replace("picked", at ? [{ type: "Feature", properties: {}, geometry: { type: "Point", coordinates: at } }] : [], "circle");
    map.setPaintProperty("picked", "circle-color", color("accent"));
  }

  function placeOf(time: number): [number, number] {
    const [times, lon, lat] = (track as Columns).data as [Float64Array, Float64Array, Float64Array];
    const i = nearest(times, time);
    return [lon[i] as number, lat[i] as number];
  }

  function remember(): void {
    address("map", () => {
      return `${written({ path, range: charts.isWhole ? null : charts.range, at: picked, uprights: charts.uprights })}&quantity=${encodeURIComponent(quantity.value)}`;
    });
  }

  function mark(time: number | null): void {
    here = time;
    if (!track?.count || time === null || !under.loaded) return;
    const i = nearest(track.data[0] as Float64Array, time);
    const [lon, lat] = [(track.data[1] as Float64Array)[i] as number, (track.data[2] as Float64Array)[i] as number];
    replace("here", [{ type: "Feature", properties: {}, geometry: { type: "Point", coordinates: [lon, lat] } }], "circle");
    tell(i);
  }

  function tell(i: number): void {
    if (!track) return;
    const asked = names().find((n) => n.value === quantity.value);
    const unit = unitOf(quantity.value);
    const t = (track.data[0] as Float64Array)[i] as number;
    const v = track.data[3]?.[i];
    const event = eventAt(t);
    readout.value = [`t ${run ? moment(run, t) : ""}`, v === undefined ? "" : `${asked?.title} ${withUnit(digits(v * unit.scale), unit)}`, soilAt(run, t), event ? `${event.kind}${event.why ? `: ${event.why}` : ""}` : ""].filter(Boolean).join("   ");
  }

  charts.onCursor = mark;
  /** A wide rim about the stretch whose times are shown. */
  function drawBrushed(): void {
    if (!under.loaded || !track || !run) return;
    const [start, end] = charts.range;
    const whole = start <= run.start && end >= run.end;
    const [time, lon, lat] = track.data as [Float64Array, Float64Array, Float64Array];
    const line: number[][] = [];
    if (!whole && track.count) for (let i = nearest(time, start); i <= nearest(time, end); i++) line.push([lon[i] as number, lat[i] as number]);
    const features: GeoJSON.Feature[] = line.length > 1 ? [{ type: "Feature", properties: {}, geometry: { type: "LineString", coordinates: line } }] : [];
    const source = map.getSource("brushed") as maplibre.GeoJSONSource | undefined;
    if (source) return void source.setData({ type: "FeatureCollection", features });
    map.addSource("brushed", { type: "geojson", data: { type: "FeatureCollection", features } });
    map.addLayer({ id: "brushed", source: "brushed", type: "line", layout: { "line-cap": "round", "line-join": "round" }, paint: { "line-color": color("accent"), "line-width": 16, "line-opacity": 0.45 } }, map.getLayer("track-rim") ? "track-rim" : undefined);
  }

  charts.onUpright = remember;
  charts.onRange = ([start, end]) => {
    remember();
    drawBrushed();
    if (!track?.count || !run) return;
    if (start <= run.start && end >= run.end) return frame();
    const time = track.data[0] as Float64Array;
    const [a, b] = [nearest(time, start), nearest(time, end)];
    const bounds = new maplibre.LngLatBounds();
    for (let i = a; i <= b; i++) bounds.extend([(track.data[1] as Float64Array)[i] as number, (track.data[2] as Float64Array)[i] as number]);
    map.fitBounds(bounds, { padding: 60, duration: 200, maxZoom: 24 });
  };
  map.on("mousemove", (event) => {
    if (!track?.count) return;
    const [, lon, lat] = track.data as [Float64Array, Float64Array, Float64Array];
    let best = -1;
    let least = 0.02 * (map.getBounds().getEast() - map.getBounds().getWest());
    for (let i = 0; i < lon.length; i++) {
      const away = Math.hypot((lon[i] as number) - event.lngLat.lng, (lat[i] as number) - event.lngLat.lat);
      if (away < least) [least, best] = [away, i];
    }
    if (best >= 0) charts.point((track.data[0] as Float64Array)[best] as number, true);
    else here = null;
  });
  map.on("click", () => here !== null && pick(here));
  charts.onPick = pick;

  choice.addEventListener("change", () => {
    if (isElsewhere(choice.value, "path")) return;
    seen = "";
    path = choice.value;
    run = null;
    void reload();
  });
  charts.onReplaced = () => void reload();
  quantity.addEventListener("change", () => {
    remember();
    void draw();
  });
  doubt.addEventListener("change", () => void draw());
  const reload = oneAtATime(async () => {
    const folder = await tried(() => get<{ items: Item[] }>("folder"));
    if (!folder) return;
    items = folder.items;
    const runs = runsOf(items);
    const wanted = path || query.get("path") || brushed()?.path || [...runs.keys()][0] || "";
    const now = runs.get(wanted) ?? "";
    fill(choice, listed(items, wanted));
    under.offer(items);
    if (!wanted) charts.clear("Nothing to show yet: open a recording on the folder page and estimate it.");
    else if (!now) leave(wanted, path && run ? `${wanted} was removed from the folder. Choose another run.` : notHere(wanted));
    else if (now !== seen || !run) {
      if (run && seen) note(`${wanted} was replaced: reloaded`);
      seen = now;
      await open(wanted);
    }
  });

  const forgets = [
    notices.on((notice) => notice.kind === "folder" && void reload()),
    onUnits(() => {
      if (!run) return;
      showChart(run);
      void draw();
    }),
    forgetTheme,
  ];
  void reload();
  Object.assign(window, { terragripMap: { map, charts } });
  return () => {
    forgets.forEach((forget) => forget());
    making.leave();
    charts.close();
    under.leave();
  };
};

function nearest(time: Float64Array, wanted: number): number {
  let [low, high] = [0, time.length - 1];
  while (low < high) {
    const middle = (low + high) >> 1;
    if ((time[middle] as number) < wanted) low = middle + 1;
    else high = middle;
  }
  return low;
}

/** The map itself: MapLibre on plain paper, in the theme's colours, and a picture of the user's own as basemap. */

import "maplibre-gl/dist/maplibre-gl.css";
import * as maplibre from "maplibre-gl";
import workerUrl from "maplibre-gl/dist/maplibre-gl-worker.mjs?worker&url";
import { address as server, get, type Item } from "../ui/api";
import { fill, h } from "../ui/dom";
import { tried } from "../ui/notes";
import { color, onTheme } from "../ui/theme";
import { corners, type Corners, keepBasemap, keepCorners, keptBasemap, keptCorners, type Placed } from "./basemap";
import { pictureOf } from "./figure";

maplibre.setWorkerUrl(workerUrl);

export class UnderMap {
  readonly box = h("div", { class: "map", id: "map" });
  readonly map: maplibre.Map;
  /** When the map accepts layers. */
  readonly ready: Promise<void>;
  loaded = false;
  /** Which picture lies below. */
  readonly choice = h("select", { "aria-label": "Basemap" });
  /** Changes the edges of a picture without coordinates. */
  readonly edges = h("button", { type: "button", id: "map-edges", hidden: true, click: () => void this.replaceEdges(), title: "Change the edges of the picture" }, "Edges");
  private forget: () => void;

  /** `above`: the layer that the picture lies under; `keyboard`: the arrow keys move the map. */
  constructor(
    private above: string,
    keyboard: boolean,
  ) {
    this.map = new maplibre.Map({
      container: this.box,
      style: { version: 8, sources: {}, layers: [{ id: "paper", type: "background", paint: { "background-color": color("panel") } }] },
      attributionControl: false,
      dragRotate: false,
      pitchWithRotate: false,
      keyboard,
    });
    this.map.touchZoomRotate.disableRotation();
    this.map.addControl(new maplibre.ScaleControl({ unit: "metric" }));
    this.map.addControl(new maplibre.NavigationControl({ showCompass: false }));
    this.ready = new Promise<void>((resolve) => this.map.on("load", () => resolve())).then(() => void (this.loaded = true));
    this.forget = onTheme(() => {
      if (this.map.isStyleLoaded()) this.map.setPaintProperty("paper", "background-color", color("panel"));
    });
    this.choice.addEventListener("change", () => void this.lay(this.choice.value, true));
  }

  /** Offer the pictures of the folder; the first time the one that lay there last is laid again. */
  offer(items: Item[]): void {
    const pictures = items.filter((item) => item.kind === "basemap" || (item.kind === "picture" && !item.path.endsWith(".svg"))).map((item) => item.path);
    const first = !this.choice.options.length;
    const kept = first ? keptBasemap() : this.choice.value;
    const before = pictures.includes(kept) ? kept : "";
    fill(this.choice, h("option", { value: "" }, "No basemap"), pictures.map((name) => h("option", { value: name, selected: name === before }, name)));
    if (first && before) void this.lay(before, false);
  }

  /** The picture that lies there, for a sheet. */
  async picture(): Promise<{ image: HTMLImageElement; corners: Corners } | null> {
    const at = this.choice.value ? (this.map.getSource("base") as maplibre.ImageSource | undefined)?.coordinates : undefined;
    return at ? { image: await pictureOf(server("basemap/picture", { path: this.choice.value })), corners: at as Corners } : null;
  }

  leave(): void {
    this.forget();
    this.map.remove();
  }

  /** Place a picture; `ask`: for its edges, where neither it nor this browser has them. */
  private async lay(picture: string, ask: boolean): Promise<void> {
    await this.ready;
    const { map } = this;
    this.edges.hidden = true;
    if (map.getLayer("base")) map.removeLayer("base");
    if (map.getSource("base")) map.removeSource("base");
    keepBasemap(picture);
    if (!picture) return;
    const placed = await tried(() => get<Placed>("basemap", { path: picture }));
    if (!placed) return;
    const known = placed.corners ?? keptCorners(picture);
    const at = known ?? (ask ? await corners(picture, map.getBounds()) : null);
    if (!at) {
      this.choice.value = "";
      keepBasemap("");
      return;
    }
    if (!placed.corners) keepCorners(picture, at);
    this.edges.hidden = placed.corners !== null;
    map.addSource("base", { type: "image", url: new URL(server("basemap/picture", { path: picture }), location.href).href, coordinates: at });
    map.addLayer({ id: "base", type: "raster", source: "base" }, map.getLayer(this.above) ? this.above : undefined);
  }

  private async replaceEdges(): Promise<void> {
    const picture = this.choice.value;
    const at = await corners(picture, this.map.getBounds(), keptCorners(picture));
    if (!at) return;
    keepCorners(picture, at);
    await this.lay(picture, false);
  }
}

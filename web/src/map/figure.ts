/** The map as a sheet, redrawn: the part that is shown, with title, legend, degrees at its edges and a scale in metres. */

import type { Map as Maplibre } from "maplibre-gl";
import { DRY, type Box, type Ink } from "../ui/ink";
import { LINE, type Sheet } from "../ui/sheet";
import { color } from "../ui/theme";
import { ticks } from "../ui/view";
import type { Corners } from "./basemap";
import { inkLegend, type Legend } from "./quantities";

const [LEFT, RIGHT, FOOT, GAP] = [84, 24, 40, 14];
const EARTH = 40_075_016.686; // metres around the equator
const TILE = 512; // pixels of the world at zoom 0

export type Place = [number, number];
export type Project = (place: Place) => Place;

export interface Drawing {
  map: Maplibre;
  title: string;
  legend: Legend;
  base: { image: HTMLImageElement; corners: Corners } | null;
  /** Draw what lies on the map; `box`: where the map is on the sheet. */
  draw(ink: Ink, project: Project, box: Box): void;
}

export function sheetOf({ map, title, legend, base, draw }: Drawing): Sheet {
  const { clientWidth: width, clientHeight: height } = map.getContainer();
  const whole = width + LEFT + RIGHT;
  const top = GAP + LINE + inkLegend(DRY, legend, LEFT, GAP + LINE + 4, width) + 4;
  const box: Box = { x: LEFT, y: top, width, height };
  const project = (place: Place): Place => {
    const { x, y } = map.project(place);
    return [LEFT + x, top + y];
  };
  return {
    width: whole,
    height: top + height + FOOT,
    draw: (ink) => {
      ink.text(title, LEFT, GAP, color("ink"), "start", { bold: true });
      inkLegend(ink, legend, LEFT, GAP + LINE + 4, width);
      ink.clipped(box, () => {
        ink.area([box.x, top, box.x + width, top, box.x + width, top + height, box.x, top + height], color("panel"), 1);
        if (base) ink.picture(base.image, laid(base.image, base.corners.map(project) as Place[]));
        draw(ink, project, box);
        drawScale(ink, map, box);
      });
      drawDegrees(ink, map, box, project);
    },
  };
}

/** Where the pixels of a picture lie, by three of its corners. */
function laid({ naturalWidth: w, naturalHeight: h }: HTMLImageElement, [tl, tr, , bl]: Place[]): [number, number, number, number, number, number] {
  if (!tl || !tr || !bl) return [1, 0, 0, 1, 0, 0];
  return [(tr[0] - tl[0]) / w, (tr[1] - tl[1]) / w, (bl[0] - tl[0]) / h, (bl[1] - tl[1]) / h, tl[0], tl[1]];
}

function drawDegrees(ink: Ink, map: Maplibre, { x, y, width, height }: Box, project: (place: Place) => Place): void {
  const bounds = map.getBounds();
  const middle = map.getCenter();
  const edge = color("muted");
  const foot = y + height;
  ink.line([x, y, x + width, y, x + width, foot, x, foot, x, y], { color: edge });
  const label = (at: number[]): ((v: number) => string) => {
    const step = (at[1] ?? 1) - (at[0] ?? 0);
    const decimals = Math.min(Math.max(Math.ceil(-Math.log10(step) - 1e-9), 0), 9);
    return (v) => v.toFixed(decimals);
  };
  const east = ticks({ low: bounds.getWest(), high: bounds.getEast() }, width / 130);
  const north = ticks({ low: bounds.getSouth(), high: bounds.getNorth() }, height / 80);
  for (const degrees of east) {
    const [px] = project([degrees, middle.lat]);
    ink.line([px, foot, px, foot + 4], { color: edge });
    ink.text(label(east)(degrees), px, foot + 13, edge, "middle");
  }
  for (const degrees of north) {
    const [, py] = project([middle.lng, degrees]);
    ink.line([x - 4, py, x, py], { color: edge });
    ink.text(label(north)(degrees), x - 7, py, edge, "end");
  }
  ink.text("longitude [°], WGS 84", x + width / 2, foot + 30, color("ink"), "middle");
  ink.text("latitude [°]", 10, y + height / 2, color("ink"), "middle", { turn: true });
}

function drawScale(ink: Ink, map: Maplibre, { x, y, height }: Box): void {
  const metre = (TILE * 2 ** map.getZoom()) / (EARTH * Math.cos((map.getCenter().lat * Math.PI) / 180)); // pixels
  const power = 10 ** Math.floor(Math.log10(140 / metre));
  const long = ([5, 2, 1].find((one) => one * power * metre <= 140) ?? 1) * power;
  const [from, to, foot] = [x + 14, x + 14 + long * metre, y + height - 14];
  ink.area([from - 6, foot - 26, to + 6, foot - 26, to + 6, foot + 6, from - 6, foot + 6], color("paper"), 0.75);
  ink.line([from, foot - 5, from, foot, to, foot, to, foot - 5], { color: color("ink"), width: 1.5 });
  ink.text(long >= 1000 ? `${long / 1000} km` : `${long} m`, (from + to) / 2, foot - 14, color("ink"), "middle");
}

/** A picture of the studio as one that a file can hold. */
export async function pictureOf(address: string): Promise<HTMLImageElement> {
  const answer = await fetch(address);
  if (!answer.ok) throw new Error("The basemap could not be read.");
  const content = await answer.blob();
  const text = await new Promise<string>((resolve, reject) => {
    const reader = new FileReader();
    reader.onload = () => resolve(String(reader.result));
    reader.onerror = () => reject(new Error("The basemap could not be read."));
    reader.readAsDataURL(content);
  });
  const image = new Image();
  image.src = text;
  await image.decode();
  return image;
}

/** The cells as pictures, a pixel a cell, laid on the map tile by tile: a hundred thousand cells cost what one picture does. */

import { h } from "../../ui/dom";
import { color } from "../../ui/theme";
import type { Project } from "../figure";
import { rgbOf } from "../shade";
import type { Cells, Field, Place, Tile } from "./data";
import type { Painted } from "./layers";

const RIM = 1.5; // pixels around the driven cells, so that dark ones are visible on a dark page
const AROUND = [[1, 0], [-1, 0], [0, 1], [0, -1], [0.7, 0.7], [0.7, -0.7], [-0.7, 0.7], [-0.7, -0.7]] as const;

/** From cells of a tile (from its north-west corner) to pixels: x' = a x + c y + e, y' = b x + d y + f. */
type Affine = [a: number, b: number, c: number, d: number, e: number, f: number];

interface Sheet {
  tile: Tile;
  cells: HTMLCanvasElement;
  /** The same cells in one colour. */
  mask: HTMLCanvasElement;
}

export class Raster {
  private sheets: Sheet[] = [];

  constructor(private field: Field) {}

  /** Paint the cells that are shown; gives how many have ink. */
  paint(cells: Cells, shown: (i: number) => boolean, { paint }: Painted): number {
    const rim = rgbOf(color("muted"));
    const sheets = this.field.tiles.map((tile) => ({ tile, cells: new ImageData(tile.wide, tile.high), mask: new ImageData(tile.wide, tile.high) }));
    let drawn = 0;
    for (let i = 0; i < cells.count; i++) {
      if (!shown(i)) continue;
      const [rgb, ink] = paint(i);
      if (!ink) continue;
      drawn += 1;
      const [column, row] = [cells.column[i] as number, cells.row[i] as number];
      const of = sheets.find(({ tile }) => column >= tile.column && column < tile.column + tile.wide && row >= tile.row && row < tile.row + tile.high);
      if (!of) continue;
      const at = 4 * ((of.tile.high - 1 - (row - of.tile.row)) * of.tile.wide + (column - of.tile.column));
      for (let k = 0; k < 3; k++) {
        of.cells.data[at + k] = rgb[k] as number;
        of.mask.data[at + k] = rim[k] as number;
      }
      of.cells.data[at + 3] = Math.round(255 * ink);
      of.mask.data[at + 3] = 255;
    }
    this.sheets = sheets.map(({ tile, cells: one, mask }) => ({ tile, cells: canvasOf(one), mask: canvasOf(mask) }));
    return drawn;
  }

  /** Draw on a pen whose units are the pixels of `project`. */
  draw(pen: CanvasRenderingContext2D, project: Project): void {
    const laid = this.sheets.map((sheet) => ({ ...sheet, to: affine(sheet.tile, project) }));
    const each = (which: "cells" | "mask", [dx, dy]: readonly [number, number] = [0, 0]): void => {
      for (const { to, [which]: picture } of laid) {
        pen.save();
        pen.transform(to[0], to[1], to[2], to[3], to[4] + dx, to[5] + dy);
        pen.imageSmoothingEnabled = Math.hypot(to[0], to[1]) < 1; // less than a pixel a cell: their mean, not one of them
        pen.drawImage(picture, 0, 0);
        pen.restore();
      }
    };
    for (const [dx, dy] of AROUND) each("mask", [RIM * dx, RIM * dy]);
    pen.globalCompositeOperation = "destination-out";
    each("mask");
    pen.globalCompositeOperation = "source-over";
    each("cells");
  }

  /** Column and row of the grid at a pixel; null off the grid's tiles. */
  cellAt([x, y]: [number, number], project: Project): [number, number] | null {
    for (const tile of this.field.tiles) {
      const [a, b, c, d, e, f] = affine(tile, project);
      const [u, v, whole] = [x - e, y - f, a * d - b * c];
      const [column, down] = [Math.floor((u * d - v * c) / whole), Math.floor((v * a - u * b) / whole)];
      if (column >= 0 && column < tile.wide && down >= 0 && down < tile.high) return [tile.column + column, tile.row + tile.high - 1 - down];
    }
    return null;
  }

  /** Longitude and latitude of a place of the grid, in cells; NaN off its tiles. */
  placeOf(column: number, row: number): Place {
    const tile = this.field.tiles.find((one) => column >= one.column && column <= one.column + one.wide && row >= one.row && row <= one.row + one.high);
    if (!tile) return [NaN, NaN];
    const [east, south] = [(column - tile.column) / tile.wide, 1 - (row - tile.row) / tile.high];
    const [nw, ne, se, sw] = tile.corners;
    return [0, 1].map((k) => (1 - south) * ((1 - east) * (nw[k] as number) + east * (ne[k] as number)) + south * ((1 - east) * (sw[k] as number) + east * (se[k] as number))) as Place;
  }
}

function canvasOf(image: ImageData): HTMLCanvasElement {
  const canvas = h("canvas", { width: image.width, height: image.height });
  canvas.getContext("2d")?.putImageData(image, 0, 0);
  return canvas;
}

function affine({ wide, high, corners }: Tile, project: Project): Affine {
  const [[x0, y0], [x1, y1], [x2, y2]] = [project(corners[0]), project(corners[1]), project(corners[3])];
  return [(x1 - x0) / wide, (y1 - y0) / wide, (x2 - x0) / high, (y2 - y0) / high, x0, y0];
}

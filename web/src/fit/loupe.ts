/** A loupe at the pointer while a line is digitised: the picture five times as large, and the points clicked so far. */

import { h } from "../ui/dom";
import { color } from "../ui/theme";
import { CanvasInk } from "../ui/ink";
import { drawPicture } from "./plot";
import type { State } from "./state";
import { View } from "../ui/view";

const [SIZE, TIMES, APART] = [150, 5, 24];

export class Loupe {
  /** Whether it is to be shown. */
  wanted: () => boolean = () => false;
  private canvas = h("canvas", { class: "loupe", width: SIZE * devicePixelRatio, height: SIZE * devicePixelRatio, "aria-hidden": "true", hidden: true });

  constructor(
    host: HTMLElement,
    private state: State,
    private view: View,
  ) {
    host.append(this.canvas);
    host.addEventListener("pointermove", (event) => {
      const box = host.getBoundingClientRect();
      this.show(event.clientX - box.left, event.clientY - box.top, box.width);
    });
    host.addEventListener("pointerleave", () => (this.canvas.hidden = true));
  }

  private show(x: number, y: number, room: number): void {
    this.canvas.hidden = !this.wanted() || !this.view.inside(x, y);
    const pen = this.canvas.getContext("2d");
    if (this.canvas.hidden || !pen) return;
    const left = x + APART + SIZE < room ? x + APART : x - APART - SIZE;
    this.canvas.style.left = `${left}px`;
    this.canvas.style.top = `${Math.max(y - SIZE - APART, 4)}px`;
    const near = new View({ ...this.view.x }, { ...this.view.y }, this.view.width, this.view.height);
    near.zoom(1 / TIMES, x, y);
    pen.setTransform(devicePixelRatio, 0, 0, devicePixelRatio, 0, 0);
    pen.clearRect(0, 0, SIZE, SIZE);
    pen.save();
    pen.translate(SIZE / 2 - x, SIZE / 2 - y);
    const ink = new CanvasInk(pen);
    for (const [path, picture] of Object.entries(this.state.kept.pictures)) {
      const image = this.state.images.get(path);
      if (!image || !picture.shown) continue;
      drawPicture(pen, near, image, { ...picture, opacity: 1 });
      for (const line of picture.lines) ink.dots(line.points.flatMap(([s, mu]) => [near.px(s), near.py(mu)]), 4, color("vermillion"), 0.9);
    }
    pen.restore();
    const middle = SIZE / 2;
    ink.line([0, middle, middle - 6, middle, NaN, NaN, middle + 6, middle, SIZE, middle], { color: color("bad") });
    ink.line([middle, 0, middle, middle - 6, NaN, NaN, middle, middle + 6, middle, SIZE], { color: color("bad") });
  }
}

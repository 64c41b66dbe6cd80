/** What is marked on a chart besides its traces: soils, events, the picked sample; of the main run. */

import type uPlot from "uplot";
import { color } from "../ui/theme";
import type { Way } from "./along";
import { EVENT_COLORS, soilColor, soilsOf, type Run } from "./run";

/** Soils as a tint behind, events as a strong strip at the foot. */
export function spans(plot: uPlot, run: Run, way: Way): void {
  const { ctx, bbox } = plot;
  const x = (time: number): number => Math.min(Math.max(plot.valToPos(way.place(time), "x", true), bbox.left), bbox.left + bbox.width);
  ctx.save();
  for (const span of soilsOf(run)) {
    const [from, to] = [x(span.start), x(span.end)];
    if (to <= from) continue;
    ctx.fillStyle = `color-mix(in srgb, ${color(soilColor(span.name))} 12%, transparent)`;
    ctx.fillRect(from, bbox.top, to - from, bbox.height);
  }
  const strip = 5 * devicePixelRatio;
  for (const event of run.events) {
    const [from, to] = [x(event.start), x(event.end)];
    if (to <= bbox.left || from >= bbox.left + bbox.width) continue;
    ctx.fillStyle = color(EVENT_COLORS[event.kind] ?? "ink");
    ctx.fillRect(from, bbox.top + bbox.height - strip, Math.max(to - from, devicePixelRatio), strip);
  }
  ctx.restore();
}

/** A vertical line with a head. */
export function pick(plot: uPlot, place: number): void {
  const { ctx, bbox } = plot;
  const x = plot.valToPos(place, "x", true);
  if (!(x >= bbox.left && x <= bbox.left + bbox.width)) return;
  const size = 5 * devicePixelRatio;
  ctx.save();
  ctx.strokeStyle = ctx.fillStyle = color("accent");
  ctx.lineWidth = 1.5 * devicePixelRatio;
  ctx.beginPath();
  ctx.moveTo(x, bbox.top);
  ctx.lineTo(x, bbox.top + bbox.height);
  ctx.stroke();
  ctx.beginPath();
  ctx.moveTo(x - size, bbox.top);
  ctx.lineTo(x + size, bbox.top);
  ctx.lineTo(x, bbox.top + 1.5 * size);
  ctx.fill();
  ctx.restore();
}

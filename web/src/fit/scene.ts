/** What is drawn where: axes, points, bins, curves, on any ink. */

import { color } from "../ui/theme";
import { unitFor } from "../ui/units";
import { digits } from "../ui/dom";
import type { Ink } from "../ui/ink";
import type { Samples } from "./samples";
import type { Curve, Soil } from "./state";
import { ticks, type View } from "../ui/view";

export function drawAxes(ink: Ink, view: View): void {
  const { width, height, left, right, top, bottom } = view;
  const share = unitFor("share");
  const [ink_, muted, grid] = [color("ink"), color("muted"), color("grid")];
  for (const x of ticks(view.x, (width - left - right) / 90)) {
    const px = view.px(x);
    ink.line([px, top, px, height - bottom], { color: grid });
    ink.text(digits(x * share.scale), px, height - bottom + 14, muted, "middle");
  }
  for (const y of ticks(view.y, (height - top - bottom) / 60)) {
    const py = view.py(y);
    ink.line([left, py, width - right, py], { color: grid });
    ink.text(digits(y), left - 8, py, muted, "end");
  }
  ink.line([left, top, left, height - bottom, width - right, height - bottom], { color: muted });
  if (view.y.low < 0 && view.y.high > 0) ink.line([left, view.py(0), width - right, view.py(0)], { color: muted });
  ink.text(`slip s [${share.name}]`, (left + width - right) / 2, height - 10, ink_, "middle");
  ink.text("adhesion µ (gross traction ratio less ρt) [–]", 14, (top + height - bottom) / 2, ink_, "middle", { turn: true });
}

export function drawSoil(ink: Ink, view: View, soil: Soil): void {
  const shade = color(soil.color);
  const { slip, adhesion } = soil.points;
  const points = new Float64Array(2 * slip.length);
  for (let i = 0; i < slip.length; i++) {
    points[2 * i] = view.px(slip[i] as number);
    points[2 * i + 1] = view.py(adhesion[i] as number);
  }
  const many = slip.length > 300;
  ink.dots(points, many ? 1 : 3.5, shade, many ? 0.3 : 0.9);
  for (const bin of soil.bins) {
    const px = view.px(bin.slip);
    if (bin.std > 0) {
      ink.line([px, view.py(bin.mean - bin.std), px, view.py(bin.mean + bin.std)], { color: shade, width: 1.2 });
    }
  }
  ink.dots(soil.bins.flatMap((bin) => [view.px(bin.slip), view.py(bin.mean)]), 4, shade, 1);
}

export function drawCurve(ink: Ink, view: View, curve: Curve, active: boolean, samples: Samples | null): void {
  const shade = color(curve.color);
  const band = curve.fit?.band;
  if (band) {
    const outline: number[] = [];
    band.slip.forEach((s, i) => outline.push(view.px(s), view.py(band.high[i] as number)));
    for (let i = band.slip.length - 1; i >= 0; i--) outline.push(view.px(band.slip[i] as number), view.py(band.low[i] as number));
    ink.area(outline, shade, 0.18);
  }
  if (samples) ink.line(pointsOf(samples, view), { color: shade, width: active ? 2.6 : 1.6 });
}

/** What the fit of a curve found, where the curve has been moved since. */
export function drawFit(ink: Ink, view: View, curve: Curve, samples: Samples | null): void {
  if (samples) ink.line(pointsOf(samples, view), { color: color(curve.color), width: 1.6, dash: [7, 5] });
}

function pointsOf(samples: Samples, view: View): Float64Array {
  const points = new Float64Array(2 * samples.slip.length);
  samples.slip.forEach((s, i) => {
    points[2 * i] = view.px(s);
    points[2 * i + 1] = view.py(samples.value[i] ?? NaN);
  });
  return points;
}

/** Whether the curve still is what its fit found: a moved slider parts them. */
export function sameCurve(curve: Curve): boolean {
  const fit = curve.fit;
  return !!fit && fit.model === curve.model && Object.entries(fit.parameters).every(([name, v]) => Math.abs((curve.parameters[name] ?? 0) - v) < 1e-9);
}

/** At the lower right, where curves of adhesion leave room. */
export function drawLegend(ink: Ink, view: View, curves: Curve[], soils: Soil[]): void {
  const top = view.height - view.bottom - 12 - 18 * (curves.length + soils.length);
  let y = top + 12;
  const x = view.width - view.right - 10;
  const longest = Math.max(0, ...[...curves, ...soils].map(({ name }) => name.length));
  const [left, below] = [x - 36 - 7 * longest, top + 6 + 18 * (curves.length + soils.length)];
  if (longest) ink.area([left, top + 1, x + 6, top + 1, x + 6, below, left, below], color("paper"), 0.82); // readable over points
  for (const curve of curves) {
    ink.text(curve.name, x - 28, y, color("ink"), "end");
    ink.line([x - 22, y, x, y], { color: color(curve.color), width: 2.4 });
    y += 18;
  }
  for (const soil of soils) {
    ink.text(soil.name, x - 28, y, color("ink"), "end");
    ink.dots([x - 11, y], 4, color(soil.color), 1);
    y += 18;
  }
}

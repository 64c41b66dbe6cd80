/** The charts as a sheet: what is shown, with title, legend, units and the plot of one quantity over another. */

import { lapse, moment } from "../ui/clock";
import { digits } from "../ui/dom";
import { DRY, type Ink, type Stroke } from "../ui/ink";
import { LINE, legend, widthOf, type Sheet } from "../ui/sheet";
import { color } from "../ui/theme";
import { ticks, View } from "../ui/view";
import type { Across } from "./across";
import { AXES, type Layer } from "./along";
import { extent, outsideOf } from "./axes";
import { isKnown } from "./buckets";
import { MARKS, type Chart, type Charts } from "./charts";
import { runColor } from "./overlay";
import { within, type Drawn, type Values } from "./rows";
import { EVENT_COLORS, soilColor, soilsOf } from "./run";

const [WIDTH, HEIGHT, PLOT] = [1000, 170, 300]; // of the sheet, a chart, the plot
const [LEFT, RIGHT, FOOT] = [64, 24, 34];
type Lead = (ink: Ink | null, y: number) => number;

export function sheetOf(charts: Charts, layers: Layer[], across: Across): Sheet {
  const parts: Lead[] = [(ink, y) => head(ink, y, layers, charts.range, charts)];
  charts.shown.forEach((chart, i) => parts.push((ink, y) => drawChart(ink, y, charts, chart, layers, i === charts.shown.length - 1)));
  parts.push((ink, y) => drawPlot(ink, y, across));
  const all = (ink: Ink | null): number => parts.reduce((y, part) => part(ink, y), 14);
  return { width: WIDTH, height: Math.ceil(all(null)), draw: (ink) => void all(ink) };
}

function head(wet: Ink | null, y: number, layers: Layer[], [low, high]: [number, number], charts: Charts): number {
  const ink = wet ?? DRY;
  const [main] = layers;
  if (!main) return y;
  const { title, unit } = AXES[charts.axis];
  const shown = charts.axis === "time" ? `${moment(main.run, low)} to ${moment(main.run, high)}` : charts.axis === "elapsed" ? `${lapse(main.run, low)} to ${lapse(main.run, high)}` : `${digits(low, 6)} to ${digits(high, 6)} ${unit}`;
  ink.text(layers.map(({ path }) => path).join(", "), LEFT, y, color("ink"), "start", { bold: true });
  ink.text(`${title} ${shown}; ${main.run.vehicle}, method ${main.run.method}; shaded: 95 % intervals`, LEFT, y + LINE, color("muted"), "start");
  const patch = (shade: string, height: number, alpha: number) => (to: Ink, x: number, at: number): void => to.area([x, at - height / 2, x + 20, at - height / 2, x + 20, at + height / 2, x, at + height / 2], color(shade), alpha);
  const soils = [...new Set(soilsOf(main.run).map(({ name }) => name))];
  const kinds = [...new Set(main.run.events.map(({ kind }) => kind))];
  const of = layers.length > 1 ? `${main.label}: ` : "";
  const entries = [
    ...(layers.length > 1 ? layers.map(({ label }, i) => ({ text: label, sample: patch(runColor(i), 4, 1) })) : []),
    ...soils.map((name, i) => ({ text: `${i ? "" : of}${name}`, sample: patch(soilColor(name), 12, 0.3) })),
    ...kinds.map((kind, i) => ({ text: `${i || soils.length ? "" : of}${kind}`, sample: patch(EVENT_COLORS[kind] ?? "ink", 5, 1) })),
  ];
  return y + 2 * LINE + legend(ink, entries, LEFT, y + 2 * LINE, WIDTH - LEFT - RIGHT) + 4;
}

function drawChart(wet: Ink | null, y: number, charts: Charts, { panel, plot, drawn }: Chart, layers: Layer[], last: boolean): number {
  const ink = wet ?? DRY;
  const heading = `${panel.title} [${panel.unit}]`;
  const from = LEFT + widthOf(heading, true) + 20;
  ink.text(heading, LEFT, y + 8, color("ink"), "start", { bold: true });
  const entries = panel.traces.map((trace) => ({ text: trace.label, sample: (to: Ink, x: number, at: number): void => to.line([x, at, x + 20, at], strokeOf(trace, 2.4)) }));
  const top = y + 8 + Math.max(legend(ink, entries, from, y + 8, WIDTH - from - RIGHT), LINE) - 4;
  const foot = top + HEIGHT;
  const below = foot + (last ? FOOT + 6 : 22);
  if (!wet) return below;

  const [low, high] = charts.range;
  const { min, max } = plot.scales["y"] ?? {};
  const [least, most] = [min ?? 0, max ?? 1];
  const upright = panel.log ? Math.log10 : (v: number): number => v;
  const px = (x: number): number => LEFT + ((x - low) / (high - low)) * (WIDTH - LEFT - RIGHT);
  const py = (v: number): number => foot - ((upright(v) - upright(least)) / (upright(most) - upright(least))) * HEIGHT;
  const box = { x: LEFT, y: top, width: WIDTH - LEFT - RIGHT, height: HEIGHT };
  ink.clipped(box, () => drawSpans(ink, layers[0], px, top, foot));
  const marked = layers[0]?.way.marked;
  const marks = marked ? marked.marks(low, high, 10) : ticks({ low, high }, 10);
  for (const x of marks) {
    ink.line([px(x), top, px(x), foot], { color: color("grid") });
    ink.text(marked ? marked.text(x, (marks[1] ?? x + 1) - (marks[0] ?? x)) : digits(x, 6), px(x), foot + 11, color("muted"), "middle");
  }
  for (const v of panel.log ? MARKS : ticks({ low: least, high: most }, 4)) {
    ink.line([LEFT, py(v), WIDTH - RIGHT, py(v)], { color: color("grid") });
    ink.text(digits(v, 4), LEFT - 8, py(v), color("muted"), "end");
  }
  for (const level of panel.levels ?? []) ink.line([LEFT, py(level), WIDTH - RIGHT, py(level)], { color: color("muted"), dash: [5, 4] });
  ink.clipped(box, () => {
    for (const one of drawn) drawBand(ink, one, charts.range, px, py);
    for (const one of drawn) drawTrace(ink, one, charts.range, px, py);
    if (charts.picked !== null && layers[0]) {
      const at = px(layers[0].way.place(charts.picked));
      ink.line([at, top, at, foot], { color: color("accent"), width: 1.5 });
    }
  });
  ink.line([LEFT, top, LEFT, foot, WIDTH - RIGHT, foot], { color: color("muted") });
  const [above, under] = outsideOf(extent(drawn, charts.range), panel, [least, most]);
  ink.text(above, WIDTH - RIGHT - 4, top + 10, color("bad"), "end");
  ink.text(under, WIDTH - RIGHT - 4, foot - 10, color("bad"), "end");
  const { title, unit } = AXES[charts.axis];
  if (last) ink.text(`${title} [${marked?.unit ?? unit}]`, (LEFT + WIDTH - RIGHT) / 2, foot + 28, color("ink"), "middle");
  return below;
}

function strokeOf({ color: shade, dash }: { color: string; dash?: number[] }, width: number): Stroke {
  return { color: color(shade), width, ...(dash?.length ? { dash } : {}) };
}

function drawSpans(ink: Ink, main: Layer | undefined, px: (x: number) => number, top: number, foot: number): void {
  if (!main) return;
  const { run, way } = main;
  const rectangle = (start: number, end: number, from: number, to: number, shade: string, alpha: number): void => {
    const [a, b] = [px(way.place(start)), Math.max(px(way.place(end)), px(way.place(start)) + 1)];
    if (b >= LEFT && a <= WIDTH - RIGHT) ink.area([a, from, b, from, b, to, a, to], color(shade), alpha);
  };
  for (const span of soilsOf(run)) rectangle(span.start, span.end, top, foot, soilColor(span.name), 0.12);
  for (const event of run.events) rectangle(event.start, event.end, foot - 5, foot, EVENT_COLORS[event.kind] ?? "ink", 1);
}

function drawBand(ink: Ink, { x, low, high, trace }: Drawn, range: [number, number], px: (x: number) => number, py: (v: number) => number): void {
  if (!low || !high) return;
  const [first, last] = within(x, range);
  const known = (i: number): boolean => isKnown(low[i]) && isKnown(high[i]);
  for (let i = first; i < last; i++) {
    const from = i;
    while (i < last && known(i)) i++;
    if (i === from) continue;
    const outline: number[] = [];
    for (let k = from; k < i; k++) outline.push(px(x[k] as number), py(high[k] as number));
    for (let k = i - 1; k >= from; k--) outline.push(px(x[k] as number), py(low[k] as number));
    ink.area(outline, color(trace.bandColor ?? trace.color), 0.22);
  }
}

/** A line through rows, or through the smallest and largest value of each bucket; a sample without neighbours is a point. */
function drawTrace(ink: Ink, { x, values, trace, cut }: Drawn, range: [number, number], px: (x: number) => number, py: (v: number) => number): void {
  const [first, last] = within(x, range);
  const line: number[] = [];
  const points: number[] = [];
  for (let i = first; i < last; i++) {
    const v = values[i];
    line.push(px(x[i] as number), isKnown(v) ? py(v) : NaN);
    if (alone(values, i)) points.push(...line.slice(-2));
  }
  ink.line(line, { ...strokeOf(trace, cut ? 0.9 : 1.4) });
  if (points.length) ink.dots(points, 2, color(trace.color), 1);
}

const alone = (values: Values, i: number): boolean => isKnown(values[i]) && !isKnown(values[i - 1]) && !isKnown(values[i + 1]);

function drawPlot(wet: Ink | null, y: number, across: Across): number {
  if (!across.drawn) return y;
  const foot = y + 12 + PLOT;
  if (wet) {
    const view = new View(undefined, undefined, WIDTH, foot + 36);
    Object.assign(view, { left: LEFT, right: WIDTH - LEFT - 1.4 * PLOT, top: y + 12, bottom: 36 });
    across.plane.ink(wet, view);
    wet.line([view.left, view.top, view.left, foot, WIDTH - view.right, foot], { color: color("muted") });
    wet.text(across.said, LEFT, foot + 46, color("muted"), "start");
  }
  return foot + 60;
}

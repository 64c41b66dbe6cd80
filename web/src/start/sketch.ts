/** A machine drawn from its numbers: from the side and from above. What is only typical of its class is drawn dashed. */

import { digits, h } from "../ui/dom";

type Shape = Element | null;

/** An SVG element; text only ever becomes text. */
export function svg(tag: string, attributes: Record<string, string | number>, ...children: (Shape | Shape[] | string)[]): SVGElement {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, String(value));
  for (const child of children.flat()) if (child !== null) element.append(child);
  return element;
}

interface Wheel {
  radius: number;
}

export interface Vehicle {
  mass: number;
  wheelbase?: number;
  track?: number;
  center_of_gravity_height?: number;
  hitch_height?: number;
  axles: Record<string, { mass: number; wheels: string[]; driven?: boolean; wheel?: Wheel }>;
  wheel?: Wheel;
}

const WIDTH = 420;
const TALL = 150; // what a machine may be high

export function sketch(vehicle: Vehicle, known: Set<string>): HTMLElement {
  const axles = Object.values(vehicle.axles);
  const side = axles.every((axle) => axle.wheel ?? vehicle.wheel);
  return h("figure", { class: "sketch" }, side ? sideView(vehicle, known) : null, side && vehicle.track ? topView(vehicle, known) : null, h("figcaption", { class: "hint" }, side ? "To scale. Dashed: typical of the class, not given yet." : "With a bus speed no dimension of the machine matters."));
}

/** Rear to the left, front to the right, ground below. */
function sideView(vehicle: Vehicle, known: Set<string>): SVGElement {
  const axles = Object.values(vehicle.axles);
  const radii = axles.map((axle) => (axle.wheel ?? vehicle.wheel ?? { radius: 0 }).radius);
  const front = radii[0] as number;
  const rear = radii[radii.length - 1] as number;
  const base = axles.length > 1 ? (vehicle.wheelbase ?? 0) : 0;
  const gravity = vehicle.center_of_gravity_height ?? 0;
  const tall = Math.max(2 * Math.max(front, rear), gravity * 1.25, 0.01);
  const long = base + front + rear;
  const beside = vehicle.hitch_height ? 112 : 30; // room for the hitch's label
  const scale = Math.min((WIDTH - beside - 30) / long, TALL / tall);
  const ground = 24 + scale * tall;
  const height = ground + (base ? 56 : 26);
  const left = beside + (WIDTH - beside - 30 - scale * long) / 2 + scale * rear;
  const right = left + scale * base;
  const up = (height: number): number => ground - scale * height;
  const style = (...names: string[]): string => (names.every((name) => known.has(name)) ? "known" : "typical");
  const share = base ? (axles[0]?.mass ?? 0) / vehicle.mass : 0;
  const middle = left + scale * base * share;
  const radiusNames = "front_wheel_radius";
  const wheels = axles.map((axle, i) => {
    const x = axles.length > 1 && i === 0 ? right : left;
    const radius = radii[i] as number;
    const name = i === 0 && front !== rear ? radiusNames : "wheel_radius";
    return svg("g", { class: `${style(name)} ${axle.driven === false ? "idle" : "driven"}` }, svg("circle", { cx: x, cy: up(radius), r: scale * radius }), svg("circle", { cx: x, cy: up(radius), r: 2.5, class: "dot" }));
  });
  const body = base
    ? svg("path", { class: `body ${style("wheelbase")}`, d: `M${left - 4} ${up(rear)}L${left - 4} ${up(Math.max(rear, gravity) * 1.15)}L${(left + right) / 2} ${up(Math.max(rear, gravity) * 1.15)}L${right + 8} ${up(Math.max(front * 1.35, gravity))}L${right + 8} ${up(front)}Z` })
    : null;
  const label = (x: number, y: number, text: string, anchor: string, name: string): SVGElement => svg("text", { x, y, "text-anchor": anchor, class: style(name) }, text);
  return svg(
    "svg",
    { viewBox: `0 0 ${WIDTH} ${height}`, role: "img", "aria-label": "The machine from the side" },
    svg("line", { x1: 12, x2: WIDTH - 12, y1: ground, y2: ground, class: "ground" }),
    body,
    wheels,
    base ? dimension(left, right, ground + 20, `wheelbase ${digits(vehicle.wheelbase)} m`, style("wheelbase")) : null,
    label(left, ground + (base ? 36 : 18), `r ${digits(rear)} m`, "middle", "wheel_radius"),
    base ? label(right, ground + 36, `r ${digits(front)} m`, "middle", front !== rear ? radiusNames : "wheel_radius") : null,
    base && gravity
      ? svg("g", { class: style("center_of_gravity_height", "front_mass") }, svg("circle", { cx: middle, cy: up(gravity), r: 6, class: "gravity" }), svg("path", { d: `M${middle} ${up(gravity)}v-6a6 6 0 0 1 6 6zv6a6 6 0 0 1 -6 -6z`, class: "dot" }), svg("line", { x1: middle, x2: middle, y1: up(gravity) + 6, y2: ground, class: "thin" }))
      : null,
    base && gravity ? label(middle, up(tall) - 8, `${digits(vehicle.mass)} kg, its centre ${digits(gravity)} m high`, "middle", "mass") : label(left, up(tall) - 8, `${digits(vehicle.mass)} kg`, "middle", "mass"),
    vehicle.hitch_height ? svg("g", { class: style("hitch_height") }, svg("path", { d: `M${left} ${up(vehicle.hitch_height)}H${left - scale * rear - 14}m0 -4v8`, class: "thin" })) : null,
    vehicle.hitch_height ? label(left - scale * rear - 18, up(vehicle.hitch_height) + 4, `hitch ${digits(vehicle.hitch_height)} m`, "end", "hitch_height") : null,
    base ? label(right, ground + 51, `front ${digits(axles[0]?.mass)} kg`, "middle", "front_mass") : null,
    base ? label(left, ground + 51, `rear ${digits(axles[axles.length - 1]?.mass)} kg`, "middle", "front_mass") : null,
  );
}

/** From above, front to the right. */
function topView(vehicle: Vehicle, known: Set<string>): SVGElement {
  const axles = Object.values(vehicle.axles);
  const radii = axles.map((axle) => (axle.wheel ?? vehicle.wheel ?? { radius: 0.1 }).radius);
  const track = vehicle.track as number;
  const base = axles.length > 1 ? (vehicle.wheelbase ?? 0) : 0;
  const height = 130;
  const scale = Math.min((height - 50) / track, (WIDTH - 150) / (base + 2 * Math.max(...radii)));
  const middle = height / 2;
  const start = WIDTH / 2 - (scale * base) / 2;
  const style = (name: string): string => (known.has(name) ? "known" : "typical");
  const wheels = axles.flatMap((axle, i) => {
    const x = axles.length > 1 && i === 0 ? start + scale * base : start;
    const long = 2 * scale * (radii[i] as number);
    const wide = Math.max(6, long * 0.28);
    return axle.wheels.map((name, k) => {
      const y = middle + (axle.wheels.length > 1 ? (k - (axle.wheels.length - 1) / 2) * ((scale * track) / (axle.wheels.length - 1)) : 0);
      const idle = axle.driven === false ? "idle" : "driven";
      return svg("g", { class: `${style("track")} ${idle}` }, svg("rect", { x: x - long / 2, y: y - wide / 2, width: long, height: wide, rx: 3 }), svg("text", { x, y: k === 0 ? y - wide / 2 - 4 : y + wide / 2 + 13, "text-anchor": "middle" }, axle.driven === false ? `${name}, not driven` : name));
    });
  });
  const x = WIDTH - 90;
  return svg(
    "svg",
    { viewBox: `0 0 ${WIDTH} ${height}`, role: "img", "aria-label": "The machine from above" },
    base ? svg("line", { x1: start, x2: start + scale * base, y1: middle, y2: middle, class: `thin ${style("wheelbase")}` }) : null,
    wheels,
    svg("path", { class: `thin ${style("track")}`, d: `M${x} ${middle - (scale * track) / 2}V${middle + (scale * track) / 2}m-4 0h8m-8 ${-scale * track}h8` }),
    svg("text", { x: x + 8, y: middle + 4, class: style("track") }, `${digits(track)} m`),
  );
}

function dimension(from: number, to: number, y: number, text: string, style: string): SVGElement {
  return svg("g", { class: style }, svg("path", { class: "thin", d: `M${from} ${y - 4}v8M${to} ${y - 4}v8M${from} ${y}H${to}` }), svg("text", { x: (from + to) / 2, y: y - 4, "text-anchor": "middle" }, text));
}

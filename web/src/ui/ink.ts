/** One drawing, two media: the screen's canvas and an SVG file. */

export interface Stroke {
  color: string;
  width?: number;
  dash?: number[];
  alpha?: number;
  /** Round ends. */
  round?: boolean;
}

export interface Ink {
  line(points: ArrayLike<number>, stroke: Stroke): void;
  dots(points: ArrayLike<number>, radius: number, color: string, alpha: number): void;
  area(points: ArrayLike<number>, color: string, alpha: number): void;
  text(text: string, x: number, y: number, color: string, align: "start" | "middle" | "end", style?: { turn?: boolean; bold?: boolean }): void;
  /** Draw inside a box only. */
  clipped(box: Box, work: () => void): void;
  /** A picture by an affine map of its pixels: x' = a x + c y + e, y' = b x + d y + f. */
  picture(image: HTMLImageElement, map: [a: number, b: number, c: number, d: number, e: number, f: number]): void;
}

/** An ink that draws nothing: to measure heights before there is a sheet. */
export const DRY: Ink = { line: () => undefined, dots: () => undefined, area: () => undefined, text: () => undefined, clipped: (_, work) => work(), picture: () => undefined };

export interface Box {
  x: number;
  y: number;
  width: number;
  height: number;
}

export const FONT = "12px system-ui, sans-serif";

/** Points are x, y, x, y, …; a NaN breaks a line. */
export class CanvasInk implements Ink {
  constructor(private pen: CanvasRenderingContext2D) {}

  private trace(points: ArrayLike<number>): void {
    this.pen.beginPath();
    let on = false;
    for (let i = 0; i < points.length; i += 2) {
      const x = points[i] as number;
      const y = points[i + 1] as number;
      if (Number.isNaN(y)) on = false;
      else if (on) this.pen.lineTo(x, y);
      else {
        this.pen.moveTo(x, y);
        on = true;
      }
    }
  }

  line(points: ArrayLike<number>, { color, width = 1, dash = [], alpha = 1, round = false }: Stroke): void {
    this.trace(points);
    this.pen.globalAlpha = alpha;
    this.pen.lineCap = round ? "round" : "butt";
    this.pen.strokeStyle = color;
    this.pen.lineWidth = width;
    this.pen.lineJoin = "round";
    this.pen.setLineDash(dash);
    this.pen.stroke();
    this.pen.setLineDash([]);
    this.pen.globalAlpha = 1;
  }

  dots(points: ArrayLike<number>, radius: number, color: string, alpha: number): void {
    this.pen.fillStyle = color;
    this.pen.globalAlpha = alpha;
    for (let i = 0; i < points.length; i += 2) {
      const x = points[i] as number;
      const y = points[i + 1] as number;
      if (radius < 2) this.pen.fillRect(x - radius, y - radius, 2 * radius, 2 * radius);
      else {
        this.pen.beginPath();
        this.pen.arc(x, y, radius, 0, 2 * Math.PI);
        this.pen.fill();
      }
    }
    this.pen.globalAlpha = 1;
  }

  area(points: ArrayLike<number>, color: string, alpha: number): void {
    this.trace(points);
    this.pen.closePath();
    this.pen.fillStyle = color;
    this.pen.globalAlpha = alpha;
    this.pen.fill();
    this.pen.globalAlpha = 1;
  }

  text(text: string, x: number, y: number, color: string, align: "start" | "middle" | "end", { turn = false, bold = false } = {}): void {
    this.pen.save();
    this.pen.translate(x, y);
    if (turn) this.pen.rotate(-Math.PI / 2);
    this.pen.font = bold ? `600 ${FONT}` : FONT;
    this.pen.fillStyle = color;
    this.pen.textAlign = align === "middle" ? "center" : align;
    this.pen.textBaseline = "middle";
    this.pen.fillText(text, 0, 0);
    this.pen.restore();
  }

  clipped({ x, y, width, height }: Box, work: () => void): void {
    this.pen.save();
    this.pen.beginPath();
    this.pen.rect(x, y, width, height);
    this.pen.clip();
    work();
    this.pen.restore();
  }

  picture(image: HTMLImageElement, map: [number, number, number, number, number, number]): void {
    this.pen.save();
    this.pen.transform(...map);
    this.pen.drawImage(image, 0, 0);
    this.pen.restore();
  }
}

export class SvgInk implements Ink {
  private parts: string[] = [];
  private clips = 0;

  private path(points: ArrayLike<number>): string {
    let out = "";
    let on = false;
    for (let i = 0; i < points.length; i += 2) {
      const x = points[i] as number;
      const y = points[i + 1] as number;
      if (Number.isNaN(y)) {
        on = false;
        continue;
      }
      out += `${on ? "L" : "M"}${x.toFixed(2)} ${y.toFixed(2)}`;
      on = true;
    }
    return out;
  }

  line(points: ArrayLike<number>, { color, width = 1, dash = [], alpha = 1, round = false }: Stroke): void {
    const dashes = `${dash.length ? ` stroke-dasharray="${dash.join(" ")}"` : ""}${alpha < 1 ? ` stroke-opacity="${alpha}"` : ""}${round ? ' stroke-linecap="round"' : ""}`;
    this.parts.push(`<path d="${this.path(points)}" fill="none" stroke="${color}" stroke-width="${width}" stroke-linejoin="round"${dashes}/>`);
  }

  dots(points: ArrayLike<number>, radius: number, color: string, alpha: number): void {
    let out = `<g fill="${color}" fill-opacity="${alpha}">`;
    for (let i = 0; i < points.length; i += 2) {
      out += `<circle cx="${(points[i] as number).toFixed(2)}" cy="${(points[i + 1] as number).toFixed(2)}" r="${radius}"/>`;
    }
    this.parts.push(`${out}</g>`);
  }

  area(points: ArrayLike<number>, color: string, alpha: number): void {
    this.parts.push(`<path d="${this.path(points)}Z" fill="${color}" fill-opacity="${alpha}"/>`);
  }

  text(text: string, x: number, y: number, color: string, align: "start" | "middle" | "end", { turn = false, bold = false } = {}): void {
    const plain = text.replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
    const turned = turn ? ` transform="rotate(-90 ${x} ${y})"` : "";
    this.parts.push(`<text x="${x}" y="${y}" fill="${color}" text-anchor="${align}" dominant-baseline="central"${bold ? ' font-weight="600"' : ""}${turned}>${plain}</text>`);
  }

  clipped({ x, y, width, height }: Box, work: () => void): void {
    const id = `clip${this.clips++}`;
    this.parts.push(`<clipPath id="${id}"><rect x="${x}" y="${y}" width="${width}" height="${height}"/></clipPath><g clip-path="url(#${id})">`);
    work();
    this.parts.push("</g>");
  }

  /** The picture goes into the file where its address is a `data:` one. */
  picture(image: HTMLImageElement, map: [number, number, number, number, number, number]): void {
    this.parts.push(`<image href="${image.src}" width="${image.naturalWidth}" height="${image.naturalHeight}" transform="matrix(${map.join(" ")})"/>`);
  }

  toString(width: number, height: number, paper: string): string {
    const size = `width="${width}" height="${height}" viewBox="0 0 ${width} ${height}"`;
    const font = `font-family="system-ui, sans-serif" font-size="12"`;
    return `<svg xmlns="http://www.w3.org/2000/svg" ${size} ${font}><rect width="100%" height="100%" fill="${paper}"/>${this.parts.join("")}</svg>\n`;
  }
}

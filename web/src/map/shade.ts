/** Cividis (Nuñez, Anderton and Renslow 2018): even steps of lightness, the same to colour-blind eyes. Nine of its colours, mixed linearly. */

const STOPS = ["#00224e", "#123570", "#3b496c", "#575d6d", "#707173", "#8a8678", "#a59c74", "#c3b369", "#fee838"];
const LEVELS = 24;

export function SCALE(share: number): string {
  const at = Math.min(Math.max(share, 0), 1) * (STOPS.length - 1);
  const i = Math.min(Math.floor(at), STOPS.length - 2);
  const part = (hex: string, k: number): number => parseInt(hex.slice(1 + 2 * k, 3 + 2 * k), 16);
  const mixed = [0, 1, 2].map((k) => Math.round(part(STOPS[i] as string, k) + (at - i) * (part(STOPS[i + 1] as string, k) - part(STOPS[i] as string, k))));
  return `rgb(${mixed.join(" ")})`;
}

/** One of 24 shades, so that neighbours of nearly the same value are one line. */
export function shade(share: number): string {
  return SCALE(Math.round(Math.min(Math.max(share, 0), 1) * (LEVELS - 1)) / (LEVELS - 1));
}

/** Cividis (Nuñez, Anderton and Renslow 2018): even steps of lightness, the same to colour-blind eyes. Nine of its colours, mixed linearly. */

const STOPS = ["#00224e", "#123570", "#3b496c", "#575d6d", "#707173", "#8a8678", "#a59c74", "#c3b369", "#fee838"];
const LEVELS = 24;

export type Rgb = [number, number, number];

/** The colour at a share of the way along stops of even distance. */
export function mixed(stops: string[], share: number): Rgb {
  const at = Math.min(Math.max(share, 0), 1) * (stops.length - 1);
  const i = Math.min(Math.floor(at), stops.length - 2);
  const [one, next] = [rgbOf(stops[i] as string), rgbOf(stops[i + 1] as string)];
  return one.map((value, k) => Math.round(value + (at - i) * ((next[k] as number) - value))) as Rgb;
}

/** A colour of six hexadecimal digits. */
export const rgbOf = (hex: string): Rgb => [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16)) as Rgb;

export const CIVIDIS = (share: number): Rgb => mixed(STOPS, share);
export const SCALE = (share: number): string => `rgb(${CIVIDIS(share).join(" ")})`;

/** One of 24 shades, so that neighbours of nearly the same value are one line. */
export function shade(share: number): string {
  return SCALE(Math.round(Math.min(Math.max(share, 0), 1) * (LEVELS - 1)) / (LEVELS - 1));
}

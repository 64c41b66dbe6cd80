/** Times for the reader: seconds in a short run, h:mm:ss in a long one, the time of day where the log has a date. */

/** What a run says of its time: first and last [s], and the date of its second 0 where the log has one. */
export interface Timed {
  start: number;
  end: number;
  /** ISO 8601; without a zone where the log names none. */
  began: string | null;
}

/** Runs from here on are read in minutes [s]. */
const LONG = 600;
/** Steps of an axis in seconds, minutes and hours [s]. */
export const STEPS = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 10800, 21600, 43200, 86400];

const isLong = ({ start, end }: Timed): boolean => end - start >= LONG;
/** Epoch of a run's second 0 [s]; a date without a zone is read as it stands. */
const zeroOf = (began: string): number => Date.parse(/(Z|[+-]\d\d:\d\d)$/.test(began) ? began : `${began}Z`) / 1000;
const zoneOf = (began: string): string => (/(Z|[+-]\d\d:\d\d)$/.test(began) ? " UTC" : "");

/** 0:04:05.20: with hours, so that it cannot be read as a time of day. */
export function hms(seconds: number, decimals = 0): string {
  const size = Number(Math.abs(seconds).toFixed(decimals));
  const [hours, minutes] = [Math.floor(size / 3600), Math.floor(size / 60) % 60];
  const rest = (size - 3600 * hours - 60 * minutes).toFixed(decimals).padStart(decimals ? decimals + 3 : 2, "0");
  return `${seconds < 0 && size > 0 ? "−" : ""}${hours}:${String(minutes).padStart(2, "0")}:${rest}`;
}

/** A time since the start of a run, or on a clock that is none of day. */
export function lapse(run: Timed, seconds: number, decimals = 2): string {
  return isLong(run) ? hms(seconds, decimals) : `${seconds.toFixed(decimals)} s`;
}

/** A time of a run's own clock; with the date where it has one. */
export function moment(run: Timed, time: number, decimals = 2): string {
  if (!run.began) return lapse(run, time, decimals);
  const [day, clock] = dated(run.began, time, decimals);
  return `${day} ${clock}${zoneOf(run.began)}`;
}

/** The time of day alone; seconds where there is no date. */
export function timeOfDay(run: Timed, time: number, decimals = 0): string {
  return run.began ? (dated(run.began, time, decimals)[1] as string) : lapse(run, time, decimals);
}

function dated(began: string, time: number, decimals: number): string[] {
  const text = new Date(1000 * Number((zeroOf(began) + time).toFixed(decimals))).toISOString();
  return [text.slice(0, 10), text.slice(11, decimals ? 20 + Math.min(decimals, 3) : 19)];
}

export interface TimeAxis {
  /** What follows a heading, in brackets. */
  unit: string;
  /** What follows one of the marks. */
  zone: string;
  /** Marks within a range, at most a number of them. */
  marks: (low: number, high: number, most: number) => number[];
  text: (value: number, step: number) => string;
}

/** How an axis of a run's time is marked; null where it is one of plain seconds. `ofDay`: of its own clock, not since its start. */
export function timeAxis(run: Timed, ofDay: boolean): TimeAxis | null {
  const began = ofDay ? run.began : null;
  if (!began && !isLong(run)) return null;
  const zero = began ? zeroOf(began) : 0;
  const marks = (low: number, high: number, most: number): number[] => {
    const step = STEPS.find((one) => (high - low) / one <= most) ?? 86400 * Math.ceil((high - low) / 86400 / most);
    const found: number[] = [];
    for (let i = Math.ceil((low + zero) / step); i * step - zero <= high; i++) found.push(i * step - zero);
    return found;
  };
  const places = (step: number): number => Math.max(0, Math.ceil(-Math.log10(step) - 1e-9));
  return {
    unit: began ? zoneOf(began).trim() || "time of day" : "h:mm:ss",
    zone: began ? zoneOf(began) : "",
    marks,
    text: (value, step) => (began ? (dated(began, value, places(step))[1] as string) : hms(value, places(step))),
  };
}

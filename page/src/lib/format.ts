/** Numbers as people read them: a fitting unit, and as many digits as the uncertainty leaves (two of u). */
import type { Measurement } from "./api";

export type System = "metric" | "imperial";
type Step = readonly [name: string, from: number, factor: number];

const LENGTHS: Record<System, readonly Step[]> = {
  metric: [
    ["km", 1e4, 1e3],
    ["m", 1, 1],
    ["mm", 1e-3, 1e-3],
    ["µm", 0, 1e-6],
  ],
  imperial: [
    ["mi", 1609.344 * 2, 1609.344],
    ["ft", 0.9144, 0.3048],
    ["in", 0, 0.0254],
  ],
};
const FIXED: Record<string, readonly [string, number]> = {
  px: ["px", 1],
  rad: ["°", Math.PI / 180],
  "px/m": ["px/mm", 1e3],
  "m/px": ["mm/px", 1e-3],
  "1": ["", 1],
  s: ["s", 1],
};

export function fitting(value: number, unit: string, system: System = "metric"): { name: string; factor: number } {
  if (unit === "m") {
    const steps = LENGTHS[system];
    const step = steps.find(([, from]) => Math.abs(value) >= from) ?? steps[steps.length - 1]!;
    return { name: step[0], factor: step[2] };
  }
  const [name, factor] = FIXED[unit] ?? [unit, 1];
  return { name, factor };
}

/** Decimals that show two significant digits of u; negative for tens and hundreds. */
export function digitsFor(u: number): number {
  return u > 0 && Number.isFinite(u) ? 1 - Math.floor(Math.log10(u) + 1e-12) : 6;
}

/** 13 556.50, with narrow no-break spaces between groups of three. */
export function grouped(value: number, decimals: number): string {
  if (decimals < 0) {
    const step = 10 ** -decimals;
    value = Math.round(value / step) * step;
  }
  const text = Math.abs(value).toFixed(Math.min(Math.max(decimals, 0), 12));
  const [whole = "", fraction] = text.split(".");
  const sign = value < 0 && Number(text) !== 0 ? "−" : "";
  return sign + whole.replace(/\B(?=(\d{3})+$)/g, "\u202f") + (fraction ? `.${fraction}` : "");
}

export interface Shown {
  value: string;
  unit: string;
  low: string | null;
  high: string | null;
  u: string | null;
  exact: boolean;
}

/** A measurement's numbers in one unit. */
export function shown(m: Pick<Measurement, "value" | "u" | "low" | "high" | "unit">, system: System = "metric"): Shown {
  const { name, factor } = fitting(m.value, m.unit, system);
  const ends = [m.low, m.high].filter((end): end is number => end !== null).map((end) => Math.abs(m.value - end));
  const doubt = m.u ?? (ends.length ? Math.max(...ends) / 2 : Math.abs(m.value) / 2);
  if (m.u === 0) return { value: plain(m.value / factor), unit: name, low: null, high: null, u: null, exact: true };
  const decimals = digitsFor(doubt / factor);
  const text = (x: number | null) => (x === null ? null : grouped(x / factor, decimals));
  return { value: grouped(m.value / factor, decimals), unit: name, low: text(m.low), high: text(m.high), u: text(m.u), exact: false };
}

/** Seven significant digits without trailing zeros. */
export function plain(value: number): string {
  const text = String(Number(value.toPrecision(7)));
  if (text.includes("e")) return text;
  const decimals = text.split(".")[1]?.length ?? 0;
  return grouped(value, decimals);
}

/** "13.07 to 14.09 m", "from 3.1 m", "up to 4 m". */
export function interval(s: Shown): string {
  const unit = s.unit === "°" ? "°" : s.unit ? `\u00a0${s.unit}` : "";
  if (s.exact) return "exact";
  if (s.low === null && s.high === null) return "open on both sides";
  if (s.high === null) return `from ${s.low}${unit}, far limit open`;
  if (s.low === null) return `up to ${s.high}${unit}, near limit open`;
  return `${s.low} to ${s.high}${unit}`;
}

export function withUnit(text: string, unit: string): string {
  return unit === "°" ? `${text}°` : unit ? `${text}\u00a0${unit}` : text;
}

export function percent(share: number): string {
  return share >= 0.005 ? `${Math.round(100 * share)}\u00a0%` : "<1\u00a0%";
}

const TITLES: Record<string, string> = {
  range: "distance (range)",
  depth: "distance along the axis (depth)",
  length: "length",
  size: "real size",
  extent: "size in the picture",
  focal_length: "focal length",
  sensor_width: "sensor width",
  image_width: "picture width",
  focal_length_px: "focal length in pixels",
  sensor_scale: "pixels per mm on the sensor",
  object_scale: "mm per pixel at the object",
  field_of_view: "field of view across the width",
  angle: "angle the object subtends",
  tilt: "tilt to the line of sight",
};

export function title(what: string): string {
  return TITLES[what] ?? what.replaceAll("_", " ");
}

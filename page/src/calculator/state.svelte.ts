/** What stands in the calculator's fields, and how that becomes a request, a link and a line of the history. */
import { compose, parse, typed, type Typed } from "../lib/typed";

export const FIELDS = ["focal", "sensor_width", "image_width", "size", "extent", "distance"] as const;
export type FieldName = (typeof FIELDS)[number];
export const EXTRAS = ["tilt", "aspect"] as const;
export type ExtraName = (typeof EXTRAS)[number];

export interface FieldInfo {
  label: string;
  units: readonly string[];
  hint: string;
  symbol: string;
}

const LENGTHS = ["mm", "cm", "m", "in", "ft"] as const;

export const INFO: Record<FieldName | ExtraName, FieldInfo> = {
  focal: { label: "Focal length", units: ["mm", "in"], hint: "of the lens, not its 35 mm equivalent", symbol: "f" },
  sensor_width: { label: "Sensor width", units: ["mm", "in"], hint: "of the part that made the picture", symbol: "s" },
  image_width: { label: "Picture width", units: ["px"], hint: "of the whole picture, neither cropped nor resized", symbol: "W" },
  size: { label: "Real size", units: LENGTHS, hint: "of the object, end to end", symbol: "L" },
  extent: { label: "Size in the picture", units: ["px"], hint: "of the same length, in pixels", symbol: "p" },
  distance: { label: "Distance", units: ["m", "cm", "mm", "km", "ft", "in"], hint: "from the lens, along its axis", symbol: "D" },
  tilt: { label: "Tilt of the object", units: ["deg"], hint: "0 faces the camera; 0 ± 20 (limits) if you only see that it roughly does", symbol: "t" },
  aspect: { label: "Pixel width / height", units: ["1"], hint: "1 for square pixels", symbol: "a" },
};

/** The name of a field in a measurement's `what`. */
export const WHAT: Record<FieldName, string> = {
  focal: "focal_length",
  sensor_width: "sensor_width",
  image_width: "image_width",
  size: "size",
  extent: "extent",
  distance: "depth",
};

export type Texts = Partial<Record<FieldName | ExtraName | "along" | "offset", string>>;

export interface Example {
  name: string;
  texts: Texts;
}

export const EXAMPLES: readonly Example[] = [
  {
    name: "Package on a conveyor belt",
    texts: { focal: "35 mm", sensor_width: "14.1 mm", image_width: "4096", size: "200 mm", extent: "150" },
  },
  {
    name: "Statue from a drone",
    texts: { focal: "24 mm", sensor_width: "23.5 mm", image_width: "5472", size: "5 m", extent: "120", along: "height" },
  },
];

export class Calculator {
  fields: Record<FieldName | ExtraName, Typed> = $state(blank());
  unknown: FieldName = $state("distance");
  along: "width" | "height" = $state("width");
  offset: string = $state("");

  /** The texts of the request: every field but the unknown. */
  get texts(): Texts {
    const found: Texts = {};
    for (const name of [...FIELDS, ...EXTRAS]) {
      const text = name === this.unknown ? "" : compose(this.fields[name]);
      if (text) found[name] = text;
    }
    if (this.along === "height") found.along = "height";
    if (this.offset.trim()) found.offset = this.offset.trim();
    return found;
  }

  /** Fields that are still empty. */
  get missing(): FieldName[] {
    return FIELDS.filter((name) => name !== this.unknown && !compose(this.fields[name]));
  }

  /** Put texts into the fields; what they leave out becomes empty, and the first empty field the unknown. */
  fill(texts: Texts): void {
    const fields = blank();
    for (const name of [...FIELDS, ...EXTRAS]) {
      const text = texts[name];
      if (text) fields[name] = parse(text, INFO[name].units[0]!) ?? { ...fields[name], value: text };
    }
    this.fields = fields;
    this.unknown = FIELDS.find((name) => !texts[name]) ?? "distance";
    this.along = texts.along === "height" ? "height" : "width";
    this.offset = texts.offset ?? "";
  }

  /** Put texts into some fields and leave the others. */
  merge(texts: Texts): void {
    for (const name of [...FIELDS, ...EXTRAS]) {
      const text = texts[name];
      const read = text ? parse(text, INFO[name].units[0]!) : null;
      if (read) this.fields[name] = read;
    }
  }

  /** Make a field the unknown; the one that was it takes `solved` (its answer) so that nothing is lost. */
  solveFor(name: FieldName, solved: string): void {
    if (name === this.unknown) return;
    const before = this.unknown;
    this.unknown = name;
    if (!compose(this.fields[before]) || solved) this.fields[before] = { ...this.fields[before], value: solved, doubt: "", exact: false };
  }
}

function blank(): Record<FieldName | ExtraName, Typed> {
  const found = {} as Record<FieldName | ExtraName, Typed>;
  for (const name of [...FIELDS, ...EXTRAS]) found[name] = typed("", INFO[name].units[0]!);
  return found;
}

/** The fragment of a link that restores everything. */
export function toFragment(texts: Texts): string {
  return "#" + new URLSearchParams(texts as Record<string, string>).toString();
}

export function fromFragment(fragment: string): Texts | null {
  const found: Texts = {};
  const known = new Set<string>([...FIELDS, ...EXTRAS, "along", "offset"]);
  for (const [name, value] of new URLSearchParams(fragment.replace(/^#/, ""))) {
    if (known.has(name) && value.length <= 200) found[name as FieldName] = value;
  }
  return Object.keys(found).length ? found : null;
}

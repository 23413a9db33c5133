/** What several measurements of a photo say together: distances between things, one number from several. Plain data. */
import type { Point, Shape, Sheet } from "./session";

export type Kind = "between" | "same";

export interface Together {
  id: string;
  kind: Kind;
  /** Ids of measurements: two of a distance, two or more of one and the same thing. */
  of: readonly string[];
}

/** So many of a kind the server takes at once. */
export const MOST = 20;

export function membersOf(one: Together, sheet: Sheet): Shape[] {
  return one.of.flatMap((id) => sheet.shapes.find((shape) => shape.id === id) ?? []);
}

/** As reports name it. */
export function nameOf(one: Together, sheet: Sheet): string {
  return membersOf(one, sheet)
    .map((shape) => shape.label)
    .join(one.kind === "between" ? " to " : " and ");
}

/** The middle of what is drawn of a measurement, px: of the points that its name stands at. */
export function middleOf(shape: Shape): Point {
  const points = Object.values(shape.points).at(-1)!;
  const mean = (axis: 0 | 1) => points.reduce((sum, point) => sum + point[axis], 0) / points.length;
  return [mean(0), mean(1)];
}

/** The sheet without a measurement, and without what can't be told without it. */
export function withoutShape(sheet: Sheet, id: string): Sheet {
  const left = (sheet.together ?? []).map((one) => (one.of.includes(id) ? { ...one, of: one.of.filter((other) => other !== id) } : one));
  return withTogether({ ...sheet, shapes: sheet.shapes.filter((shape) => shape.id !== id) }, left);
}

/** The sheet with these and no others; what has fewer than two members is none. */
export function withTogether(sheet: Sheet, together: readonly Together[]): Sheet {
  const { together: _old, ...rest } = sheet;
  const whole = together.filter((one) => one.of.length > 1);
  const distinct = whole.filter((one, i) => whole.findIndex((other) => isSame(one, other)) === i);
  return distinct.length ? { ...rest, together: distinct } : rest;
}

export function isSame(one: Omit<Together, "id">, other: Omit<Together, "id">): boolean {
  return one.kind === other.kind && one.of.length === other.of.length && one.of.every((id) => other.of.includes(id));
}

/** What picked measurements make: of a distance every pair, of one thing all at once. */
export function combinations(kind: Kind, of: readonly string[]): Omit<Together, "id">[] {
  if (of.length < 2) return [];
  return kind === "same" ? [{ kind, of }] : of.flatMap((first, i) => of.slice(i + 1).map((second) => ({ kind, of: [first, second] })));
}

/** Those of a stored sheet that can be read and whose measurements are there. */
export function readTogether(value: unknown, ids: ReadonlySet<string>): Together[] {
  const readable = (one: Partial<Together> | null): one is Together =>
    typeof one?.id === "string" && !ids.has(one.id) && (one.kind === "between" || one.kind === "same") && Array.isArray(one.of) && one.of.length > 1 && new Set(one.of).size === one.of.length && one.of.every((id) => ids.has(id)) && (one.kind === "same" || one.of.length === 2);
  const found = (Array.isArray(value) ? value : []).filter(readable).map(({ id, kind, of }) => ({ id, kind, of: [...of] }));
  return found.filter((one, i) => found.findIndex((other) => other.id === one.id || isSame(one, other)) === i);
}

/** What a person measures: photos, their cameras, the shapes drawn on them. Plain data, never changed in place. */
import type { Detection, GivenCamera, MethodRow, Note, Outlined, Photo, Seen } from "../lib/api";
import { readTogether, type Together } from "./together";

export type Point = readonly [x: number, y: number];

export interface Shape {
  id: string;
  label: string;
  method: string;
  /** Points of each field, px of the upright picture; (0, 0) is the centre of the top-left pixel. */
  points: Readonly<Record<string, readonly Point[]>>;
  /** What was typed into the other fields. */
  texts: Readonly<Record<string, string>>;
  /** Standard deviation of a clicked end, px; empty for the default. */
  sigma: string;
  /** What a detector or an edge says of the points, by field; gone once they are moved by hand. */
  seen?: Readonly<Record<string, Seen>>;
  /** What a detector says of the thing, which holds wherever its points are. */
  found?: Found;
  /** Where points stood that were moved to the edges near them, by field, and what is doubtful about it. */
  snapped?: Readonly<Record<string, Snapped>>;
  /** The outline that its points are an extent of. */
  outline?: OutlineOf;
}

export interface OutlineOf {
  field: string;
  contour: readonly Point[];
  extents: Readonly<Record<string, Seen>>;
}

export interface Found {
  detector: string;
  /** The field of its size, and what stands there before a size that is told. */
  field: string;
  prefix: string;
  /** What its size is taken to be, as the field takes it; null where it must be told. */
  text: string | null;
  /** The same with its law and source. */
  size: Readonly<Record<string, unknown>> | null;
  target: string | null;
  others: readonly string[];
  tilt: Readonly<Record<string, unknown>> | null;
  notes: readonly Note[];
}

export interface Snapped {
  marked: readonly Point[];
  notes: readonly Note[];
}

export interface Sheet {
  photo: Pick<Photo, "id" | "name" | "width_px" | "height_px" | "sha256">;
  camera: GivenCamera;
  shapes: readonly Shape[];
  /** Distances between them, and which of them are one and the same thing. */
  together?: readonly Together[];
}

export interface Session {
  sheets: readonly Sheet[];
  current: number;
}

export const EMPTY: Session = { sheets: [], current: 0 };
export const CLICK_SIGMA = 0.7;
/** The tool that is no method's: it finds the outline of a thing. */
export const OUTLINE = " outline";

const LEAST_OF_MANY = 5;

export interface PointField {
  name: string;
  /** How many points it takes; Infinity where that is free, from `least` on. */
  count: number;
  least: number;
  closed: boolean;
  /** Whether its points lie on a rim, so that the line through them is round; else they are corners. */
  round: boolean;
}

/** Fields of a method that take points and can not do without, in order. Only the last may be free: it is clear where it begins. */
export function pointFields(method: MethodRow): PointField[] {
  return Object.entries(method.inputs.properties)
    .filter(([name, field]) => field["x-noun"] === "Observation" && method.inputs.required.includes(name))
    .map(([name, field], i, all) => {
      const [points, closed] = [field["x-points"], field["x-closed"] ?? false];
      const count = points === undefined || (field["x-more"] && i === all.length - 1) ? Infinity : points;
      return { name, count, least: points ?? field["x-least"] ?? LEAST_OF_MANY, closed, round: closed && points === undefined };
    });
}

/** Fields of a method that a person types: those with a default doubt, and targets. */
export function typedFields(method: MethodRow): { name: string; noun: string; unit: string; description: string; required: boolean }[] {
  return Object.entries(method.inputs.properties)
    .filter(([, field]) => (field["x-noun"] === "Quantity" && field["x-typed"]) || field["x-noun"] === "Target")
    .map(([name, field]) => ({
      name,
      noun: field["x-noun"]!,
      unit: field["x-unit"] ?? "",
      description: field.description,
      required: method.inputs.required.includes(name),
    }));
}

/** Whether a method measures by points in a picture that can be set, so that there is a tool for it. */
export function isTool(method: MethodRow): boolean {
  const fields = pointFields(method);
  // two cameras are no single photo's
  const rig = Object.values(method.inputs.properties).some((field) => field["x-noun"] === "Rig");
  return !rig && fields.length > 0 && fields.every((field) => field.closed || method.inputs.properties[field.name]!["x-points"] !== undefined);
}

/** The stated standard deviation of an end, px; undefined where nothing was said, null where it can't be read. */
export function sigmaOf(shape: Shape): number | null | undefined {
  const text = shape.sigma.trim().replace(",", ".").replace(/\s*px$/, "");
  if (!text) return undefined;
  const sigma = Number(text);
  return Number.isFinite(sigma) && sigma > 0 && sigma < 1e4 ? sigma : null;
}

/** The `inputs` of a request. */
export function inputsOf(shape: Shape): Record<string, unknown> {
  const inputs: Record<string, unknown> = {};
  const sigma = sigmaOf(shape);
  const stated = typeof sigma === "number";
  const several = Object.keys(shape.points).length > 1;
  for (const [name, points] of Object.entries(shape.points)) {
    inputs[name] = shape.seen?.[name] ?? {
      points_px: points,
      ...(several ? { label: name } : {}),
      sigma_px: stated ? sigma : CLICK_SIGMA,
      source: stated ? "clicked, as stated" : `assumed: a clicked end is known to ${CLICK_SIGMA} px`,
    };
  }
  if (shape.found?.tilt) inputs.tilt = shape.found.tilt;
  for (const [name, text] of Object.entries(shape.texts)) if (text.trim()) inputs[name] = text.trim();
  if (shape.found?.size && isAssumed(shape)) inputs[shape.found.field] = shape.found.size;
  return inputs;
}

/** Whether the size is still the one that a detector took. */
function isAssumed({ found, texts }: Shape): boolean {
  return found !== undefined && found.text !== null && texts[found.field] === found.text;
}

/** Doubts about what was seen, for `notes` of a request; a size that a person has said is no longer assumed. */
export function notesOf(shape: Shape): Note[] {
  const found = shape.found;
  const assumed = isAssumed(shape);
  const seen = (found?.notes ?? []).filter((note) => note.code !== "assumed_size" || assumed);
  return [...seen, ...Object.values(shape.snapped ?? {}).flatMap((one) => one.notes)];
}

/** What was found as a measurement without a name; `told` is the size of things whose size must be told. */
export function shapeOf(one: Detection, told: string): Omit<Shape, "id" | "label"> {
  const { points_px, sigma_px, cov, label, score, source } = one;
  const text = one.size_text ?? (told.trim() ? one.size_prefix + told.trim() : "");
  return {
    method: one.method,
    points: { [one.points_field]: points_px },
    texts: text ? { [one.size_field]: text } : {},
    sigma: "",
    seen: { [one.points_field]: { points_px, sigma_px, cov, label, score, source } },
    found: { detector: one.detector, field: one.size_field, prefix: one.size_prefix, text: one.size_text, size: one.size, target: one.target, others: one.others, tilt: one.tilt, notes: one.notes },
  };
}

/** The longest extent of an outline as a measurement without a name. */
export function outlineShape(one: Outlined): Omit<Shape, "id" | "label"> {
  const extents = Object.fromEntries(Object.entries(one.extents).filter(([, seen]) => seen.points_px.length === 2));
  const longest = extents.longest ?? Object.values(extents)[0]!;
  return {
    method: one.method,
    points: { [one.points_field]: longest.points_px },
    texts: {},
    sigma: "",
    seen: { [one.points_field]: longest },
    found: { detector: "outline", field: one.size_field, prefix: "", text: null, size: null, target: null, others: [], tilt: null, notes: one.notes },
    outline: { field: one.points_field, contour: one.contour_px, extents },
  };
}

/** Which extent of its outline a measurement is of; empty where its points were moved. */
export function extentOf(shape: Shape): string {
  const points = shape.points[shape.outline?.field ?? ""];
  return Object.entries(shape.outline?.extents ?? {}).find(([, seen]) => shape.seen && JSON.stringify(seen.points_px) === JSON.stringify(points))?.[0] ?? "";
}

/** The measurement with another extent of its outline. */
export function withExtent(shape: Shape, name: string): Shape {
  const { outline } = shape;
  const seen = outline?.extents[name];
  if (!outline || !seen) return shape;
  const moved = withPoints(shape, outline.field, seen.points_px);
  return { ...moved, seen: { ...moved.seen, [outline.field]: seen } };
}

/** Whether two measurements are of the same thing found: by the same detector, at the same place. */
export function sameFound(a: Pick<Shape, "method" | "points" | "found">, b: Pick<Shape, "method" | "points" | "found">): boolean {
  if (!a.found || a.found.detector !== b.found?.detector || a.method !== b.method) return false;
  return Object.entries(a.points).every(([field, points]) => {
    const others = b.points[field] ?? [];
    const extent = Math.max(...points.map((p) => Math.hypot(p[0] - points[0]![0], p[1] - points[0]![1])));
    return others.length === points.length && points.every((p, i) => Math.hypot(p[0] - others[i]![0], p[1] - others[i]![1]) < Math.max(2, 0.03 * extent));
  });
}

/** A rectangle of which one side is still to be said. */
const ONE_SIDE = /^rectangle\s+(x\s.*|.*\sx)\s*$/;

/** Required fields that nothing, or only half of it, was typed into yet. */
export function wanting(shape: Shape, method: MethodRow): string[] {
  const open = (text: string) => !text.trim() || ONE_SIDE.test(text);
  return typedFields(method)
    .filter((field) => field.required && open(shape.texts[field.name] ?? ""))
    .map((field) => field.name);
}

/** The next letter that no shape has: A to Z, then A2, B2, ... */
export function nextLabel(shapes: readonly Shape[]): string {
  const taken = new Set(shapes.map((shape) => shape.label));
  for (let round = 1; ; round += 1) {
    for (let letter = 0; letter < 26; letter += 1) {
      const label = String.fromCharCode(65 + letter) + (round > 1 ? round : "");
      if (!taken.has(label)) return label;
    }
  }
}

export function withSheet(session: Session, index: number, change: (sheet: Sheet) => Sheet): Session {
  return { ...session, sheets: session.sheets.map((sheet, i) => (i === index ? change(sheet) : sheet)) };
}

export function withShape(sheet: Sheet, id: string, change: (shape: Shape) => Shape): Sheet {
  return { ...sheet, shapes: sheet.shapes.map((shape) => (shape.id === id ? change(shape) : shape)) };
}

/** A record without one of its fields; undefined where nothing is left. */
function without<T>(of: Readonly<Record<string, T>> | undefined, field: string): { [name: string]: T } | undefined {
  const left = Object.entries(of ?? {}).filter(([name]) => name !== field);
  return left.length ? Object.fromEntries(left) : undefined;
}

function withPoints(shape: Shape, field: string, points: readonly Point[]): Shape {
  const { seen: oldSeen, snapped: oldSnapped, ...rest } = shape;
  const [seen, snapped] = [without(oldSeen, field), without(oldSnapped, field)];
  return { ...rest, points: { ...shape.points, [field]: points }, ...(seen ? { seen } : {}), ...(snapped ? { snapped } : {}) };
}

/** The shape with one point moved; what a detector or an edge said of the field's points is gone. */
export function moved(shape: Shape, field: string, index: number, to: Point): Shape {
  return withPoints(
    shape,
    field,
    (shape.points[field] ?? []).map((point, i) => (i === index ? to : point)),
  );
}

/** A closed shape with its corners counted from the next one, so that width and height change places. */
export function turned(shape: Shape, field: string): Shape {
  const points = shape.points[field] ?? [];
  return withPoints(shape, field, [...points.slice(1), ...points.slice(0, 1)]);
}

/** The shape with a field's points at the edges near them. */
export function snappedTo(shape: Shape, field: string, seen: Seen, notes: readonly Note[]): Shape {
  const marked = shape.points[field] ?? [];
  const moved = withPoints(shape, field, seen.points_px);
  return { ...moved, seen: { ...moved.seen, [field]: seen }, snapped: { ...moved.snapped, [field]: { marked, notes } } };
}

/** The shape with the points where they were marked. */
export function unsnapped(shape: Shape): Shape {
  return Object.entries(shape.snapped ?? {}).reduce((before, [field, { marked }]) => withPoints(before, field, marked), shape);
}

/** A point inside the picture, to a hundredth of a pixel. */
export function inside(point: Point, size: { width_px: number; height_px: number }): Point {
  const clamp = (x: number, most: number) => Math.round(Math.min(Math.max(x, -0.5), most - 0.5) * 100) / 100;
  return [clamp(point[0], size.width_px), clamp(point[1], size.height_px)];
}

/** With Shift: the point on the nearest of eight directions from `from`. */
export function constrained(from: Point, to: Point): Point {
  const dx = to[0] - from[0];
  const dy = to[1] - from[1];
  const step = Math.PI / 4;
  const angle = Math.round(Math.atan2(dy, dx) / step) * step;
  const along = dx * Math.cos(angle) + dy * Math.sin(angle);
  return [from[0] + along * Math.cos(angle), from[1] + along * Math.sin(angle)];
}

// -- project files ---------------------------------------------------------------------------------------

export const PROJECT = "subtense-project/1";

export interface ProjectSheet extends Sheet {
  /** The picture as base64; left out, it is known by its hash and must be given again. */
  data?: string;
}

export interface Project {
  schema: typeof PROJECT;
  sheets: ProjectSheet[];
}

/** A project from a file's text; a sentence where it is none. */
export function readProject(text: string): Project | string {
  let found: unknown;
  try {
    found = JSON.parse(text);
  } catch {
    return "the file is not JSON";
  }
  const project = found as Partial<Project> | null;
  if (!project || project.schema !== PROJECT || !Array.isArray(project.sheets)) return "the file is not a project of subtense";
  const sheets: ProjectSheet[] = [];
  for (const sheet of project.sheets as unknown[]) {
    const read = readSheet(sheet);
    if (!read) return "the project is damaged: one of its sheets can't be read";
    sheets.push(read);
  }
  return { schema: PROJECT, sheets };
}

function isText(value: unknown, most = 1000): value is string {
  return typeof value === "string" && value.length <= most;
}

function isPoint(value: unknown): value is Point {
  return Array.isArray(value) && value.length === 2 && value.every((x) => typeof x === "number" && Number.isFinite(x));
}

/** A sheet of a stored session or project, checked; null where it is damaged. */
export function readSheet(value: unknown): ProjectSheet | null {
  const sheet = value as ProjectSheet | null;
  const photo = sheet?.photo;
  if (!photo || !isText(photo.name) || !/^[0-9a-f]{64}$/.test(String(photo.sha256)) || !Array.isArray(sheet.shapes)) return null;
  if (!(photo.width_px > 0 && photo.height_px > 0)) return null;
  const camera = sheet.camera ?? null;
  if (!(camera === null || isText(camera) || (isText(camera.name) && isText(camera.content, 2 ** 20)))) return null;
  const shapes = sheet.shapes.map(readShape);
  if (shapes.some((shape) => shape === null)) return null;
  const ids = new Set(shapes.map((shape) => shape!.id));
  if (ids.size < shapes.length) return null;
  const { name, width_px, height_px, sha256 } = photo;
  const kept = { id: sha256.slice(0, 32), name, width_px, height_px, sha256 };
  const together = readTogether(sheet.together, ids);
  return { photo: kept, camera, shapes: shapes as Shape[], ...(together.length ? { together } : {}), ...(typeof sheet.data === "string" ? { data: sheet.data } : {}) };
}

function readShape(value: unknown): Shape | null {
  const shape = value as Shape | null;
  if (!shape || !isText(shape.id) || !isText(shape.label) || !isText(shape.method) || typeof shape.points !== "object") return null;
  const points = Object.entries(shape.points ?? {});
  if (!points.length || points.some(([, list]) => !list.length)) return null;
  if (!points.every(([, list]) => Array.isArray(list) && list.every(isPoint))) return null;
  const texts = Object.entries(shape.texts ?? {});
  if (!texts.every(([, text]) => isText(text))) return null;
  const seen = shape.seen && typeof shape.seen === "object" ? { seen: shape.seen } : {};
  const found = isFound(shape.found) ? { found: shape.found } : {};
  const snapped = isSnapped(shape.snapped) ? { snapped: shape.snapped! } : {};
  const outline = isOutline(shape.outline) ? { outline: shape.outline } : {};
  return { id: shape.id, label: shape.label, method: shape.method, points: shape.points, texts: shape.texts ?? {}, sigma: String(shape.sigma ?? ""), ...seen, ...found, ...snapped, ...outline };
}

function isNotes(value: unknown): value is Note[] {
  return Array.isArray(value) && value.length <= 20 && value.every((note: Partial<Note> | null) => note && isText(note.code, 50) && isText(note.text) && isText(note.cure));
}

function isFound(value: unknown): value is Found {
  const found = value as Partial<Found> | null;
  if (!found || typeof found !== "object" || !isText(found.detector) || !isText(found.field) || !isText(found.prefix)) return false;
  const named = (text: unknown) => text === null || isText(text);
  const noun = (value: unknown) => value === null || (typeof value === "object" && !Array.isArray(value));
  return named(found.text) && named(found.target) && noun(found.tilt) && noun(found.size) && Array.isArray(found.others) && found.others.every((name) => isText(name)) && isNotes(found.notes);
}

function isOutline(value: unknown): value is OutlineOf {
  const outline = value as Partial<OutlineOf> | null;
  if (!outline || typeof outline !== "object" || !isText(outline.field) || !Array.isArray(outline.contour) || outline.contour.length > 5000) return false;
  const extents = Object.values(outline.extents ?? {}) as (Partial<Seen> | null)[];
  return outline.contour.every(isPoint) && extents.every((seen) => seen !== null && Array.isArray(seen?.points_px) && seen.points_px.every(isPoint));
}

function isSnapped(value: unknown): value is Record<string, Snapped> {
  if (!value || typeof value !== "object") return false;
  return Object.values(value).every((one: Partial<Snapped> | null) => one && Array.isArray(one.marked) && one.marked.every(isPoint) && isNotes(one.notes));
}

/** What a person measures: photos, their cameras, the shapes drawn on them. Plain data, never changed in place. */
import type { GivenCamera, MethodRow, Photo, Seen } from "../lib/api";

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
  /** What a detector saw, by field; gone once its points are moved by hand. */
  seen?: Readonly<Record<string, Seen>>;
}

export interface Sheet {
  photo: Pick<Photo, "id" | "name" | "width_px" | "height_px" | "sha256">;
  camera: GivenCamera;
  shapes: readonly Shape[];
}

export interface Session {
  sheets: readonly Sheet[];
  current: number;
}

export const EMPTY: Session = { sheets: [], current: 0 };
export const CLICK_SIGMA = 0.7;

/** Fields of a method that take points, in order, with how many each. */
export function pointFields(method: MethodRow): { name: string; count: number; closed: boolean }[] {
  return Object.entries(method.inputs.properties)
    .filter(([, field]) => field["x-noun"] === "Observation" && field["x-points"])
    .map(([name, field]) => ({ name, count: field["x-points"]!, closed: field["x-closed"] ?? false }));
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

/** Whether a method measures by points in a picture, so that there is a tool for it. */
export function isTool(method: MethodRow): boolean {
  return pointFields(method).length > 0;
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
  for (const [name, text] of Object.entries(shape.texts)) if (text.trim()) inputs[name] = text.trim();
  return inputs;
}

/** Required fields that nothing was typed into yet. */
export function wanting(shape: Shape, method: MethodRow): string[] {
  return typedFields(method)
    .filter((field) => field.required && !shape.texts[field.name]?.trim())
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

/** The shape with one point moved; what a detector said of the field is gone. */
export function moved(shape: Shape, field: string, index: number, to: Point): Shape {
  const points = { ...shape.points, [field]: (shape.points[field] ?? []).map((point, i) => (i === index ? to : point)) };
  const { seen, ...rest } = shape;
  const left = Object.fromEntries(Object.entries(seen ?? {}).filter(([name]) => name !== field));
  return { ...rest, points, ...(Object.keys(left).length ? { seen: left } : {}) };
}

/** A closed shape with its corners counted from the next one, so that width and height change places. */
export function turned(shape: Shape, field: string): Shape {
  const points = shape.points[field] ?? [];
  const { seen: _seen, ...rest } = shape;
  return { ...rest, points: { ...shape.points, [field]: [...points.slice(1), ...points.slice(0, 1)] } };
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
  return { photo: kept, camera, shapes: shapes as Shape[], ...(typeof sheet.data === "string" ? { data: sheet.data } : {}) };
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
  return { id: shape.id, label: shape.label, method: shape.method, points: shape.points, texts: shape.texts ?? {}, sigma: String(shape.sigma ?? ""), ...seen };
}

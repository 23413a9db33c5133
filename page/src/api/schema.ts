/** The OpenAPI document as a reader wants it: operations in groups, schemas as rows of a table, requests as curl. */

export interface Schema {
  $ref?: string;
  title?: string;
  description?: string;
  type?: string | string[];
  const?: unknown;
  enum?: unknown[];
  format?: string;
  default?: unknown;
  examples?: unknown[];
  minimum?: number;
  maximum?: number;
  exclusiveMinimum?: number;
  exclusiveMaximum?: number;
  minLength?: number;
  maxLength?: number;
  minItems?: number;
  maxItems?: number;
  pattern?: string;
  items?: Schema;
  properties?: Record<string, Schema>;
  required?: string[];
  additionalProperties?: boolean | Schema;
  anyOf?: Schema[];
  oneOf?: Schema[];
}
export interface Parameter {
  name: string;
  in: "path" | "query" | "header" | "cookie";
  required?: boolean;
  description?: string;
  schema: Schema;
}
type Content = Record<string, { schema: Schema }>;
interface RawOperation {
  summary?: string;
  description?: string;
  operationId?: string;
  tags?: string[];
  parameters?: Parameter[];
  requestBody?: { content: Content };
  responses: Record<string, { description: string; content?: Content }>;
}
export interface OpenApi {
  openapi: string;
  info: { title: string; version: string; description?: string };
  paths: Record<string, Record<string, RawOperation>>;
  components?: { schemas?: Record<string, Schema> };
}

export interface Response {
  status: string;
  description: string;
  types: string[];
  schema: Schema | null;
}
export interface Operation {
  id: string;
  method: string;
  path: string;
  summary: string;
  description: string;
  group: string;
  parameters: Parameter[];
  body: { type: string; schema: Schema } | null;
  good: Response[];
  refusals: Response[];
  words: string;
}
export interface Row {
  name: string;
  depth: number;
  type: string;
  required: boolean;
  fallback: string;
  limits: string;
  text: string;
}

const GROUPS: Record<string, string> = {
  methods: "Tables",
  presets: "Tables",
  targets: "Tables",
  calc: "Calculator",
  photos: "Photos",
  camera: "Camera",
  measure: "Measuring",
  detect: "Finding targets",
  jobs: "Finding targets",
};
export const JSON_TYPE = "application/json";

export function operations(document: OpenApi): Operation[] {
  const found: Operation[] = [];
  for (const [path, methods] of Object.entries(document.paths)) {
    for (const [method, raw] of Object.entries(methods)) {
      if (!["get", "post", "put", "patch", "delete"].includes(method)) continue;
      const [type, content] = Object.entries(raw.requestBody?.content ?? {})[0] ?? [];
      const responses = Object.entries(raw.responses)
        .map(([status, said]) => answered(status, said.description, said.content ?? {}))
        .sort((a, b) => a.status.localeCompare(b.status));
      const segment = path.split("/").find((part) => part && part !== "api") ?? "";
      const parameters = raw.parameters ?? [];
      found.push({
        id: raw.operationId ?? `${method} ${path}`,
        method: method.toUpperCase(),
        path,
        summary: raw.summary ?? "",
        description: raw.description ?? "",
        group: raw.tags?.[0] ?? GROUPS[segment] ?? "More",
        parameters,
        body: type && content ? { type, schema: content.schema } : null,
        good: responses.filter((response) => response.status < "300"),
        refusals: responses.filter((response) => response.status >= "300"),
        words: [method, path, raw.summary, raw.description, ...parameters.map((p) => p.name), nameOf(content?.schema)].join(" ").toLowerCase(),
      });
    }
  }
  return found;
}

function answered(status: string, description: string, content: Content): Response {
  // a framework names JSON without a schema beside the types that are really sent
  const real = Object.entries(content).filter(([type, { schema }]) => type !== JSON_TYPE || Object.keys(schema).length > 0);
  return { status, description, types: real.map(([type]) => type.replace(/;.*/, "")), schema: content[JSON_TYPE]?.schema ?? null };
}

export function nameOf(schema: Schema | undefined): string {
  return schema?.$ref?.split("/").pop() ?? schema?.title ?? "";
}

export function resolved(schema: Schema, document: OpenApi): Schema {
  const name = schema.$ref?.split("/").pop();
  const target = name === undefined ? undefined : document.components?.schemas?.[name];
  if (!target) return schema;
  const { $ref: _, ...beside } = schema;
  return { ...target, ...beside };
}

/** The ways a value may be, without null; and whether it may be null. */
function ways(schema: Schema): { ways: Schema[]; nullable: boolean } {
  const all = schema.anyOf ?? schema.oneOf ?? [schema];
  const rest = all.filter((way) => way.type !== "null");
  const nullable = rest.length < all.length || rest.some((way) => Array.isArray(way.type) && way.type.includes("null"));
  return { ways: rest, nullable };
}

function simple(schema: Schema): string {
  if (schema.$ref) return nameOf(schema);
  if (schema.const !== undefined) return JSON.stringify(schema.const);
  if (schema.enum) return schema.enum.map((value) => JSON.stringify(value)).join(", ");
  const type = Array.isArray(schema.type) ? schema.type.filter((name) => name !== "null").join(" or ") : schema.type;
  if (type === "array") return schema.items && Object.keys(schema.items).length ? `list of ${typeOf(schema.items)}` : "list";
  if (type === "object" && typeof schema.additionalProperties === "object") return `object of ${typeOf(schema.additionalProperties)} by name`;
  if (type === "string" && schema.format === "binary") return "file";
  return type ?? "anything";
}

export function typeOf(schema: Schema): string {
  const { ways: found, nullable } = ways(schema);
  const names = [...new Set(found.map(simple))];
  return [...names, ...(nullable ? ["null"] : [])].join(" or ");
}

export function limitsOf(schema: Schema): string {
  const said: string[] = [];
  for (const way of ways(schema).ways) {
    const low = way.minimum ?? way.exclusiveMinimum;
    const high = way.maximum ?? way.exclusiveMaximum;
    const above = way.exclusiveMinimum === undefined ? "from" : "above";
    const below = way.exclusiveMaximum === undefined ? "to" : "below";
    if (low !== undefined && high !== undefined) said.push(`${above} ${low} ${below} ${high}`);
    else if (low !== undefined) said.push(`${above} ${low}`);
    else if (high !== undefined) said.push(way.exclusiveMaximum === undefined ? `up to ${high}` : `below ${high}`);
    if (way.minLength) said.push(`at least ${way.minLength} characters`);
    if (way.maxLength !== undefined) said.push(`up to ${way.maxLength} characters`);
    if (way.minItems !== undefined && way.minItems === way.maxItems) said.push(`${way.minItems} items`);
    else {
      if (way.minItems) said.push(`at least ${way.minItems} items`);
      if (way.maxItems !== undefined) said.push(`up to ${way.maxItems} items`);
    }
    if (way.pattern) said.push(way.pattern);
    const inner = way.items && !way.items.$ref ? limitsOf(way.items) : "";
    if (inner) said.push(`each ${inner}`);
  }
  return [...new Set(said)].join("; ");
}

/** The default as JSON; none where it is empty. */
export function fallbackOf(schema: Schema): string {
  return schema.default === undefined || schema.default === "" ? "" : JSON.stringify(schema.default);
}

/** Every property, those of objects within it one step further in; a schema within itself is named only. */
export function rows(schema: Schema, document: OpenApi, depth = 0, within: readonly string[] = []): Row[] {
  const whole = resolved(schema, document);
  const found: Row[] = [];
  for (const [name, property] of Object.entries(whole.properties ?? {})) {
    found.push({
      name,
      depth,
      type: typeOf(property),
      required: whole.required?.includes(name) ?? false,
      fallback: fallbackOf(property),
      limits: limitsOf(property),
      text: property.description ?? ways(property).ways.find((way) => way.description)?.description ?? "",
    });
    for (const way of ways(property).ways) {
      let inner = way;
      while (inner.type === "array" && inner.items) inner = inner.items;
      if (inner.type === "object" && typeof inner.additionalProperties === "object") inner = inner.additionalProperties;
      const key = inner.$ref ?? "";
      if (depth < 4 && !(key && within.includes(key))) found.push(...rows(inner, document, depth + 1, key ? [...within, key] : within));
    }
  }
  return found;
}

/** A body to begin with: the schema's own example, or the least that it asks for. */
export function example(schema: Schema, document: OpenApi): unknown {
  const whole = resolved(schema, document);
  if (whole.examples?.length) return whole.examples[0];
  const { ways: found } = ways(whole);
  const way = found[0];
  if (way && way !== whole) return example(way, document);
  if (whole.default !== undefined) return whole.default;
  if (whole.const !== undefined) return whole.const;
  if (whole.enum?.length) return whole.enum[0];
  const type = Array.isArray(whole.type) ? whole.type[0] : whole.type;
  if (type === "array") return [];
  if (type === "number" || type === "integer") return whole.minimum ?? 0;
  if (type === "boolean") return false;
  if (type === "string") return "";
  const made: Record<string, unknown> = {};
  for (const name of whole.required ?? []) made[name] = example(whole.properties?.[name] ?? {}, document);
  return made;
}

/** A path with its values; one that is missing stands in capitals, as a place to fill in. */
export function address(path: string, parameters: readonly Parameter[], values: Record<string, string>): string {
  let made = path;
  const query = new URLSearchParams();
  for (const { name, in: place } of parameters) {
    const value = values[name]?.trim() ?? "";
    if (place === "path") made = made.replace(`{${name}}`, value ? encodeURIComponent(value) : name.toUpperCase());
    else if (place === "query" && value) query.set(name, value);
  }
  return query.size ? `${made}?${query}` : made;
}

function quoted(text: string): string {
  return `'${text.replaceAll("'", `'\\''`)}'`;
}

export function curl(operation: Operation, origin: string, path: string, body: string): string {
  const lines = [`curl ${operation.method === "GET" ? "" : `-X ${operation.method} `}${quoted(origin + path)}`, `-H "Authorization: Bearer $TOKEN"`];
  if (operation.body?.type === JSON_TYPE) lines.push(`-H ${quoted(`Content-Type: ${JSON_TYPE}`)}`, `-d ${quoted(compact(body))}`);
  else if (operation.body) lines.push(`-F ${quoted("file=@photo.jpg")}`);
  const types = operation.good.flatMap((response) => response.types);
  const file = /[?&]format=pdf\b/.test(path) ? "report.pdf" : /[?&]format=overlay\b/.test(path) ? "picture.png" : "";
  if (types.includes("text/event-stream")) lines.push("-N");
  else if (file) lines.push(`-o ${file}`);
  else if (types.length && types.every((type) => type.startsWith("image/"))) lines.push(`-o ${path.endsWith(".png") ? "tile.png" : "tile.jpg"}`);
  return lines.join(" \\\n  ");
}

/** JSON for people: a list of numbers on one line. */
export function pretty(value: unknown): string {
  const number = String.raw`-?\d[\d.eE+-]*`;
  const list = new RegExp(String.raw`\[\n\s+(${number}(?:,\n\s+${number})*)\n\s+\]`, "g");
  return JSON.stringify(value, null, 2).replace(list, (_, inner: string) => `[${inner.replace(/\s+/g, " ")}]`);
}

/** JSON on one line; what is no JSON as it is. */
function compact(text: string): string {
  try {
    return JSON.stringify(JSON.parse(text));
  } catch {
    return text;
  }
}

/** The HTTP API: one function per use, one error type, and requests of which the latest wins. */

export interface Note {
  code: string;
  text: string;
  cure: string;
}
export interface Contribution {
  name: string;
  source: string;
  u: number;
  share: number;
}
export interface Measurement {
  what: string;
  label: string;
  value: number;
  unit: string;
  u: number | null;
  low: number | null;
  high: number | null;
  level: number;
  method: string;
  evaluation: string;
  budget: Contribution[];
  notes: Note[];
  improve: string;
  given: Record<string, unknown>;
}
export interface Hypothesis {
  source: string;
  f_px: number | null;
  u_f_px: number | null;
  text: string;
  chosen: boolean;
}
export interface CameraSaid {
  f_px: number;
  u_f_px: number | null;
  width_px: number;
  height_px: number | null;
  source: string;
  hypotheses?: Hypothesis[];
}
export interface Doc {
  schema: string;
  version: string;
  photo: { name: string; width_px: number; height_px: number; sha256: string } | null;
  camera: CameraSaid | null;
  measurements: Measurement[];
  notes: Note[];
}
export interface Photo {
  id: string;
  name: string;
  width_px: number;
  height_px: number;
  sha256: string;
  tile_px: number;
  levels: number;
  tags: Record<string, string | number>;
  notes: Note[];
  kept?: boolean;
}
export interface FieldSchema {
  description: string;
  "x-noun"?: "Quantity" | "Observation" | "Target" | "Camera" | "Rig";
  "x-widget": string;
  "x-unit"?: string;
  "x-points"?: number;
  "x-least"?: number;
  "x-more"?: boolean;
  "x-closed"?: boolean;
  "x-typed"?: boolean;
}
export interface MethodRow {
  name: string;
  title: string;
  button: string;
  needs: string;
  assumes: string[];
  source: string;
  typical: string;
  outputs: { what: string; unit: string; title: string }[];
  inputs: { required: string[]; properties: Record<string, FieldSchema> };
}
export interface DetectorRow {
  name: string;
  title: string;
  groups: string[];
  asks: string;
  automatic: boolean;
  extra: string;
}
export interface ReportRow {
  name: string;
  title: string;
  media_type: string;
  suffix: string;
  of_photo: boolean;
}
export interface Tables {
  methods: MethodRow[];
  detectors: DetectorRow[];
  camera_sources: string[];
  reports: ReportRow[];
  units: Record<string, { unit: string; factor: number }>;
}
export interface Preset {
  name: string;
  title: string;
  kind: "class" | "sensor";
  aliases: string[];
  source: string;
  sensor_width_mm: [number, number];
  focal_mm: [number, number] | null;
  image_width_px: [number, number] | null;
}
export interface Target {
  name: string;
  title: string;
  group: string;
  what: string;
  shape: "length" | "rectangle" | "circle";
  size: string | null;
  width: string | null;
  height: string | null;
  text: string;
  aliases: string[];
  doubt: string;
  source: string;
}
export interface Seen {
  points_px: [number, number][];
  sigma_px: number | number[];
  cov: number[][] | null;
  label: string;
  score: number;
  source: string;
}
/** One thing found, and how it is measured: its points go into one field of a method, its size into another. */
export interface Detection extends Seen {
  detector: string;
  shape: string;
  target: string | null;
  others: string[];
  tilt: Record<string, unknown> | null;
  notes: Note[];
  method: string;
  points_field: string;
  size_field: string;
  size_prefix: string;
  size_text: string | null;
  size: Record<string, unknown> | null;
}
/** The outline of a thing, and its extents, each as two ends. */
export interface Outlined {
  contour_px: [number, number][];
  extents: Record<string, Seen>;
  notes: Note[];
  method: string;
  points_field: string;
  size_field: string;
}
export interface Job {
  id: string;
  state: "running" | "done" | "failed" | "cancelled";
  progress: number;
  doing: string;
  result: { detections: Detection[]; notes: Note[] } | null;
  error: { message: string } | null;
}
export interface Curve {
  x_what: string;
  y_what: string;
  x_unit: string;
  y_unit: string;
  x: number[];
  value: number[];
  low: number[];
  high: number[];
}
export type GivenCamera = string | { name: string; content: string } | null;

/** What the server said when it refused, or that it could not be reached (status 0). */
export class ApiError extends Error {
  constructor(
    readonly status: number,
    readonly kind: string,
    readonly field: string | null,
    message: string,
  ) {
    super(message);
  }
}

export async function request(path: string, init: RequestInit = {}): Promise<Response> {
  let response: Response;
  try {
    response = await fetch(path, { credentials: "same-origin", ...init });
  } catch (error) {
    if (error instanceof DOMException && error.name === "AbortError") throw error;
    throw new ApiError(0, "Unreachable", null, "the server does not answer; start it again with: subtense serve");
  }
  if (response.ok) return response;
  const said = await response.json().catch(() => null);
  const error = said?.error ?? {};
  throw new ApiError(response.status, error.type ?? "Failure", error.name ?? null, error.message ?? `status ${response.status}`);
}

export async function get<T>(path: string): Promise<T> {
  return (await request(path)).json();
}

export function posting(body: unknown, signal?: AbortSignal): RequestInit {
  return {
    method: "POST",
    headers: { "content-type": "application/json" },
    body: JSON.stringify(body),
    ...(signal ? { signal } : {}),
  };
}

export async function post<T>(path: string, body: unknown, signal?: AbortSignal): Promise<T> {
  return (await request(path, posting(body, signal))).json();
}

export async function send(file: Blob, name: string, signal?: AbortSignal): Promise<Photo> {
  const form = new FormData();
  form.append("file", file, name);
  const init: RequestInit = { method: "POST", body: form, ...(signal ? { signal } : {}) };
  const said: { photos: Photo[] } = await (await request("/api/photos", init)).json();
  const photo = said.photos[0];
  if (!photo) throw new ApiError(500, "Failure", null, "the server kept no photo");
  return photo;
}

/** Follow a job until it ends. */
export function watch(id: string, moved: (job: Job) => void): { ended: Promise<Job>; close: () => void } {
  const source = new EventSource(`/api/jobs/${id}/events`);
  const ended = new Promise<Job>((resolve, reject) => {
    const see = (event: MessageEvent<string>) => {
      const job = JSON.parse(event.data) as Job;
      moved(job);
      if (job.state !== "running") {
        source.close();
        resolve(job);
      }
    };
    for (const state of ["running", "done", "failed", "cancelled"]) source.addEventListener(state, see);
    source.onerror = () => {
      source.close();
      reject(new ApiError(0, "Unreachable", null, "the server does not answer"));
    };
  });
  return { ended, close: () => source.close() };
}

/**
 * Runs one request at a time and, when it ends, the newest that was asked for meanwhile: what lies between is skipped, so a
 * drag never queues up behind itself.
 */
export class Latest<In, Out> {
  private waiting: { input: In } | null = null;
  private running = false;

  constructor(
    private readonly work: (input: In) => Promise<Out>,
    private readonly done: (output: Out, input: In) => void,
    private readonly failed: (error: unknown, input: In) => void,
  ) {}

  ask(input: In): void {
    this.waiting = { input };
    if (!this.running) void this.run();
  }

  private async run(): Promise<void> {
    this.running = true;
    while (this.waiting) {
      const { input } = this.waiting;
      this.waiting = null;
      try {
        this.done(await this.work(input), input);
      } catch (error) {
        this.failed(error, input);
      }
    }
    this.running = false;
  }
}

/** The measuring page's state: session with undo, photos on the server, answers; what is drawn and pressed is in the components. */
import { ApiError, get, Latest, post, send, type CameraSaid, type Detection, type Doc, type GivenCamera, type MethodRow, type Note, type Outlined, type Photo, type Seen, type Tables, type Target } from "../lib/api";
import { store } from "../lib/store";
import { Undo } from "../lib/undo";
import { Combined } from "./combined.svelte";
import { requestOf } from "./request";
import { EMPTY, inputsOf, nextLabel, notesOf, outlineShape, pointFields, PROJECT, readProject, readSheet, sameFound, shapeOf, sigmaOf, snappedTo, wanting, withShape, withSheet, type ProjectSheet, type Session, type Shape, type Sheet } from "./session";
import { withoutShape } from "./together";

export type Answer = { state: "done"; doc: Doc } | { state: "wants"; fields: string[] } | { state: "refused"; message: string; field: string | null } | { state: "waits" };

interface Asked {
  shape: Shape;
  sheet: Sheet;
}

const KEEP_EVERY_MS = 30_000;

export class Model {
  tables: Tables | null = $state.raw(null);
  targets: Target[] = $state.raw([]);
  session: Session = $state.raw(EMPTY);
  photos: Record<string, Photo> = $state.raw({});
  cameras: Record<string, { said: CameraSaid | null; notes: Note[]; error: string }> = $state.raw({});
  answers: Record<string, Answer> = $state.raw({});
  selected: string | null = $state(null);
  canUndo = $state(false);
  canRedo = $state(false);
  trouble = $state("");
  reachable = $state(true);
  busy: string[] = $state([]);
  ready = $state(false);
  /** Whether points that are set go to the edges near them, and what the last such move said. */
  snaps = $state(false);
  said = $state("");
  /** The sizes of things whose size must be told, by detector. */
  sizes: Record<string, string> = $state({});
  /** Distances between measurements, and one number from several. */
  readonly combined = new Combined(this);

  private answered: Record<string, { shape: Shape; camera: GivenCamera } | null> = $state.raw({});
  private current = new Map<string, { shape: Shape; camera: GivenCamera }>();
  private cameraAsked = new Map<string, number>();
  private others = "BroadcastChannel" in globalThis ? new BroadcastChannel("subtense") : null;
  private history = new Undo<Session>(EMPTY);
  private asking = new Map<string, Latest<Asked, Doc>>();
  private saving: ReturnType<typeof setTimeout> | undefined;
  private retrying: ReturnType<typeof setTimeout> | undefined;
  private resending = new Map<string, Promise<boolean>>();

  get sheet(): Sheet | undefined {
    return this.session.sheets[this.session.current];
  }
  get photo(): Photo | undefined {
    return this.sheet ? this.photos[this.sheet.photo.id] : undefined;
  }
  get shape(): Shape | undefined {
    return this.sheet?.shapes.find((shape) => shape.id === this.selected);
  }
  target(name: string | null): Target | undefined {
    return this.targets.find((row) => row.name === name);
  }
  method(name: string): MethodRow | undefined {
    return this.tables?.methods.find((row) => row.name === name);
  }

  // -- beginning -----------------------------------------------------------------------------------------

  async start(): Promise<void> {
    try {
      this.tables = await get<Tables>("/api/methods");
      const stored = (await store.session()) as Partial<Session> | undefined;
      const sheets = readSheets(stored?.sheets);
      const held = (await get<{ photos: Photo[] }>("/api/photos")).photos;
      for (const photo of held) this.photos = { ...this.photos, [photo.id]: photo };
      const fresh = held.filter((photo) => photo.kept && !sheets.some((sheet) => sheet.photo.id === photo.id)).map(sheetOf);
      const all = [...sheets, ...fresh];
      const current = fresh.length ? all.indexOf(fresh[0]!) : Math.min(stored?.current ?? 0, Math.max(all.length - 1, 0));
      this.replace({ sheets: all, current });
      this.history = new Undo(this.session);
      this.reachable = true;
      await Promise.all(all.map((sheet) => this.present(sheet)));
      this.measureAll();
    } catch (error) {
      this.ready = true;
      const lost = this.unreachable(error);
      clearTimeout(this.retrying);
      if (lost) this.retrying = setTimeout(() => void this.start(), 1000);
      else this.trouble = error instanceof Error ? error.message : String(error);
      return;
    }
    this.ready = true;
    setInterval(() => void this.keep(), KEEP_EVERY_MS);
    setTimeout(() => void this.loadTargets(), 300);
    if (this.others) this.others.onmessage = () => void this.follow();
    for (const photo of Object.values(this.photos)) if (photo.kept) void this.fetchKept(photo);
  }

  /** The file of a photo named on the command line, so that projects and a new start of the server have it too. */
  private async fetchKept(photo: Photo): Promise<void> {
    if (await store.photo(photo.id)) return;
    const response = await fetch(`/api/photos/${photo.id}/file`).catch(() => null);
    if (response?.ok) await store.putPhoto(photo.id, { blob: await response.blob(), name: photo.name });
  }

  async loadTargets(): Promise<void> {
    if (!this.targets.length) this.targets = (await get<{ targets: Target[] }>("/api/targets").catch(() => ({ targets: [] }))).targets;
  }

  // -- the session ---------------------------------------------------------------------------------------

  /** The session as it is while something is dragged: shown and measured, but no step of undo yet. */
  replace(session: Session): void {
    this.session = session;
    clearTimeout(this.saving);
    this.saving = setTimeout(() => this.save(), 150);
  }

  /** A step of undo. */
  commit(session: Session = this.session): void {
    this.replace(session);
    this.history.commit(session);
    this.mark();
  }

  undo(): void {
    this.settle();
    this.travel(this.history.undo());
  }
  redo(): void {
    this.settle();
    this.travel(this.history.redo());
  }

  /** What was changed without a step of its own yet (keys, half a word) becomes one. */
  private settle(): void {
    if (this.session.sheets !== this.history.now.sheets) this.commit();
  }

  private travel(session: Session): void {
    const before = this.session;
    this.replace(session);
    this.mark();
    if (!this.shape && !this.combined.selected) this.selected = null;
    session.sheets.forEach((sheet) => {
      const old = before.sheets.find((other) => other.photo.id === sheet.photo.id);
      if (!old) void this.present(sheet).then(() => this.measureSheet(sheet));
      else if (old.camera !== sheet.camera) void this.readCamera(sheet).then(() => this.measureSheet(sheet));
      else for (const shape of sheet.shapes) if (!old.shapes.includes(shape)) this.measure(shape, sheet);
    });
    this.combined.renew();
  }

  private mark(): void {
    this.canUndo = this.history.canUndo;
    this.canRedo = this.history.canRedo;
  }

  save(): void {
    void store.putSession($state.snapshot(this.session)).then(() => this.others?.postMessage("saved"));
  }

  /** Another tab of this browser has changed the session, which they share: take it over. */
  private async follow(): Promise<void> {
    const stored = (await store.session()) as Partial<Session> | undefined;
    const sheets = readSheets(stored?.sheets);
    const current = Math.max(sheets.findIndex((sheet) => sheet.photo.id === this.sheet?.photo.id), 0);
    this.session = { sheets, current };
    this.history.commit(this.session);
    this.mark();
    await Promise.all(sheets.map((sheet) => this.present(sheet)));
    this.measureAll();
  }

  change(change: (sheet: Sheet) => Sheet, commit = true): void {
    const next = withSheet(this.session, this.session.current, change);
    if (commit) this.commit(next);
    else this.replace(next);
  }

  changeShape(id: string, change: (shape: Shape) => Shape, commit = true): void {
    this.change((sheet) => withShape(sheet, id, change), commit);
    const shape = this.sheet?.shapes.find((one) => one.id === id);
    if (shape && this.sheet) this.measure(shape, this.sheet);
  }

  /** New measurements in a photo, the current one unless another is named. */
  add(shapes: Omit<Shape, "id" | "label">[], labels: (string | undefined)[] = [], photo = this.sheet?.photo.id): Shape[] {
    const index = this.session.sheets.findIndex((one) => one.photo.id === photo);
    const sheet = this.session.sheets[index];
    if (!sheet) return [];
    const made = named(shapes, labels, sheet.shapes);
    this.commit(withSheet(this.session, index, (old) => ({ ...old, shapes: [...old.shapes, ...made] })));
    if (index === this.session.current) this.selected = made[0]?.id ?? null;
    for (const shape of made) this.measure(shape, this.session.sheets[index]!);
    return made;
  }

  /** What a search found becomes measurements, in one step of undo; what is there already only learns its size. */
  take(found: readonly Detection[], photo: string): { made: number; known: number; unsized: number } {
    const index = this.session.sheets.findIndex((one) => one.photo.id === photo);
    const sheet = this.session.sheets[index];
    if (!sheet) return { made: 0, known: 0, unsized: 0 };
    const all = found.map((one) => ({ label: one.label, shape: shapeOf(one, this.sizes[one.detector] ?? "") }));
    const fresh = all.filter(({ shape }) => !sheet.shapes.some((old) => sameFound(old, shape)));
    const old = sheet.shapes.map((shape) => {
      const again = all.find((one) => sameFound(shape, one.shape))?.shape;
      const field = shape.found?.field ?? "";
      // what a person typed stays; a size that was assumed or left open is what is known of it now
      const free = again?.texts[field] && (!shape.texts[field]?.trim() || shape.texts[field] === shape.found?.text);
      return free ? { ...shape, texts: { ...shape.texts, [field]: again.texts[field]! }, found: again.found! } : shape;
    });
    const made = named(fresh.map((one) => one.shape), fresh.map((one) => one.label), old);
    this.commit(withSheet(this.session, index, (before) => ({ ...before, shapes: [...old, ...made] })));
    if (index === this.session.current) this.selected = made.length === 1 ? made[0]!.id : null;
    this.measureSheet(this.session.sheets[index]!);
    return { made: made.length, known: all.length - made.length, unsized: made.filter((shape) => !shape.texts[shape.found!.field]).length };
  }

  /** Have the outline of what is at a place found: x, y of a point, or x1, y1, x2, y2 of a box. */
  async outline(place: readonly number[]): Promise<void> {
    const photo = this.sheet?.photo.id;
    if (!photo) return;
    this.said = "Looking for its outline…";
    try {
      const found = await this.withPhoto(photo, () => post<Outlined>("/api/outline", { photo, place }));
      this.said = "";
      this.add([outlineShape(found)], [], photo);
    } catch (error) {
      this.said = "";
      if (!this.unreachable(error)) this.said = error instanceof Error ? error.message : String(error);
    }
  }

  /** Move the points of a shape to the edges near them, where there are some; a step of undo of its own. */
  async snap(id: string): Promise<void> {
    const sheet = this.sheet;
    const shape = sheet?.shapes.find((one) => one.id === id);
    if (!sheet || !shape) return;
    const several = Object.keys(shape.points).length > 1;
    const sigma = sigmaOf(shape);
    this.said = "";
    let now = shape;
    for (const [field, points] of Object.entries(shape.points)) {
      const row = this.method(shape.method);
      const round = row && pointFields(row).some((one) => one.name === field && one.round); // a rim has no corners
      if (shape.seen?.[field] || round || (points.length !== 2 && points.length !== 4)) continue;
      try {
        const body = { photo: sheet.photo.id, points_px: points, ...(typeof sigma === "number" ? { sigma_px: sigma } : {}) };
        const { observation, notes } = await this.withPhoto(sheet.photo.id, () => post<{ observation: Seen; notes: Note[] }>("/api/snap", body));
        now = snappedTo(now, field, { ...observation, label: several ? field : "" }, notes);
      } catch (error) {
        if (this.unreachable(error)) return;
        this.said = `Left where it was set: ${error instanceof Error ? error.message : String(error)}`;
      }
    }
    const newest = this.sheet?.shapes.find((one) => one.id === id);
    if (now === shape || newest?.points !== shape.points) return; // it was moved on meanwhile
    const { points, seen, snapped } = now;
    this.changeShape(id, (old) => ({ ...old, points, ...(seen ? { seen } : {}), ...(snapped ? { snapped } : {}) }));
  }

  remove(id: string): void {
    if (this.combined.all.some((one) => one.id === id)) return this.combined.remove(id);
    this.change((sheet) => withoutShape(sheet, id));
    if (!this.shape && !this.combined.selected) this.selected = null;
    this.combined.renew();
  }

  setCamera(camera: GivenCamera): void {
    this.change((sheet) => ({ ...sheet, camera }));
    const sheet = this.sheet!;
    void this.readCamera(sheet).then(() => this.measureSheet(sheet));
  }

  go(index: number): void {
    this.replace({ ...this.session, current: index });
    this.selected = null;
  }

  close(index: number): void {
    const sheets = this.session.sheets.filter((_, i) => i !== index);
    const current = this.session.current - (index < this.session.current ? 1 : 0);
    this.commit({ sheets, current: Math.min(current, Math.max(sheets.length - 1, 0)) });
    this.selected = null;
  }

  // -- photos --------------------------------------------------------------------------------------------

  async addFiles(files: Iterable<File>): Promise<void> {
    for (const file of files) {
      this.busy = [...this.busy, file.name];
      this.trouble = "";
      try {
        if (/\.json$/i.test(file.name) || file.type === "application/json") await this.openProject(await file.text());
        else await this.addPhoto(file, file.name);
      } catch (error) {
        this.trouble = this.unreachable(error) ?? (error instanceof Error ? error.message : String(error));
      }
      this.busy = this.busy.filter((name) => name !== file.name);
    }
  }

  private async addPhoto(file: Blob, name: string): Promise<void> {
    const photo = await send(file, name);
    void store.putPhoto(photo.id, { blob: file, name });
    this.photos = { ...this.photos, [photo.id]: photo };
    const known = this.session.sheets.findIndex((sheet) => sheet.photo.id === photo.id);
    if (known >= 0) {
      this.replace({ ...this.session, current: known });
      this.measureSheet(this.session.sheets[known]!);
      void this.readCamera(this.session.sheets[known]!);
      return;
    }
    const sheet = sheetOf(photo);
    this.commit({ sheets: [...this.session.sheets, sheet], current: this.session.sheets.length });
    this.selected = null;
    await this.readCamera(sheet);
  }

  /** Have the server hold a sheet's photo: it may have been dropped, or the server may be a new one. */
  private async present(sheet: Sheet): Promise<void> {
    if (!this.photos[sheet.photo.id]) await this.resend(sheet.photo.id);
    if (this.photos[sheet.photo.id]) await this.readCamera(sheet);
  }

  private resend(id: string): Promise<boolean> {
    let going = this.resending.get(id);
    if (!going) {
      going = this.resendNow(id).finally(() => this.resending.delete(id));
      this.resending.set(id, going);
    }
    return going;
  }

  private async resendNow(id: string): Promise<boolean> {
    const stored = await store.photo(id);
    if (!stored) {
      const { [id]: _gone, ...rest } = this.photos; // so that the page asks for the file
      this.photos = rest;
      return false;
    }
    try {
      const photo = await send(stored.blob, stored.name);
      this.photos = { ...this.photos, [photo.id]: photo };
      return photo.id === id;
    } catch (error) {
      this.unreachable(error);
      return false;
    }
  }

  /** Tell the server which photos are still shown, and send again what it has dropped. */
  async keep(): Promise<void> {
    const ids = this.session.sheets.map((sheet) => sheet.photo.id);
    if (!ids.length) return;
    try {
      const { absent } = await post<{ absent: string[] }>("/api/photos/keep", { photos: ids });
      await Promise.all(absent.map((id) => this.resend(id)));
      if (!this.reachable) {
        this.reachable = true;
        this.trouble = "";
        for (const sheet of this.session.sheets) void this.present(sheet);
        this.measureAll();
      }
    } catch (error) {
      this.unreachable(error);
    }
  }

  /** Note that the server does not answer, and ask until it does; the message, or null for another error. */
  unreachable(error: unknown): string | null {
    if (!(error instanceof ApiError) || error.status !== 0) return null;
    this.reachable = false;
    clearTimeout(this.retrying);
    this.retrying = setTimeout(() => void this.keep(), 1000);
    return error.message;
  }

  // -- answers -------------------------------------------------------------------------------------------

  async readCamera(sheet: Sheet): Promise<void> {
    const key = sheet.photo.id;
    const turn = (this.cameraAsked.get(key) ?? 0) + 1;
    this.cameraAsked.set(key, turn);
    try {
      const doc = await this.withPhoto(key, () => post<Doc>("/api/camera", { photo: key, camera: sheet.camera }));
      if (this.cameraAsked.get(key) !== turn) return;
      const unknown = doc.camera ? undefined : doc.notes.find((note) => note.code === "unknown_camera");
      this.cameras = { ...this.cameras, [key]: { said: doc.camera, notes: doc.notes, error: unknown ? `${unknown.text}; ${unknown.cure}` : "" } };
    } catch (error) {
      if (this.unreachable(error) || this.cameraAsked.get(key) !== turn) return;
      this.cameras = { ...this.cameras, [key]: { said: null, notes: [], error: error instanceof Error ? error.message : String(error) } };
    }
  }

  /** Ask something of a photo; where the server has dropped it, send it again and ask once more. */
  async withPhoto<T>(id: string, work: () => Promise<T>): Promise<T> {
    try {
      return await work();
    } catch (error) {
      if (error instanceof ApiError && error.status === 404 && (await this.resend(id))) return work();
      throw error;
    }
  }

  measureAll(): void {
    for (const sheet of this.session.sheets) this.measureSheet(sheet);
  }

  measureSheet(sheet: Sheet): void {
    const now = this.session.sheets.find((other) => other.photo.id === sheet.photo.id);
    for (const shape of now?.shapes ?? []) this.measure(shape, now!);
  }

  measure(shape: Shape, sheet: Sheet): void {
    const row = this.method(shape.method);
    const missing = row ? wanting(shape, row) : [];
    this.current.set(shape.id, { shape, camera: sheet.camera });
    if (!row) return this.tell(shape.id, { state: "refused", message: `this server has no method ${shape.method}`, field: null });
    if (missing.length) return this.tell(shape.id, { state: "wants", fields: missing });
    if (sigmaOf(shape) === null) return this.tell(shape.id, { state: "refused", message: `each end is known to "${shape.sigma}"; give a number of pixels above 0`, field: "sigma" });
    const camera = this.cameras[sheet.photo.id];
    if (camera?.error && row.inputs.required.includes("camera")) return this.tell(shape.id, { state: "refused", message: camera.error, field: "camera" });
    if (!this.answers[shape.id]) this.tell(shape.id, { state: "waits" });
    let asking = this.asking.get(shape.id);
    if (!asking) {
      asking = new Latest<Asked, Doc>(
        ({ shape, sheet }) =>
          this.withPhoto(sheet.photo.id, () =>
            post<Doc>(`/api/measure/${shape.method}`, { photo: sheet.photo.id, camera: sheet.camera, label: shape.label, inputs: inputsOf(shape), notes: notesOf(shape) }),
          ),
        (doc, { shape, sheet }) => {
          if (this.isNewest(shape, sheet)) this.tell(shape.id, { state: "done", doc }, shape, sheet);
          else this.combined.renew(shape.id);
        },
        (error, { shape, sheet }) => {
          if (this.unreachable(error) || !this.isNewest(shape, sheet)) return;
          const field = error instanceof ApiError ? error.field : null;
          this.tell(shape.id, { state: "refused", message: error instanceof Error ? error.message : String(error), field });
        },
      );
      this.asking.set(shape.id, asking);
    }
    asking.ask({ shape, sheet });
  }

  private tell(id: string, answer: Answer, shape?: Shape, sheet?: Sheet): void {
    this.answers = { ...this.answers, [id]: answer };
    this.answered = { ...this.answered, [id]: shape && sheet ? { shape, camera: sheet.camera } : null };
    this.combined.renew(id);
  }

  /** Whether nothing newer was asked of a measurement meanwhile. */
  private isNewest(shape: Shape, sheet: Sheet): boolean {
    const newest = this.current.get(shape.id);
    return newest?.shape === shape && newest.camera === sheet.camera;
  }

  /** Whether the answer that is shown is that of the measurement as it stands. */
  isCurrent(shape: Shape): boolean {
    const of = this.answered[shape.id];
    return !of || (of.shape === shape && of.camera === this.sheet?.camera);
  }

  /** The body of POST /api/measure for a sheet: what it has that can be measured. */
  request(sheet: Sheet): Record<string, unknown> {
    const able = sheet.shapes.filter((shape) => {
      const row = this.method(shape.method);
      return row && !wanting(shape, row).length;
    });
    const answered = able.filter((shape) => this.answers[shape.id]?.state === "done" && this.isCurrent(shape));
    const together = (sheet.together ?? []).filter((one) => this.combined.answers[one.id]?.state === "done" && one.of.every((id) => answered.some((shape) => shape.id === id)));
    return requestOf(sheet, [...answered, ...able.filter((shape) => !answered.includes(shape))], together);
  }

  /** What is asked of the current sheet is answered, or a few seconds have passed. */
  async settled(): Promise<void> {
    const open = () => this.sheet?.shapes.some((shape) => !this.isCurrent(shape) || this.answers[shape.id]?.state === "waits") || this.combined.all.some((one) => !this.combined.isCurrent(one) || this.combined.answers[one.id]?.state === "waits");
    for (const end = Date.now() + 4000; open() && Date.now() < end; ) await new Promise((resolve) => setTimeout(resolve, 30));
  }

  // -- project files -------------------------------------------------------------------------------------

  async project(withPictures: boolean): Promise<Blob> {
    const sheets: ProjectSheet[] = [];
    for (const sheet of this.session.sheets) {
      const stored = withPictures ? await store.photo(sheet.photo.id) : undefined;
      const data = stored ? await base64(stored.blob) : undefined;
      sheets.push({ ...$state.snapshot(sheet), ...(data ? { data } : {}) } as ProjectSheet);
    }
    return new Blob([JSON.stringify({ schema: PROJECT, sheets }, null, 1)], { type: "application/json" });
  }

  private async openProject(text: string): Promise<void> {
    const project = readProject(text);
    if (typeof project === "string") throw new Error(project);
    for (const { data, ...sheet } of project.sheets) {
      if (data) {
        const blob = new Blob([Uint8Array.from(atob(data), (c) => c.charCodeAt(0))]);
        const photo = await send(blob, sheet.photo.name);
        if (photo.sha256 !== sheet.photo.sha256) throw new Error(`${sheet.photo.name}: the picture in the project is not the one that was measured`);
        void store.putPhoto(photo.id, { blob, name: photo.name });
        this.photos = { ...this.photos, [photo.id]: photo };
      }
      const index = this.session.sheets.findIndex((other) => other.photo.id === sheet.photo.id);
      const sheets = index < 0 ? [...this.session.sheets, sheet] : this.session.sheets.map((other, i) => (i === index ? sheet : other));
      this.commit({ sheets, current: index < 0 ? sheets.length - 1 : index });
      await this.present(sheet);
      this.measureSheet(sheet);
    }
    this.selected = null;
  }
}

/** Measurements with ids and labels of their own: that which is wished, or the next free letter. */
function named(shapes: readonly Omit<Shape, "id" | "label">[], labels: readonly (string | undefined)[], there: readonly Shape[]): Shape[] {
  const made: Shape[] = [];
  shapes.forEach((shape, i) => {
    const wished = labels[i];
    const taken = [...there, ...made].some((other) => other.label === wished);
    made.push({ ...shape, id: crypto.getRandomValues(new Uint32Array(2)).join("-"), label: wished && !taken ? wished : nextLabel([...there, ...made]) });
  });
  return made;
}

/** Stored sheets that can be read, each photo once. */
function readSheets(stored: unknown): Sheet[] {
  const found = (Array.isArray(stored) ? stored : []).map(readSheet).filter((sheet): sheet is ProjectSheet => sheet !== null);
  return found.filter((sheet, i) => found.findIndex((other) => other.photo.id === sheet.photo.id) === i);
}

function sheetOf(photo: Photo): Sheet {
  const { id, name, width_px, height_px, sha256 } = photo;
  return { photo: { id, name, width_px, height_px, sha256 }, camera: null, shapes: [] };
}

async function base64(blob: Blob): Promise<string> {
  const bytes = new Uint8Array(await blob.arrayBuffer());
  const parts: string[] = [];
  for (let i = 0; i < bytes.length; i += 0x8000) parts.push(String.fromCharCode(...bytes.subarray(i, i + 0x8000)));
  return btoa(parts.join(""));
}

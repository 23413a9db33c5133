/** Distances between measured things, and one number from several: what is picked, asked and answered. */
import { Latest, post, type Doc, type GivenCamera, type Note } from "../lib/api";
import type { Answer, Model } from "./model.svelte";
import { requestOf } from "./request";
import type { Shape, Sheet } from "./session";
import { combinations, isSame, membersOf, MOST, withTogether, type Kind, type Together } from "./together";

/** What an answer rests on. */
interface Basis {
  shapes: readonly Shape[];
  camera: GivenCamera;
}
interface Question extends Basis {
  one: Together;
  sheet: Sheet;
}

const METHOD: Record<Kind, string> = { between: "between", same: "fuse" };

export class Combined {
  answers: Record<string, Answer> = $state.raw({});
  /** Ids of the measurements that are ticked. */
  ticked: readonly string[] = $state.raw([]);

  private answered: Record<string, Basis | null> = $state.raw({});
  private asked = new Map<string, Question>();
  private asking = new Map<string, Latest<Question, Doc>>();

  constructor(private readonly model: Model) {}

  get all(): readonly Together[] {
    return this.model.sheet?.together ?? [];
  }
  get selected(): Together | undefined {
    return this.all.find((one) => one.id === this.model.selected);
  }

  // -- picking ---------------------------------------------------------------------------------------------

  /** The picked measurements, in the order of the list. */
  get picked(): Shape[] {
    return (this.model.sheet?.shapes ?? []).filter((shape) => this.ticked.includes(shape.id));
  }

  pick(id: string): void {
    this.ticked = this.ticked.includes(id) ? this.ticked.filter((other) => other !== id) : [...this.ticked, id];
  }

  /** A click with Shift or Ctrl: one more than what is picked, or than what is selected. */
  pickAlso(id: string): void {
    const first = this.model.shape?.id;
    if (!this.picked.length && first && first !== id) this.ticked = [first];
    this.pick(id);
  }

  /** How many of a kind what is picked would add. */
  fresh(kind: Kind): Omit<Together, "id">[] {
    const ids = this.picked.map((shape) => shape.id);
    return combinations(kind, ids).filter((one) => !this.all.some((old) => isSame(old, one)));
  }

  room(kind: Kind): number {
    return MOST - this.all.filter((one) => one.kind === kind).length;
  }

  /** Make of what is picked its distances, or one number; a step of undo. What is there already is shown. */
  combine(kind: Kind): void {
    const ids = this.picked.map((shape) => shape.id);
    const wanted = combinations(kind, ids);
    const fresh = this.fresh(kind);
    if (!wanted.length || fresh.length > this.room(kind)) return;
    const made = fresh.map((one) => ({ ...one, id: crypto.getRandomValues(new Uint32Array(2)).join("-") }));
    if (made.length) this.model.change((sheet) => withTogether(sheet, [...(sheet.together ?? []), ...made]));
    this.ticked = [];
    this.model.selected = (made[0] ?? this.all.find((old) => isSame(old, wanted[0]!)))?.id ?? null;
    this.renew();
  }

  remove(id: string): void {
    this.model.change((sheet) => withTogether(sheet, (sheet.together ?? []).filter((one) => one.id !== id)));
    if (this.model.selected === id) this.model.selected = null;
  }

  /** A distance counted from its other end. */
  turn(id: string): void {
    this.model.change((sheet) => ({ ...sheet, together: (sheet.together ?? []).map((one) => (one.id === id ? { ...one, of: [...one.of].reverse() } : one)) }));
    this.renew();
  }

  // -- answers ---------------------------------------------------------------------------------------------

  /** Ask again what a measurement is part of, or all. What stands as it was is not asked twice. */
  renew(of?: string): void {
    for (const sheet of this.model.session.sheets) {
      for (const one of sheet.together ?? []) if (!of || one.of.includes(of)) this.ask(one, sheet);
    }
  }

  private ask(one: Together, sheet: Sheet): void {
    const shapes = membersOf(one, sheet);
    const state = (shape: Shape) => this.model.answers[shape.id]?.state;
    const refused = shapes.find((shape) => state(shape) === "refused");
    if (refused) return this.settle(one.id, { state: "refused", message: `${refused.label} has no answer`, field: null });
    const open = shapes.filter((shape) => state(shape) === "wants").map((shape) => shape.label);
    if (open.length) return this.settle(one.id, { state: "wants", fields: open });
    if (!this.answers[one.id] || this.answers[one.id]!.state === "wants") this.tell(one.id, { state: "waits" });
    if (shapes.some((shape) => state(shape) !== "done")) return;
    const question = { one, sheet, shapes, camera: sheet.camera };
    const before = this.asked.get(one.id);
    if (before && sameBasis(before, question)) return;
    this.asked.set(one.id, question);
    this.queue(one.id).ask(question);
  }

  private queue(id: string): Latest<Question, Doc> {
    let asking = this.asking.get(id);
    if (!asking) {
      asking = new Latest<Question, Doc>(
        ({ one, sheet, shapes }) => this.model.withPhoto(sheet.photo.id, () => post<Doc>("/api/measure", requestOf(sheet, shapes, [one]))),
        // while something is dragged an older answer is better than none: it is shown as such
        (doc, question) => this.asked.has(id) && this.tell(id, answerOf(doc, question), question),
        (error, question) => {
          const lost = this.model.unreachable(error);
          if (this.asked.get(id) !== question) return;
          if (lost) return void this.asked.delete(id);
          const message = error instanceof Error ? error.message : String(error);
          this.tell(id, { state: "refused", message: this.inWords(message), field: null }, question);
        },
      );
      this.asking.set(id, asking);
    }
    return asking;
  }

  /** An answer that no request will bring. */
  private settle(id: string, answer: Answer): void {
    this.asked.delete(id);
    this.tell(id, answer);
  }

  private tell(id: string, answer: Answer, basis?: Basis): void {
    this.answers = { ...this.answers, [id]: answer };
    this.answered = { ...this.answered, [id]: basis ? { shapes: basis.shapes, camera: basis.camera } : null };
  }

  /** Whether the answer that is shown is that of the measurements as they stand. */
  isCurrent(one: Together): boolean {
    const [of, sheet] = [this.answered[one.id], this.model.sheet];
    return !of || !sheet || sameBasis(of, { shapes: membersOf(one, sheet), camera: sheet.camera });
  }

  /** A message of the server with methods called as the buttons call them. */
  private inWords(message: string): string {
    const named = message.replace(/\b[a-z]+(_[a-z]+)*\b/g, (word) => this.model.method(word)?.button ?? word);
    return named.replace(/^between is '(.*?)'; it /, "$1 ").replace(/^what is missing; give what all of them measure/, "they measure nothing in common");
  }

  /** Doubts of an answer, and of what it is made of. */
  notes(one: Together): Note[] {
    const answer = this.answers[one.id];
    const own = answer?.state === "done" ? answer.doc.measurements[0]!.notes : [];
    const sheet = this.model.sheet;
    const theirs = (sheet ? membersOf(one, sheet) : []).flatMap((shape) => {
      const part = this.model.answers[shape.id];
      const notes = part?.state === "done" ? part.doc.measurements[0]!.notes : [];
      return notes.filter((note) => !own.some((other) => other.code === note.code && other.text === note.text)).map((note) => ({ ...note, text: `${shape.label}: ${note.text}` }));
    });
    return [...own, ...theirs];
  }
}

function sameBasis(one: Basis, other: Basis): boolean {
  return one.camera === other.camera && one.shapes.length === other.shapes.length && one.shapes.every((shape, i) => shape === other.shapes[i]);
}

function answerOf(doc: Doc, { one }: Question): Answer {
  const measurements = doc.measurements.filter((m) => m.method === METHOD[one.kind]);
  return measurements.length ? { state: "done", doc: { ...doc, measurements } } : { state: "refused", message: "the server gave no answer", field: null };
}

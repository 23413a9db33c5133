/** Whole states, newest last: undo and redo go between them. States must not be changed after they were given. */
export class Undo<T> {
  private past: T[] = [];
  private future: T[] = [];

  constructor(
    private present: T,
    private readonly most = 200,
  ) {}

  get now(): T {
    return this.present;
  }
  get canUndo(): boolean {
    return this.past.length > 0;
  }
  get canRedo(): boolean {
    return this.future.length > 0;
  }

  /** A new state; what was undone before can't be redone any more. */
  commit(next: T): void {
    if (next === this.present) return;
    this.past = [...this.past, this.present].slice(-this.most);
    this.future = [];
    this.present = next;
  }

  undo(): T {
    const before = this.past.pop();
    if (before !== undefined) {
      this.future.push(this.present);
      this.present = before;
    }
    return this.present;
  }

  redo(): T {
    const after = this.future.pop();
    if (after !== undefined) {
      this.past.push(this.present);
      this.present = after;
    }
    return this.present;
  }
}

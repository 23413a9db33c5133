/** The last calculations, kept in this browser. */
import { toFragment, type Texts } from "./state.svelte";

export interface Entry {
  texts: Texts;
  title: string;
  value: string;
}

const KEY = "subtense.history";
const MOST = 30;

export function load(): Entry[] {
  try {
    const found: unknown = JSON.parse(localStorage.getItem(KEY) ?? "[]");
    return Array.isArray(found) ? found.filter((e): e is Entry => typeof e?.title === "string" && typeof e?.texts === "object") : [];
  } catch {
    return [];
  }
}

/** Newest first; the same inputs once. */
export function remember(entries: Entry[], entry: Entry): Entry[] {
  const key = toFragment(entry.texts);
  const kept = [entry, ...entries.filter((other) => toFragment(other.texts) !== key)].slice(0, MOST);
  save(kept);
  return kept;
}

export function save(entries: Entry[]): void {
  try {
    localStorage.setItem(KEY, JSON.stringify(entries));
  } catch {
    // no storage: the history is that of this page
  }
}

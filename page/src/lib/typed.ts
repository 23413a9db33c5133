/** A quantity as it stands in a field: number, unit, doubt and how the doubt is meant; to and from the text the API reads. */

export type Meaning = "95" | "1s" | "limits";

export interface Typed {
  value: string;
  unit: string;
  doubt: string;
  /** The unit of the doubt; "%" or as `unit`. */
  doubtUnit: string;
  meaning: Meaning;
  exact: boolean;
}

export function typed(value = "", unit = ""): Typed {
  return { value, unit, doubt: "", doubtUnit: unit, meaning: "95", exact: false };
}

const TAIL: Record<Meaning, string> = { "95": "", "1s": " (1s)", limits: " (limits)" };

/** The text that the API reads; empty where nothing was typed. */
export function compose(t: Typed): string {
  const value = t.value.trim().replace(",", ".");
  if (!value) return "";
  const head = t.unit && t.unit !== "1" && t.unit !== "px" ? `${value} ${t.unit}` : value;
  if (t.exact) return `${head} exact`;
  const doubt = t.doubt.trim().replace(",", ".");
  if (!doubt) return head;
  const unit = t.doubtUnit === "%" ? " %" : t.unit === "px" ? " px" : "";
  // the unit stands once, behind the doubt, where both have it: "200 ± 0.5 mm"
  const both = t.doubtUnit === "%" || t.unit === "px" || t.unit === "1" ? `${head} ± ${doubt}${unit}` : `${value} ± ${doubt} ${t.unit}`;
  return both + TAIL[t.meaning];
}

const NUMBER = String.raw`[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?`;
const TEXT = new RegExp(
  String.raw`^\s*(${NUMBER})\s*([A-Za-zµ°]+)?\s*(?:±\s*(${NUMBER})\s*([A-Za-zµ°%]+)?)?\s*(?:\((1s|limits|95\s*%)\))?\s*(exact)?\s*$`,
);

/** What `compose` and the API's own texts say, as a field; null for a text of another form. */
export function parse(text: string, unit: string): Typed | null {
  const match = TEXT.exec(text);
  if (!match) return null;
  const [, value = "", headUnit, doubt = "", tailUnit, meaning, exact] = match;
  const found = (headUnit === "exact" ? undefined : headUnit) ?? (tailUnit !== "%" ? tailUnit : undefined) ?? unit;
  return {
    value,
    unit: found,
    doubt,
    doubtUnit: tailUnit === "%" ? "%" : found,
    meaning: meaning === "1s" || meaning === "limits" ? meaning : "95",
    exact: exact === "exact" || headUnit === "exact",
  };
}

/** Whether a text is a quantity half typed ("200 ±", "-", "0."), which is not worth a question yet. */
export function halfTyped(text: string): boolean {
  return /(^|\s)[+-]?$|±\s*$|\(\s*[\w ]*$|\d\.$|e[+-]?$|^[+-]?0+[.,]?0*(\s*[a-z]*)?$/i.test(text.trimEnd()) && text.trim() !== "";
}

const METRES: Record<string, number> = { mm: 1e-3, cm: 1e-2, m: 1, km: 1e3, in: 0.0254, ft: 0.3048, yd: 0.9144 };

/**
 * The same number in another unit; a text that is no number is left as it is. Only one significant digit more than were typed
 * is kept between metric and imperial units, since what is assumed of a number without ± follows from its last digit.
 */
export function converted(text: string, from: string, to: string): string {
  const a = METRES[from];
  const b = METRES[to];
  const value = Number(text.trim().replace(",", "."));
  if (!text.trim() || !Number.isFinite(value) || a === undefined || b === undefined || a === b) return text;
  const digits = text.replace(/e.*$/i, "").replace(/^[^1-9]*/, "").replace(/\D/g, "").length;
  const imperial = (unit: string) => ["in", "ft", "yd"].includes(unit);
  const kept = imperial(from) === imperial(to) && !imperial(from) ? 15 : Math.max(digits + 1, 4);
  return String(Number(((value * a) / b).toPrecision(Math.min(kept, 15))));
}

/** Sizes as texts of the table of known things. */

/** A size without its doubts: "210 x 297 mm" of "210 ± 1.5 mm (limits) x 297 ± 2 mm (limits)". */
export function sizesOnly(text: string): string {
  const sides = text.split(" x ").map((side) => /^\s*([\d.]+)[^a-z]*([a-zµ]+)?/.exec(side));
  if (sides.some((side) => !side)) return text;
  const unit = sides[sides.length - 1]![2] ?? "";
  const values = sides.map((side) => Number(side![1]));
  if (unit === "mm" && values.every((value) => value >= 1000)) return `${values.map((value) => value / 1000).join(" x ")} m`;
  return `${values.join(" x ")} ${unit}`.trim();
}

/** With its doubt, in short: "1710 ± 90 mm", where all sides share one. */
export function shortSize(text: string): string {
  return text.replaceAll(/\s*\((1s|limits)\)/g, "");
}

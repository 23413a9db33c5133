/** What is sent to measure a whole sheet, with names and numbers that can't be mistaken. */
import { inputsOf, notesOf, type Shape, type Sheet } from "./session";
import { MOST, type Kind, type Together } from "./together";

/** Names that are all different and none empty, as the server tells measurements by them. */
export function distinctLabels(shapes: readonly Shape[]): string[] {
  const names: string[] = [];
  for (const shape of shapes) {
    // a name with a method behind it is a check's, which the server does not count
    const wished = (shape.label.trim().slice(0, 90) || "unnamed").replace(new RegExp(`, by ${shape.method}$`), (end) => ` (${end.slice(2)})`);
    let name = wished;
    for (let n = 2; names.includes(name); n += 1) name = `${wished} (${n})`;
    names.push(name);
  }
  return names;
}

/** A measurement's number as a text that is no measurement's name: a name of digits would be taken first. */
function numberAmong(number: number, labels: readonly string[]): string {
  let text = String(number);
  while (labels.includes(text) && text.length < 5) text = `0${text}`;
  return text;
}

/**
 * The body of POST /api/measure.
 *
 * The server counts what has an answer, so what may have none must stand behind all that is named in `together`.
 */
export function requestOf(sheet: Sheet, shapes: readonly Shape[], together: readonly Together[]): Record<string, unknown> {
  const labels = distinctLabels(shapes);
  const items = shapes.map((shape, i) => ({ method: shape.method, label: labels[i], inputs: inputsOf(shape), notes: notesOf(shape) }));
  const said = (kind: Kind) =>
    together
      .filter((one) => one.kind === kind)
      .slice(0, MOST)
      .map((one) => one.of.map((id) => numberAmong(shapes.findIndex((shape) => shape.id === id) + 1, labels)).join(","));
  const [between, same] = [said("between"), said("same")];
  return { photo: sheet.photo.id, camera: sheet.camera, items, ...(between.length ? { between } : {}), ...(same.length ? { same } : {}) };
}

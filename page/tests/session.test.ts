import { describe, expect, it, vi } from "vitest";
import { Latest, type MethodRow } from "../src/lib/api";
import { Undo } from "../src/lib/undo";
import { Calculator, fromFragment, toFragment } from "../src/calculator/state.svelte";
import { constrained, inputsOf, inside, moved, nextLabel, pointFields, readProject, readSheet, turned, typedFields, wanting, type Shape } from "../src/measure/session";
import { toPicture, toScreen } from "../src/measure/viewer";

vi.mock("openseadragon", () => ({ default: { console: {} } }));

const shape: Shape = { id: "1", label: "A", method: "known_size", points: { ends: [[1, 2], [3, 4]] }, texts: { size: " 200 mm " }, sigma: "" };
const sheet = {
  photo: { id: "0".repeat(32), name: "a.jpg", width_px: 100, height_px: 50, sha256: "0".repeat(64) },
  camera: null,
  shapes: [shape],
};
const method = {
  name: "known_size",
  inputs: {
    required: ["camera", "ends", "size"],
    properties: {
      camera: { description: "", "x-noun": "Camera", "x-widget": "camera", "x-typed": true },
      ends: { description: "", "x-noun": "Observation", "x-widget": "points", "x-points": 2 },
      size: { description: "", "x-noun": "Quantity", "x-widget": "quantity", "x-unit": "m", "x-typed": true },
      focus: { description: "", "x-noun": "Quantity", "x-widget": "quantity", "x-unit": "1", "x-typed": false },
    },
  },
} as unknown as MethodRow;

describe("a method's row", () => {
  it("tells which fields take points and which are typed", () => {
    expect(pointFields(method)).toEqual([{ name: "ends", count: 2, closed: false }]);
    expect(typedFields(method).map((field) => field.name)).toEqual(["size"]);
    expect(wanting(shape, method)).toEqual([]);
    expect(wanting({ ...shape, texts: { size: " " } }, method)).toEqual(["size"]);
  });
});

describe("a shape", () => {
  it("becomes inputs, its default click said to be assumed", () => {
    const inputs = inputsOf(shape) as { ends: { sigma_px: number; source: string }; size: string };
    expect(inputs.size).toBe("200 mm");
    expect(inputs.ends).toMatchObject({ points_px: [[1, 2], [3, 4]], sigma_px: 0.7 });
    expect(inputs.ends.source).toMatch(/^assumed/);
    expect((inputsOf({ ...shape, sigma: "0,2" }).ends as { sigma_px: number }).sigma_px).toBe(0.2);
  });
  it("keeps what a detector saw until a point is moved", () => {
    const seen = { points_px: [[1, 2], [3, 4]], cov: [[1]] } as never;
    const found = { ...shape, seen: { ends: seen } };
    expect(inputsOf(found).ends).toBe(seen);
    expect(inputsOf(moved(found, "ends", 0, [9, 9])).ends).toMatchObject({ points_px: [[9, 9], [3, 4]] });
  });
  it("is never changed in place", () => {
    const before = JSON.stringify(shape);
    moved(shape, "ends", 1, [0, 0]);
    turned(shape, "ends");
    expect(JSON.stringify(shape)).toBe(before);
  });
  it("gets the next free letter", () => {
    expect(nextLabel([])).toBe("A");
    expect(nextLabel([shape])).toBe("B");
    expect(nextLabel(Array.from({ length: 26 }, (_, i) => ({ ...shape, label: String.fromCharCode(65 + i) })))).toBe("A2");
  });
});

it("points stay inside, to a hundredth", () => expect(inside([-9, 49.123456], { width_px: 100, height_px: 50 })).toEqual([-0.5, 49.12]));
it.each([
  [[10, 1], [10, 0]],
  [[1, 10], [0, 10]],
  [[10, 9], [9.5, 9.5]],
] as const)("Shift takes %o to %o", (to, wanted) => {
  const found = constrained([0, 0], to);
  expect(found[0]).toBeCloseTo(wanted[0], 9);
  expect(found[1]).toBeCloseTo(wanted[1], 9);
});
it("the screen counts from a pixel's corner, we from its centre", () => {
  const view = { scale: 8, x: 100, y: 50 };
  expect(toScreen(view, [0, 0])).toEqual([104, 54]);
  expect(toPicture(view, toScreen(view, [12.25, 7]))).toEqual([12.25, 7]);
});

describe("project files", () => {
  it("are read back", () => {
    expect(readProject(JSON.stringify({ schema: "subtense-project/1", sheets: [sheet] }))).toEqual({ schema: "subtense-project/1", sheets: [sheet] });
  });
  it.each(["", "[]", "null", "{}", '{"schema":"subtense-project/2","sheets":[]}', '{"schema":"subtense-project/1","sheets":[1]}'])("%s is refused with a sentence", (text) => expect(typeof readProject(text)).toBe("string"));
  it.each([
    { ...sheet, photo: { ...sheet.photo, sha256: "../../etc" } },
    { ...sheet, photo: { ...sheet.photo, width_px: 0 } },
    { ...sheet, camera: { name: "a" } },
    { ...sheet, shapes: [{ ...shape, points: { ends: [[1, "x"]] } }] },
    { ...sheet, shapes: [{ ...shape, texts: { size: 5 } }] },
    { ...sheet, shapes: "none" },
  ])("damage is seen: %o", (damaged) => expect(readSheet(damaged)).toBeNull());
});

describe("undo", () => {
  it("goes back and forth, and forgets what was undone when something new is done", () => {
    const history = new Undo({ n: 0 });
    const [one, two] = [{ n: 1 }, { n: 2 }];
    history.commit(one);
    history.commit(two);
    expect(history.undo()).toBe(one);
    expect(history.redo()).toBe(two);
    history.undo();
    history.commit({ n: 3 });
    expect(history.canRedo).toBe(false);
    expect(history.undo()).toBe(one);
    expect(history.undo().n).toBe(0);
    expect(history.undo().n).toBe(0);
  });
});

describe("the latest question", () => {
  it("is asked when the one under way is answered, and those between are skipped", async () => {
    const asked: number[] = [];
    const answers: number[] = [];
    const open: (() => void)[] = [];
    const latest = new Latest<number, number>(
      (n) => new Promise((resolve) => (asked.push(n), open.push(() => resolve(n * 10)))),
      (out) => answers.push(out),
      () => undefined,
    );
    for (const n of [1, 2, 3, 4]) latest.ask(n);
    expect(asked).toEqual([1]);
    open.shift()!();
    await new Promise((resolve) => setTimeout(resolve));
    expect(asked).toEqual([1, 4]);
    open.shift()!();
    await new Promise((resolve) => setTimeout(resolve));
    expect(answers).toEqual([10, 40]);
  });
});

describe("a link", () => {
  it("restores the calculator", () => {
    const calculator = new Calculator();
    calculator.fill({ focal: "35 mm", sensor_width: "14.1 ± 0.1 mm (limits)", image_width: "4096", size: "5 m", extent: "120", along: "height", tilt: "0 ± 20 deg (limits)" });
    expect(calculator.unknown).toBe("distance");
    const again = new Calculator();
    again.fill(fromFragment(toFragment(calculator.texts))!);
    expect(again.texts).toEqual(calculator.texts);
  });
  it("takes nothing it does not know, and nothing long", () => {
    expect(fromFragment("#evil=1&focal=35")).toEqual({ focal: "35" });
    expect(fromFragment(`#focal=${"9".repeat(300)}`)).toBeNull();
    expect(fromFragment("")).toBeNull();
  });
});

import { describe, expect, it, vi } from "vitest";
import { Latest, type Detection, type MethodRow } from "../src/lib/api";
import { Undo } from "../src/lib/undo";
import { Calculator, fromFragment, toFragment } from "../src/calculator/state.svelte";
import { constrained, inputsOf, inside, isTool, moved, nextLabel, notesOf, pointFields, readProject, readSheet, sameFound, shapeOf, snappedTo, turned, typedFields, unsnapped, wanting, type Shape } from "../src/measure/session";
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
    expect(pointFields(method)).toEqual([{ name: "ends", count: 2, least: 2, closed: false, round: false }]);
    expect(typedFields(method).map((field) => field.name)).toEqual(["size"]);
    expect(wanting(shape, method)).toEqual([]);
    expect(wanting({ ...shape, texts: { size: " " } }, method)).toEqual(["size"]);
    for (const half of ["rectangle  x 297 mm", "rectangle 210 ± 1 mm x "]) expect(wanting({ ...shape, texts: { size: half } }, method)).toEqual(["size"]);
    expect(wanting({ ...shape, texts: { size: "rectangle 210 mm x 297 mm" } }, method)).toEqual([]);
  });
  it("may take any number of points, and ask for some that can be left out", () => {
    const rim = { description: "", "x-noun": "Observation", "x-widget": "points", "x-closed": true } as const;
    const disc = { ...method, inputs: { required: ["rim"], properties: { rim, horizon: rim } } };
    expect(pointFields(disc)).toEqual([{ name: "rim", count: Infinity, least: 5, closed: true, round: true }]);
    const ball = { ...disc, inputs: { ...disc.inputs, properties: { rim: { ...rim, "x-least": 3 } } } };
    expect(pointFields(ball)[0]).toMatchObject({ count: Infinity, least: 3 });
  });
  it("takes more points than it must in its last field alone", () => {
    const [four, three] = [4, 3].map((n) => ({ description: "", "x-noun": "Observation", "x-widget": "points", "x-points": n, "x-more": true, "x-closed": true }) as const);
    const area = { ...method, inputs: { required: ["points", "path"], properties: { points: four!, path: three! } } };
    expect(pointFields(area).map(({ count, least, round }) => [count, least, round])).toEqual([[4, 4, false], [Infinity, 3, false]]);
    expect(isTool(area)).toBe(true);
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
  it("that was found is measured by what the detector says, whose doubts go along", () => {
    const assumed = { code: "assumed_size", text: "taken to be a cup", cure: "" };
    const turnedHead = { code: "head_turned", text: "turned", cure: "" };
    const cup: Detection = {
      points_px: [[1, 2], [3, 40]], sigma_px: 1, cov: null, label: "cup", score: 1, source: "boxes", detector: "objects", shape: "length", target: "cup",
      others: ["glass"], tilt: { value: 0 }, notes: [assumed, turnedHead], method: "known_size", points_field: "ends", size_field: "size", size_prefix: "",
      size_text: "93 ± 14 mm (1s)", size: { value: 0.093, u: 0.014, unit: "m", source: "assumed: spread of cups" },
    };
    const found = { ...shapeOf(cup, ""), id: "2", label: "cup" };
    expect(inputsOf(found)).toEqual({ ends: { points_px: cup.points_px, sigma_px: 1, cov: null, label: "cup", score: 1, source: "boxes" }, size: cup.size, tilt: { value: 0 } });
    expect(notesOf(found)).toEqual([assumed, turnedHead]);
    expect(notesOf({ ...found, texts: { size: "95 mm" } })).toEqual([turnedHead]); // a person said it
    expect(inputsOf({ ...found, texts: { size: "95 mm" } }).size).toBe("95 mm");
    expect(shapeOf({ ...cup, size_text: null, size_prefix: "square " }, " 50 mm ").texts).toEqual({ size: "square 50 mm" });
    expect(shapeOf({ ...cup, size_text: null }, " ").texts).toEqual({});
    const dragged = moved(found, "ends", 0, [1, 2.1]);
    expect(dragged.seen).toBeUndefined();
    expect(notesOf(dragged)).toEqual([assumed, turnedHead]);
    expect(sameFound(found, dragged)).toBe(true);
    expect(sameFound(found, moved(found, "ends", 0, [9, 9]))).toBe(false);
    expect(sameFound(shape, found)).toBe(false);
    const stored = readSheet(JSON.parse(JSON.stringify({ ...sheet, shapes: [found] })))!;
    expect(stored.shapes[0]).toEqual(found);
    const bad = readSheet({ ...sheet, shapes: [{ ...found, found: { ...found.found, notes: "none" } }] })!;
    expect(bad.shapes[0]!.found).toBeUndefined();
  });
  it("goes to the edges near it and back", () => {
    const seen = { points_px: [[1.2, 2.2], [3, 4]], sigma_px: 1, cov: null, label: "", score: 1, source: "edges" } as never;
    const note = { code: "snapped", text: "moved", cure: "" };
    const there = snappedTo(shape, "ends", seen, [note]);
    expect(inputsOf(there).ends).toBe(seen);
    expect(notesOf(there)).toEqual([note]);
    expect(unsnapped(there)).toEqual(shape);
    expect(notesOf(moved(there, "ends", 0, [5, 5]))).toEqual([]);
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

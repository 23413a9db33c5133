import { describe, expect, it } from "vitest";
import { requestOf } from "../src/measure/request";
import { readSheet, type Shape, type Sheet } from "../src/measure/session";
import { combinations, membersOf, middleOf, nameOf, withoutShape, withTogether, type Together } from "../src/measure/together";

const shape = (id: string, label: string): Shape => ({ id, label, method: "known_size", points: { ends: [[0, 0], [4, 2]] }, texts: { size: "1 m" }, sigma: "" });
const between: Together = { id: "t", kind: "between", of: ["a", "b"] };
const same: Together = { id: "s", kind: "same", of: ["a", "b", "c"] };
const shapes = [shape("a", "near"), shape("b", "far"), shape("c", "2")];
const sheet: Sheet = { photo: { id: "0".repeat(32), name: "a.jpg", width_px: 9, height_px: 9, sha256: "0".repeat(64) }, camera: null, shapes, together: [between, same] };

describe("what measurements say together", () => {
  it("is named as reports name it, between the middles of what is drawn", () => {
    expect(nameOf(between, sheet)).toBe("near to far");
    expect(nameOf(same, sheet)).toBe("near and far and 2");
    expect(middleOf({ ...shapes[0]!, points: { reference: [[9, 9]], ends: [[0, 0], [4, 2]] } })).toEqual([2, 1]);
  });
  it("goes with the measurements it is made of", () => {
    const left = withoutShape(sheet, "b");
    expect(left.together).toEqual([{ ...same, of: ["a", "c"] }]);
    expect(withoutShape(left, "c").together).toBeUndefined();
    expect(membersOf(between, left).length).toBe(1);
  });
  it("stands once", () => {
    expect(withTogether(sheet, [between, { ...between, id: "u", of: ["b", "a"] }]).together).toEqual([between]);
    expect(combinations("between", ["a", "b", "c"]).map((one) => one.of.join())).toEqual(["a,b", "a,c", "b,c"]);
    expect(combinations("same", ["a", "b", "c"])).toHaveLength(1);
    expect(combinations("same", ["a"])).toEqual([]);
  });
  it("is read back, and only what is damaged is lost", () => {
    expect(readSheet(JSON.parse(JSON.stringify(sheet)))!.together).toEqual([between, same]);
    const bad = [null, 7, { ...between, of: ["a"] }, { ...between, of: ["a", "a"] }, { ...between, of: ["a", "x"] }, { ...between, id: "a" }, { ...between, kind: "x" }, { ...between, of: ["a", "b", "c"] }];
    expect(readSheet({ ...sheet, together: [...bad, between, { ...same, id: "t" }] })!.together).toEqual([between]);
    expect(readSheet({ ...sheet, together: "none" })!.together).toBeUndefined();
  });
});

describe("the request", () => {
  const asked = (labels: string[], together: Together[]) => requestOf(sheet, labels.map((label, i) => shape("abc"[i]!, label)), together) as { items: { label: string }[]; between?: string[]; same?: string[] };
  it("names each measurement once, by a number that is no name", () => {
    expect(asked(["x", "x", ""], [between, same])).toMatchObject({ between: ["1,2"], same: ["1,2,3"] });
    expect(asked(["x", "x", ""], []).items.map((item) => item.label)).toEqual(["x", "x (2)", "unnamed"]);
    expect(asked(["2", "1", "01"], [between])).toMatchObject({ between: ["001,02"] }); // 1 and 2 would be the names of the others
    expect(asked(["x", "y", "z"], [])).not.toHaveProperty("between");
  });
});

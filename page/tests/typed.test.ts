import { describe, expect, it } from "vitest";
import { compose, converted, halfTyped, parse, typed } from "../src/lib/typed";

describe("compose", () => {
  it.each([
    [{ value: "35", unit: "mm" }, "35 mm"],
    [{ value: " 35,5 ", unit: "mm" }, "35.5 mm"],
    [{ value: "200", unit: "mm", doubt: "0.5" }, "200 ± 0.5 mm"],
    [{ value: "200", unit: "mm", doubt: "2", doubtUnit: "%" }, "200 mm ± 2 %"],
    [{ value: "150", unit: "px", doubt: "1", meaning: "1s" as const }, "150 ± 1 px (1s)"],
    [{ value: "0", unit: "deg", doubt: "20", meaning: "limits" as const }, "0 ± 20 deg (limits)"],
    [{ value: "35", unit: "mm", exact: true, doubt: "3" }, "35 mm exact"],
    [{ value: "", unit: "mm", doubt: "3" }, ""],
    [{ value: "1", unit: "1", doubt: "0.1" }, "1 ± 0.1"],
  ])("%o is %s", (field, text) => {
    expect(compose({ ...typed(), doubtUnit: field.unit, ...field })).toBe(text);
  });
});

describe("parse", () => {
  it.each(["35 mm", "200 ± 0.5 mm", "200 mm ± 2 %", "150 ± 1 px (1s)", "0 ± 20 deg (limits)", "35 mm exact", "1.5 m", "6.17 ± 0.1 mm (1s)"])("reads back %s", (text) => {
    const read = parse(text, "mm");
    expect(read).not.toBeNull();
    expect(compose(read!)).toBe(text);
  });
  it("takes the field's unit for a bare number", () => {
    expect(parse("4096", "px")).toMatchObject({ value: "4096", unit: "px", doubt: "" });
  });
  it.each(["", "6 ft 2 in", "abc", "1 ± 2 ± 3 mm", "± 3"])("leaves %s to the server", (text) => {
    expect(parse(text, "mm")).toBeNull();
  });
});

describe("converted", () => {
  it("keeps the value between metric units", () => {
    expect(converted("14.1", "mm", "cm")).toBe("1.41");
    expect(converted("2", "m", "mm")).toBe("2000");
  });
  it("claims no more digits than were typed, but one, in inches", () => {
    expect(converted("14.1", "mm", "in")).toBe("0.5551");
    expect(converted("1", "in", "mm")).toBe("25.4");
  });
  it("leaves what is no number, and other units", () => {
    expect(converted("abc", "mm", "m")).toBe("abc");
    expect(converted("5", "px", "m")).toBe("5");
  });
});

it.each(["200 ±", "200 ± ", "-", "0.", "3.", "1e", "5 ± 1 (", "0", "0 mm", "0.0"])("%s is half typed", (text) => expect(halfTyped(text)).toBe(true));
it.each(["200", "200 ± 1 mm", "0.5", "10", "1e3", "5 mm (1s)", "two apples", "", "0 ± 20 deg (limits)"])("%s is not", (text) => expect(halfTyped(text)).toBe(false));

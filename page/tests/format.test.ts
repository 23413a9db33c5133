import { describe, expect, it } from "vitest";
import { digitsFor, fitting, grouped, interval, percent, plain, shown, withUnit } from "../src/lib/format";

const thin = (text: string) => text.replaceAll(" ", "\u202f");

it.each([
  [0.26, 2],
  [0.026, 3],
  [2.6, 1],
  [26, 0],
  [260, -1],
  [0.1, 2],
  [1, 1],
])("u %d leaves %d decimals", (u, digits) => expect(digitsFor(u)).toBe(digits));

it.each([
  [13556.501, 2, "13 556.50"],
  [1234567, 0, "1 234 567"],
  [13556.5, -1, "13 560"],
  [-0.04, 1, "0.0"],
  [-12.34, 1, "−12.3"],
  [999.999, 2, "1 000.00"],
])("%d with %d decimals is %s", (value, decimals, text) => expect(grouped(value, decimals)).toBe(thin(text)));

it("plain keeps seven digits and no zeros behind", () => {
  expect(plain(14.1)).toBe("14.1");
  expect(plain(10167.3758)).toBe(thin("10 167.38"));
  expect(plain(0)).toBe("0");
});

it.each([
  [13.5, "metric", "m"],
  [0.2, "metric", "mm"],
  [5e-4, "metric", "µm"],
  [2e4, "metric", "km"],
  [13.5, "imperial", "ft"],
  [0.2, "imperial", "in"],
] as const)("%d m in %s is in %s", (value, system, name) => expect(fitting(value, "m", system).name).toBe(name));

describe("shown", () => {
  const m = { value: 13.556501, u: 0.2595, low: 13.0687, high: 14.0858, unit: "m" };
  it("rounds to two digits of u", () => {
    const s = shown(m);
    expect([s.value, s.unit, s.low, s.high, s.u]).toEqual(["13.56", "m", "13.07", "14.09", "0.26"]);
    expect(interval(s)).toBe("13.07 to 14.09\u00a0m");
  });
  it("opens an interval as the numbers say", () => {
    expect(interval(shown({ ...m, u: null, high: null }))).toMatch(/^from .*far limit open$/);
    expect(interval(shown({ ...m, u: null, low: null }))).toMatch(/^up to .*near limit open$/);
    expect(interval(shown({ ...m, u: null, low: null, high: null }))).toBe("open on both sides");
  });
  it("says exact", () => expect(interval(shown({ ...m, u: 0 }))).toBe("exact"));
  it("gives angles in degrees without a space", () => {
    const s = shown({ value: 0.397, u: 0.007, low: 0.384, high: 0.411, unit: "rad" });
    expect(withUnit(s.value, s.unit)).toBe("22.75°");
  });
});

it("shares", () => expect([percent(0.8), percent(0.001), percent(1)]).toEqual(["80\u00a0%", "<1\u00a0%", "100\u00a0%"]));

import { describe, expect, it } from "vitest";
import { along, drawing } from "../src/calculator/geometry";
import { place } from "../src/measure/place";

const belt = { focal_m: 0.035, sensor_m: 0.0141, size_m: 0.2, distance_m: 13.5565 };

describe("drawing", () => {
  it("is to scale on each side, with one angle on both", () => {
    const d = drawing(belt, 500, 150)!;
    const object = d.objectX - d.lensX;
    const camera = d.lensX - d.sensorX;
    expect(d.objectHalf / object).toBeCloseTo(0.1 / 13.5565, 10);
    expect(d.imageHalf / camera).toBeCloseTo(d.objectHalf / object, 10);
    expect(d.sensorHalf / camera).toBeCloseTo(d.viewHalf / object, 10);
    expect(object * d.objectScale).toBeCloseTo(13.5565, 9);
  });
  it.each([
    [belt, "narrow"],
    [{ ...belt, sensor_m: 0.4 }, "wide"],
    [{ ...belt, size_m: 30 }, "large"],
  ])("fits into its room: %o %s", (given) => {
    const d = drawing(given, 500, 150)!;
    expect(d.sensorX).toBeGreaterThanOrEqual(-1e-9);
    expect(d.objectX).toBeLessThanOrEqual(500 + 1e-9);
    for (const half of [d.viewHalf, d.sensorHalf, d.objectHalf, d.imageHalf]) expect(half).toBeLessThanOrEqual(75 + 1e-9);
  });
  it.each([0, -1, NaN, Infinity])("is none for %d", (bad) => expect(drawing({ ...belt, size_m: bad }, 500, 150)).toBeNull());
});

it("along a straight line in logarithms", () => {
  const xs = [1, 10, 100];
  const ys = xs.map((x) => 300 / x);
  for (const x of [1, 3, 20, 100, 400, 0.5]) expect(along(xs, ys, x)).toBeCloseTo(300 / x, 9);
});

describe("place", () => {
  const stage = { width: 800, height: 600 };
  it("stands below where there is room", () => {
    expect(place([[300, 200], [500, 220]], 100, 40, stage, [])).toMatchObject({ x: 350, y: 234 });
  });
  it("stays inside at every edge", () => {
    for (const p of [[0, 0], [800, 600], [0, 600], [800, 0], [-50, -50]] as const) {
      const box = place([p, p], 120, 50, stage, []);
      expect(box.x).toBeGreaterThanOrEqual(0);
      expect(box.y).toBeGreaterThanOrEqual(0);
      expect(box.x + box.width).toBeLessThanOrEqual(800);
      expect(box.y + box.height).toBeLessThanOrEqual(600);
    }
  });
  it("goes elsewhere where a caption stands", () => {
    const first = place([[300, 200], [500, 220]], 100, 40, stage, []);
    const second = place([[300, 200], [500, 220]], 100, 40, stage, [first]);
    expect(second.y).not.toBe(first.y);
  });
});

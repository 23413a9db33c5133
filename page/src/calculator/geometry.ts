/** The pinhole's two similar triangles, each side of the lens to its own scale, in the units of a drawing. */

export interface Given {
  focal_m: number;
  sensor_m: number;
  size_m: number;
  distance_m: number;
}

export interface Drawing {
  /** x of sensor, lens and object plane; y of the axis. */
  sensorX: number;
  lensX: number;
  objectX: number;
  axisY: number;
  /** Half heights of the field of view at the object plane and of the sensor, and of the object and its image. */
  viewHalf: number;
  sensorHalf: number;
  objectHalf: number;
  imageHalf: number;
  /** How much larger than in the drawing things are: object side; and how much smaller: camera side. */
  objectScale: number;
  cameraScale: number;
}

/**
 * @param width of the drawing, px; @param height of the drawing, px.
 * @returns null where a triangle can't be drawn: a number is missing or not positive.
 */
export function drawing(given: Given, width: number, height: number): Drawing | null {
  const { focal_m, sensor_m, size_m, distance_m } = given;
  if (![focal_m, sensor_m, size_m, distance_m].every((x) => Number.isFinite(x) && x > 0)) return null;
  const half = height / 2;
  const cameraRoom = width * 0.27;
  const objectRoom = width * 0.73;
  const view_m = (sensor_m / focal_m) * distance_m;
  const widest_m = Math.max(view_m, size_m);
  const perMetre = Math.min(objectRoom / distance_m, (2 * half) / widest_m);
  const perCameraMetre = Math.min(cameraRoom / focal_m, (2 * half) / Math.max(sensor_m, (focal_m * size_m) / distance_m));
  const objectLength = distance_m * perMetre;
  const cameraLength = focal_m * perCameraMetre;
  const left = (width - objectLength - cameraLength) / 2;
  return {
    sensorX: left,
    lensX: left + cameraLength,
    objectX: left + cameraLength + objectLength,
    axisY: half,
    viewHalf: (view_m * perMetre) / 2,
    sensorHalf: (sensor_m * perCameraMetre) / 2,
    objectHalf: (size_m * perMetre) / 2,
    imageHalf: (((focal_m * size_m) / distance_m) * perCameraMetre) / 2,
    objectScale: 1 / perMetre,
    cameraScale: 1 / perCameraMetre,
  };
}

/** y at x on a curve through points, straight between them on logarithmic axes, and beyond its ends. */
export function along(xs: readonly number[], ys: readonly number[], x: number): number {
  if (xs.length < 2) return ys[0] ?? NaN;
  let i = xs.findIndex((one) => one >= x);
  if (i < 0) i = xs.length - 1;
  i = Math.max(i, 1);
  const [x0, x1, y0, y1] = [xs[i - 1]!, xs[i]!, ys[i - 1]!, ys[i]!].map(Math.log) as [number, number, number, number];
  return Math.exp(y0 + ((Math.log(x) - x0) / (x1 - x0)) * (y1 - y0));
}

/** Where a caption goes: beside its shape, on the side with room, inside the stage and off captions already there. */

export interface Box {
  x: number;
  y: number;
  width: number;
  height: number;
}

export function place(points: readonly (readonly [number, number])[], width: number, height: number, stage: { width: number; height: number }, taken: readonly Box[], gap = 14): Box {
  const xs = points.map((p) => p[0]);
  const ys = points.map((p) => p[1]);
  const [left, right, top, bottom] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
  const [cx, cy] = [(left + right) / 2, (top + bottom) / 2];
  const spots = [
    [cx - width / 2, bottom + gap],
    [cx - width / 2, top - gap - height],
    [right + gap, cy - height / 2],
    [left - gap - width, cy - height / 2],
    [right + gap / 2, bottom + gap / 2],
    [left - gap / 2 - width, bottom + gap / 2],
    [right + gap / 2, top - gap / 2 - height],
    [left - gap / 2 - width, top - gap / 2 - height],
  ] as const;
  const cost = ([x, y]: readonly [number, number]) => {
    const outside = Math.max(-x, 0) + Math.max(-y, 0) + Math.max(x + width - stage.width, 0) + Math.max(y + height - stage.height, 0);
    const over = taken.reduce((sum, b) => sum + Math.max(Math.min(x + width, b.x + b.width) - Math.max(x, b.x), 0) * Math.max(Math.min(y + height, b.y + b.height) - Math.max(y, b.y), 0), 0);
    return outside + over;
  };
  let best = spots[0] as readonly [number, number];
  for (const spot of spots) if (cost(spot) < cost(best)) best = spot;
  const clamp = (x: number, most: number) => Math.min(Math.max(x, 4), Math.max(most - 4, 4));
  return { x: clamp(best[0], stage.width - width), y: clamp(best[1], stage.height - height), width, height };
}

/** The exact pixels around a point, from lossless tiles, for a magnifier without smoothing. */
import type { Photo } from "../lib/api";
import type { Point } from "./session";

export class Pixels {
  private tiles = new Map<string, ImageBitmap | null>();

  constructor(
    private readonly photo: Photo,
    private readonly arrived: () => void,
  ) {}

  private tile(column: number, row: number): ImageBitmap | null {
    const key = `${column}_${row}`;
    const known = this.tiles.get(key);
    if (known !== undefined) return known;
    this.tiles.set(key, null);
    void this.load(key);
    return null;
  }

  private async load(key: string): Promise<void> {
    try {
      const response = await fetch(`/api/photos/${this.photo.id}/tiles/${this.photo.levels - 1}/${key}.png`);
      if (!response.ok) throw new Error(String(response.status));
      this.tiles.set(key, await createImageBitmap(await response.blob()));
      if (this.tiles.size > 64) this.tiles.delete(this.tiles.keys().next().value!);
      this.arrived();
    } catch {
      this.tiles.delete(key); // asked again with the next movement
    }
  }

  /** Draw the picture around a point (pixel centres at whole numbers) into a square canvas. */
  draw(context: CanvasRenderingContext2D, at: Point, size: number, zoom: number): void {
    const side = this.photo.tile_px;
    const half = size / zoom / 2;
    const left = at[0] + 0.5 - half;
    const top = at[1] + 0.5 - half;
    context.imageSmoothingEnabled = false;
    context.fillStyle = "#333";
    context.fillRect(0, 0, size, size);
    const last = { x: Math.ceil(this.photo.width_px / side) - 1, y: Math.ceil(this.photo.height_px / side) - 1 };
    for (let row = Math.max(Math.floor(top / side), 0); row <= Math.min(Math.floor((top + 2 * half) / side), last.y); row += 1) {
      for (let column = Math.max(Math.floor(left / side), 0); column <= Math.min(Math.floor((left + 2 * half) / side), last.x); column += 1) {
        const bitmap = this.tile(column, row);
        if (bitmap) context.drawImage(bitmap, (column * side - left) * zoom, (row * side - top) * zoom, bitmap.width * zoom, bitmap.height * zoom);
      }
    }
  }
}

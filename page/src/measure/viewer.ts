/** The deep-zoom viewer: tiles of the server, and where the picture stands on the screen. */
import OpenSeadragon from "openseadragon";
import type { Photo } from "../lib/api";
import type { Point } from "./session";

/** screen = (picture + 0.5) * scale + offset: the viewer counts from the corner of a pixel, we from its centre. */
export interface View {
  scale: number;
  x: number;
  y: number;
}

export function toScreen(view: View, [x, y]: Point): Point {
  return [(x + 0.5) * view.scale + view.x, (y + 0.5) * view.scale + view.y];
}

export function toPicture(view: View, [x, y]: Point): Point {
  return [(x - view.x) / view.scale - 0.5, (y - view.y) / view.scale - 0.5];
}

export function tileSource(photo: Photo): OpenSeadragon.TileSourceOptions {
  return {
    width: photo.width_px,
    height: photo.height_px,
    tileSize: photo.tile_px,
    tileOverlap: 0,
    minLevel: 0,
    maxLevel: photo.levels - 1,
    getTileUrl: (level: number, x: number, y: number) => `/api/photos/${photo.id}/tiles/${level}/${x}_${y}.jpg`,
  } as OpenSeadragon.TileSourceOptions;
}

/**
 * The viewer would add a style sheet of its own, which the content security policy forbids. It looks for an element named
 * `style` first; one of another namespace is no sheet, and is found. Its rule stands in page.css.
 */
function standInForItsSheet(): void {
  const mark = "data-openseadragon-mobile-css";
  if (document.querySelector(`style[${mark}]`)) return;
  const mock = document.createElementNS("urn:subtense", "style");
  mock.setAttribute(mark, "true");
  document.head.append(mock);
}

// it tells the console about tiles of a picture that was left meanwhile, which is nothing to worry about
(OpenSeadragon as unknown as { console: Record<string, unknown> }).console.warn = () => undefined;

export function viewer(element: HTMLElement): OpenSeadragon.Viewer {
  standInForItsSheet();
  const gestures = { clickToZoom: false, dblClickToZoom: false, flickEnabled: false, pinchRotate: false };
  const made = OpenSeadragon({
    element,
    drawer: "canvas",
    showNavigationControl: false,
    showNavigator: false,
    animationTime: 0.18,
    springStiffness: 9,
    blendTime: 0,
    zoomPerScroll: 1.25,
    maxZoomPixelRatio: 64,
    minZoomImageRatio: 0.5,
    visibilityRatio: 0.4,
    gestureSettingsMouse: gestures,
    gestureSettingsTouch: gestures,
    gestureSettingsPen: gestures,
    imageLoaderLimit: 6,
    maxImageCacheCount: 400,
  } as unknown as OpenSeadragon.Options);
  // its own keys would take ours
  const { innerTracker } = made as unknown as { innerTracker: Record<string, unknown> };
  innerTracker.keyHandler = null;
  innerTracker.keyDownHandler = null;
  return made;
}

/** Where the picture stands at this moment of an animation. */
export function viewOf(made: OpenSeadragon.Viewer): View | null {
  const item = made.world.getItemAt(0);
  if (!item) return null;
  const zero = made.viewport.pixelFromPoint(item.imageToViewportCoordinates(0, 0), true);
  const far = made.viewport.pixelFromPoint(item.imageToViewportCoordinates(1000, 0), true);
  return { scale: (far.x - zero.x) / 1000, x: zero.x, y: zero.y };
}

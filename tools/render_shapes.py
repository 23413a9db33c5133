"""Mitsuba building blocks: panels, boxes, lofted bodies, tubes, lights, the camera."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
from render_lens import Camera, Pinhole
from scipy.interpolate import CubicSpline

mi.set_variant("scalar_rgb")
Transform = mi.ScalarTransform4f


class Scene:
    """Collects shapes and lights under automatic names."""

    def __init__(self, max_depth: int = 4) -> None:
        """Empty scene for path tracing up to ``max_depth`` segments."""
        self.items: dict = {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": max_depth, "hide_emitters": False},
        }

    def add(self, item) -> None:
        """Add a Mitsuba object or dictionary."""
        self.items[f"item_{len(self.items)}"] = item

    def load(self, camera: Camera, pinhole: Pinhole, samples: int, seed: int):
        """The Mitsuba scene with its sensor."""
        return mi.load_dict({**self.items, "sensor": sensor(camera, pinhole, samples, seed)})


def sensor(camera: Camera, pinhole: Pinhole, samples: int, seed: int) -> dict:
    """Centred pinhole sensor; Mitsuba's camera axes are x left, y up, z forward."""
    matrix = np.eye(4)
    right, down, forward = camera.rotation
    matrix[:3, :4] = np.stack([-right, -down, forward, camera.centre], axis=1)
    return {
        "type": "perspective",
        "fov": pinhole.fov_x_deg,
        "fov_axis": "x",
        "near_clip": 0.01,
        "far_clip": 1000.0,
        "to_world": Transform(matrix),
        "sampler": {"type": "multijitter", "sample_count": samples, "seed": seed},
        "film": {
            "type": "hdrfilm",
            "width": pinhole.width,
            "height": pinhole.height,
            "rfilter": {"type": "box"},
            "pixel_format": "rgb",
            "component_format": "float32",
        },
    }


def colour(value) -> dict:
    """An RGB reflectance or radiance."""
    return {"type": "rgb", "value": [float(v) for v in np.broadcast_to(value, 3)]}


def image(picture: np.ndarray, repeat: tuple[float, float] | None = None) -> dict:
    """Bitmap texture of linear reflectance, optionally repeated (u, v) times."""
    # Mitsuba puts the first row at v = 0, the lower side; pictures start at the upper side.
    data = mi.Bitmap(np.ascontiguousarray(picture[::-1], np.float32))
    out = {"type": "bitmap", "bitmap": data, "raw": True, "wrap_mode": "clamp"}
    if repeat:
        out["wrap_mode"] = "repeat"
        out["to_uv"] = Transform().scale([repeat[0], repeat[1], 1])
    return out


def matte(value) -> dict:
    """Two-sided diffuse material from a colour or a texture dictionary."""
    reflectance = value if isinstance(value, dict) else colour(value)
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": reflectance}}


def glossy(value, alpha: float = 0.12) -> dict:
    """Two-sided lacquer over a diffuse base."""
    reflectance = value if isinstance(value, dict) else colour(value)
    inner = {"type": "roughplastic", "diffuse_reflectance": reflectance, "alpha": alpha}
    return {"type": "twosided", "bsdf": inner}


def glass_front(value) -> dict:
    """Smooth dark pane that mirrors the sky."""
    reflectance = value if isinstance(value, dict) else colour(value)
    return {"type": "twosided", "bsdf": {"type": "plastic", "diffuse_reflectance": reflectance}}


def panel(top_left, top_right, bottom_left, material) -> dict:
    """Rectangle whose texture's top-left corner lies at ``top_left``."""
    tl, tr, bl = (np.asarray(p, float) for p in (top_left, top_right, bottom_left))
    ex, ey = (tr - tl) / 2, (tl - bl) / 2
    normal = np.cross(ex, ey)
    matrix = np.eye(4)
    matrix[:3, :4] = np.stack([ex, ey, normal / np.linalg.norm(normal), tl + ex - ey], axis=1)
    return {"type": "rectangle", "to_world": Transform(matrix), "bsdf": material}


def flat(centre, width: float, depth: float, yaw_deg: float, material) -> tuple[dict, np.ndarray]:
    """Horizontal rectangle facing up and its corners (tl, tr, br, bl seen from above)."""
    a = np.radians(yaw_deg)
    ex = np.array([np.cos(a), np.sin(a), 0]) * width / 2
    ey = np.array([-np.sin(a), np.cos(a), 0]) * depth / 2
    c = np.asarray(centre, float)
    corners = np.array([c - ex + ey, c + ex + ey, c + ex - ey, c - ex - ey])
    return panel(corners[0], corners[1], corners[3], material), corners


def box(low, high, materials: dict, default) -> list[dict]:
    """Axis-aligned box; ``materials`` may name front (-y), back, left, right, top."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    faces = {
        "front": ((x0, y0, z1), (x1, y0, z1), (x0, y0, z0)),
        "back": ((x1, y1, z1), (x0, y1, z1), (x1, y1, z0)),
        "left": ((x0, y1, z1), (x0, y0, z1), (x0, y1, z0)),
        "right": ((x1, y0, z1), (x1, y1, z1), (x1, y0, z0)),
        "top": ((x0, y1, z1), (x1, y1, z1), (x0, y0, z1)),
    }
    return [panel(*face, materials.get(name, default)) for name, face in faces.items()]


def mesh(vertices: np.ndarray, faces: np.ndarray, material, smooth: bool, uv=None):
    """Triangle mesh; smooth meshes get area-weighted vertex normals."""
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(material)
    out = mi.Mesh(
        "mesh",
        vertex_count=len(vertices),
        face_count=len(faces),
        has_vertex_normals=smooth,
        has_vertex_texcoords=uv is not None,
        props=properties,
    )
    params = mi.traverse(out)
    params["vertex_positions"] = np.asarray(vertices, np.float32).ravel()
    params["faces"] = np.asarray(faces, np.uint32).ravel()
    if smooth:
        params["vertex_normals"] = vertex_normals(vertices, faces).astype(np.float32).ravel()
    if uv is not None:
        params["vertex_texcoords"] = np.asarray(uv, np.float32).ravel()
    params.update()
    return out


def vertex_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Area-weighted normals."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    cross = np.cross(b - a, c - a)
    normals = np.zeros_like(vertices)
    for i in range(3):
        np.add.at(normals, faces[:, i], cross)
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)


def ring_mesh(rings: np.ndarray, material, smooth: bool = True):
    """Skin over closed rings of equal length (M, N, 3), with capped ends."""
    m, n = rings.shape[:2]
    vertices = np.concatenate([rings.reshape(-1, 3), rings[[0, -1]].mean(axis=1)])
    i, j = (k.ravel() for k in np.mgrid[: m - 1, :n])
    a, b, c, d = i * n + j, i * n + (j + 1) % n, (i + 1) * n + (j + 1) % n, (i + 1) * n + j
    k = np.arange(n)
    last = (m - 1) * n
    faces = [np.stack([a, b, c], 1), np.stack([a, c, d], 1)]
    faces.append(np.stack([(k + 1) % n, k, np.full(n, m * n)], 1))
    faces.append(np.stack([last + k, last + (k + 1) % n, np.full(n, m * n + 1)], 1))
    if not smooth:
        flat_vertices = vertices[np.concatenate(faces).ravel()]
        return mesh(flat_vertices, np.arange(len(flat_vertices)).reshape(-1, 3), material, False)
    return mesh(vertices, np.concatenate(faces), material, True)


def loft(sections, material, count: int = 60, segments: int = 48):
    """Body through horizontal ellipses (z, cx, cy, rx, ry), splined upwards."""
    table = np.asarray(sections, float)
    t = np.linspace(0, len(table) - 1, count)
    z, cx, cy, rx, ry = CubicSpline(np.arange(len(table)), table)(t).T
    angle = np.arange(segments) * 2 * np.pi / segments
    rx, ry = np.maximum(rx, 1e-4), np.maximum(ry, 1e-4)
    x = cx[:, None] + rx[:, None] * np.cos(angle)
    y = cy[:, None] + ry[:, None] * np.sin(angle)
    return ring_mesh(np.stack([x, y, np.repeat(z[:, None], segments, 1)], -1), material)


def ellipsoid(centre, radii, material, count: int = 48):
    """Axis-aligned ellipsoid."""
    phi = np.linspace(-np.pi / 2 + 1e-3, np.pi / 2 - 1e-3, count)[:, None]
    angle = np.arange(64) * 2 * np.pi / 64
    unit = [np.cos(phi) * np.cos(angle), np.cos(phi) * np.sin(angle), np.sin(phi) + 0 * angle]
    return ring_mesh(np.asarray(centre) + np.stack(unit, -1) * np.asarray(radii), material)


def tube(path, radii, material, count: int = 40, segments: int = 24, smooth: bool = True):
    """Round tube along a splined path, with rounded ends."""
    path, radii = np.asarray(path, float), np.asarray(radii, float)
    t = np.linspace(0, len(path) - 1, count)
    knots = np.arange(len(path))
    spline = CubicSpline(knots, path)
    centre, tangent = spline(t), spline(t, 1)
    radius = np.interp(t, knots, radii)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    cap = np.sin(np.linspace(0, np.pi / 2, 8))[::-1][:-1]
    head = centre[0] - tangent[0] * radius[0] * cap[:, None]
    tail = centre[-1] + tangent[-1] * radius[-1] * cap[::-1, None]
    centre = np.concatenate([head, centre, tail])
    tangent = np.concatenate([tangent[[0] * 7], tangent, tangent[[-1] * 7]])
    round_off = np.sqrt(np.maximum(1 - cap**2, 1e-6))
    radius = np.concatenate([radius[0] * round_off, radius, radius[-1] * round_off[::-1]])
    side = np.cross(tangent, perpendicular(tangent.mean(axis=0)))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    other = np.cross(tangent, side)
    angle = (np.arange(segments) * 2 * np.pi / segments)[None, :, None]
    ring = np.cos(angle) * side[:, None] + np.sin(angle) * other[:, None]
    return ring_mesh(centre[:, None] + ring * radius[:, None, None], material, smooth)


def perpendicular(axis: np.ndarray) -> np.ndarray:
    """A unit vector roughly perpendicular to an axis."""
    return np.eye(3)[np.argmin(np.abs(axis))]


def lathe(centre, profile, material, segments: int = 96, smooth: bool = True):
    """Body of revolution about z from (radius, height) pairs."""
    table = np.asarray(profile, float)
    angle = np.arange(segments) * 2 * np.pi / segments
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], -1)
    rings = ring[None] * table[:, 0, None, None]
    rings[..., 2] += table[:, 1, None]
    return ring_mesh(rings + np.asarray(centre), material, smooth)


def rounded_card(centre, yaw_deg: float, size, radius: float, thick: float, material):
    """Flat card with round corners: top face with texture, thin sides; and sharp corners."""
    w, d = size
    arcs = [(1, 1), (-1, 1), (-1, -1), (1, -1)]
    outline = []
    for quarter, (sx, sy) in enumerate(arcs):
        angle = (quarter + np.linspace(0, 1, 25)) * np.pi / 2
        x = sx * (w / 2 - radius) + radius * np.cos(angle)
        y = sy * (d / 2 - radius) + radius * np.sin(angle)
        outline.append(np.stack([x, y], -1))
    outline = np.concatenate(outline)
    n = len(outline)
    top = np.column_stack([outline, np.full(n, thick)])
    low = np.column_stack([outline, np.zeros(n)])
    local = np.concatenate([top, low, [[0, 0, thick]]])
    k = np.arange(n)
    nxt = (k + 1) % n
    faces = [np.stack([k, nxt, np.full(n, 2 * n)], 1)]
    faces += [np.stack([n + k, n + nxt, nxt], 1), np.stack([n + k, nxt, k], 1)]
    uv = local[:, :2] / [w, d] + 0.5
    a = np.radians(yaw_deg)
    turn = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    sharp = np.array([[-w, d], [w, d], [w, -d], [-w, -d]]) / 2
    corners = np.column_stack([sharp, np.full(4, thick)]) @ turn.T + centre
    body = mesh(local @ turn.T + centre, np.concatenate(faces), material, False, uv)
    return body, corners


def quads(corners: np.ndarray, material, uv: np.ndarray | None = None):
    """One mesh of many quadrilaterals (N, 4, 3), with optional texture coordinates."""
    count = len(corners)
    first = 4 * np.arange(count)[:, None]
    faces = np.concatenate([np.add(first, (0, 1, 2)), np.add(first, (0, 2, 3))])
    flat_uv = None if uv is None else uv.reshape(-1, 2)
    return mesh(corners.reshape(-1, 3), faces, material, False, flat_uv)


def foliage(centre, radii, count: int, leaf: float, materials: list[dict], seed: int) -> list:
    """Crown of randomly turned leaves gathered in clumps, one mesh per material."""
    rng = np.random.default_rng(seed)
    clumps = rng.normal(size=(28, 3))
    clumps *= rng.uniform(0.35, 1.0, (28, 1)) ** 0.5 / np.linalg.norm(clumps, axis=1)[:, None]
    out = []
    for material in materials:
        n = count // len(materials)
        spread = rng.normal(size=(n, 3)) * 0.17
        middle = centre + (clumps[rng.integers(28, size=n)] + spread) * radii
        axes = np.linalg.qr(rng.normal(size=(n, 3, 3)))[0]
        a, b = axes[:, :, 0] * leaf / 2, axes[:, :, 1] * leaf / 3
        corners = np.stack([middle - a, middle - b, middle + a, middle + b], axis=1)
        out.append(quads(corners, material))
    return out


def area_light(centre, target, width: float, height: float, radiance) -> dict:
    """Rectangular lamp facing a target."""
    look = Transform().look_at(origin=list(centre), target=list(target), up=[0.01, 0.02, 1])
    return {
        "type": "rectangle",
        "to_world": look @ Transform().scale([width / 2, height / 2, 1]),
        "bsdf": matte(0.0),
        "emitter": {"type": "area", "radiance": colour(radiance)},
    }


def sun(direction, irradiance, spread_deg: float = 0.8) -> dict:
    """Distant disk: sunlight with soft shadow edges; ``direction`` points to the sun."""
    d = np.asarray(direction, float) / np.linalg.norm(direction)
    distance = 300.0
    radius = distance * np.tan(np.radians(spread_deg) / 2)
    radiance = np.asarray(irradiance) * distance**2 / (np.pi * radius**2)
    look = Transform().look_at(origin=list(d * distance), target=[0, 0, 0], up=[0.1, 0.2, 1])
    return {
        "type": "disk",
        "to_world": look @ Transform().scale([radius, radius, 1]),
        "emitter": {"type": "area", "radiance": colour(radiance)},
    }


def sky_light(picture: np.ndarray, scale: float) -> dict:
    """Environment map with world z up; the picture's centre looks along +y."""
    return {
        "type": "envmap",
        "bitmap": mi.Bitmap(np.ascontiguousarray(picture * scale, np.float32)),
        "to_world": Transform().rotate([0, 0, 1], 180) @ Transform().rotate([1, 0, 0], 90),
    }

"""A room to photograph: every surface has a pattern that stitching can hold on to, and all of it can be path-traced."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from bench.places.meshes import rectangle
from bench.places.objects import rgb
from bench.places.place import loaded, mitsuba_objects
from bench.truth import Estimate, cached, content_hash, path_trace

from lightdepth.cameras import Equirectangular
from lightdepth.directions import FloatArray, direction_to_latlong, euler_rotation
from lightdepth.kernel.start import start
from lightdepth.scene.model import CameraView, Mesh, RealSurface, Role, SyntheticObject

LOW, HIGH = np.array([-1.7, -1.9, 0.0]), np.array([2.7, 3.3, 2.6])
"""Two corners of the room, world, metres."""
FLOOR = np.array([[LOW[0], LOW[1], 0], [HIGH[0], LOW[1], 0], [HIGH[0], HIGH[1], 0], [LOW[0], HIGH[1], 0]])
"""The floor's corners, counter-clockwise seen from above."""
RUG = np.array([[0.0, 0.0, 0.0], [1.6, 0.0, 0.0], [1.6, 2.2, 0.0], [0.0, 2.2, 0.0]])
"""The rug's corners. The first one is the world's origin, the first side its x axis."""
CEILING_CORNER = np.array([HIGH[0], HIGH[1], HIGH[2]])
CAPTURE, ROTATION = np.array([0.2, -0.5, 1.5]), np.array([1.6, -1.1, 17.0])
"""Where the camera stands in world, metres, and light space to world, XYZ Euler, degrees."""
_LAMP = (1.3, 1.9, 1.2, 1.8)
_WINDOW = (0.4, 1.9, 0.9, 2.1)


def _rectangles() -> dict[str, Mesh]:
    """The room's surfaces, each facing inward."""
    dx, dy, up = np.diag(HIGH - LOW)
    lamp_hole = (_LAMP[2] - LOW[1], _LAMP[3] - LOW[1], _LAMP[0] - LOW[0], _LAMP[1] - LOW[0])
    window_hole = (_WINDOW[0] - LOW[1], _WINDOW[1] - LOW[1], _WINDOW[2], _WINDOW[3])
    rug_hole = (RUG[0, 0] - LOW[0], RUG[2, 0] - LOW[0], RUG[0, 1] - LOW[1], RUG[2, 1] - LOW[1])
    return {
        "floor": rectangle(LOW, dx, dy, [rug_hole]),
        "rug": rectangle(RUG[0], RUG[1], RUG[3]),
        "ceiling": rectangle(LOW + up, dy, dx, [lamp_hole]),
        "front": rectangle(LOW, up, dx),
        "back": rectangle(LOW + dy, dx, up),
        "left": rectangle(LOW, dy, up, [window_hole]),
        "right": rectangle(LOW + dx, up, dy),
        "lamp": rectangle(
            (_LAMP[0], _LAMP[2], HIGH[2]), (0, _LAMP[3] - _LAMP[2], 0), (_LAMP[1] - _LAMP[0], 0, 0)
        ),
        "window": rectangle(
            (LOW[0], _WINDOW[0], _WINDOW[2]), (0, _WINDOW[1] - _WINDOW[0], 0), (0, 0, _WINDOW[3] - _WINDOW[2])
        ),
    }  # fmt: skip


_GLOW = {"lamp": (34.0, 28.0, 20.0), "window": (6.0, 7.2, 9.0)}
_COLOR = {
    "floor": (0.50, 0.36, 0.24), "ceiling": (0.78, 0.77, 0.74), "front": (0.62, 0.60, 0.52),
    "back": (0.42, 0.52, 0.58), "left": (0.64, 0.62, 0.56), "right": (0.60, 0.44, 0.36),
}  # fmt: skip
_TILES = {"floor": (30, 9), "ceiling": (9, 11), "front": (7, 12), "back": (12, 7), "left": (14, 7), "right": (7, 14)}
"""Tiles along a texture's u and v."""


@cache
def _pattern(name: str) -> FloatArray:
    """Reflectance of a surface, shape (512, 512, 3), float32: tiles of different tones with joints between them."""
    v, u = (np.mgrid[:512, :512] + 0.5) / 512
    if name == "rug":
        across, along = RUG[2, :2]
        edge = np.minimum(np.minimum(u, 1 - u) * across, np.minimum(v, 1 - v) * along)
        diamonds = (np.abs((u * 5) % 1 - 0.5) + np.abs((v * 7) % 1 - 0.5)) < 0.3
        tone = np.where(diamonds[..., None], (0.55, 0.47, 0.33), (0.33, 0.09, 0.10))
        return np.where(((edge > 0.05) & (edge < 0.1))[..., None], (0.68, 0.62, 0.5), tone).astype(np.float32)
    rng = np.random.default_rng(sum(name.encode()))
    across, along = _TILES[name]
    column, row = (u * across).astype(int), (v * along).astype(int)
    tones = rng.uniform(0.72, 1.0, (along, across))
    pattern = tones[row, column]
    for _ in range(60):  # Scattered spots tell places apart that lie on like tiles.
        x, y, size = rng.uniform(0, 1), rng.uniform(0, 1), rng.uniform(0.004, 0.02)
        spot = np.hypot(u - x, v - y) < size
        pattern = np.where(spot, rng.uniform(0.35, 0.9), pattern)
    joint = (np.abs(u * across - np.round(u * across)) < 0.03) | (np.abs(v * along - np.round(v * along)) < 0.03)
    pattern = np.where(joint, 0.6 * pattern, pattern)
    return (pattern[..., None] * np.asarray(_COLOR[name])).astype(np.float32)


def trace(
    view: CameraView, samples: int, objects: Sequence[SyntheticObject] = (), seed: int = 1, max_depth: int = 12
) -> Estimate:
    """The room through a camera by stock Mitsuba's ``path``, with or without objects in it; cached."""
    start()
    meshes = _rectangles()
    patterns = {name: _pattern(name) for name in meshes if name not in _GLOW}
    key = content_hash("textured room", meshes, patterns, _GLOW, view, samples, tuple(objects), seed, max_depth)

    def make() -> Estimate:
        import mitsuba as mi

        from lightdepth.kernel.shapes import mesh_shape

        entries: dict[str, Any] = {"type": "scene"}
        for name, mesh in meshes.items():
            plugins = _lamp(_GLOW[name]) if name in _GLOW else _matte(patterns[name])
            entries[f"real_{name}"] = mesh_shape(mesh, **loaded(plugins))
        entries |= mitsuba_objects(tuple(objects))
        scene = mi.load_dict(entries, optimize=False)
        return path_trace(scene, view, samples, seed, max_depth, with_coverage=bool(objects))

    return cached(key, make)


def _matte(pattern: FloatArray) -> dict[str, Any]:
    import mitsuba as mi

    return {"bsdf": {"type": "diffuse", "reflectance": {"type": "bitmap", "bitmap": mi.Bitmap(pattern), "raw": True}}}


def _lamp(radiance: tuple[float, float, float]) -> dict[str, Any]:
    return {
        "bsdf": {"type": "diffuse", "reflectance": rgb((0.0, 0.0, 0.0))},
        "emitter": {"type": "area", "radiance": rgb(radiance)},
    }


def panorama_view(width: int) -> CameraView:
    """The full panorama from the capture point."""
    return CameraView(Equirectangular(type="equirectangular", width=width), CAPTURE, euler_rotation(ROTATION))


def true_surfaces(support: Sequence[str]) -> tuple[RealSurface, ...]:
    """The room's exact geometry; the named surfaces are support, the others environment."""
    return tuple(
        RealSurface(name, mesh, Role.SUPPORT if name in support else Role.ENVIRONMENT)
        for name, mesh in _rectangles().items()
    )


def clicks(points: FloatArray, width: int, rotation: FloatArray | None = None) -> str:
    """Where a person who hits the nearest pixel clicks for world points: ``x,y x,y ...``.

    Args:
        points: world, metres, shape (n, 3).
        width: of the panorama, pixels.
        rotation: the panorama's own light space to world, shape (3, 3); by default that of :func:`panorama_view`.
    """
    to_world = euler_rotation(ROTATION) if rotation is None else rotation
    u, v = direction_to_latlong((np.atleast_2d(points) - CAPTURE) @ to_world)
    return " ".join(f"{np.floor(x) + 0.5},{np.floor(y) + 0.5}" for x, y in zip(u * width, v * width / 2, strict=True))

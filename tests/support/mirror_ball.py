"""Photographs of a chrome ball: path-traced in the textured room, or computed in a box that carries a known picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from bench.places.objects import Matte
from bench.truth import Estimate

from lightdepth.cameras import Equirectangular, Perspective
from lightdepth.directions import FloatArray, look_at_rotation, pixel_directions, pixel_solid_angles
from lightdepth.scene.materials import Material
from lightdepth.scene.model import AnalyticShape, CameraView, SyntheticObject, SyntheticPart
from tests.support import textured_room as room
from tests.support.photography import look_up

CENTRE, RADIUS = np.array([0.6, 0.5, 1.1]), 0.06
"""Of the mirror ball, world, metres."""
GREY_CENTRE, ALBEDO = np.array([0.78, 0.5, 1.1]), 0.35
"""Of the grey ball, of the same radius."""
FIRST, SECOND = np.array([0.75, -0.9, 1.25]), np.array([1.95, 0.6, 1.3])
"""Where the camera stands for the two photographs."""
REFLECTANCE = "0.6876,0.6490,0.6870"
"""Mitsuba's chromium at normal incidence."""


class Chrome(Material):
    """A perfectly smooth metal with the reflectance of chromium at every angle."""

    type: Literal["chrome"] = "chrome"

    def plugins(self) -> dict[str, dict[str, Any]]:
        return {"bsdf": {"type": "conductor", "material": "Cr"}}


def sphere(name: str, centre: FloatArray, radius: float, material: Material) -> SyntheticObject:
    """A sphere anywhere."""
    to_world = np.diag([radius, radius, radius, 1.0])
    to_world[:3, 3] = centre
    return SyntheticObject(name, (SyntheticPart(AnalyticShape("sphere", to_world), material),))


def camera(position: FloatArray, width: int, fov: float = 17.0, aside: FloatArray | None = None) -> CameraView:
    """A camera that looks at the mirror ball, or ``aside`` of it; its photographs are 4 : 3."""
    rotation = look_at_rotation(position, CENTRE if aside is None else CENTRE + aside)
    perspective = Perspective(type="perspective", width=width, height=width * 3 // 4, fov=fov)
    return CameraView(perspective, position, rotation)


def photograph(view: CameraView, samples: int, grey: bool = False, seed: int = 1) -> Estimate:
    """The balls in the room."""
    balls = [sphere("mirror ball", CENTRE, RADIUS, Chrome())]
    if grey:
        balls.append(sphere("grey ball", GREY_CENTRE, RADIUS, Matte(color=(ALBEDO,) * 3)))
    return room.trace(view, samples, balls, seed)


def panorama(rotation: FloatArray, width: int, samples: int) -> Estimate:
    """The empty room from the mirror ball's centre; ``rotation`` is light space to world."""
    return room.trace(CameraView(Equirectangular(type="equirectangular", width=width), CENTRE, rotation), samples)


@dataclass(frozen=True)
class Box:
    """A box whose walls carry a panorama as it is seen from the middle: what a ball there must give, whatever its size.

    Attributes:
        panorama: linear RGB, shape (height, 2 height, 3).
        half: half the box's edge, metres; infinity puts the panorama infinitely far away.
        sun: radiance added to a disc of the panorama, 0 for none.
        sun_direction: toward its middle.
        sun_radius: of the disc, degrees.
    """

    panorama: np.ndarray
    half: float = np.inf
    sun: float = 0.0
    sun_direction: tuple[float, float, float] = (0.48, -0.6, 0.64)
    sun_radius: float = 3.0

    def distance(self, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """To the walls along rays from within; metres."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.min((np.sign(directions) * self.half - origins) / directions, axis=-1))

    def look(self, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Radiance along rays."""
        if np.isfinite(self.half):
            directions = origins + directions * self.distance(origins, directions)[..., None]
            directions = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
        # OpenCV's maps have at most 32767 entries a side.
        flat = directions.reshape(-1, 3)
        parts = [look_up(self.panorama, flat[start : start + 30000, None]) for start in range(0, len(flat), 30000)]
        light = np.concatenate(parts).reshape(directions.shape)
        inside = directions @ np.array(self.sun_direction) > np.cos(np.radians(self.sun_radius))
        return light + self.sun * inside[..., None]

    def irradiance(self, normals: np.ndarray) -> np.ndarray:
        """Of surfaces in the middle."""
        directions = pixel_directions(64, 128)
        weight = pixel_solid_angles(64, 128)[:, None, None] * look_up(self.panorama, directions)
        cosine = np.maximum(np.tensordot(pixel_directions(32, 64), directions, axes=(2, 2)), 0.0)
        ambient = np.tensordot(cosine, weight, axes=((2, 3), (0, 1)))
        sun = self.sun * np.pi * np.sin(np.radians(self.sun_radius)) ** 2
        facing = np.maximum(normals @ np.array(self.sun_direction), 0.0)
        return look_up(ambient, normals[None])[0] + sun * facing[..., None]


def fresnel(cosine: np.ndarray) -> np.ndarray:
    """Unpolarised reflectance of chromium at 550 nm."""
    index = 3.18 + 3.31j
    inner = np.sqrt(index**2 - 1.0 + cosine**2)
    across = (cosine - inner) / (cosine + inner)
    along = (index**2 * cosine - inner) / (index**2 * cosine + inner)
    return np.asarray(0.5 * (np.abs(across) ** 2 + np.abs(along) ** 2))


def computed_photograph(
    box: Box, position: np.ndarray, width: int, fov: float, radius: float, grey_beside: float = 0.0, aside: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """A mirror ball at the middle of a box, and a grey one ``grey_beside`` metres to its right.

    Independent of the code that it tests: rays meet the balls by the quadratic equation. The reflectance is that of
    chromium, by Fresnel's equations with a complex index.

    Returns:
        ``(radiance, rotation)``: shape (3 / 4 width, width, 3), float32, and camera space to the box's axes.
    """
    rotation = look_at_rotation(position, np.array([aside, 0.0, 0.0]))
    height, fine = width * 3 // 4, 3
    y, x = (np.mgrid[: height * fine, : width * fine] + 0.5) / fine
    reach = width / 2.0 / np.tan(np.radians(fov / 2.0))
    rays = np.stack([x - width / 2.0, np.full_like(x, reach), height / 2.0 - y], axis=-1)
    rays = (rays / np.linalg.norm(rays, axis=-1, keepdims=True)) @ rotation.T
    origin = np.broadcast_to(position, rays.shape)
    light = box.look(origin, rays)
    for centre, grey in ((np.zeros(3), False), (grey_beside * rotation[:, 0], True)):
        if grey and not grey_beside:
            continue
        along = -((position - centre) * rays).sum(axis=-1)
        inside = along**2 - (((position - centre) ** 2).sum() - radius**2)
        hit = inside > 0.0
        point = position + rays[hit] * (along[hit] - np.sqrt(inside[hit]))[:, None]
        normal = (point - centre) / radius
        if grey:
            parts = np.array_split(normal, 1 + len(normal) // 30000)
            light[hit] = ALBEDO / np.pi * np.concatenate([box.irradiance(part) for part in parts])
        else:
            mirrored = rays[hit] - 2.0 * (rays[hit] * normal).sum(axis=-1, keepdims=True) * normal
            light[hit] = fresnel(-(rays[hit] * normal).sum(axis=-1))[:, None] * box.look(point, mirrored)
    picture = light.reshape(height, fine, width, fine, 3).mean(axis=(1, 3))
    return picture.astype(np.float32), rotation

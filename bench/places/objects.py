"""The synthetic objects of the benchmark: shapes and materials that every compared renderer can express."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from bench.places.meshes import box, turned
from lightdepth.scene.materials import Material
from lightdepth.scene.model import AnalyticShape, SyntheticObject, SyntheticPart

Color = tuple[float, float, float]
Point = tuple[float, float, float]
STANDING = 0.001
"""Metres between the floor and what stands on it, so that no two surfaces coincide."""


def rgb(color: Color) -> dict[str, Any]:
    """A colour as Mitsuba's dictionary."""
    return {"type": "rgb", "value": list(color)}


class Matte(Material):
    """Lambertian of the given albedo."""

    type: Literal["matte"] = "matte"
    color: Color

    def plugins(self) -> dict[str, dict[str, Any]]:  # noqa: D102
        return {"bsdf": {"type": "diffuse", "reflectance": rgb(self.color)}}


class Polished(Material):
    """Metal without Fresnel effect: GGX with ``alpha = roughness ** 2``, tinted by ``color``; Cycles' Glossy BSDF."""

    type: Literal["polished"] = "polished"
    color: Color
    roughness: float

    def plugins(self) -> dict[str, dict[str, Any]]:  # noqa: D102
        return {
            "bsdf": {
                "type": "roughconductor",
                "material": "none",
                "distribution": "ggx",
                "alpha": self.roughness**2,
                "specular_reflectance": rgb(self.color),
            }
        }


class Glowing(Material):
    """Lambertian emitter of the given radiance that reflects nothing."""

    type: Literal["glowing"] = "glowing"
    radiance: Color

    def plugins(self) -> dict[str, dict[str, Any]]:  # noqa: D102
        return {
            "bsdf": {"type": "diffuse", "reflectance": rgb((0.0, 0.0, 0.0))},
            "emitter": {"type": "area", "radiance": rgb(self.radiance)},
        }


def ball(name: str, place: tuple[float, float], radius: float, material: Material) -> SyntheticObject:
    """A sphere that stands on the floor at ``place`` (x, y in metres)."""
    to_world = np.diag([radius, radius, radius, 1.0])
    to_world[:3, 3] = (*place, radius + STANDING)
    return SyntheticObject(name, (SyntheticPart(AnalyticShape("sphere", to_world), material),))


def block(
    name: str, place: tuple[float, float], size: Point, material: Material, degrees: float = 0.0
) -> SyntheticObject:
    """A box that stands on the floor centred at ``place``, turned by ``degrees`` about the vertical."""
    x, y = place
    low = (x - 0.5 * size[0], y - 0.5 * size[1], STANDING)
    high = (x + 0.5 * size[0], y + 0.5 * size[1], STANDING + size[2])
    return SyntheticObject(name, (SyntheticPart(turned(box(low, high), degrees, place), material),))


def object_set(variant: str, center: tuple[float, float]) -> tuple[SyntheticObject, ...]:
    """A group of objects around ``center`` (x, y in metres), about 1.5 m across and at most 0.75 m high.

    Args:
        variant: ``matte`` (Lambertian spheres and a box), ``mixed`` (also rough and glossy metal) or ``lamp`` (a
            glowing sphere between matte ones).
        center: where the group stands.

    Raises:
        KeyError: there is no such variant.
    """
    x, y = center
    red, white, blue = Matte(color=(0.7, 0.15, 0.1)), Matte(color=(0.75, 0.75, 0.72)), Matte(color=(0.15, 0.25, 0.6))
    variants = {
        "matte": (red, white, blue),
        "mixed": (
            red,
            Polished(color=(0.9, 0.75, 0.45), roughness=0.5),
            Polished(color=(0.9, 0.9, 0.9), roughness=0.3),
        ),
        "lamp": (red, white, Glowing(radiance=(9.0, 7.0, 4.0))),
    }
    first, second, third = variants[variant]
    return (
        ball("ball", (x + 0.35, y - 0.05), 0.32, first),
        block("block", (x - 0.45, y + 0.35), (0.42, 0.36, 0.72), second, 25.0),
        ball("small ball", (x - 0.2, y - 0.35), 0.2, third),
    )

"""Surfaces that only shine."""

from __future__ import annotations

from typing import Literal

from lightdepth.scene.materials.material import Material, Plugin, area_light, two_sided
from lightdepth.scene.materials.values import Radiance


class Emitter(Material):
    """A black surface that sends ``radiance`` from the side of its normals."""

    type: Literal["emitter"]
    radiance: Radiance

    def plugins(self) -> dict[str, Plugin]:  # noqa: D102
        black = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.0, 0.0, 0.0]}}
        return {"bsdf": two_sided(black), "emitter": area_light(self.radiance)}

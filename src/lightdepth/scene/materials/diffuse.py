"""Matte surfaces."""

from __future__ import annotations

from typing import Literal

from lightdepth.scene.materials.material import Material, Plugin, rgb, two_sided
from lightdepth.scene.materials.values import Colour


class Diffuse(Material):
    """Lambertian reflection of ``color``, from both sides."""

    type: Literal["diffuse"]
    color: Colour = (0.5, 0.5, 0.5)

    def plugins(self) -> dict[str, Plugin]:  # noqa: D102
        return {"bsdf": two_sided({"type": "diffuse", "reflectance": rgb(self.color)})}

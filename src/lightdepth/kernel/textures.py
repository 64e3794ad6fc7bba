"""Textures of the scene as Mitsuba bitmaps, each made once."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np

from lightdepth.kernel.loading import load
from lightdepth.scene.materials.texture import Texture, VertexColors


class TextureCache:
    """Turns the textures in plugin dictionaries into Mitsuba objects, and shares those that are used again."""

    def __init__(self) -> None:
        self._made: dict[tuple[int, bool], tuple[Texture, mi.Texture]] = {}

    def plugin(self, description: Any, v_up: bool) -> Any:
        """A copy of a plugin dictionary in which every texture is a Mitsuba object.

        Args:
            description: a dictionary of ``Material.plugins``, or one of its values.
            v_up: whether the shape's v grows upward in images (Mitsuba's analytic shapes) or downward (meshes).
        """
        if isinstance(description, dict):
            return {key: self.plugin(value, v_up) for key, value in description.items()}
        if isinstance(description, Texture):
            return self._bitmap(description, v_up)
        if isinstance(description, VertexColors):
            return {"type": "mesh_attribute", "name": "vertex_color"}
        return description

    def _bitmap(self, texture: Texture, v_up: bool) -> mi.Texture:
        key = (id(texture), v_up)
        if key not in self._made:
            # The texture is kept with its bitmap, so that its id stays its own.
            self._made[key] = (texture, bitmap(texture, v_up))
        return self._made[key][1]


def bitmap(texture: Texture, v_up: bool = False) -> mi.Texture:
    """A Mitsuba ``bitmap`` of a texture. Its numbers are linear already, so it is always raw."""
    to_uv = texture.to_uv
    if v_up:
        to_uv = to_uv @ np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 1.0], [0.0, 0.0, 1.0]])
    return load(
        {
            "type": "bitmap",
            "bitmap": mi.Bitmap(np.ascontiguousarray(texture.pixels)),
            "raw": True,
            "format": "auto",  # half precision stays half
            "filter_type": "nearest" if texture.nearest else "bilinear",
            "wrap_mode": texture.wrap,
            "to_uv": mi.ScalarTransform3f(to_uv),
        }
    )

"""What every material is."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

from pydantic import BaseModel, ConfigDict

Plugin = dict[str, Any]


class Material(BaseModel, ABC):
    """Base of the materials: the settings of a ``material = { type = ... }`` table."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, arbitrary_types_allowed=True)

    type: Any

    @abstractmethod
    def plugins(self) -> dict[str, Plugin]:
        """The Mitsuba plugins that make this material, as plain dictionaries.

        Returns:
            ``{"bsdf": ...}`` and, for what shines by itself, ``"emitter"`` as well. Textures stand in them as
            ``Texture`` values; ``kernel`` turns these into bitmaps.
        """


def rgb(colour: Any) -> Any:
    """A colour or radiance as a Mitsuba plugin; textures are left to ``kernel``."""
    return {"type": "rgb", "value": list(colour)} if isinstance(colour, tuple) else colour


def two_sided(bsdf: Plugin) -> Plugin:
    """The reflecting BSDF seen from both sides: a mesh with faces the wrong way round shows no black holes."""
    return {"type": "twosided", "bsdf": bsdf}


def area_light(radiance: Any) -> Plugin:
    """An emitter over the whole surface, on the side of its normals."""
    return {"type": "area", "radiance": rgb(radiance)}

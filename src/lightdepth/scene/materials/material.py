"""What every material is."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict


class Material(BaseModel):
    """Base of the materials: the settings of a ``material = { type = ... }`` table."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    def plugins(self) -> dict[str, dict[str, Any]]:
        """The Mitsuba plugins that make this material, as plain dictionaries.

        Returns:
            ``{"bsdf": ...}`` and, for what shines by itself, ``"emitter"`` as well. Textures stand in them as
            ``Texture`` values; ``kernel`` turns these into bitmaps.
        """
        raise NotImplementedError

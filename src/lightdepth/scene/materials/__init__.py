"""Materials of synthetic objects. A new kind is a file in this folder and a line in ``MaterialSettings``."""

from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from lightdepth.scene.materials.diffuse import Diffuse
from lightdepth.scene.materials.emitter import Emitter
from lightdepth.scene.materials.glass import Glass
from lightdepth.scene.materials.material import Material
from lightdepth.scene.materials.metal import Metal
from lightdepth.scene.materials.mitsuba import MitsubaBsdf
from lightdepth.scene.materials.principled import Principled
from lightdepth.scene.materials.texture import Texture, VertexColors


def _with_type(value: Any) -> Any:
    """``{ mitsuba = {...} }`` says its kind by its key."""
    if isinstance(value, dict) and "mitsuba" in value and "type" not in value:
        return {"type": "mitsuba", **value}
    return value


MaterialSettings = Annotated[
    Annotated[
        Principled  # the lines of this union are the registry
        | Diffuse
        | Metal
        | Glass
        | Emitter
        | MitsubaBsdf,
        Field(discriminator="type"),
    ],
    BeforeValidator(_with_type),
]

__all__ = [
    "Diffuse",
    "Emitter",
    "Glass",
    "Material",
    "MaterialSettings",
    "Metal",
    "MitsubaBsdf",
    "Principled",
    "Texture",
    "VertexColors",
]

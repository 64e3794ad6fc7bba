"""The kinds of value that a material's settings may have, with errors that name the range."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

from pydantic import PlainValidator, ValidationInfo

from lightdepth.quantities import BRIGHTEST
from lightdepth.scene.materials.image import Content, read_texture
from lightdepth.scene.materials.texture import Texture, VertexColors

Triple = tuple[float, float, float]


def _texture(value: Any, content: Content, info: ValidationInfo) -> Texture | VertexColors | None:
    """The value where it is a texture already, or the image file that it names, relative to the scene file."""
    if isinstance(value, Texture | VertexColors):
        return value
    if isinstance(value, str):
        return read_texture(Path((info.context or {}).get("folder", "")) / value, content)
    return None


def _numbers(value: Any, upper: float) -> list[float]:
    """The value as finite numbers from 0 to ``upper``; empty if it is anything else."""
    numbers = value if isinstance(value, list | tuple) else [value]
    if all(isinstance(n, int | float) and not isinstance(n, bool) and 0.0 <= n <= upper for n in numbers):
        return [float(n) for n in numbers if math.isfinite(n)]
    return []


def _three(value: Any, upper: float) -> Triple | None:
    """Three numbers from 0 to ``upper``, or one for all three."""
    numbers = _numbers(value, upper)
    if len(numbers) == 1:
        return numbers[0], numbers[0], numbers[0]
    return (numbers[0], numbers[1], numbers[2]) if len(numbers) == 3 else None


def _colour(value: Any, info: ValidationInfo) -> Triple | Texture | VertexColors:
    found = _texture(value, Content.COLOUR, info) or _three(value, 1.0)
    if found is None:
        raise ValueError("must be three numbers from 0 to 1 (linear red, green, blue), one number, or an image file")
    return found


def _radiance(value: Any, info: ValidationInfo) -> Triple | Texture:
    found = _texture(value, Content.COLOUR, info) or _three(value, BRIGHTEST)
    if found is None or isinstance(found, VertexColors):
        raise ValueError(
            f"must be three numbers from 0 to {BRIGHTEST:g} (linear red, green, blue), one number, or an image file"
        )
    return found


def _share(value: Any, info: ValidationInfo) -> float | Texture:
    texture = _texture(value, Content.SHARE, info)
    if isinstance(texture, Texture):
        return texture
    numbers = _numbers(value, 1.0)
    if len(numbers) != 1:
        raise ValueError("must be a number from 0 to 1, or an image file")
    return numbers[0]


def _normals(value: Any, info: ValidationInfo) -> Texture | None:
    texture = _texture(value, Content.VECTOR, info)
    if not isinstance(texture, Texture):
        raise ValueError("must be an image file of tangent-space normals (x to the right, y up in the image)")
    return texture


Colour = Annotated[Triple | Texture | VertexColors, PlainValidator(_colour)]
"""Share per channel, linear Rec.709 in [0, 1]."""
Radiance = Annotated[Triple | Texture, PlainValidator(_radiance)]
"""Emitted radiance per channel, linear Rec.709, 0 or more, in the panorama's unit."""
Share = Annotated[float | Texture, PlainValidator(_share)]
"""A number in [0, 1]."""
NormalMap = Annotated[Texture, PlainValidator(_normals)]
"""Normals in tangent space, each component mapped from [-1, 1] to [0, 1]; x right, y up in the image."""

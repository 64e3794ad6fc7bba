"""Textures of glTF materials: channels picked, factors multiplied in, transforms and samplers carried along."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightdepth.images.radiance import read_radiance
from lightdepth.scene.materials import Texture
from lightdepth.scene.materials.texture import SRGB_TO_LINEAR, Wrap
from lightdepth.scene.meshes.gltf_file import GltfFile

_WRAPS: dict[int, Wrap] = {10497: "repeat", 33071: "clamp", 33648: "mirror"}
_NEAREST_FILTER = 9728
_CODES = np.arange(256) / 255.0
RED, GREEN, BLUE, ALPHA = range(4)
Info = dict[str, Any]
"""A ``textureInfo`` of the file."""


class GltfTextures:
    """Makes the textures of one file; the same channels of the same image are made once.

    Mitsuba wraps both axes alike, so ``wrapT`` is taken to be ``wrapS``.
    """

    def __init__(self, file: GltfFile) -> None:
        self._file = file
        self._made: dict[tuple[Any, ...], Texture] = {}

    def colour(self, info: Info, factor: Sequence[float]) -> Texture:
        """Red, green and blue, times a factor for each; decoded from sRGB but for images of radiance, which are linear."""
        if (file := self._file.radiance_file(self._source(info))) is not None:
            key = (json.dumps(info, sort_keys=True), file, *factor)
            if key not in self._made:
                self._made[key] = self._sampled(info, read_radiance(file) * np.asarray(factor, np.float32))
            return self._made[key]
        return self._texture(info, {c: SRGB_TO_LINEAR * factor[c] for c in (RED, GREEN, BLUE)})

    def share(self, info: Info, channel: int, factor: float) -> Texture | float:
        """One channel as numbers in [0, 1] times a factor; one number where all texels are equal."""
        return _number_if_constant(self._texture(info, {channel: _CODES * factor}))

    def mask(self, info: Info, factor: float, cutoff: float) -> Texture | float:
        """1 where alpha times a factor reaches the cutoff, else 0."""
        return _number_if_constant(self._texture(info, {ALPHA: (_CODES * factor >= cutoff).astype(np.float64)}))

    def normals(self, info: Info) -> Texture:
        """Tangent-space normals, x and y times the scale that the file gives them."""
        leaning = 0.5 + (_CODES - 0.5) * info.get("scale", 1.0)
        return self._texture(info, {RED: leaning, GREEN: leaning, BLUE: _CODES})

    def _texture(self, info: Info, tables: Mapping[int, NDArray[np.float64]]) -> Texture:
        """A texture of some channels, with a table of values for the 256 codes of each."""
        key = (json.dumps(info, sort_keys=True), *((channel, t.tobytes()) for channel, t in tables.items()))
        if key not in self._made:
            codes = self._file.image(self._source(info))
            channels = [table.astype(np.float16)[codes[:, :, channel]] for channel, table in tables.items()]
            self._made[key] = self._sampled(info, np.stack(channels, axis=-1))
        return self._made[key]

    def _source(self, info: Info) -> int:
        """Number of the image that a texture shows."""
        texture = self._file.header["textures"][info["index"]]
        return int(texture.get("extensions", {}).get("EXT_texture_webp", texture)["source"])

    def _sampled(self, info: Info, pixels: NDArray[np.floating]) -> Texture:
        """Pixels as the sampler and the transform of a texture lay them."""
        texture = self._file.header["textures"][info["index"]]
        sampler = self._file.header["samplers"][texture["sampler"]] if "sampler" in texture else {}
        return Texture(
            pixels,
            wrap=_WRAPS.get(sampler.get("wrapS", 10497), "repeat"),
            nearest=sampler.get("magFilter") == _NEAREST_FILTER,
            to_uv=_to_uv(_transform(info)),
        )


def texture_coordinate_set(info: Info) -> int:
    """Number of the ``TEXCOORD`` attribute that a texture uses."""
    own: int = info.get("texCoord", 0)
    return int(_transform(info).get("texCoord", own))


def _transform(info: Info) -> dict[str, Any]:
    transform: dict[str, Any] = info.get("extensions", {}).get("KHR_texture_transform", {})
    return transform


def _to_uv(transform: dict[str, Any]) -> NDArray[np.float64]:
    """Matrix of ``KHR_texture_transform``: scaled, turned counter-clockwise as seen with v downward, then moved."""
    (su, sv), (tu, tv) = transform.get("scale", (1.0, 1.0)), transform.get("offset", (0.0, 0.0))
    cos, sin = math.cos(transform.get("rotation", 0.0)), math.sin(transform.get("rotation", 0.0))
    return np.array([[cos * su, sin * sv, tu], [-sin * su, cos * sv, tv], [0.0, 0.0, 1.0]])


def _number_if_constant(texture: Texture) -> Texture | float:
    first = texture.pixels.flat[0]
    return float(first) if (texture.pixels == first).all() else texture

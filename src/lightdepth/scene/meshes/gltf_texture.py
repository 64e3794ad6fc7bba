"""Textures of glTF materials: channels picked, factors multiplied in, transforms and samplers carried along."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError
from lightdepth.images.radiance import read_radiance
from lightdepth.scene.materials import Texture
from lightdepth.scene.materials.texture import SRGB_TO_LINEAR, Wrap
from lightdepth.scene.meshes.gltf_file import GltfFile
from lightdepth.scene.meshes.gltf_schema import Sampler, TextureInfo, TextureTransform
from lightdepth.scene.meshes.part import Note

_WRAPS: dict[int, Wrap] = {10497: "repeat", 33071: "clamp", 33648: "mirror"}
_NEAREST_FILTER = 9728
_CODES = np.arange(256) / 255.0
RED, GREEN, BLUE, ALPHA = range(4)


class GltfTextures:
    """Makes the textures of one file; the same channels of the same image are made once.

    Mitsuba wraps both axes alike, so ``wrapT`` is taken to be ``wrapS``.
    """

    def __init__(self, file: GltfFile, note: Note) -> None:
        self._file = file
        self._note = note
        self._made: dict[tuple[Any, ...], Texture] = {}

    def colour(self, info: TextureInfo, factor: Sequence[float]) -> Texture:
        """Red, green and blue, times a factor for each; decoded from sRGB but for images of radiance, which are linear."""
        file = self._file.radiance_file(self._sources(info.index)[-1])
        if file is not None:
            key = (info.model_dump_json(), file, *factor)
            if key not in self._made:
                self._made[key] = self._sampled(info, read_radiance(file) * np.asarray(factor, np.float32))
            return self._made[key]
        return self._texture(info, {c: SRGB_TO_LINEAR * factor[c] for c in (RED, GREEN, BLUE)})

    def share(self, info: TextureInfo, channel: int, factor: float) -> Texture | float:
        """One channel as numbers in [0, 1] times a factor; one number where all texels are equal."""
        return _number_if_constant(self._texture(info, {channel: _CODES * factor}))

    def mask(self, info: TextureInfo, factor: float, cutoff: float) -> Texture | float:
        """1 where alpha times a factor reaches the cutoff, else 0."""
        return _number_if_constant(self._texture(info, {ALPHA: (_CODES * factor >= cutoff).astype(np.float64)}))

    def complement(self, info: TextureInfo, channel: int, factor: float) -> Texture | float:
        """1 minus one channel times a factor."""
        return _number_if_constant(self._texture(info, {channel: 1.0 - _CODES * factor}))

    def mean_colour(self, info: TextureInfo) -> NDArray[np.float64]:
        """Mean of red, green and blue, linear, shape (3,)."""
        pixels = self.colour(info, (1.0, 1.0, 1.0)).pixels
        return np.asarray(pixels.reshape(-1, 3).mean(axis=0, dtype=np.float64))

    def normals(self, info: TextureInfo) -> Texture:
        """Tangent-space normals, x and y times the scale that the file gives them."""
        leaning = np.clip(0.5 + (_CODES - 0.5) * info.scale, -1e4, 1e4)
        return self._texture(info, {RED: leaning, GREEN: leaning, BLUE: _CODES})

    def _texture(self, info: TextureInfo, tables: Mapping[int, NDArray[np.float64]]) -> Texture:
        """A texture of some channels, with a table of values for the 256 codes of each."""
        key = (info.model_dump_json(), *((channel, t.tobytes()) for channel, t in tables.items()))
        if key not in self._made:
            codes = self._codes(info.index)
            # Radiance may exceed what 16 bits hold.
            precision = np.float16 if max(float(t.max()) for t in tables.values()) < 6e4 else np.float32
            channels = [table.astype(precision)[codes[:, :, channel]] for channel, table in tables.items()]
            self._made[key] = self._sampled(info, np.stack(channels, axis=-1))
        return self._made[key]

    def _sampled(self, info: TextureInfo, pixels: NDArray[np.floating]) -> Texture:
        """Pixels as the sampler and the transform of a texture lay them."""
        header = self._file.header
        texture = self._file.entry(header.textures, info.index, "texture")
        sampler = (
            Sampler() if texture.sampler is None else self._file.entry(header.samplers, texture.sampler, "sampler")
        )
        if sampler.wrap_s != sampler.wrap_t:
            self._note(f"texture {info.index} is wrapped differently along its axes; both are as wrapS says")
        return Texture(
            pixels,
            wrap=_WRAPS.get(sampler.wrap_s, "repeat"),
            nearest=sampler.mag_filter == _NEAREST_FILTER,
            to_uv=_to_uv(info.transform),
        )

    def _sources(self, index: int) -> list[int]:
        """The images of a texture: in the formats that extensions add, and last its own."""
        texture = self._file.entry(self._file.header.textures, index, "texture")
        added = texture.extensions
        formats = (added.KHR_texture_basisu, added.EXT_texture_webp, added.EXT_texture_avif, added.MSFT_texture_dds)
        sources = [entry.source for entry in formats if entry is not None and entry.source is not None]
        if texture.source is not None:
            sources.append(texture.source)
        if not sources:
            raise InputError(f"{self._file.path}: texture {index} has no image")
        return sources

    def _codes(self, index: int) -> NDArray[np.uint8]:
        """The pixels of a texture: the first of its images that can be read."""
        sources = self._sources(index)
        for source in sources[:-1]:
            try:
                return self._file.image(source)
            except InputError:
                continue
        return self._file.image(sources[-1])


def _to_uv(transform: TextureTransform) -> NDArray[np.float64]:
    """Matrix of ``KHR_texture_transform``: scaled, turned counter-clockwise as seen with v downward, then moved."""
    (su, sv), (tu, tv) = transform.scale, transform.offset
    cos, sin = math.cos(transform.rotation), math.sin(transform.rotation)
    return np.array([[cos * su, sin * sv, tu], [-sin * su, cos * sv, tv], [0.0, 0.0, 1.0]])


def _number_if_constant(texture: Texture) -> Texture | float:
    first = texture.pixels.flat[0]
    return float(first) if (texture.pixels == first).all() else texture

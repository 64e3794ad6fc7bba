"""Which channels of an OpenEXR file are its picture: parts and layers as renderers and compositors name them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError, warn
from lightdepth.images.chromaticities import converted, luminance_weights, primaries_of, to_rec709
from lightdepth.images.exr import ExrHeader, ExrReader

PICTURE_NAMES = (
    *("composite", "beauty", "rgba", "combined", "rgb", "rgb color", "final", "finalimage", "effectsresult", "main"),
    *("default", "primary", "image", "color", "c", "ci"),
)
"""What the finished picture's part or layer is called, the most telling first."""
TELLING_WORDS = PICTURE_NAMES[:4]
"""Those that mark it also as a word of a longer name such as ``ViewLayer.Combined``."""

_SYNONYMS = {"r": "R", "red": "R", "g": "G", "green": "G", "b": "B", "blue": "B", "a": "A", "alpha": "A"}
_SYNONYMS |= {"y": "Y", "ry": "RY", "by": "BY"}


@dataclass(frozen=True)
class Layer:
    """Channels that make up one picture.

    Attributes:
        part: where it is.
        name: of the layer in the part, without the channels' own; "" for channels without a layer.
        channels: full names by R, G, B, A, or Y, RY, BY.
    """

    part: ExrHeader
    name: str
    channels: dict[str, str]

    @property
    def words(self) -> list[str]:
        """The words of the part's and the layer's name, in small letters."""
        return [word for name in (self.part.name, self.name) for word in re.split(r"[._ -]", name.lower())]

    @property
    def title(self) -> str:
        """Part and layer, for messages."""
        part = f"part '{self.part.name}'" if self.part.name else "the file"
        return f"{part}, layer '{self.name}'" if self.name else part

    @property
    def is_picture(self) -> bool:
        """Whether it has colour or luminance."""
        return {"R", "G", "B"} <= self.channels.keys() or ("Y" in self.channels and not self.is_vector)

    @property
    def is_vector(self) -> bool:
        """Whether its Y stands between an X and a Z, as those of a position, a normal or tristimulus values."""
        dot = "." if self.name else ""
        every = {channel.lower() for channel in self.part.channels}
        return {f"{self.name}{dot}{axis}".lower() for axis in "XZ"} <= every


@dataclass(frozen=True)
class Beauty:
    """The picture of a file.

    Attributes:
        radiance: linear Rec.709, shape (height, width, 3), float32.
        alpha: shape (height, width), float32; ``None`` where there is none.
    """

    radiance: NDArray[np.float32]
    alpha: NDArray[np.float32] | None


def read_beauty(path: Path) -> Beauty:
    """Read the picture of an OpenEXR file in its display window, converted from its primaries to Rec.709.

    Raises:
        InputError: the file is missing or unreadable, has no picture, several that may be meant, or a cube map.
    """
    with ExrReader(path) as reader:
        layer = choose_layer(reader.headers, path)
        if layer.part.attributes.get("envmap") == "cube":
            raise InputError(
                f"{path}: is a cube map; convert it to an equirectangular panorama, twice as wide as high, first"
            )
        primaries = primaries_of(layer.part.attributes, path)
        matrix = to_rec709(primaries, path)
        names = layer.channels
        alpha = None
        if {"R", "G", "B"} <= names.keys():
            # At once, for every read decompresses all channels.
            planes = reader.read(layer.part, [names[name] for name in "RGBA" if name in names])
            radiance = np.ascontiguousarray(planes[:, :, :3], dtype=np.float32)
            alpha = planes[:, :, 3].astype(np.float32) if "A" in names else None
        else:
            radiance = _from_luminance(reader, layer, luminance_weights(primaries))
            if "A" in names:
                alpha = reader.read(layer.part, [names["A"]])[:, :, 0].astype(np.float32)
    aspect = layer.part.attributes.get("PixelAspectRatio", 1.0)
    if abs(aspect - 1.0) > 1e-3:
        warn(f"{path}: its header states pixels {aspect:g} times as wide as high; they are taken to be square")
    return Beauty(converted(radiance, matrix), alpha)


def choose_layer(headers: Sequence[ExrHeader], path: Path) -> Layer:
    """The layer that holds the finished picture.

    In each part, channels without a layer go before layers. Of several candidates, the one is taken that is named like
    a finished picture, see ``PICTURE_NAMES``.

    Raises:
        InputError: there is none, or several have an equal right.
    """
    pictures = []
    for header in headers:
        layers = [layer for layer in _layers(header) if layer.is_picture]
        pictures += [layer for layer in layers if not layer.name] or layers
    if not pictures:
        found = ", ".join(sorted(channel for header in headers for channel in header.channels))
        raise InputError(f"{path}: has channels {found}; R, G and B, or Y, are needed")
    coloured = [layer for layer in pictures if "R" in layer.channels or "RY" in layer.channels]
    chosen = _named(coloured or pictures)
    if len(chosen) > 1:
        raise InputError(
            f"{path}: holds {len(chosen)} pictures that may be the finished one: "
            f"{'; '.join(layer.title for layer in chosen)}. Save one of them alone, or name it 'beauty'"
        )
    views = chosen[0].part.attributes.get("multiView")
    if views is not None and len(views) > 1:
        warn(f"{path}: is a stereo picture ({', '.join(views)}); the view '{views[0]}' is used")
    return chosen[0]


def _named(layers: list[Layer]) -> list[Layer]:
    """Those that are named most like a finished picture; all where none is, or there is but one."""
    if len(layers) == 1:
        return layers
    for name in PICTURE_NAMES:
        if exact := [layer for layer in layers if (layer.name or layer.part.name).lower() == name]:
            return exact
    for word in TELLING_WORDS:
        if telling := [layer for layer in layers if word in layer.words]:
            return telling
    return layers


def _layers(header: ExrHeader) -> list[Layer]:
    found: dict[str, dict[str, str]] = {}
    for channel in header.channels:
        layer, _, own = channel.rpartition(".")
        if own.lower() in _SYNONYMS:
            found.setdefault(layer, {}).setdefault(_SYNONYMS[own.lower()], channel)
    return [Layer(header, name, channels) for name, channels in found.items()]


def _from_luminance(reader: ExrReader, layer: Layer, weights: NDArray[np.float32]) -> NDArray[np.float32]:
    """RGB from luminance, and chroma where there is any: RY = (R - Y) / Y and BY = (B - Y) / Y."""
    luminance = reader.read(layer.part, [layer.channels["Y"]]).astype(np.float32, copy=False)
    if not {"RY", "BY"} <= layer.channels.keys():
        return np.repeat(luminance, 3, axis=2)
    red, blue = (
        luminance * (1.0 + reader.read(layer.part, [layer.channels[name]]).astype(np.float32)) for name in ("RY", "BY")
    )
    green = (luminance - weights[0] * red - weights[2] * blue) / weights[1]
    return np.concatenate([red, green, blue], axis=2)

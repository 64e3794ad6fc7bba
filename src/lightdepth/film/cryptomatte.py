"""Cryptomatte: mattes of objects and materials, whose edges are as smooth as the picture's.

Friedman and Jones, "Fully automatic ID mattes with support for motion blur and transparency" (SIGGRAPH 2015 posters), and
their specification 1.2.0. A layer has pairs of an id and its coverage, the largest first, two pairs to a group of channels
R G B A; an id is the hash of a name, and the header lists the names.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lightdepth.cameras.topology import Rectangle
from lightdepth.film.sparse import sparse_zeros
from lightdepth.scene.model import SyntheticObject

MOST_RANKS = 6
"""Pairs of id and coverage that are kept of a pixel, as most renderers do."""


@dataclass(frozen=True)
class Mattes:
    """How much of the pixels shapes cover: a list of n pairs of a pixel and a shape, by pixel.

    Attributes:
        pixels: row-major indices, ascending, shape (n,), uint32.
        shapes: indices into ``objects`` and ``materials``, shape (n,), uint32.
        shares: of the pixel that the shape covers, in (0, 1], shape (n,), float32.
        objects: for each shape, the name of the object that it is part of.
        materials: for each shape, the name of its material.
    """

    pixels: NDArray[np.uint32]
    shapes: NDArray[np.uint32]
    shares: NDArray[np.float32]
    objects: tuple[str, ...]
    materials: tuple[str, ...]

    def cut(self, rectangle: Rectangle, width: int) -> Mattes:
        """Those of a part of an image of ``width`` columns."""
        row, column = np.divmod(self.pixels, np.uint32(width))
        here = (row >= rectangle.top) & (row < rectangle.bottom)
        here &= (column >= rectangle.left) & (column < rectangle.right)
        pixels = (row[here] - rectangle.top) * rectangle.width + column[here] - rectangle.left
        return replace(self, pixels=pixels.astype(np.uint32), shapes=self.shapes[here], shares=self.shares[here])

    def dominant(self, size: int, owners: Sequence[int]) -> NDArray[np.uint32]:
        """Which object covers most of each pixel of an image of ``size`` pixels, shape (size,).

        0 is none of them, i + 1 the i-th object.

        Args:
            size: pixels of the image.
            owners: for each shape, the index of its object; objects need not have different names.
        """
        pixels, ids, shares = _together(self, np.array(owners, np.uint32) + np.uint32(1))
        here, index = np.unique(pixels, return_inverse=True)
        most, rest = np.zeros(len(here), np.float32), np.ones(len(here), np.float32)
        np.subtract.at(rest, index, shares)
        np.maximum.at(most, index, shares)
        result = sparse_zeros((size,), np.uint32)
        winner = (shares == most[index]) & (shares > rest[index])
        result[pixels[winner]] = ids[winner]
        return result


def shape_names(things: Sequence[SyntheticObject]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of the object and the material of each shape, in the order of the objects' parts.

    Materials of mesh files are called ``OBJECT.NAME``, all others ``OBJECT.TYPE``, with a number where an object has
    several of a type.
    """
    objects, materials = [], []
    for thing in things:
        known: dict[int, str] = {}
        for part in thing.parts:
            objects.append(thing.name)
            if part.material_name is not None:
                materials.append(f"{thing.name}.{part.material_name}")
                continue
            base = f"{thing.name}.{part.material.type}"
            same = sum(name == base or name.startswith(f"{base}.") for name in known.values())
            materials.append(known.setdefault(id(part.material), f"{base}.{same + 1}" if same else base))
    return tuple(objects), tuple(materials)


def matte_channels(
    mattes: Mattes, layer: str, names: Sequence[str], shape: tuple[int, int]
) -> tuple[dict[str, NDArray[np.float32]], dict[str, str]]:
    """The channels of a Cryptomatte layer and what the header says of it.

    Args:
        mattes: the coverage.
        layer: name of the layer.
        names: for each shape, the name that counts.
        shape: height and width of the image.

    Returns:
        Channels of shape (height, width), float32, by name, and header attributes; both empty without shapes.
    """
    if not names:
        return {}, {}
    manifest = {name: matte_id(name) for name in dict.fromkeys(names)}
    ids = np.array([manifest[name] for name in names], np.uint32)
    pixels, found, shares = _together(mattes, ids)
    order = np.lexsort((-shares, pixels))
    pixels, found, shares = pixels[order], found[order], shares[order]
    first = np.searchsorted(pixels, pixels)
    rank = np.arange(len(pixels)) - first
    ranks = min(int(rank.max(initial=0)) + 1, MOST_RANKS)
    channels = {}
    for index in range(2 * (-(-ranks // 2))):
        here = rank == index
        for letter, values in zip("RG" if index % 2 == 0 else "BA", (found.view(np.float32), shares), strict=True):
            plane = sparse_zeros(shape, np.float32)
            plane.reshape(-1)[pixels[here]] = values[here]
            channels[f"{layer}{index // 2:02d}.{letter}"] = plane
    prefix = f"cryptomatte/{murmur3(layer.encode()):08x}"[: len("cryptomatte/") + 7]
    header = {
        "name": layer,
        "hash": "MurmurHash3_32",
        "conversion": "uint32_to_float32",
        "manifest": json.dumps({name: f"{value:08x}" for name, value in manifest.items()}, ensure_ascii=False),
    }
    return channels, {f"{prefix}/{key}": value for key, value in header.items()}


def matte_id(name: str) -> int:
    """The id of a name: its hash, changed where its bits read as a float would not be a normal number."""
    value = murmur3(name.encode())
    if (value >> 23) & 255 in (0, 255):
        value ^= 1 << 23
    return value


def murmur3(data: bytes) -> int:
    """MurmurHash3_x86_32 with the seed 0 (A. Appleby, public domain)."""

    def rotated(value: int, by: int) -> int:
        return ((value << by) | (value >> (32 - by))) & 0xFFFFFFFF

    def mixed(block: int) -> int:
        return rotated(block * 0xCC9E2D51 & 0xFFFFFFFF, 15) * 0x1B873593 & 0xFFFFFFFF

    value, end = 0, len(data) // 4 * 4
    for start in range(0, end, 4):
        value ^= mixed(int.from_bytes(data[start : start + 4], "little"))
        value = (rotated(value, 13) * 5 + 0xE6546B64) & 0xFFFFFFFF
    value ^= mixed(int.from_bytes(data[end:], "little")) if data[end:] else 0
    value ^= len(data)
    for shift, factor in ((16, 0x85EBCA6B), (13, 0xC2B2AE35)):
        value = (value ^ (value >> shift)) * factor & 0xFFFFFFFF
    return value ^ (value >> 16)


def _together(
    mattes: Mattes, ids: NDArray[np.uint32]
) -> tuple[NDArray[np.uint32], NDArray[np.uint32], NDArray[np.float32]]:
    """Pixels, ids and coverage, where shapes of one id count as one; by pixel."""
    key = (mattes.pixels.astype(np.uint64) << np.uint64(32)) | ids[mattes.shapes]
    unique, inverse = np.unique(key, return_inverse=True)
    shares = np.bincount(inverse, mattes.shares, len(unique)).astype(np.float32)
    low = np.uint64(0xFFFFFFFF)
    return (unique >> np.uint64(32)).astype(np.uint32), (unique & low).astype(np.uint32), shares

"""Sums of samples as a value: saved, loaded and merged, so that several processes can share one still."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError
from lightdepth.film.arrays_file import read_arrays, write_arrays
from lightdepth.film.film_regions import common, gaps
from lightdepth.film.schedule import Region

KIND = "lightdepth sums"
ARRAYS: dict[str, tuple[type[np.generic], int]] = {
    "pixels": (np.uint32, 1),
    "taken": (np.uint32, 1),
    "change": (np.float32, 3),
    "synthetic": (np.float32, 3),
    "squares": (np.float32, 3),
    "covered": (np.float32, 1),
    "light_change": (np.float32, 3),
    "light_synthetic": (np.float32, 3),
    "light_squares": (np.float32, 1),
}
"""Type of each array and its numbers per pixel."""


@dataclass(frozen=True)
class Share:
    """Share ``index`` of ``count`` of a still's samples, which one process takes.

    Camera paths are divided by pixels, packet by packet in turn, so that shares cost about the same; of the light paths, a
    share takes every ``count``-th block.

    Attributes:
        index: from 0 on.
        count: how many there are.
    """

    index: int = 0
    count: int = 1

    PACKET = 16

    def __post_init__(self) -> None:
        if not 0 <= self.index < self.count:
            raise InputError(f"share {self.index + 1}/{self.count}: the first number must be from 1 to the second")

    @classmethod
    def parse(cls, text: str) -> Share:
        """A share as it is written, counted from 1: ``2/4`` is the second of four.

        Raises:
            InputError: it is not written so.
        """
        index, _, count = text.partition("/")
        if not (index.isascii() and index.isdigit() and count.isascii() and count.isdigit()):
            raise InputError(f"share '{text}': write it as 2/4, the second of four")
        return cls(int(index) - 1, int(count))

    def __str__(self) -> str:
        return f"{self.index + 1}/{self.count}"

    def owns(self, slots: NDArray[np.integer]) -> NDArray[np.bool_]:
        """Which indices into the list of pixels belong to this share, shape as ``slots``."""
        if self.count == 1:
            return np.ones(slots.shape, bool)
        return (slots // self.PACKET) % self.count == self.index


@dataclass(frozen=True)
class Origin:
    """Which picture sums belong to; only sums of equal origin can be merged.

    Attributes:
        scene: digest of the scene, see :func:`~lightdepth.scene.identity.scene_digest`.
        view: digest of the camera and its pose.
        method: name of the method.
        seed: of the random numbers.
        size: width and height in pixels.
        samples: per pixel, on average, that the whole picture has in the end.
        version: of lightdepth.
        path: the scene file, for the command that merges; does not count for equality.
        camera: the camera's name, likewise.
        draft: whether it is a draft.
    """

    scene: str
    view: str
    method: str
    seed: int
    size: tuple[int, int]
    samples: int
    version: str
    path: str = field(default="", compare=False)
    camera: str = field(default="", compare=False)
    draft: bool = False

    def difference(self, other: Origin) -> str | None:
        """The first thing in which two origins differ, in words; ``None`` where there is none."""
        for each in fields(self):
            mine, theirs = getattr(self, each.name), getattr(other, each.name)
            if each.compare and mine != theirs:
                shown = "" if each.name in ("scene", "view") else f" ({theirs} and {mine})"
                return f"another {'camera' if each.name == 'view' else each.name}{shown}"
        return None


@dataclass(frozen=True)
class PixelSums:
    """Sums over the samples of n pixels.

    Attributes:
        origin: the picture that they belong to.
        shares: which shares of the still are in them.
        of: how many shares there are.
        pixels: row-major indices into the image, ascending, shape (n,), uint32.
        taken: samples of each, shape (n,), uint32.
        change: sums of the change of support surfaces' radiance, shape (n, 3), float32.
        synthetic: sums of the radiance of new objects, shape (n, 3), float32.
        squares: sums of the squares of ``change + synthetic``, shape (n, 3), float32.
        covered: samples that met a new object, shape (n,), float32.
        light_change: sums of splats on support surfaces, shape (n, 3), float32.
        light_synthetic: likewise to new objects, shape (n, 3), float32.
        light_squares: squares of each splat, mean of the channels, shape (n,), float32.
        light_count: light paths; each of the three divided by it is a mean.
        light_list_error: estimated relative error that the light lists give all pixels; 0 where it is not known.
        cache_error: likewise of the radiance cache.
        regions: the parts of the film that they are of, none of which meets another; empty for all of it.
    """

    origin: Origin
    shares: tuple[int, ...]
    of: int
    pixels: NDArray[np.uint32]
    taken: NDArray[np.uint32]
    change: NDArray[np.float32]
    synthetic: NDArray[np.float32]
    squares: NDArray[np.float32]
    covered: NDArray[np.float32]
    light_change: NDArray[np.float32]
    light_synthetic: NDArray[np.float32]
    light_squares: NDArray[np.float32]
    light_count: int = 0
    light_list_error: float = 0.0
    cache_error: float = 0.0
    regions: tuple[Region, ...] = ()

    @property
    def complete(self) -> bool:
        """Whether all shares and regions of the still are there."""
        return not self.missing

    @property
    def missing(self) -> tuple[str, ...]:
        """The shares and regions that the whole still lacks, in words."""
        shares = [f"{share + 1}/{self.of}" for share in range(self.of) if share not in self.shares]
        left = gaps(self.regions, self.origin.size) if self.regions else []
        return (*shares, *(f"the region {_written(region)}" for region in left))

    def within(self, region: Region) -> PixelSums:
        """Those of the pixels in ``region`` alone: columns and rows (left, top, right, bottom), the last two beyond.

        Raises:
            InputError: it has no pixel that they are of.
        """
        film = (0, 0, *self.origin.size)
        regions = tuple(kept for each in self.regions or (film,) if (kept := common(each, region)) is not None)
        if not regions:
            raise InputError(f"region = {region}: the sums have no pixel in it")
        left, top, right, bottom = region
        row, column = np.divmod(self.pixels, np.uint32(self.origin.size[0]))
        inside = (column >= left) & (column < right) & (row >= top) & (row < bottom)
        arrays = {name: getattr(self, name)[inside] for name in ARRAYS}
        return replace(self, **arrays, regions=() if regions == (film,) else regions)

    def save(self, path: Path) -> None:
        """Write them to a file, which appears whole or not at all.

        Raises:
            InputError: it cannot be written.
        """
        write_arrays(path, KIND, self.header(), self.arrays())

    def header(self) -> dict[str, Any]:
        """All but the arrays, as plain values."""
        return {
            "origin": {**vars(self.origin), "size": list(self.origin.size)},
            "shares": list(self.shares),
            "of": self.of,
            "light_count": self.light_count,
            "light_list_error": self.light_list_error,
            "cache_error": self.cache_error,
            "regions": [list(region) for region in self.regions],
        }

    def arrays(self) -> dict[str, NDArray]:
        """The arrays by name."""
        return {name: getattr(self, name) for name in ARRAYS}

    @classmethod
    def load(cls, path: Path) -> PixelSums:
        """Read a file that :meth:`save` wrote.

        Raises:
            InputError: it is missing, damaged, or something else.
        """
        return cls.from_arrays(path, *read_arrays(path, KIND))

    @classmethod
    def from_arrays(cls, path: Path, header: dict[str, Any], arrays: dict[str, NDArray]) -> PixelSums:
        """The sums out of :meth:`header` and :meth:`arrays`, checked; ``path`` is for messages.

        Raises:
            InputError: something is missing or does not fit.
        """
        try:
            origin = Origin(**{**header["origin"], "size": tuple(header["origin"]["size"])})
            sums = cls(
                origin,
                tuple(int(share) for share in header["shares"]),
                int(header["of"]),
                **{name: arrays[name] for name in ARRAYS},
                light_count=int(header["light_count"]),
                light_list_error=float(header["light_list_error"]),
                cache_error=float(header["cache_error"]),
                regions=tuple((int(x0), int(y0), int(x1), int(y1)) for x0, y0, x1, y1 in header["regions"]),
            )
            count = len(sums.pixels)
            for name, (kind, numbers) in ARRAYS.items():
                array = arrays[name]
                if array.dtype != kind or array.shape != ((count,) if numbers == 1 else (count, numbers)):
                    raise ValueError(name)
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"{path}: its contents are damaged ({error})") from error
        return sums


def merge(parts: Sequence[PixelSums], names: Sequence[str] | None = None) -> PixelSums:
    """Sums of several parts of one picture together, in any order of the parts.

    Args:
        parts: at least one; no share of a pixel may be in two of them.
        names: what the parts are called in messages; numbers by default.

    Returns:
        The sums, for every pixel that is in any of the parts. Where a pixel is in one part only, its sums are that
        part's, bit for bit. What is missing is named by :attr:`PixelSums.missing`.

    Raises:
        InputError: there is nothing to merge, or the parts do not belong together.
    """
    called = list(names) if names is not None else [f"part {i + 1}" for i in range(len(parts))]
    if not parts:
        raise InputError("no parts to merge were given")
    groups: dict[tuple[int, ...], list[tuple[PixelSums, str]]] = {}
    for part, name in zip(parts, called, strict=True):
        different = parts[0].origin.difference(part.origin)
        if different is None and part.of != parts[0].of:
            different = f"another division ({part.of} and {parts[0].of} shares)"
        if different is not None:
            raise InputError(f"{name}: does not belong to {called[0]}: it has {different}")
        for other, its in (member for group in groups.values() for member in group):
            _must_be_apart(part, name, other, its)
        groups.setdefault(part.shares, []).append((part, name))
    (regions, first), *others = [_regions_of(group) for group in groups.values()]
    for theirs, name in others:
        if theirs != regions:
            raise InputError(
                f"{name}: does not belong to {first}: it has other regions "
                f"({_all_written(theirs)} and {_all_written(regions)})"
            )
    pixels = np.unique(np.concatenate([part.pixels for part in parts])).astype(np.uint32)
    total: dict[str, NDArray] = {
        name: np.zeros((len(pixels),) if numbers == 1 else (len(pixels), numbers), kind)
        for name, (kind, numbers) in ARRAYS.items()
    }
    total["pixels"] = pixels
    # In the order of the shares, so that the result does not depend on that of the files.
    for part in sorted(parts, key=lambda part: part.shares):
        index = np.searchsorted(pixels, part.pixels)
        for name in ARRAYS:
            if name != "pixels":
                total[name][index] += getattr(part, name)
    return PixelSums(
        parts[0].origin,
        tuple(sorted(share for shares in groups for share in shares)),
        parts[0].of,
        **total,
        # The regions of a share have the same paths from the light.
        light_count=sum(group[0][0].light_count for group in groups.values()),
        # All parts have the same lists and the same cache: each has estimated the same errors in pixels of its own.
        light_list_error=math.sqrt(sum(part.light_list_error**2 for part in parts) / len(parts)),
        cache_error=math.sqrt(sum(part.cache_error**2 for part in parts) / len(parts)),
        regions=regions,
    )


def _must_be_apart(part: PixelSums, name: str, other: PixelSums, its: str) -> None:
    """Refuse parts that have a share of a pixel in common."""
    film = (0, 0, *part.origin.size)
    meeting = [common(one, two) for one in part.regions or (film,) for two in other.regions or (film,)]
    region = next((each for each in meeting if each is not None), None)
    share = next((share for share in part.shares if share in other.shares), None)
    if share is None or (region is None and part.shares == other.shares):
        return
    if region is None:
        raise InputError(
            f"{name}: holds other shares ({_parts(part)}) than {its} ({_parts(other)}), and of other regions"
        )
    where = "" if region == film else f" of the region {_written(region)}"
    raise InputError(f"{name}: holds share {share + 1}/{part.of}{where}, which is in {its} as well")


def _regions_of(group: Sequence[tuple[PixelSums, str]]) -> tuple[tuple[Region, ...], str]:
    """The regions of all sums of the same shares, and the name of the first; empty where they are the film.

    Raises:
        InputError: they are not of the same paths from the light.
    """
    first, name = group[0]
    for part, its in group:
        if part.light_count != first.light_count:
            raise InputError(
                f"{its}: does not belong to {name}: it is of another number of light paths "
                f"({part.light_count} and {first.light_count})"
            )
    regions = tuple(sorted(region for part, _ in group for region in part.regions))
    return (regions if gaps(regions, first.origin.size) else ()), name


def _parts(sums: PixelSums) -> str:
    return ", ".join(f"{share + 1}/{sums.of}" for share in sums.shares)


def _written(region: Region) -> str:
    return ",".join(map(str, region))


def _all_written(regions: Sequence[Region]) -> str:
    return " ".join(map(_written, regions)) or "all"

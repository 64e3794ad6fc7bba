"""Which photographs of a folder belong to one bracket."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from lightdepth.capture.exposure import Exposure, read_exposures
from lightdepth.capture.photograph import PHOTOGRAPHS
from lightdepth.errors import InputError, warn

Bracket = list[tuple[Path, Exposure]]

SAME = 0.1
"""Exposures that differ by less, in stops, are the same."""


def brackets_in_folder(folder: Path, table: Path | None = None, size: int | None = None) -> list[Bracket]:
    """Group a folder's photographs into brackets, one for each orientation, in the order in which they were taken.

    Folders within the folder hold one bracket each. Otherwise see :func:`group_by_exposure`.

    Args:
        folder: holds photographs, or folders of photographs.
        table: exposures by file name, see :func:`lightdepth.capture.exposure.read_exposures`.
        size: photographs in a bracket, where the user states it.

    Raises:
        InputError: there are no photographs, or their number is no multiple of ``size``.
    """
    inner = [path for path in sorted(folder.iterdir()) if path.is_dir() and _photographs(path)]
    if inner:
        return [_in_order(_photographs(path), table) for path in inner]
    photographs = _in_order(_photographs(folder), table)
    if not photographs:
        raise InputError(f"{folder}: holds no photographs; allowed are {', '.join(PHOTOGRAPHS)}")
    if size is not None:
        if size < 1 or len(photographs) % size:
            raise InputError(f"{folder}: holds {len(photographs)} photographs, no multiple of --bracket {size}")
        return [photographs[start : start + size] for start in range(0, len(photographs), size)]
    return group_by_exposure(photographs)


def group_by_exposure(photographs: Sequence[tuple[Path, Exposure]]) -> list[Bracket]:
    """Split a sequence of photographs into brackets.

    Where the sequence of exposures comes again and again, its period is the bracket, whose exposures may repeat; the
    last one may lack some. Otherwise a bracket begins where an exposure occurs that the present one has already; where
    that gives no groups of (almost) the same exposures, every photograph stands alone, with a warning.
    """
    period = _period(photographs)
    if period is not None:
        return [list(photographs[start : start + period]) for start in range(0, len(photographs), period)]
    groups: list[Bracket] = []
    for photograph in photographs:
        if not groups or _contains(groups[-1], photograph[1]):
            groups.append([])
        groups[-1].append(photograph)
    largest = max(groups, key=len)
    alike = all(
        len(group) * 3 >= len(largest) * 2 and all(_contains(largest, exposure) for _, exposure in group)
        for group in groups
    )
    if alike and len(largest) > 1:
        return groups
    if len(largest) > 1:
        warn(
            f"{photographs[0][0].parent}: the exposures of the {len(photographs)} photographs follow no pattern, so each "
            "is taken as an orientation of its own; if they are brackets, give their size as --bracket"
        )
    return [[photograph] for photograph in photographs]


def _period(photographs: Sequence[tuple[Path, Exposure]]) -> int | None:
    """After how many photographs the exposures come again; ``None`` where they do not, or are all the same."""
    exposures = [exposure for _, exposure in photographs]
    if all(_same(exposure, exposures[0]) for exposure in exposures):
        return None
    for period in range(2, len(exposures) // 2 + 1):
        if all(_same(before, after) for before, after in zip(exposures, exposures[period:], strict=False)):
            return period
    return None


def _same(one: Exposure, other: Exposure) -> bool:
    return 2.0**-SAME < one.amount / other.amount < 2.0**SAME


def _contains(group: Bracket, exposure: Exposure) -> bool:
    return any(_same(other, exposure) for _, other in group)


def _photographs(folder: Path) -> list[Path]:
    return sorted(path for path in folder.iterdir() if path.is_file() and path.suffix.lower() in PHOTOGRAPHS)


def _in_order(paths: list[Path], table: Path | None) -> Bracket:
    pairs = list(zip(paths, read_exposures(paths, table), strict=True))
    if all(exposure.taken is not None for _, exposure in pairs):
        pairs.sort(key=lambda pair: (pair[1].taken, pair[0].name))
    return pairs

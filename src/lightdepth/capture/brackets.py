"""Which photographs of a folder belong to one bracket."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path

from lightdepth.capture.exposure import Exposure, read_exposures
from lightdepth.capture.photograph import OTHER_PICTURES, PHOTOGRAPHS
from lightdepth.errors import InputError, warn
from lightdepth.parameters.capture import DEFAULT, CaptureParameters

Bracket = list[tuple[Path, Exposure]]

_NUMBERS = re.compile(r"([^0-9]*)([0-9]*)")


def brackets_in_folder(
    folder: Path, table: Path | None = None, size: int | None = None, tuned: CaptureParameters = DEFAULT
) -> list[Bracket]:
    """Group a folder's photographs into brackets, one for each orientation, in the order in which they were taken.

    Folders within the folder hold one bracket each. Otherwise see :func:`group_by_exposure`.

    Args:
        folder: holds photographs, or folders of photographs.
        table: exposures by file name, see :func:`lightdepth.capture.exposure.read_exposures`.
        size: photographs in a bracket, where the user states it.
        tuned: which exposures are the same.

    Raises:
        InputError: there are no photographs, or their number is no multiple of ``size``.
    """
    folders = in_order(path for path in folder.iterdir() if path.is_dir() and not path.name.startswith("."))
    inside = {path: _photographs(path) for path in folders}
    here = _photographs(folder)
    if any(inside.values()):
        if here:
            raise InputError(
                f"{folder}: holds photographs, such as {here[0].name}, and folders of them, such as "
                f"{next(path.name for path, inner in inside.items() if inner)}; allowed are either"
            )
        return [_by_time(inner, table) for inner in inside.values() if inner]
    photographs = _by_time(here, table)
    if not photographs:
        raise InputError(f"{folder}: holds no photographs; allowed are {', '.join(PHOTOGRAPHS)}")
    if size is not None:
        if size < 1 or len(photographs) % size:
            raise InputError(f"{folder}: holds {len(photographs)} photographs, not a multiple of --bracket {size}")
        return [photographs[start : start + size] for start in range(0, len(photographs), size)]
    return group_by_exposure(photographs, tuned)


def group_by_exposure(
    photographs: Sequence[tuple[Path, Exposure]], tuned: CaptureParameters = DEFAULT
) -> list[Bracket]:
    """Split a sequence of photographs into brackets.

    Where the sequence of exposures comes again and again, its period is the bracket, whose exposures may repeat; the
    last one may lack some. So it is where only the steps between the exposures come again, as with a camera that meters
    each bracket for itself. Otherwise a bracket begins where an exposure occurs that the present one has already; where
    that gives no groups of (almost) the same exposures, every photograph stands alone, with a warning.

    Args:
        photographs: with their exposures, in the order in which they were taken.
        tuned: which exposures are the same.
    """
    period = _period(photographs, tuned) or _period_of_steps(photographs, tuned)
    if period is not None:
        return [list(photographs[start : start + period]) for start in range(0, len(photographs), period)]
    groups: list[Bracket] = []
    for photograph in photographs:
        if not groups or _contains(groups[-1], photograph[1], tuned):
            groups.append([])
        groups[-1].append(photograph)
    largest = max(groups, key=len)
    alike = all(
        len(group) * 3 >= len(largest) * 2 and all(_contains(largest, exposure, tuned) for _, exposure in group)
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


def _period(photographs: Sequence[tuple[Path, Exposure]], tuned: CaptureParameters) -> int | None:
    """After how many photographs the exposures come again; ``None`` where they do not, or are all the same."""
    exposures = [exposure for _, exposure in photographs]
    if all(_same(exposure, exposures[0], tuned) for exposure in exposures):
        return None
    for period in range(2, len(exposures) // 2 + 1):
        if all(_same(before, after, tuned) for before, after in zip(exposures, exposures[period:], strict=False)):
            return period
    return None


def _period_of_steps(photographs: Sequence[tuple[Path, Exposure]], tuned: CaptureParameters) -> int | None:
    """After how many photographs the steps in exposure come again, from about where they began."""
    stops = [math.log2(exposure.amount) for _, exposure in photographs]
    steps = [after - before for before, after in pairwise(stops)]
    for period in range(2, len(stops) // 2 + 1):
        first = stops[:period]
        span = max(first) - min(first)
        within = [index for index in range(len(steps) - period) if index % period != period - 1]
        begins = [min(stops[start : start + period]) for start in range(0, len(stops) - period + 1, period)]
        if (
            span > tuned.bracket_least_span
            and all(abs(steps[index] - steps[index + period]) < tuned.bracket_same for index in within)
            and all(abs(begin - begins[0]) < span / 2.0 for begin in begins)  # Else it is one bracket in equal steps.
        ):
            return period
    return None


def _same(one: Exposure, other: Exposure, tuned: CaptureParameters) -> bool:
    return 2.0**-tuned.bracket_same < one.amount / other.amount < 2.0**tuned.bracket_same


def _contains(group: Bracket, exposure: Exposure, tuned: CaptureParameters) -> bool:
    return any(_same(other, exposure, tuned) for _, other in group)


def _photographs(folder: Path) -> list[Path]:
    """The photographs of a folder by name; other pictures are named in a warning."""
    files = files_of(folder)
    others = [path.name for path in files if path.suffix.lower() in OTHER_PICTURES]
    if others:
        warn(
            f"{folder}: {len(others)} pictures of other kinds are left out, such as {others[0]}; photographs are "
            f"{', '.join(PHOTOGRAPHS)}"
        )
    return [path for path in files if path.suffix.lower() in PHOTOGRAPHS]


def files_of(folder: Path) -> list[Path]:
    """The files of a folder in order; hidden ones, as macOS keeps beside every file on a card, are left out."""
    return in_order(path for path in folder.iterdir() if path.is_file() and not path.name.startswith("."))


def in_order(paths: Iterable[Path]) -> list[Path]:
    """Paths by name, as a camera or a person numbers them: 2 before 10."""
    return sorted(paths, key=lambda path: [(text, int(number or -1)) for text, number in _NUMBERS.findall(path.name)])


def _by_time(paths: list[Path], table: Path | None) -> Bracket:
    pairs = list(zip(paths, read_exposures(paths, table), strict=True))
    if all(exposure.taken is not None for _, exposure in pairs):
        pairs.sort(key=lambda pair: pair[1].taken or 0.0)  # Those of one second stay in the order of their names.
    return pairs

"""Known orientations of the camera, as a panoramic tripod head sets them."""

from __future__ import annotations

from pathlib import Path

from lightdepth.errors import InputError

Rig = list[tuple[float, float, float]]
"""Yaw (to the right), pitch (up) and roll of each photograph, in degrees."""


def _ring(count: int) -> Rig:
    return [(360.0 * index / count, 0.0, 0.0) for index in range(count)]


_ZENITH, _NADIR = (0.0, 90.0, 0.0), (0.0, -90.0, 0.0)

PRESETS: dict[str, Rig] = {
    "paper": [*_ring(5), _ZENITH, _NADIR],
    "three": _ring(3),
    "four": _ring(4),
    "four+zenith": [*_ring(4), _ZENITH],
    "six+zenith+nadir": [*_ring(6), _ZENITH, _NADIR],
}
"""Rigs by name. "paper" is that of Zang, Felinto and Velho: five around, zenith, nadir."""


def parse_rig(text: str, count: int) -> Rig:
    """A rig by its name, as ``yaw,pitch yaw,pitch ...``, or in a text file that holds such pairs.

    Args:
        text: what the user gave; a third number is the roll.
        count: how many orientations were photographed.

    Raises:
        InputError: it is none of these, or has another number of orientations.
    """
    if text in PRESETS:
        rig = PRESETS[text]
    else:
        try:
            rig = [_orientation(pair) for pair in _pairs(text).split()]
        except ValueError as error:
            raise InputError(
                f"--rig is '{text}'; allowed are {', '.join(PRESETS)}, pairs such as \"0,0 72,0 0,90\" "
                "(yaw to the right and pitch up in degrees), or a file with such pairs"
            ) from error
    if len(rig) != count:
        raise InputError(f"--rig '{text}' has {len(rig)} orientations, but {count} were photographed; they must agree")
    return rig


def _pairs(text: str) -> str:
    """What the file of this name holds, or the text itself."""
    try:
        return Path(text).read_text(encoding="utf-8-sig") if Path(text).is_file() else text
    except OSError:  # Many pairs make a longer name than a file may have.
        return text


def _orientation(pair: str) -> tuple[float, float, float]:
    numbers = [float(number) for number in pair.split(",")]
    if len(numbers) not in (2, 3) or not all(abs(number) <= 360.0 for number in numbers):
        raise ValueError(pair)
    return numbers[0], numbers[1], numbers[2] if len(numbers) == 3 else 0.0

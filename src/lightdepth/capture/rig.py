"""Known orientations of the camera, as a panoramic tripod head sets them."""

from __future__ import annotations

from pathlib import Path

from lightdepth.errors import InputError

Rig = list[tuple[float, float]]
"""Yaw (to the right) and pitch (up) of each photograph, in degrees."""

PRESETS: dict[str, Rig] = {
    "paper": [(0, 0), (72, 0), (144, 0), (216, 0), (288, 0), (0, 90), (0, -90)],
    "four": [(0, 0), (90, 0), (180, 0), (270, 0)],
    "four+zenith": [(0, 0), (90, 0), (180, 0), (270, 0), (0, 90)],
    "six+zenith+nadir": [(60 * index, 0) for index in range(6)] + [(0, 90), (0, -90)],
}
"""Rigs by name. "paper" is that of Zang, Felinto and Velho: five around, zenith, nadir."""


def parse_rig(text: str, count: int) -> Rig:
    """A rig by its name, as ``yaw,pitch yaw,pitch ...``, or a text file that holds such pairs.

    Args:
        text: what the user gave.
        count: how many orientations were photographed.

    Raises:
        InputError: it is none of these, or has another number of orientations.
    """
    if text in PRESETS:
        rig = PRESETS[text]
    else:
        pairs = Path(text).read_text() if Path(text).is_file() else text
        try:
            rig = [(float(yaw), float(pitch)) for yaw, pitch in (pair.split(",") for pair in pairs.split())]
        except ValueError as error:
            raise InputError(
                f"--rig is '{text}'; allowed are {', '.join(PRESETS)}, pairs such as \"0,0 72,0 0,90\" "
                "(yaw to the right, pitch up, in degrees), or a file with such pairs"
            ) from error
    if len(rig) != count:
        raise InputError(f"--rig '{text}' has {len(rig)} orientations, but {count} were photographed; they must agree")
    return rig

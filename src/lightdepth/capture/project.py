"""Hugin's project files: reading what its tools have found."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lightdepth.capture.lens import PROJECTIONS, Lens
from lightdepth.errors import LightdepthError

_VALUE = re.compile(r'(?<![\w"])(Vm|[a-zA-Z][a-zA-Z]*?)(=?)(-?\d[-+.\deE]*)(?=\s|,|$)')
_NAMES = {number: name for name, number in PROJECTIONS.items()} | {3: "fisheye"}


@dataclass(frozen=True)
class ControlPoint:
    """The same point of the place in two photographs.

    Attributes:
        images: numbers of the two photographs.
        first: pixels ``(x, y)`` in the first.
        second: pixels ``(x, y)`` in the second.
    """

    images: tuple[int, int]
    first: tuple[float, float]
    second: tuple[float, float]


def read_project(path: Path) -> tuple[list[Lens], list[ControlPoint]]:
    """Lenses with poses, and control points, of a project file.

    Raises:
        LightdepthError: the file is not one that this program understands.
    """
    lenses: list[dict[str, float]] = []
    points = []
    for line in path.read_text().splitlines():
        if line.startswith("i "):
            values = {}
            for name, link, number in _VALUE.findall(line.split(' n"')[0]):
                # "v=0" means: linked to photograph 0, which stands earlier in the file.
                values[name] = lenses[int(number)][name] if link else float(number)
            lenses.append(values)
        elif line.startswith("c "):
            fields = dict(re.findall(r"([nNxyXYt])(-?[\d.eE+-]+)", line))
            if fields.get("t", "0") == "0":
                points.append(
                    ControlPoint(
                        (int(fields["n"]), int(fields["N"])),
                        (float(fields["x"]), float(fields["y"])),
                        (float(fields["X"]), float(fields["Y"])),
                    )
                )
    try:
        return [_lens(values) for values in lenses], points
    except KeyError as error:
        raise LightdepthError(
            f"{path}: Hugin's project file lacks the value {error}, or it is an unknown one"
        ) from error


def angle_between(lenses: Sequence[Lens], point: ControlPoint, offset: float = 0.5) -> float:
    """Angle in degrees between the directions in which two photographs show a control point.

    Args:
        lenses: lenses and poses of all photographs.
        point: the control point.
        offset: added to its pixels; Hugin counts from the centre of the first pixel, lenses from its corner.
    """
    first, second = (
        lenses[image].unproject(x + offset, y + offset)
        for image, (x, y) in zip(point.images, (point.first, point.second), strict=True)
    )
    return float(np.degrees(2.0 * np.arcsin(min(float(np.linalg.norm(first - second)) / 2.0, 1.0))))


def _lens(values: dict[str, float]) -> Lens:
    return Lens(
        width=int(values["w"]),
        height=int(values["h"]),
        projection=_NAMES[int(values["f"])],
        fov=values["v"],
        distortion=(values["a"], values["b"], values["c"]),
        shift=(values["d"], values["e"]),
        yaw=values["y"],
        pitch=values["p"],
        roll=values["r"],
    )

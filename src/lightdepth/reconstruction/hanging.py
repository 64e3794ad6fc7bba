"""Lamps that hang from the ceiling: spheres and boxes, placed by their pixels."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
import trimesh
from numpy.typing import NDArray

from lightdepth.calibration.clicks import read_clicks
from lightdepth.errors import InputError
from lightdepth.parameters.reconstruction import DEFAULT, ClickParameters
from lightdepth.reconstruction.pose import Pose
from lightdepth.scene.model import Mesh, RealSurface, Role

FloatArray = NDArray[np.float64]

FORM = (
    "write it as 'NAME: at=X,Y from=X,Y rim=X,Y', with the pixels of its middle, of where it hangs from the ceiling, and "
    "of its rim; instead of 'from', 'height=METRES' of its middle above the floor; instead of 'rim', 'radius=METRES' of a "
    "sphere or 'size=X,Y,Z' of a box, metres along the world's axes"
)


def hanging_lamp(
    text: str,
    number: int,
    size: tuple[int, int] | None,
    pose: Pose,
    floor: float,
    planes: Sequence[FloatArray],
    tuned: ClickParameters = DEFAULT.clicks,
) -> list[RealSurface]:
    """A lamp as it was written; see ``FORM``.

    Args:
        text: ``NAME: at=X,Y ...``.
        number: which of its kind, from 1, for its name.
        size: height and width of the panorama in pixels, or ``None`` where clicks are angles.
        pose: of the panorama.
        floor: height of the floor, world z, metres.
        planes: of the ceiling, each ``(a, b, c)`` of ``z = a x + b y + c``; none outdoors.
        tuned: how exactly it must hang below its click.

    Returns:
        One surface (environment) whose faces look outward.

    Raises:
        InputError: it is written otherwise, or the clicks do not fit together.
    """
    what = f"--lamp '{text}'"
    name, colon, rest = text.rpartition(":")
    settings = dict(word.split("=", 1) for word in rest.split() if "=" in word)
    well_formed = (
        len(settings) == len(rest.split()) == 3
        and "at" in settings
        and len(settings.keys() & {"from", "height"}) == 1
        and len(settings.keys() & {"rim", "radius", "size"}) == 1
        and (not colon or re.fullmatch(r"[A-Za-z0-9][\w-]*", name.strip()))
    )
    if not well_formed:
        raise InputError(f"{what}: {FORM}")

    def click(key: str) -> FloatArray:
        return pose.to_world(read_clicks(settings[key], size, f"{what}: {key}", 1)[0])

    toward = click("at")
    if "from" in settings:
        distance = _below(click("from"), toward, pose, planes, what, tuned.lamp_beside)
    else:
        (height,) = _numbers(settings["height"], 1, f"{what}: height")
        rise = floor + height - float(pose.position[2])
        if rise * toward[2] <= 0.0 or abs(toward[2]) < 0.01:
            raise InputError(
                f"{what}: its middle is seen {'above' if toward[2] > 0 else 'below'} the horizon, but at height {height:g} "
                f"m it would be {'above' if rise > 0 else 'below'} the camera; near the horizon, give 'from' instead"
            )
        distance = rise / float(toward[2])
    if "size" in settings:
        sides = np.array(_numbers(settings["size"], 3, f"{what}: size"))
        shape = trimesh.creation.box(extents=sides)
        reach = 0.5 * float(np.linalg.norm(sides))
    else:
        if "rim" in settings:
            cosine = float(np.clip(click("rim") @ toward, -1.0, 1.0))
            reach = distance * float(np.sqrt(1.0 - cosine**2))
        else:
            (reach,) = _numbers(settings["radius"], 1, f"{what}: radius")
        if reach <= 0.0:
            raise InputError(f"{what}: 'rim' is where 'at' is; click the edge of the lamp as seen")
        # A faceted sphere of the volume of the round one.
        shape = trimesh.creation.icosphere(subdivisions=tuned.lamp_subdivisions, radius=reach)
        shape.apply_scale((4.0 / 3.0 * np.pi * reach**3 / shape.volume) ** (1.0 / 3.0))
    if distance - reach < tuned.lamp_nearest:
        raise InputError(
            f"{what}: it would reach to the capture point: its middle is {distance:.2f} m away, and it is "
            f"{2 * reach:.2f} m wide"
        )
    vertices = np.asarray(shape.vertices) + pose.position + distance * toward
    mesh = Mesh(vertices.astype(np.float32), np.asarray(shape.faces, dtype=np.int32))
    return [RealSurface(name.strip() or f"lamp-{number}", mesh, Role.ENVIRONMENT)]


def _below(
    mount: FloatArray, toward: FloatArray, pose: Pose, planes: Sequence[FloatArray], what: str, allowed: float
) -> float:
    """Distance of a lamp that hangs plumb below the point where a direction meets the ceiling, metres."""
    if not planes:
        raise InputError(f"{what}: outdoors there is no ceiling to hang from; give 'height' instead of 'from'")
    reaches = []
    for a, b, c in planes:
        slope = float(mount[2] - a * mount[0] - b * mount[1])
        below = float(a * pose.position[0] + b * pose.position[1] + c - pose.position[2])
        if slope > 1e-3:
            reaches.append(below / slope)
    if not reaches:
        raise InputError(f"{what}: 'from' must be above the horizon, where the lamp hangs from the ceiling")
    point = min(reaches) * mount
    level = float(np.linalg.norm(point[:2]))
    beside = np.degrees(np.arctan2(point[0], point[1]) - np.arctan2(toward[0], toward[1]))
    beside = abs((beside + 180.0) % 360.0 - 180.0)
    if beside > allowed:
        raise InputError(
            f"{what}: its middle is {beside:.1f} degrees of azimuth beside where it hangs from; it hangs plumb, so that up "
            f"to {allowed:g} are allowed"
        )
    distance = level / max(float(np.linalg.norm(toward[:2])), 1e-6)
    if distance * toward[2] > point[2]:
        raise InputError(f"{what}: its middle is above the ceiling; 'from' is where it hangs from, 'at' its middle")
    return distance


def _numbers(text: str, count: int, what: str) -> list[float]:
    try:
        values = [float(word) for word in text.split(",")]
    except ValueError:
        values = []
    if len(values) != count or not all(0.0 < value < np.inf for value in values):
        raise InputError(f"{what}: '{text}' is not {count} positive number{'s' if count > 1 else ''}; {FORM}")
    return values

"""What a reconstruction starts from: a panorama and its pose, from a scene file where there is one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from lightdepth.directions import euler_rotation, rotation_to_euler
from lightdepth.errors import InputError, warn
from lightdepth.images.panorama_file import read_panorama
from lightdepth.images.validation import validate_panorama
from lightdepth.reconstruction.pose import Pose
from lightdepth.scene.animation import Animation
from lightdepth.scene.problems import Problems
from lightdepth.scene.schema import PanoramaTable, SceneFile
from lightdepth.toml_file import read_toml

Three = tuple[float, float, float]


@dataclass(frozen=True)
class PosedPanorama:
    """The panorama that a reconstruction starts from.

    Attributes:
        pose: of the panorama.
        rotation_degrees: the pose's rotation as XYZ Euler angles, for a new scene file.
        radiance: linear RGB, shape (height, 2 height, 3), float32; ``None`` where no panorama was given.
        image: the panorama's file.
        notes: what of that file makes pictures wrong in places, a sentence each.
    """

    pose: Pose
    rotation_degrees: Three
    radiance: NDArray[np.float32] | None = None
    image: Path | None = None
    notes: tuple[str, ...] = ()


def read_posed_panorama(
    path: Path | None,
    position: Three | None = None,
    rotation: Three | None = None,
    default_height: float | None = None,
) -> PosedPanorama:
    """Read a panorama, or the first ``[[panorama]]`` of a scene file whose meshes need not exist yet.

    Args:
        path: a panorama or a scene file (.toml), or ``None``.
        position: capture point, world, metres; it goes before that of the scene file.
        rotation: light space to world, XYZ Euler, degrees; it goes before that of the scene file, and that before what
            the panorama's metadata says.
        default_height: z of the capture point where nothing else gives a position, metres.

    Raises:
        InputError: the file or its panorama is missing or wrong, or nothing gives a position.
    """
    image, radiance = path, None
    if path is not None and path.suffix.lower() == ".toml":
        table = _panorama_table(path)
        image = table.image
        position, rotation = position or table.position, rotation or table.rotation
    notes: tuple[str, ...] = ()
    if image is not None:
        found = read_panorama(image)
        radiance, notes = validate_panorama(found.radiance, image), found.notes
        if rotation is None and found.rotation is not None:
            rotation = _rounded(rotation_to_euler(found.rotation))
    if position is None:
        if default_height is None:
            raise InputError('the capture point is not known: give a scene file, or --position "x,y,z" in metres')
        position = (0.0, 0.0, default_height)
    rotation = rotation or (0.0, 0.0, 0.0)
    return PosedPanorama(Pose(np.array(position), euler_rotation(rotation)), rotation, radiance, image, notes)


def check_same_size(path: Path, shape: tuple[int, ...], panorama: PosedPanorama) -> None:
    """Warn of a depth image whose size cannot come from the panorama's by scaling.

    Args:
        path: of the depth image.
        shape: of it.
        panorama: it is for.
    """
    if panorama.radiance is None:
        return
    rows, own = panorama.radiance.shape[0], shape[0]
    if max(rows, own) % min(rows, own):
        warn(
            f"{path}: is {2 * own} x {own} pixels, and the panorama {2 * rows} x {rows}; neither size is a multiple of the "
            "other. Both show the whole sphere, so this works; but is it the depth of this panorama?"
        )


def _rounded(degrees: NDArray[np.float64]) -> Three:
    x, y, z = (round(float(angle), 5) + 0.0 for angle in degrees)
    return x, y, z


def parse_three(text: str | None, option: str) -> Three | None:
    """Read ``x,y,z``.

    Raises:
        InputError: it is not three finite numbers.
    """
    if text is None:
        return None
    try:
        x, y, z = (float(word) for word in text.split(","))
        finite = bool(np.isfinite([x, y, z]).all())
    except ValueError:
        finite = False
    if not finite:
        raise InputError(f"{option} '{text}': write three numbers as x,y,z")
    return x, y, z


def _panorama_table(path: Path) -> PanoramaTable:
    text, document = read_toml(path)
    document = {key: value for key, value in document.items() if key in ("panorama", "sequence")}
    animation = Animation(document)
    document = animation.at(animation.sequence.first if animation.sequence else 0)
    try:
        return SceneFile.model_validate(document, context={"folder": path.parent}).panorama[0]
    except ValidationError as error:
        problems = Problems(path, text, document)
        problems.add_all(error, SceneFile)
        raise InputError("\n".join(problems.messages)) from error

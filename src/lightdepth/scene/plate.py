"""The photograph of an ordinary camera that the user gives as the picture of a scene."""

from __future__ import annotations

import shlex
from collections.abc import Mapping

from lightdepth.cameras import Camera, Perspective
from lightdepth.errors import InputError
from lightdepth.images.plate_file import read_plate
from lightdepth.scene.model import Plate
from lightdepth.scene.schema import PlateTable


def read_camera_plate(table: PlateTable, cameras: Mapping[str, Camera | None]) -> Plate | None:
    """Read the plate of a scene file.

    Args:
        table: ``[plate]``.
        cameras: of the scene file, by name; ``None`` stands for a table that is wrong.

    Returns:
        The plate; ``None`` where its camera's table is wrong, which is reported already.

    Raises:
        InputError: the picture cannot be read or has not the size of its camera; there is no such camera, or it is no
            perspective camera.
    """
    if table.camera not in cameras:
        known = f"the scene file has {', '.join(sorted(cameras))}" if cameras else "the scene file has no camera"
        image = shlex.quote(table.image.name)
        raise InputError(
            f"camera: there is no [camera.{table.camera}]; {known}. `lightdepth calibrate view {image} --write` finds the "
            "camera of a photograph"
        )
    camera = cameras[table.camera]
    if camera is None:
        return None
    if not isinstance(camera, Perspective):
        raise InputError(
            f"camera: [camera.{table.camera}] is of type '{camera.type}'; a plate is the picture of a camera of type "
            "'perspective'"
        )
    radiance = read_plate(table.image)
    height, width = radiance.shape[:2]
    if (width, height) != camera.resolution:
        raise InputError(
            f"{table.image}: is {width} x {height} pixels, but [camera.{table.camera}] {camera.width} x {camera.height}; "
            "a plate has the size of its camera: give the camera the plate's width and height (for an undistorted or "
            "scaled picture, calibrate that one)"
        )
    return Plate(radiance, table.camera, table.gain, table.image)

"""``[camera.NAME]`` with ``file``: a camera out of a glTF or USD file becomes one with a pose and a field of view."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from lightdepth.directions import rotation_to_euler
from lightdepth.errors import InputError
from lightdepth.files import is_file
from lightdepth.scene.animation import ShownAnimation
from lightdepth.scene.meshes import gltf_camera
from lightdepth.scene.meshes.file_camera import FileCamera
from lightdepth.scene.meshes.usd import FORMATS, read_usd_camera
from lightdepth.scene.problems import Problems
from lightdepth.scene.values import InputFile, Name, Table

MARK = "file"
"""The key that says that a camera comes out of a file."""
READERS: dict[str, Callable[[Path, str | None, str | None, float, bool], FileCamera]] = {
    ".gltf": gltf_camera.read_camera,
    ".glb": gltf_camera.read_camera,
    **dict.fromkeys(FORMATS, read_usd_camera),
}
"""Readers by file name extension."""
GIVEN = ("position", "rotation", "look_at")
"""What the file says, so that the table must not."""


class CameraFileTable(Table):
    """The keys of a ``[camera.NAME]`` table that take its pose out of a file.

    Attributes:
        file: a glTF or USD file.
        node: name of the node or of the camera, in USD of the prim; may be left out where there is one only.
        animation: that moves it.
    """

    file: InputFile
    node: Name | None = None
    animation: ShownAnimation | None = None


def with_cameras_of_files(
    document: Mapping[str, Any], context: Mapping[str, Any], problems: Problems
) -> Mapping[str, Any]:
    """A scene file's document in which every camera has its pose itself.

    Args:
        document: the document, without tables of keys.
        context: of validation: the scene file's folder and the moment.
        problems: takes what is wrong; such a camera is left out.
    """
    cameras = document.get("camera")
    if not isinstance(cameras, dict):
        return document
    posed: dict[str, Any] = {}
    for name, table in cameras.items():
        if not isinstance(table, dict) or MARK not in table:
            posed[name] = table
            continue
        try:
            posed[name] = _posed(table, context)
        except ValidationError as error:
            problems.add_all(error, CameraFileTable, within=("camera", name))
        except InputError as error:
            problems.add(("camera", name), str(error), MARK)
    return {**document, "camera": posed}


def _posed(table: Mapping[str, Any], context: Mapping[str, Any]) -> dict[str, Any]:
    if twice := [key for key in GIVEN if key in table]:
        raise InputError(f"{' and '.join(twice)}: the camera file gives the position and rotation already")
    own = {key: value for key, value in table.items() if key in CameraFileTable.model_fields}
    wanted = TypeAdapter(CameraFileTable).validate_python(own, context=dict(context))
    shown = wanted.animation
    name, time, loop = (None, 0.0, False) if shown is None else (shown.name, shown.offset, shown.loop)
    camera = read_camera(wanted.file, wanted.node, name, time, loop)
    posed = {key: value for key, value in table.items() if key not in own}
    posed.setdefault("type", "perspective")
    if posed["type"] == "perspective":
        width, height = posed.get("width"), posed.get("height")
        if height is None and camera.aspect is not None and isinstance(width, int):
            height = posed["height"] = max(round(width / camera.aspect), 1)
        if isinstance(width, int) and isinstance(height, int) and width > 0 and height > 0:
            half = math.tan(math.radians(0.5 * camera.vertical_fov)) * width / height
            posed.setdefault("fov", math.degrees(2.0 * math.atan(half)))
    return {
        **posed,
        "position": camera.position.tolist(),
        "rotation": rotation_to_euler(camera.rotation).tolist(),
    }


def read_camera(path: Path, name: str | None, animation: str | None, time: float, loop: bool) -> FileCamera:
    """A camera out of a file, as it is at a time.

    Args:
        path: the file.
        name: of the camera, or of the node that has it; ``None`` where there is one camera only.
        animation: name of the animation that moves it; ``None`` takes the pose without.
        time: in the animation, seconds.
        loop: begin the animation again where it ends.

    Raises:
        InputError: the file is missing, broken or of another format, or has no such camera or no such animation.
        SetupError: the package that reads it is missing.
    """
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: cameras are read from {', '.join(READERS)} files, not from '{path.suffix}'")
    if not is_file(path):
        raise InputError(f"{path}: no such file")
    return reader(path, name, animation, time, loop)

"""Cameras of a scene file as Blender's, such as the lenses that `lightdepth calibrate view` has found."""

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Euler, Matrix, Vector

from .cameras import CAMERA_TURN, PROJECTIONS, panoramic
from .picking import capture_pose
from .reallights import ImportsTables

FISHEYES = {"equidistant": "FISHEYE_EQUIDISTANT", "equisolid": "FISHEYE_EQUISOLID"}
_DEFAULT_FOV = {"perspective": 60.0, "fisheye": 180.0}


class CameraTableError(Exception):
    """A camera that Blender cannot have."""


def show_camera(context, name: str, table: Mapping[str, Any], origin: Vector) -> tuple[int, int]:
    """Make or change the camera that stands for a ``[camera.NAME]`` table.

    Args:
        context: Blender's.
        name: of the camera.
        table: what the file says of it.
        origin: of the scene file in Blender's world.

    Returns:
        Width and height of its picture.

    Raises:
        CameraTableError: it has no counterpart.
        KeyError, TypeError, ValueError: the table is wrong.
    """
    keyed = [key for key, value in table.items() if isinstance(value, Mapping)]
    if keyed:
        raise CameraTableError(f"its {keyed[0]} has keys, which are not taken over")
    item = context.scene.objects.get(name)
    if item is None or item.type != "CAMERA":
        item = bpy.data.objects.new(name, bpy.data.cameras.new(name))
        context.scene.collection.objects.link(item)
    size = _lens(item.data, table)
    pose = capture_pose(context.scene.lightdepth)
    place = Vector(table["position"]) + origin if "position" in table else pose.translation
    if "look_at" in table:
        turned = _looking(Vector(table["look_at"]) + origin - place)
    elif "rotation" in table:
        turned = Euler([math.radians(angle) for angle in table["rotation"]], "XYZ").to_matrix()
    else:
        turned = pose.to_3x3()
    item.matrix_world = Matrix.Translation(place) @ (turned @ CAMERA_TURN.transposed()).to_4x4()
    return size


def _lens(camera, table: Mapping[str, Any]) -> tuple[int, int]:
    kind, width = table["type"], int(table["width"])
    camera.lightdepth.projection, camera.lightdepth.distortion = "CAMERA", (0.0, 0.0)
    camera.shift_x = camera.shift_y = 0.0
    camera.sensor_fit = "AUTO"
    if kind == "perspective":
        return _perspective(camera, table, width)
    camera.type = "PANO"
    settings = panoramic(camera)
    if kind == "equirectangular":
        settings.panorama_type = "EQUIRECTANGULAR"
        return width, width // 2
    if kind == "fisheye":
        mapping, fov = table.get("mapping", "equidistant"), math.radians(table.get("fov", _DEFAULT_FOV[kind]))
        settings.panorama_type, settings.fisheye_fov = FISHEYES[mapping], fov
        settings.fisheye_lens = camera.sensor_width / (4.0 * math.sin(0.25 * fov))
        return width, width
    for name, projection in PROJECTIONS.items():
        if kind == projection.kind and table.get("layout", projection.layout) == projection.layout:
            settings.panorama_type, camera.lightdepth.projection = "EQUIRECTANGULAR", name
            if "interocular_distance" in table:
                camera.stereo.interocular_distance = table["interocular_distance"]
            return width, width * projection.down // projection.across
    raise CameraTableError(f"a camera of type '{kind}' has no counterpart in Blender")


def _perspective(camera, table: Mapping[str, Any], width: int) -> tuple[int, int]:
    camera.type, camera.sensor_fit = "PERSP", "HORIZONTAL"
    height = int(table["height"])
    half = math.tan(math.radians(0.5 * table.get("fov", _DEFAULT_FOV["perspective"])))
    camera.lens = 0.5 * camera.sensor_width / half
    shift = table.get("shift", (0.0, 0.0))
    if "principal_point" in table:
        x, y = table["principal_point"]
        shift = (0.5 - x, (y - 0.5) * height / width)
    camera.shift_x, camera.shift_y = shift
    camera.lightdepth.distortion = table.get("distortion", (0.0, 0.0))
    aperture = table.get("aperture", 0.0)
    camera.dof.use_dof = aperture > 0.0
    if camera.dof.use_dof:
        camera.dof.aperture_fstop = 0.5e-3 * camera.lens / aperture
        camera.dof.focus_distance = table.get("focus_distance", 1.0)
    return width, height


def _looking(direction: Vector) -> Matrix:
    """A level camera that looks along a direction, in the scene file's camera space: +y forward, +z up."""
    forward = direction.normalized()
    right = forward.cross(Vector((0.0, 0.0, 1.0)))
    right = right.normalized() if right.length > 1e-9 else Vector((1.0, 0.0, 0.0))
    return Matrix((right, forward, right.cross(forward))).transposed()


class ImportCameras(bpy.types.Operator, ImportsTables):
    """Take the cameras of a scene file over, with distortion and principal point; the first becomes the active one"""

    bl_idname = "lightdepth.import_cameras"
    bl_label = "Import Cameras"
    key, header = "camera", "[camera.NAME]"

    def shown(self, context, tables, _folder: Path, origin: np.ndarray) -> Iterator[str]:
        """Camera objects for the tables."""
        sizes = {}
        for name, table in tables.items():
            try:
                sizes[name] = show_camera(context, name, table, Vector(origin))
            except CameraTableError as error:
                yield f"Camera '{name}': {error}"
        if sizes:
            yield from _activate(context.scene, sizes)


def _activate(scene, sizes: Mapping[str, tuple[int, int]]) -> Iterator[str]:
    """Make the first camera the scene's, with its resolution; a note where others have another one."""
    first, size = next(iter(sizes.items()))
    scene.camera, render = scene.objects[first], scene.render
    render.resolution_x, render.resolution_y = size
    render.resolution_percentage, render.pixel_aspect_x, render.pixel_aspect_y = 100, 1.0, 1.0
    others = [f"'{name}' ({width} x {height})" for name, (width, height) in sizes.items() if (width, height) != size]
    if others:
        yield f"The resolution is that of '{first}'; other sizes: {', '.join(others)}"


classes = (ImportCameras,)

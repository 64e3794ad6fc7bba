"""Blender's cameras as cameras of the scene file."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import bpy
from mathutils import Matrix

from .picking import capture_pose

FISHEYES = {"FISHEYE_EQUIDISTANT": "equidistant", "FISHEYE_EQUISOLID": "equisolid"}
CAMERA_TURN = Matrix(((1, 0, 0), (0, 0, 1), (0, -1, 0)))
"""Turns the scene file's camera space (looks along +y, z up) into Blender's (looks along -z, y up)."""


class CameraError(Exception):
    """The camera's settings have no counterpart."""


@dataclass(frozen=True)
class Projection:
    """A camera of the scene file that Blender's own panoramic lenses do not have.

    Attributes:
        kind: its ``type`` in the scene file.
        label: its name in Blender.
        description: likewise.
        across: its width, relative to ``down``.
        down: its height.
        layout: the one of its layouts that is meant; ``None`` where it has one alone.
        two_eyes: whether it shows two views, with Blender's interocular distance.
    """

    kind: str
    label: str
    description: str
    across: int
    down: int
    layout: str | None = None
    two_eyes: bool = False


PROJECTIONS = {
    "CUBEMAP": Projection(
        "cubemap", "Cubemap", "Six faces of 90 degrees, three beside each other in two rows", 3, 2, "3x2"
    ),
    "EAC": Projection(
        "eac", "Equi-Angular Cubemap", "As YouTube takes it: three faces beside each other in two rows", 3, 2
    ),
    "VR180": Projection(
        "vr180", "VR180", "The front half of the sphere for each eye, side by side", 2, 1, "side-by-side", two_eyes=True
    ),
}
"""Such cameras by the camera's setting ``projection``. A new one is an entry here."""


@dataclass(frozen=True)
class Eye:
    """One of a camera's views.

    Attributes:
        matrix: where it stands.
        shift_x: of its lens.
        spherical: whether it is one of the two of an omnidirectional stereo panorama, which are rendered at once.
    """

    matrix: Matrix
    shift_x: float
    spherical: bool = False


def panoramic(camera: bpy.types.Camera):
    """Where Blender keeps the settings of panoramic cameras: on the camera since 5.0, in Cycles' settings before."""
    return camera if hasattr(camera, "panorama_type") else camera.cycles


def resolution(scene: bpy.types.Scene) -> tuple[int, int]:
    """Width and height of the whole picture, pixels, rounded as Blender does."""
    render = scene.render
    return (
        render.resolution_x * render.resolution_percentage // 100,
        render.resolution_y * render.resolution_percentage // 100,
    )


def region(scene: bpy.types.Scene) -> tuple[int, int, int, int]:
    """The part of the picture that is rendered: its left and upper edge, width and height, pixels."""
    width, height = resolution(scene)
    render = scene.render
    if not render.use_border:
        return 0, 0, width, height
    left, right = int(render.border_min_x * width), int(render.border_max_x * width)
    bottom, top = int(render.border_min_y * height), int(render.border_max_y * height)
    return left, height - top, right - left, top - bottom


def cut(item, scene: bpy.types.Scene) -> tuple[int, int, int, int]:
    """Which part of what the renderer makes is the region: left, top, width, height.

    A perspective camera without a plate is exported with a lens for the region alone; others are rendered whole.
    """
    part = region(scene)
    return (0, 0, *part[2:]) if item.data.type == "PERSP" and plate_of(item) is None else part


def plate_of(item) -> bpy.types.Image | None:
    """The plate of a camera object: its first background image that is shown, where it is said to be one."""
    camera = item.data
    if camera.type != "PERSP" or not camera.lightdepth.plate.use or not camera.show_background_images:
        return None
    shown = (each.image for each in camera.background_images if each.source == "IMAGE" and each.show_background_image)
    found = next((image for image in shown if image is not None), None)
    return found if found is None else found.original


def circle(item) -> float | None:
    """Radius of an equisolid lens's picture as a share of half the width, where Cycles shows less than the sensor has."""
    camera = item.data
    if camera.type != "PANO" or camera.lightdepth.projection in PROJECTIONS:
        return None
    if panoramic(camera).panorama_type != "FISHEYE_EQUISOLID":
        return None
    settings = panoramic(camera)
    share = 4.0 * settings.fisheye_lens * math.sin(0.25 * settings.fisheye_fov) / _sensor(camera)
    return share if share < 1.0 else None


def camera_table(item, scene, eye: Eye | None = None, posed: bool = False) -> tuple[dict[str, Any], list[str]]:
    """The ``[camera.NAME]`` table of a camera.

    Args:
        item: the camera object, evaluated.
        scene: the scene, evaluated, for the resolution and the capture point.
        eye: one of its views; by default the camera itself.
        posed: say the pose also where it is the scene file's default.

    Returns:
        The table, and notes on what of the camera is not supported.

    Raises:
        CameraError: the picture could not be what Blender shows.
    """
    if item.type != "CAMERA":
        raise CameraError(f"Camera '{item.name}': it is not a camera")
    camera, (width, height) = item.data, resolution(scene)
    _check_pixels(item.name, scene)
    eye = eye or Eye(item.matrix_world, camera.shift_x)
    plate = plate_of(item)
    if plate is not None:
        if not plate.size[0]:
            raise CameraError(f"Camera '{item.name}': its plate '{plate.name}' cannot be read; load it again")
        if scene.camera is not None and scene.camera.name == item.name and (width, height) != tuple(plate.size):
            raise CameraError(
                f"Camera '{item.name}': its plate '{plate.name}' has {plate.size[0]} x {plate.size[1]} pixels, the picture "
                f"{width} x {height}; set the resolution to the plate's, at 100 %"
            )
        table, notes = _perspective(item, *plate.size, eye.shift_x)
    elif camera.type == "PERSP":
        table, notes = _perspective(item, width, height, eye.shift_x)
        _narrow(table, region(scene))
    elif camera.type == "PANO":
        table, notes = _panoramic(item.name, camera, width, height)
        if eye.spherical:
            table = _spherical(item.name, camera.stereo, table)
    else:
        raise CameraError(
            f"Camera '{item.name}': an orthographic camera cannot be rendered; use perspective or panoramic"
        )
    if posed or not (table["type"] == "equirectangular" and _is_at_capture(eye.matrix, scene)):
        table |= pose(eye.matrix)
    return table, notes


def pose(matrix: Matrix) -> Mapping[str, list[float]]:
    """``position`` and ``rotation`` of a Blender camera's matrix, as the scene file means them."""
    rotation = matrix.to_quaternion().to_matrix() @ CAMERA_TURN
    return {
        "position": list(matrix.translation),
        "rotation": [math.degrees(angle) for angle in rotation.to_euler("XYZ")],
    }


def _spherical(name, stereo, table: dict[str, Any]) -> dict[str, Any]:
    """A panorama as one for two eyes, the left one's above the right one's."""
    if table["type"] != "equirectangular":
        raise CameraError(
            f"Camera '{name}': spherical stereo is for equirectangular panoramas; switch it off, or change the type"
        )
    ends = [math.degrees(stereo.pole_merge_angle_from), math.degrees(stereo.pole_merge_angle_to)]
    merge = ends if stereo.use_pole_merge else [90.0, 90.0]
    both = {"type": "ods", "width": table["width"], "interocular_distance": stereo.interocular_distance}
    if stereo.convergence_mode != "PARALLEL":
        both["convergence_distance"] = stereo.convergence_distance
    return both | {"zenith_merge": merge, "nadir_merge": merge, "layout": "top-bottom"}


def _is_at_capture(matrix: Matrix, scene) -> bool:
    """Whether the camera stands and looks as the panorama was taken.

    Its pose is then left to the scene file's default: the photograph's pixels come through as they are.
    """
    if scene.lightdepth.capture is None:
        return False
    capture = capture_pose(scene.lightdepth)
    turned = matrix.to_quaternion().to_matrix() @ CAMERA_TURN
    apart = (matrix.translation - capture.translation).length
    return apart < 1e-5 and all(abs(turned[i][j] - capture[i][j]) < 1e-5 for i in range(3) for j in range(3))


def _check_pixels(name, scene) -> None:
    if scene.render.pixel_aspect_x != scene.render.pixel_aspect_y:
        raise CameraError(f"Camera '{name}': pixels must be square; set both aspects in the output's format to 1")


def _perspective(item, width, height, shift_x):
    camera = item.data
    fit = camera.sensor_fit
    horizontal = fit == "HORIZONTAL" or (fit == "AUTO" and width >= height)
    sensor = camera.sensor_height if fit == "VERTICAL" else camera.sensor_width
    fitted = width if horizontal else height  # the side of the picture that the sensor spans
    table = {
        "type": "perspective",
        "width": width,
        "height": height,
        "fov": math.degrees(2.0 * math.atan(0.5 * sensor / camera.lens * width / fitted)),
    }
    if shift_x or camera.shift_y:
        table["shift"] = [shift_x * fitted / width, camera.shift_y * fitted / width]
    if any(camera.lightdepth.distortion):
        table["distortion"] = list(camera.lightdepth.distortion)
    notes = []
    if camera.dof.use_dof and (camera.dof.aperture_blades or camera.dof.aperture_ratio != 1.0):
        notes.append(f"Camera '{item.name}': its aperture is round; blades and ratio are not supported")
    return table | depth_of_field(item), notes


def depth_of_field(item) -> dict[str, float]:
    """Aperture and focus of a perspective camera, evaluated, as its table has them; nothing where all is sharp."""
    camera = item.data
    if not camera.dof.use_dof:
        return {}
    return {"aperture": 0.5e-3 * camera.lens / camera.dof.aperture_fstop, "focus_distance": _focus_distance(item)}


def _narrow(table: dict[str, Any], part: tuple[int, int, int, int]) -> None:
    """Make a perspective lens that sees a part of the picture: left, top, width, height."""
    whole_width, whole_height = table["width"], table["height"]
    left, top, width, height = part
    if (width, height) == (whole_width, whole_height):
        return
    if width < 1 or height < 1:
        raise CameraError("The render region is empty: draw it again, or switch it off")
    half = math.tan(math.radians(0.5 * table["fov"])) * width / whole_width
    across, up = table.get("shift", (0.0, 0.0))
    table["shift"] = [
        (across * whole_width + left + 0.5 * (width - whole_width)) / width,
        (up * whole_width + 0.5 * (whole_height - height) - top) / width,
    ]
    table |= {"width": width, "height": height, "fov": math.degrees(2.0 * math.atan(half))}


def _focus_distance(item) -> float:
    """Metres along the camera's axis to what is in focus, as Blender measures it."""
    focus = item.data.dof
    target = focus.focus_object
    if target is None:
        return focus.focus_distance
    place = target.matrix_world
    if target.pose is not None and focus.focus_subtarget in target.pose.bones:
        place = place @ target.pose.bones[focus.focus_subtarget].matrix
    axis = item.matrix_world.to_quaternion() @ Matrix.Identity(3).col[2]
    return max(abs((item.matrix_world.translation - place.translation).dot(axis)), 1e-5)


def _panoramic(name, camera, width, height):
    settings = panoramic(camera)
    kind = settings.panorama_type
    if camera.shift_x or camera.shift_y:
        raise CameraError(f"Camera '{name}': a panoramic lens cannot be shifted; set both shifts to 0")
    if camera.lightdepth.projection in PROJECTIONS:
        return _projected(name, camera, width, height), []
    if kind == "EQUIRECTANGULAR":
        limits = (settings.longitude_min, settings.longitude_max, settings.latitude_min, settings.latitude_max)
        if any(abs(a - b) > 1e-4 for a, b in zip(limits, (-math.pi, math.pi, -math.pi / 2, math.pi / 2), strict=True)):
            raise CameraError(
                f"Camera '{name}': a panorama is 360 x 180 degrees; limits on longitude and latitude do not work"
            )
        if width != 2 * height:
            raise CameraError(
                f"Camera '{name}': a panorama is twice as wide as high; the resolution is {width} x {height}"
            )
        return {"type": "equirectangular", "width": width}, []
    if kind not in FISHEYES:
        found = settings.bl_rna.properties["panorama_type"].enum_items[kind].name
        raise CameraError(
            f"Camera '{name}': the panorama type {found} is not rendered; use equirectangular, fisheye equidistant, "
            "fisheye equisolid, or a cubemap or VR180 by the setting Projection"
        )
    if width != height:
        raise CameraError(f"Camera '{name}': a fisheye picture is square; the resolution is {width} x {height}")
    table = {"type": "fisheye", "width": width, "mapping": FISHEYES[kind]}
    if kind == "FISHEYE_EQUIDISTANT":
        return table | {"fov": math.degrees(settings.fisheye_fov)}, []
    # Cycles: sin(theta / 2) = r / (2 lens), with r in mm on the sensor; the circle that touches the picture's sides
    # has r = sensor / 2.
    sensor = _sensor(camera)
    sine = sensor / (4.0 * settings.fisheye_lens)
    if sine > 1.0:
        raise CameraError(
            f"Camera '{name}': a lens of {settings.fisheye_lens:g} mm sees everything inside the sensor of "
            f"{sensor:g} mm; {sensor / 4.0:g} mm is the shortest"
        )
    fov = math.degrees(4.0 * math.asin(sine))
    notes = []
    if math.degrees(settings.fisheye_fov) > fov + 0.5:
        notes.append(
            f"Camera '{name}': the circle that touches the picture's sides shows {fov:.1f} degrees; it is rendered "
            f"instead of the field of view of {math.degrees(settings.fisheye_fov):.1f} degrees"
        )
    return table | {"fov": fov}, notes


def _projected(name, camera, width, height) -> dict[str, Any]:
    """A camera that Blender's own panoramic lenses do not have."""
    projection = PROJECTIONS[camera.lightdepth.projection]
    kind, across, down = projection.kind, projection.across, projection.down
    if width * down != height * across or width % across:
        size = max(width // across, 1)
        raise CameraError(
            f"Camera '{name}': a picture of type {kind} is {across} to {down}; the resolution is {width} x {height}, and "
            f"could be {size * across} x {size * down}"
        )
    table = {"type": kind, "width": width}
    if projection.two_eyes:
        return table | {"interocular_distance": camera.stereo.interocular_distance}
    return table


def _sensor(camera) -> float:
    """The side of the sensor that the picture's width spans, mm."""
    return camera.sensor_height if camera.sensor_fit == "VERTICAL" else camera.sensor_width

"""More than one photograph: further panoramas with capture points of their own, and a plate as a camera's background.

In a scene file they are ``[[panorama]]`` tables and ``[plate]``.
"""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

import bpy
from bpy_extras.io_utils import ImportHelper
from mathutils import Euler, Matrix, Vector

from . import cameras, panorama
from .meshfolder import MeshFolder
from .picking import without_scale

PICTURES = "*.exr;*.hdr;*.jpg;*.jpeg;*.png;*.tif;*.tiff"


class PhotographError(Exception):
    """A photograph that is not supported or taken over."""


Relative = Callable[[Path], str]
"""A path as the scene file writes it."""


def panorama_tables(
    scene, relative: Relative, files: MeshFolder, local: Callable[[Matrix], Matrix]
) -> dict[str, Any] | list[dict[str, Any]]:
    """The ``[panorama]`` table, or a list of them where there are further ones.

    Args:
        scene: evaluated.
        relative: for the images' paths.
        files: where packed images are written.
        local: gives a matrix of Blender's world in the scene file's.

    Raises:
        PhotographError: a further panorama has no image or no capture point.
        OSError: an image is gone, or cannot be written.
    """
    settings = scene.lightdepth
    first = (settings.image, settings.capture, settings.scale, settings.versions)
    further = [(entry.image, entry.capture, entry.scale, entry.versions) for entry in settings.further]
    tables = []
    for number, (image, capture, scale, versions) in enumerate((first, *further), start=1):
        if image is None or capture is None or capture.name not in scene.objects:
            missing = "image" if image is None else "capture point"
            raise PhotographError(
                f"Panorama {number} has no {missing}: choose one in the sidebar, panel More Photographs, or remove the "
                "panorama"
            )
        pose = without_scale(capture.matrix_world)
        table = {
            "image": relative(panorama.file_of(image, files)),
            "position": list(local(pose).translation),
            "rotation": [math.degrees(angle) for angle in pose.to_euler("XYZ")],
            "scale": scale,
            "sky": settings.sky,
        }
        for key, picture in (("plate", versions.retouched), ("mask", versions.mask)):
            if picture is not None:
                table[key] = relative(panorama.file_of(picture, files))
        if versions.use_gain:
            table["gain"] = list(versions.gain)
        tables.append(table)
    return tables if len(tables) > 1 else tables[0]


def plate_camera(scene) -> bpy.types.Object | None:
    """The camera whose plate is exported: the active one, or else the first that has a plate."""
    found = [item for item in scene.objects if item.type == "CAMERA" and cameras.plate_of(item) is not None]
    return next((item for item in found if scene.camera is not None and item.name == scene.camera.name), None) or next(
        iter(found), None
    )


def plate_table(scene, relative: Relative, files: MeshFolder) -> tuple[dict[str, Any] | None, list[str]]:
    """The ``[plate]`` table, ``None`` where no camera has a plate; and notes on plates that are not supported.

    Raises:
        PhotographError: the plate is a sequence or a movie.
        OSError: the image is gone, or cannot be written.
    """
    chosen = plate_camera(scene)
    if chosen is None:
        return None, []
    image, settings = cameras.plate_of(chosen), chosen.data.lightdepth.plate
    if image.source != "FILE":
        raise PhotographError(
            f"Camera '{chosen.name}': its plate '{image.name}' is a {image.source.lower()}; only single images are "
            "supported"
        )
    table = {"image": relative(panorama.file_of(image, files)), "camera": chosen.name}
    if settings.use_gain:
        table["gain"] = list(settings.gain)
    notes = [
        f"Camera '{item.name}': its plate is left out; a scene has one, and it is that of '{chosen.name}'"
        for item in scene.objects
        if item.type == "CAMERA" and item.name != chosen.name and cameras.plate_of(item) is not None
    ]
    return table, notes


def show_plate(item: bpy.types.Object, image: bpy.types.Image) -> None:
    """Make an image the plate of a camera: its background image, over the whole frame."""
    camera = item.data
    shown = next((each for each in camera.background_images if each.source == "IMAGE"), None)
    shown = shown or camera.background_images.new()
    shown.source, shown.image, shown.alpha, shown.display_depth = "IMAGE", image, 1.0, "BACK"
    shown.frame_method, shown.show_background_image = "FIT", True
    camera.show_background_images = camera.lightdepth.plate.use = True


def add_panorama(context, image: bpy.types.Image | None):
    """Add a further panorama, whose capture point stands at that of the first one; returns its settings."""
    settings = context.scene.lightdepth
    entry = settings.further.add()
    capture = panorama.new_capture_point(context, f"{panorama.CAPTURE_NAME} {len(settings.further) + 1}")
    capture.matrix_world = settings.capture.matrix_world.copy()
    entry.capture, entry.image = capture, image
    return entry


def load_image(path: Path, is_panorama: bool = True) -> bpy.types.Image:
    """An image of a file.

    Raises:
        PhotographError: it cannot be read, or a panorama is not twice as wide as high.
    """
    try:
        image = bpy.data.images.load(str(path), check_existing=True)
    except RuntimeError as error:
        raise PhotographError(str(error).strip()) from error
    width, height = image.size
    if width == 0 or (is_panorama and width != 2 * height):
        if image.users == 0:
            bpy.data.images.remove(image)
        why = f"has {width} x {height} pixels; a panorama is twice as wide as high" if width else "cannot be read"
        raise PhotographError(f"{path.name} {why}")
    return image


def pose(item: bpy.types.Object, position, rotation, origin) -> None:
    """Place a capture point as a scene file says: metres and degrees, from an origin in Blender's world."""
    item.rotation_mode = "XYZ"
    item.matrix_world = Matrix.LocRotScale(
        Vector(position) + Vector(origin), Euler([math.radians(angle) for angle in rotation], "XYZ"), None
    )


class Loads(ImportHelper):
    """Base of the operators that take a file over: ``load`` does it, and may raise errors in words."""

    bl_options: ClassVar = {"REGISTER", "UNDO"}

    filter_glob: bpy.props.StringProperty(default=PICTURES, options={"HIDDEN"})

    def load(self, context, path: Path) -> None:
        """Take the file over."""
        raise NotImplementedError

    def execute(self, context):
        """Load what the file holds."""
        try:
            self.load(context, Path(bpy.path.abspath(self.filepath)))
        except PhotographError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        context.view_layer.update()
        return {"FINISHED"}


class AddPanorama(Loads, bpy.types.Operator):
    """Add a further panorama of the same place, with a capture point of its own"""

    bl_idname = "lightdepth.add_panorama"
    bl_label = "Add Panorama"

    filter_glob: bpy.props.StringProperty(default="*.exr;*.hdr", options={"HIDDEN"})

    @classmethod
    def poll(cls, context):
        """There is a first panorama with a capture point."""
        return context.scene.lightdepth.image is not None and panorama.has_capture_point(context.scene)

    def load(self, context, path: Path) -> None:
        """Add it, and show it in the viewports."""
        add_panorama(context, load_image(path))
        context.scene.lightdepth.shown = len(context.scene.lightdepth.further)


class RemovePanorama(bpy.types.Operator):
    """Take this panorama and its capture point away"""

    bl_idname = "lightdepth.remove_panorama"
    bl_label = "Remove Panorama"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    index: bpy.props.IntProperty(min=0)

    def execute(self, context):
        """Remove it."""
        settings = context.scene.lightdepth
        if self.index >= len(settings.further):
            return {"CANCELLED"}
        remove_panorama(settings, self.index)
        return {"FINISHED"}


def remove_panorama(settings, index: int) -> None:
    """Take a further panorama away, with its capture point unless another one shares it."""
    capture = settings.further[index].capture
    settings.further.remove(index)
    settings.shown = 0
    if capture is not None and capture not in [settings.capture, *(entry.capture for entry in settings.further)]:
        bpy.data.objects.remove(capture)


class LoadPlate(Loads, bpy.types.Operator):
    """Load a photograph as the plate of the active camera, and set the picture's size to its size"""

    bl_idname = "lightdepth.load_plate"
    bl_label = "Load Plate"

    @classmethod
    def poll(cls, context):
        """The scene has an active camera, in perspective."""
        camera = context.scene.camera
        return camera is not None and camera.type == "CAMERA" and camera.data.type == "PERSP"

    def load(self, context, path: Path) -> None:
        """Make it the camera's background image."""
        image = load_image(path, is_panorama=False)
        show_plate(context.scene.camera, image)
        set_resolution(context.scene, image)


def set_resolution(scene, image: bpy.types.Image) -> None:
    """Make the scene's picture as large as an image."""
    render = scene.render
    render.resolution_x, render.resolution_y = image.size
    render.resolution_percentage, render.pixel_aspect_x, render.pixel_aspect_y = 100, 1.0, 1.0


classes = (AddPanorama, RemovePanorama, LoadPlate)

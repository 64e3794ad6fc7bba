"""The photographs of a scene file as Blender's: panoramas with their capture points, and the plate of a camera."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Vector

from . import panorama, photographs
from .cameraimport import CameraTableError, show_camera
from .photographs import Loads, PhotographError
from .reallights import LightFileError, origin_of, read_tables


class ImportPhotographs(Loads, bpy.types.Operator):
    """Take the panoramas, with their capture points, and the plate of a scene file over"""

    bl_idname = "lightdepth.import_photographs"
    bl_label = "Import Photographs"

    filter_glob: bpy.props.StringProperty(default="*.toml", options={"HIDDEN"})

    def load(self, context, path: Path) -> None:
        """Read the file, and show what its tables hold."""
        try:
            document = read_tables(path)
        except LightFileError as error:
            raise PhotographError(str(error)) from error
        tables = document.get("panorama")
        tables = tables if isinstance(tables, list) else [tables]
        try:
            for note in self._shown(context, document, tables, path.parent):
                self.report({"WARNING"}, note)
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise PhotographError(
                f"{path}: its photographs cannot be read ({error}); `lightdepth check` says more"
            ) from error

    def _shown(self, context, document: Mapping[str, Any], tables, folder: Path) -> list[str]:
        notes, scene = [], context.scene
        settings = scene.lightdepth
        images = [self._image(folder, table["image"]) for table in tables]
        origin = origin_of(document, settings) if panorama.has_capture_point(scene) else np.zeros(3)
        if not panorama.has_capture_point(scene):
            settings.capture = panorama.new_capture_point(context)
        while len(settings.further) > len(tables) - 1:
            photographs.remove_panorama(settings, len(settings.further) - 1)
        while len(settings.further) < len(tables) - 1:
            photographs.add_panorama(context, None)
        settings.sky = any(table.get("sky", False) for table in tables)
        for number, (owner, table, image) in enumerate(
            zip([settings, *settings.further], tables, images, strict=True), start=1
        ):
            owner.image, owner.scale = image, table.get("scale", 1.0)
            photographs.pose(owner.capture, table.get("position", (0, 0, 0)), table.get("rotation", (0, 0, 0)), origin)
            versions, gain = owner.versions, table.get("gain")
            versions.retouched = self._image(folder, table["plate"]) if "plate" in table else None
            versions.mask = self._image(folder, table["mask"]) if "mask" in table else None
            versions.use_gain = gain is not None
            if gain is not None:
                versions.gain = gain if isinstance(gain, list) else (gain,) * 3
            if "depth" in table:
                notes.append(f"Panorama {number}: its depth is not taken over; model the place, or import its meshes")
        if "plate" in document:
            notes += self._plate(context, document, folder, origin)
        return notes

    def _plate(self, context, document: Mapping[str, Any], folder: Path, origin: np.ndarray) -> list[str]:
        table = document["plate"]
        name = table["camera"]
        try:
            show_camera(context, name, document["camera"][name], Vector(origin))
        except CameraTableError as error:
            return [f"Camera '{name}': {error}"]
        item, image = context.scene.objects[name], photographs.load_image(folder / table["image"], is_panorama=False)
        photographs.show_plate(item, image)
        context.scene.camera = item
        photographs.set_resolution(context.scene, image)
        plate, gain = item.data.lightdepth.plate, table.get("gain")
        plate.use_gain = gain is not None
        if gain is not None:
            plate.gain = gain if isinstance(gain, list) else (gain,) * 3
        return []

    @staticmethod
    def _image(folder: Path, name: str) -> bpy.types.Image:
        if "#" in name:
            raise PhotographError(f"{name}: numbered files are not taken over; Blender's panoramas are single images")
        return photographs.load_image(folder / name)


classes = (ImportPhotographs,)

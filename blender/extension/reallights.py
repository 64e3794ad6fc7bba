"""Lights of the real place that the photograph lacks: suns and clipped sources, as lamps marked real.

In a scene file they are ``[[light]]`` tables. They are recovered by the renderer, imported, edited here, and written back.
"""

import math
import os
import re
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, ClassVar

import bpy
import numpy as np
from bpy_extras.io_utils import ExportHelper, ImportHelper
from mathutils import Vector

from . import toml
from .asking import Asks
from .clippedlamps import show_clipped
from .evaluation import EvaluationError, unexpected, with_render_depsgraph
from .export import FAR, ExportError, export_scene, scene_lights
from .images import from_rec709
from .lights import make_plain
from .picking import capture_pose
from .process import Question
from .properties import show_lines
from .suns import across

LAMP_HEIGHT = 3.0
"""Metres over the capture point at which a new sun's lamp stands; where it stands means nothing."""


class LightFileError(Exception):
    """A scene file whose lights cannot be read or written."""


def read_tables(path: Path) -> dict[str, Any]:
    """A scene file's content.

    Raises:
        LightFileError: it is missing, or no TOML.
    """
    try:
        return tomllib.loads(path.read_bytes().decode("utf-8-sig"))
    except OSError as error:
        raise LightFileError(f"{path} cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise LightFileError(f"{path} is not a scene file: {error}") from error


def show_lights(context, tables: Iterable[Mapping[str, Any]], folder: Path, origin: np.ndarray) -> list[str]:
    """Make or change the lamps that stand for ``[[light]]`` tables.

    Args:
        context: Blender's.
        tables: of a scene file.
        folder: that the paths in them are relative to.
        origin: of the scene file in Blender's world, shape (3,).

    Returns:
        What could not be taken over, one sentence each.
    """
    notes = []
    for table in tables:
        kind, name = table.get("type"), str(table.get("name", table.get("type", "light")))
        if kind == "sun":
            direction = _direction(table)
            if direction is None:
                notes.append(
                    f"Light '{name}': a sun by latitude, longitude and time is not taken over; give its direction, or its "
                    "azimuth and elevation"
                )
                continue
            _show_sun(context, name, table, direction, folder, origin)
        elif kind == "clipped":
            show_clipped(context, name, table)
        else:
            notes.append(f"Light '{name}': lights of type '{kind}' are not known here")
    return notes


def _direction(table: Mapping[str, Any]) -> Vector | None:
    if "direction" in table:
        return Vector([float(value) for value in table["direction"]]).normalized()
    if "azimuth" in table and "elevation" in table:
        around, above = math.radians(table["azimuth"]), math.radians(table["elevation"])
        return Vector((math.sin(around) * math.cos(above), math.cos(around) * math.cos(above), math.sin(above)))
    return None


def _show_sun(context, name, table, direction, folder, origin) -> None:
    item = context.scene.objects.get(name)
    if item is None or item.type != "LIGHT" or item.data.type != "SUN":
        item = bpy.data.objects.new(name, bpy.data.lights.new(name, "SUN"))
        item.location = capture_pose(context.scene.lightdepth).translation + Vector((0.0, 0.0, LAMP_HEIGHT))
        context.scene.collection.objects.link(item)
    light, settings = item.data, item.lightdepth
    item.rotation_mode = "QUATERNION"
    item.rotation_quaternion = direction.to_track_quat("Z", "Y")
    irradiance = from_rec709(np.array(table["irradiance"], np.float32))
    strongest = max(float(irradiance.max()), 1e-30)
    light.color, light.energy = irradiance / strongest, strongest
    light.angle = math.radians(table.get("diameter", 0.53))
    make_plain(light)
    settings.real_light = True
    settings.mask, settings.recover_mask = "", table.get("mask") == "recover"
    if "mask" in table and not settings.recover_mask:
        settings.mask = str((folder / table["mask"]).resolve())
        shift = across(direction, origin)
        settings.mask_extent = [float(edge) + shift[index % 2] for index, edge in enumerate(table["mask_extent"])]
        settings.mask_direction = direction


def spliced(text: str, tables: list[dict[str, Any]]) -> str:
    """A scene file's text with other ``[[light]]`` tables in place of its own; all else stays as it is written.

    Raises:
        LightFileError: the lights cannot be distinguished from the rest of the file.
    """
    kept: list[str] = []
    place, pending, inside = None, [], False
    for line in text.splitlines(keepends=True):
        if re.match(r"\s*\[\[\s*light\s*\]\]", line):
            place, pending, inside = len(kept) if place is None else place, [], True
        elif inside and re.match(r"\s*\[", line):
            kept += pending  # Comments above a table belong to it.
            inside = False
        elif inside:
            pending = [*pending, line] if re.match(r"\s*(#|$)", line) else []
        if not inside:
            kept.append(line)
    if inside:
        kept += pending
    before, after = "".join(kept[:place]), "" if place is None else "".join(kept[place:])
    lights = toml.dumps({"light": tables}) if tables else ""
    gap = "" if not before or before.endswith("\n\n") else "\n" if before.endswith("\n") else "\n\n"
    result = before + (gap if lights else "") + lights + ("\n" if lights and after.strip() else "") + after.lstrip("\n")
    try:
        old, new = tomllib.loads(text), tomllib.loads(result)
    except ValueError as error:
        raise LightFileError(f"its lights are written in a way that cannot be replaced: {error}") from error
    old.pop("light", None)
    if new.pop("light", []) != tomllib.loads(lights).get("light", []) or old != new:
        raise LightFileError("its lights are written in a way that cannot be replaced; edit them by hand")
    return result


def origin_of(document: Mapping[str, Any], settings) -> np.ndarray:
    """The origin of a scene file in Blender's world, shape (3,), from where both have the capture point."""
    panorama = document.get("panorama", {})
    first = (panorama or [{}])[0] if isinstance(panorama, list) else panorama
    position = np.array(first.get("position", (0.0, 0.0, 0.0)), np.float64)
    return np.round((np.array(capture_pose(settings).translation) - position) / FAR) * FAR + 0.0


class ImportsTables(ImportHelper):
    """What takes tables of a scene file over; ``shown`` makes or changes what stands for them, and yields notes."""

    bl_options: ClassVar = {"REGISTER", "UNDO"}

    key: str
    """Of the tables in the file."""
    header: str
    """How the file writes them."""

    filename_ext = ".toml"
    filter_glob: bpy.props.StringProperty(default="*.toml", options={"HIDDEN"})

    @classmethod
    def poll(cls, context):
        """There is a panorama with a capture point."""
        settings = context.scene.lightdepth
        return settings.image is not None and settings.capture is not None

    def execute(self, context):
        """Read the file, and show what its tables hold."""
        path = Path(bpy.path.abspath(self.filepath))
        try:
            document = read_tables(path)
            tables = document.get(self.key)
            if not tables:
                raise LightFileError(f"{path} has no {self.header}")
            for note in self.shown(context, tables, path.parent, origin_of(document, context.scene.lightdepth)):
                self.report({"WARNING"}, note)
        except LightFileError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        except (KeyError, TypeError, ValueError) as error:
            self.report({"ERROR"}, f"{path}: its {self.key}s cannot be read ({error}); `lightdepth check` says more")
            return {"CANCELLED"}
        return {"FINISHED"}


class ImportLights(bpy.types.Operator, ImportsTables):
    """Take the lights of a scene file over: suns and clipped sources as lamps marked real"""

    bl_idname = "lightdepth.import_lights"
    bl_label = "Import Lights"
    key, header = "light", "[[light]]"

    def shown(self, context, tables, folder: Path, origin: np.ndarray) -> Iterable[str]:
        """Lamps for the lights."""
        return show_lights(context, tables, folder, origin)


class WriteLights(bpy.types.Operator, ExportHelper):
    """Write the real lights into a scene file in place of those that it has; the rest of it stays as it is"""

    bl_idname = "lightdepth.write_lights"
    bl_label = "Write Lights"

    filename_ext = ".toml"
    filter_glob: bpy.props.StringProperty(default="*.toml", options={"HIDDEN"})

    poll = ImportLights.poll

    def execute(self, context):
        """Replace the file's lights."""
        path = Path(bpy.path.abspath(self.filepath))
        settings = context.scene.lightdepth
        try:
            document = read_tables(path)
            origin = origin_of(document, settings)
            tables, notes = with_render_depsgraph(context, lambda graph, _: scene_lights(graph, path.parent, origin))
            text = spliced(path.read_bytes().decode("utf-8-sig"), tables)
            temporary = path.with_name(f".{path.name}.part")
            temporary.write_text(text, encoding="utf-8", newline="")
            os.replace(temporary, path)
        except (LightFileError, ExportError, EvaluationError, OSError) as error:
            self.report({"ERROR"}, str(error) if str(path) in str(error) else f"{path}: {error}")
            return {"CANCELLED"}
        except Exception as error:
            self.report({"ERROR"}, unexpected(error))
            return {"CANCELLED"}
        for note in notes:
            self.report({"WARNING"}, note)
        return {"FINISHED"}


class _Recovers(Asks):
    """Asks the renderer for a light of the exported scene."""

    poll = ImportLights.poll
    what = ""

    def arguments(self, context, folder: Path):
        """Those of ``lightdepth recover`` for the exported scene."""
        path = folder / "scene.toml"
        with_render_depsgraph(context, lambda depsgraph, _: export_scene(depsgraph, path))
        document = read_tables(path)
        self._folder_of_scene, self._origin = folder, origin_of(document, context.scene.lightdepth)
        return ["recover", self.what, str(path), "--json"]


class RecoverSun(_Recovers, bpy.types.Operator):
    """Find the sun that shines in through openings and that the capture point does not see, from its patch"""

    bl_idname = "lightdepth.recover_sun"
    bl_label = "Recover Sun"
    bl_options: ClassVar = {"REGISTER", "UNDO"}
    what = "sun"

    def take(self, context, question: Question):
        """Make the sun a lamp marked real, or change the one of before."""
        table, confidence = question.json(lambda found: (_sun_table(found), str(found["confidence"])))
        show_lights(context, [table], self._folder_of_scene, self._origin)
        text = f"Sun recovered, confidence {confidence}"
        show_lines(context.scene.lightdepth.light_notes, [text])
        self.report({"INFO" if confidence == "good" else "WARNING"}, text)


class RecoverClipped(_Recovers, bpy.types.Operator):
    """Find what clipped lamps and suns really send, from what they light"""

    bl_idname = "lightdepth.recover_clipped"
    bl_label = "Recover Clipped Light"
    bl_options: ClassVar = {"REGISTER", "UNDO"}
    what = "clipped"

    def take(self, context, question: Question):
        """Make what was found lamps marked real."""
        sources = question.json(
            lambda found: [_clipped(number, each) for number, each in enumerate(found["sources"], 1)]
        )
        show_lights(context, [table for table, _ in sources if table], self._folder_of_scene, self._origin)
        lines = [line for _, line in sources] or ["Nothing in the panorama was clipped, as far as can be seen"]
        show_lines(context.scene.lightdepth.light_notes, lines)
        for line in lines:
            self.report({"INFO"}, line)


def _sun_table(found: Mapping[str, Any]) -> dict[str, Any]:
    return {key: found[key] for key in ("type", "direction", "diameter", "irradiance")} | {"name": "Sun"}


def _clipped(number: int, found: Mapping[str, Any]) -> tuple[dict[str, Any] | None, str]:
    """The table of a recovered source, ``None`` where nothing is known, and a sentence about it."""
    name, (x, y) = f"Clipped {number}", found["pixel"]
    where = f"{name} (at pixel {x:g},{y:g})"
    if found["light"] is None:
        known = found["method"] == "not clipped"
        return None, f"{where} {'was not clipped' if known else 'stays as it is: the photograph does not determine it'}"
    gain = max(a / b if a and b else 1.0 for a, b in zip(found["irradiance"], found["clipped_irradiance"], strict=True))
    sentence = f"{where}: {gain:.3g} times its clipped light ({found['method']}, confidence {found['confidence']})"
    return {**found["light"], "name": name}, sentence


classes = (ImportLights, WriteLights, RecoverSun, RecoverClipped)

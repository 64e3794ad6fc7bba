"""Where a further panorama or a plate was taken, from points and edges that are clicked."""

from pathlib import Path
from typing import Any, ClassVar

import bpy
from mathutils import Vector

from . import cameras, panorama, photographs, picking, pictures
from .asking import Asks
from .cameraimport import CameraTableError, show_camera
from .evaluation import with_render_depsgraph
from .export import ExportError, export_scene
from .meshfolder import MeshFolder
from .process import Question

PLATE = -1
"""Index that means the active camera's plate; others are those of further panoramas."""


def owner_of(scene, index: int):
    """The settings that points belong to and the image that they are clicked on; ``None`` where there are none."""
    if index == PLATE:
        camera = scene.camera
        image = None if camera is None or camera.type != "CAMERA" else cameras.plate_of(camera)
        return None if image is None else (camera.data.lightdepth.plate, image)
    further = scene.lightdepth.further
    if index >= len(further) or further[index].image is None:
        return None
    return further[index], further[index].image


class _OnPictures(picking.Clicks):
    """Clicks in image editors; the one that the operator was called from changes to the picture that is asked for."""

    index: bpy.props.IntProperty(name="Index", description="Of the further panorama; -1 is the plate", min=PLATE)
    space_type, draw_stage = bpy.types.SpaceImageEditor, "POST_VIEW"

    @classmethod
    def poll(cls, context):
        """The operator is used in an image editor, and there is a panorama."""
        space = context.space_data
        return context.scene.lightdepth.image is not None and space is not None and space.type == "IMAGE_EDITOR"

    def asked(self, count: int) -> bpy.types.Image:
        """The picture that the next click belongs to, after ``count`` clicks."""
        raise NotImplementedError

    def invoke(self, context, event):
        """Begin, if there is such a picture."""
        if owner_of(context.scene, self.index) is None:
            self.report({"ERROR"}, "This picture does not exist: load it first")
            return {"CANCELLED"}
        self._scene, self._space = context.scene, context.space_data
        self._space.image = self.asked(0)
        return super().invoke(context, event)

    def modal(self, context, event):
        """Collect one click, and show the picture of the next one."""
        result = super().modal(context, event)
        if result == {"RUNNING_MODAL"} and event.type in {"LEFTMOUSE", "BACK_SPACE"}:
            self._space.image = self.asked(len(self._points))
        return result

    def point_at(self, context, event):
        """The place under the mouse on the picture that is asked for, as ``(u, v)``."""
        under = picking.region_under_mouse(context, event, "IMAGE_EDITOR")
        if under is None or under[0].spaces.active.image != self.asked(len(self._points)):
            return None
        return picking.on_image(*under[1:])

    def draw_points(self, points, cursor):
        """Draw what was clicked on the picture that is drawn."""
        shown = bpy.context.space_data.image
        for count, (u, v) in enumerate(points):
            if self.asked(count) == shown:
                picking.draw_lines([(u, 1.0 - v)])


class ClickSharedPoints(_OnPictures, bpy.types.Operator):
    """Click points that both pictures show: on the first panorama, then the same point on this picture, and so on"""

    bl_idname = "lightdepth.click_shared_points"
    bl_label = "Click Shared Points"
    bl_options: ClassVar = {"REGISTER", "UNDO"}
    help_text = (
        "Click a point on the first panorama, then the same point on the other picture. Enter: done. Backspace: take one "
        "back."
    )

    def asked(self, count: int) -> bpy.types.Image:
        """The two pictures in turn."""
        return owner_of(self._scene, self.index)[1] if count % 2 else self._scene.lightdepth.image

    def finish(self, context, points):
        """Add the pairs to those of before."""
        owner, _ = owner_of(context.scene, self.index)
        for first, other in zip(points[::2], points[1::2], strict=False):
            pair = owner.points.add()
            pair.first, pair.other = first, other
        return {"FINISHED"}


class ClickAxisLine(_OnPictures, bpy.types.Operator):
    """Click both ends of an edge in the plate that is parallel to an axis, from minus to plus, a plumb one from below"""

    bl_idname = "lightdepth.click_axis_line"
    bl_label = "Click Edge"
    bl_options: ClassVar = {"REGISTER", "UNDO"}
    needed = 2
    help_text = "Click both ends of an edge along the axis, from minus to plus; a plumb one from below to above."

    axis: bpy.props.EnumProperty(name="Axis", items=pictures.AXES)

    def asked(self, count: int) -> bpy.types.Image:
        """The plate."""
        return owner_of(self._scene, PLATE)[1]

    def invoke(self, context, event):
        """Begin on the plate."""
        self.index = PLATE
        return super().invoke(context, event)

    def finish(self, context, points):
        """Add the edge."""
        line = owner_of(context.scene, PLATE)[0].lines.add()
        line.axis, line.start, line.end = self.axis, points[0], points[1]
        return {"FINISHED"}


class ClearClicks(bpy.types.Operator):
    """Take all clicked points and edges of this picture away"""

    bl_idname = "lightdepth.clear_clicks"
    bl_label = "Clear"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    index: bpy.props.IntProperty(min=PLATE)

    def execute(self, context):
        """Remove them."""
        found = owner_of(context.scene, self.index)
        if found is None:
            return {"CANCELLED"}
        found[0].points.clear()
        if self.index == PLATE:
            found[0].lines.clear()
        return {"FINISHED"}


def _pixels(place, image: bpy.types.Image) -> str:
    width, height = image.size
    return f"{place[0] * width:.3f},{place[1] * height:.3f}"


class _Solves(Asks):
    """Asks the renderer where a picture was taken, from what was clicked."""

    bl_options: ClassVar = {"REGISTER", "UNDO"}

    def points(self, owner, image: bpy.types.Image) -> list[str]:
        """The clicked pairs as arguments."""
        first, words = bpy.context.scene.lightdepth.image, []
        for pair in owner.points:
            here, there = _pixels(pair.first, first), _pixels(pair.other, image)
            words += ["--match", f"{there} = {here}" if self.index == PLATE else f"{here} = {there}"]
        return words

    def scene_file(self, context, folder: Path) -> str:
        """The exported scene, whose first panorama and surfaces say where the points are."""
        path = folder / "scene.toml"
        exported = with_render_depsgraph(context, lambda graph, _: export_scene(graph, path, with_cameras=False))
        self._origin = Vector(exported.origin)
        return str(path)

    def tell(self, owner, lines: list[str], warnings: list[str]) -> None:
        """Keep and report what was found."""
        owner.report = "\n".join([*lines, *(f"warning: {text}" for text in warnings)])
        for warning in warnings:
            self.report({"WARNING"}, warning)
        self.report({"INFO"}, lines[0])


class RelatePanorama(_Solves, bpy.types.Operator):
    """Place this panorama's capture point, from clicked points on modelled surfaces or by features"""

    bl_idname = "lightdepth.relate_panorama"
    bl_label = "Solve Pose"

    index: bpy.props.IntProperty(min=0)
    by_features: bpy.props.BoolProperty(
        name="By Features", description="Let the renderer find shared points, instead of the clicked ones"
    )

    def arguments(self, context, folder: Path):
        """Those of ``lightdepth calibrate second``."""
        found = owner_of(context.scene, self.index)
        if found is None:
            raise ExportError("This panorama does not exist")
        entry, image = found
        if not self.by_features and not len(entry.points):
            raise ExportError("No point was clicked: click four or more that both panoramas show, or use features")
        path = panorama.file_of(image, MeshFolder(folder / "image"))
        cues = ["--auto"] if self.by_features else [*self.points(entry, image), *(["--snap"] if entry.snap else [])]
        return ["calibrate", "second", str(path), "--scene", self.scene_file(context, folder), *cues, "--json"]

    def take(self, context, question: Question):
        """Stand the capture point where the renderer says."""
        solved = question.json(lambda found: (found["position"], found["rotation"], _errors(found), found["warnings"]))
        position, rotation, errors, warnings = solved
        entry, _ = owner_of(context.scene, self.index)
        photographs.pose(entry.capture, position, rotation, self._origin)
        self.tell(entry, [errors], warnings)


def _errors(found: dict[str, Any]) -> str:
    return (
        f"Pose solved from {found['points']} points, residual {found['residual_degrees']:.2f} degrees, "
        f"{found['residual_centimetres']:.1f} cm"
    )


class SolvePlate(_Solves, bpy.types.Operator):
    """Find where the active camera stood and its lens, from points and edges that were clicked on its plate"""

    bl_idname = "lightdepth.solve_plate"
    bl_label = "Solve Camera"
    index = PLATE

    def arguments(self, context, folder: Path):
        """Those of ``lightdepth calibrate view``."""
        found = owner_of(context.scene, PLATE)
        if found is None:
            raise ExportError("The active camera has no plate: load one")
        plate, image = found
        self._camera = context.scene.camera
        path = panorama.file_of(image, MeshFolder(folder / "image"))
        words = ["calibrate", "view", str(path), "--json", *self.points(plate, image)]
        if len(plate.points):
            words += ["--scene", self.scene_file(context, folder)]
        for line in plate.lines:
            words += [f"--{line.axis.lower()}-line", f"{_pixels(line.start, image)} {_pixels(line.end, image)}"]
        return [*words, *(["--distortion", "free"] if plate.solve_distortion else [])]

    def take(self, context, question: Question):
        """Turn and move the camera, and give it the lens."""
        table, line, warnings = question.json(_solved_view)
        origin = getattr(self, "_origin", Vector())
        if "position" not in table:
            table["position"] = list(self._camera.matrix_world.translation - origin)
            warnings = [*warnings, "The position is unknown and was left: click points that the panorama shows too"]
        try:
            show_camera(context, self._camera.name, table, origin)
        except CameraTableError as error:
            raise ExportError(str(error)) from error
        photographs.set_resolution(context.scene, owner_of(context.scene, PLATE)[1])
        self.tell(self._camera.data.lightdepth.plate, [line], warnings)


def _solved_view(found: dict[str, Any]) -> tuple[dict[str, Any], str, list[str]]:
    keys = ("width", "height", "fov", "principal_point", "distortion", "rotation", "position")
    table = {"type": "perspective", **{key: found[key] for key in keys if found[key] is not None}}
    return (
        table,
        f"Camera solved, residual {found['residual']:.2f} pixels, {found['fov']:.1f} degrees",
        found["warnings"],
    )


classes = (ClickSharedPoints, ClickAxisLine, ClearClicks, RelatePanorama, SolvePlate)

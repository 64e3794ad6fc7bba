"""The panorama's pose from four clicked corners of a floor rectangle, solved by ``lightdepth calibrate``."""

import math
from pathlib import Path
from typing import ClassVar

import bpy
from mathutils import Euler, Vector

from . import panorama, picking
from .asking import Asks
from .meshfolder import MeshFolder
from .process import Question
from .properties import show_lines

GRID_NAME = "Floor grid"
GRID_METRES = 10
CORNERS = 4


class ClickCorners(picking.Clicks, bpy.types.Operator):
    """Click the four corners of a rectangle on the floor, counter-clockwise seen from above"""

    bl_idname = "lightdepth.click_corners"
    bl_label = "Click Corners"
    bl_options: ClassVar = {"REGISTER", "UNDO"}
    needed = CORNERS
    help_text = (
        "Click the four corners of a floor rectangle, counter-clockwise seen from above. Backspace: take one back."
    )

    @classmethod
    def poll(cls, context):
        """There is a panorama, and the operator is used in a viewport or an image editor."""
        settings = context.scene.lightdepth
        space = context.space_data
        return (
            settings.image is not None
            and settings.capture is not None
            and space is not None
            and space.type in {"VIEW_3D", "IMAGE_EDITOR"}
        )

    def invoke(self, context, event):
        """Begin in the editor that the operator was called from."""
        self._editor = context.space_data.type
        if self._editor == "IMAGE_EDITOR":
            context.space_data.image = context.scene.lightdepth.image
            self.space_type, self.draw_stage = bpy.types.SpaceImageEditor, "POST_VIEW"
        context.scene.lightdepth.shown = 0
        self._capture = picking.capture_pose(context.scene.lightdepth)
        return super().invoke(context, event)

    def point_at(self, context, event):
        """The place of the panorama under the mouse, as ``(u, v)``."""
        under = picking.region_under_mouse(context, event, self._editor)
        if under is None:
            return None
        if self._editor == "IMAGE_EDITOR":
            return picking.on_image(*under[1:])
        return picking.panorama_coordinates(picking.seen_from_capture(context, *picking.ray(*under)))

    def draw_points(self, points, cursor):
        """Draw the corners on the image, or a metre from the capture point toward them."""
        shown = [*points, *([cursor] if cursor is not None and len(points) < CORNERS else [])]
        if self._editor == "IMAGE_EDITOR":
            picking.draw_lines([(u, 1.0 - v) for u, v in shown], closed=len(shown) == CORNERS)
        else:
            picking.draw_lines(
                [self._capture @ picking.panorama_direction(u, v) for u, v in shown], closed=len(shown) == CORNERS
            )

    def finish(self, context, points):
        """Keep the corners in the scene."""
        corners = context.scene.lightdepth.corners
        corners.clear()
        for u, v in points:
            corner = corners.add()
            corner.u, corner.v = u, v
        return {"FINISHED"}


class Calibrate(Asks, bpy.types.Operator):
    """Solve the panorama's pose from the clicked corners and the known length"""

    bl_idname = "lightdepth.calibrate"
    bl_label = "Solve Pose"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        """Four corners were clicked on a panorama."""
        settings = context.scene.lightdepth
        return settings.image is not None and settings.capture is not None and len(settings.corners) == CORNERS

    def arguments(self, context, folder: Path):
        """Those of ``lightdepth calibrate`` for the clicked corners; a packed panorama is written into the folder."""
        settings = context.scene.lightdepth
        width, height = settings.image.size
        corners = " ".join(f"{corner.u * width:.3f},{corner.v * height:.3f}" for corner in settings.corners)
        length = {"WIDTH": "--width", "LENGTH": "--length", "CAMERA": "--camera-height"}[settings.known]
        path = panorama.file_of(settings.image, MeshFolder(folder))
        return ["calibrate", str(path), "--rectangle", corners, length, f"{settings.known_length:.6g}", "--json"]

    def take(self, context, question: Question):
        """Stand the capture point where the renderer says, and lay a grid on the floor."""
        position, rotation, residual, warnings = question.json(_pose)
        settings = context.scene.lightdepth
        settings.capture.rotation_mode = "XYZ"
        settings.capture.location = position
        settings.capture.rotation_euler = rotation
        settings.residual = residual
        show_lines(settings.calibration_notes, warnings)
        show_grid(context)
        for warning in warnings:
            self.report({"WARNING"}, warning)
        self.report({"INFO"}, f"Pose solved, residual {residual:.2f} degrees")


def _pose(solved: dict) -> tuple[Vector, Euler, float, list[str]]:
    """Position, rotation, residual in degrees, and warnings of the command's answer."""
    rotation = Euler([math.radians(angle) for angle in solved["rotation"]], "XYZ")
    warnings = [str(text) for text in solved.get("warnings", [])]
    return Vector(solved["position"]), rotation, float(solved["residual"]), warnings


def show_grid(context) -> None:
    """Lay a grid of metres on the floor, which is seen over the panorama and never rendered."""
    if GRID_NAME in context.scene.objects:
        return
    steps = range(-GRID_METRES, GRID_METRES + 1)
    ends = (-GRID_METRES, GRID_METRES)
    vertices = [(x, y, 0.0) for x in steps for y in ends] + [(x, y, 0.0) for y in steps for x in ends]
    mesh = bpy.data.meshes.new(GRID_NAME)
    mesh.from_pydata(vertices, [(i, i + 1) for i in range(0, len(vertices), 2)], [])
    grid = bpy.data.objects.new(GRID_NAME, mesh)
    context.scene.collection.objects.link(grid)
    grid.hide_render = grid.hide_select = True


classes = (ClickCorners, Calibrate)

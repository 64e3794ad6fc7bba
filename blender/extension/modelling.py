"""Modelling the place roughly: a room from its floor, furniture as boxes, table tops that catch shadows."""

from collections.abc import Sequence
from typing import ClassVar

import bmesh
import bpy
from bpy.props import BoolProperty, CollectionProperty, FloatProperty
from mathutils import Vector
from mathutils.geometry import intersect_line_line_2d

from . import picking, roles
from .properties import FloorCorner

Floor2D = tuple[float, float]


class ModellingError(Exception):
    """What was clicked makes no such shape."""


def new_object(context, name: str, vertices: Sequence, faces: Sequence, role: str) -> bpy.types.Object:
    """Add a mesh with a role to the scene, and make it the active and only selected object."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([tuple(vertex) for vertex in vertices], [], [tuple(face) for face in faces])
    mesh.update()
    item = bpy.data.objects.new(name, mesh)
    context.collection.objects.link(item)
    item.lightdepth.role = role
    roles.show_role(item)
    for other in context.selected_objects:
        other.select_set(False)
    item.select_set(True)
    context.view_layer.objects.active = item
    return item


def counter_clockwise(corners: Sequence[Floor2D]) -> list[Floor2D]:
    """A simple polygon's corners, counter-clockwise seen from above.

    Raises:
        ModellingError: there are fewer than three corners, they enclose no area, or edges cross.
    """
    count = len(corners)
    if count < 3:
        raise ModellingError(f"{count} corners were clicked; a floor has three or more")
    for first in range(count):
        for second in range(first + 2, count):
            if (second + 1) % count != first and intersect_line_line_2d(
                corners[first], corners[first + 1], corners[second], corners[(second + 1) % count]
            ):
                raise ModellingError("The floor's edges cross; click the corners one after the other around the floor")
    doubled = sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(corners, [*corners[1:], corners[0]], strict=True))
    if abs(doubled) < 1e-6:
        raise ModellingError("The corners enclose no area")
    return list(corners) if doubled > 0.0 else list(corners)[::-1]


def room(corners: Sequence[Floor2D], height: float, ceiling: bool):
    """The walls, and the ceiling where wanted, over a floor polygon that is counter-clockwise; normals look inside.

    Returns:
        ``(vertices, faces)``.
    """
    count = len(corners)
    vertices = [(x, y, 0.0) for x, y in corners] + [(x, y, height) for x, y in corners]
    faces = [(i, i + count, (i + 1) % count + count, (i + 1) % count) for i in range(count)]
    if ceiling:
        faces.append(tuple(reversed(range(count, 2 * count))))
    return vertices, faces


class _FloorTool(picking.Clicks):
    """Clicks on the floor plane in a 3D viewport."""

    def point_at(self, context, event):
        under = picking.region_under_mouse(context, event, "VIEW_3D")
        if under is None:
            return None
        place = picking.on_floor(*picking.ray(*under))
        return None if place is None else place.to_2d()

    def draw_points(self, points, cursor):
        picking.draw_lines([*points, *([cursor] if cursor is not None else [])])

    def finish(self, context, points):
        self.corners.clear()
        for point in points:
            self.corners.add().position = point
        return self.execute(context)

    def corner_list(self) -> list[Floor2D]:
        return [tuple(corner.position) for corner in self.corners]


class AddRoom(_FloorTool, bpy.types.Operator):
    """Click the floor's corners one after the other; the walls and the ceiling follow"""

    bl_idname = "lightdepth.add_room"
    bl_label = "Room from Floor"
    bl_options: ClassVar = {"REGISTER", "UNDO"}
    help_text = (
        "Click the floor's corners. Enter or a click on the first: done. Backspace: take one back. Esc: give up."
    )

    corners: CollectionProperty(type=FloorCorner, options={"HIDDEN"})
    height: FloatProperty(name="Height", default=2.5, min=0.01, soft_max=20.0, unit="LENGTH")
    ceiling: BoolProperty(name="Ceiling", default=True)

    def closes(self, context, event, points):
        """The first corner was clicked again."""
        point = self.point_at(context, event)
        if len(points) < 3 or point is None:
            return False
        size = max((points[0] - other).length for other in points)
        return (point - points[0]).length < 0.03 * size

    def execute(self, context):
        """Make the floor, a support, and the walls, environment."""
        try:
            corners = counter_clockwise(self.corner_list())
        except ModellingError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        capture = context.scene.lightdepth.capture
        if capture is not None and not _is_inside(capture.matrix_world.translation, corners):
            self.report({"WARNING"}, "The capture point is not over this floor: does it have all its corners?")
        new_object(context, "Walls", *room(corners, self.height, self.ceiling), roles.ENVIRONMENT)
        floor = [(x, y, 0.0) for x, y in corners]
        new_object(context, "Floor", floor, [range(len(floor))], roles.SUPPORT)
        return {"FINISHED"}


def _is_inside(point, corners: Sequence[Floor2D]) -> bool:
    """Whether a point is over a polygon, by counting the edges that a ray along x crosses."""
    inside = False
    for (ax, ay), (bx, by) in zip(corners, [*corners[1:], corners[0]], strict=True):
        if (ay > point.y) != (by > point.y) and point.x < ax + (point.y - ay) / (by - ay) * (bx - ax):
            inside = not inside
    return inside


class AddBox(_FloorTool, bpy.types.Operator):
    """Click three floor corners of a piece of furniture; a box stands there"""

    bl_idname = "lightdepth.add_box"
    bl_label = "Box on Floor"
    bl_options: ClassVar = {"REGISTER", "UNDO"}
    needed = 3
    help_text = "Click three corners of the furniture's outline on the floor. Backspace: take one back. Esc: give up."

    corners: CollectionProperty(type=FloorCorner, options={"HIDDEN"})
    height: FloatProperty(name="Height", default=0.75, min=0.001, soft_max=5.0, unit="LENGTH")

    def execute(self, context):
        """Make a box without a bottom on the rectangle over the first side as deep as the third corner is away."""
        corners = [Vector(corner) for corner in self.corner_list()]
        if len(corners) != 3:
            self.report({"ERROR"}, f"{len(corners)} corners were given; a box has three on the floor")
            return {"CANCELLED"}
        first, second, third = corners
        side = second - first
        if side.length < 1e-6:
            self.report({"ERROR"}, "The first two corners coincide")
            return {"CANCELLED"}
        across = Vector((-side.y, side.x)).normalized()
        depth = across * (third - first).dot(across)
        if depth.length < 1e-6:
            self.report({"ERROR"}, "The three corners lie on one line")
            return {"CANCELLED"}
        outline = counter_clockwise([tuple(p) for p in (first, second, second + depth, first + depth)])
        centre = sum((Vector(p) for p in outline), Vector((0.0, 0.0))) / 4
        vertices = [(x - centre.x, y - centre.y, z) for z in (0.0, self.height) for x, y in outline]
        sides = [(i, (i + 1) % 4, (i + 1) % 4 + 4, i + 4) for i in range(4)]
        box = new_object(context, "Box", vertices, [*sides, (4, 5, 6, 7)], roles.ENVIRONMENT)
        box.location = (*centre, 0.0)
        return {"FINISHED"}


class AddTop(bpy.types.Operator):
    """Make the upper faces of the selected boxes surfaces of their own that catch shadows"""

    bl_idname = "lightdepth.add_top"
    bl_label = "Plane on Top"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        """A mesh is selected, in object mode."""
        return context.mode == "OBJECT" and any(item.type == "MESH" for item in context.selected_objects)

    def execute(self, context):
        """Part the uppermost level faces from each mesh, so that no two surfaces lie in one plane."""
        for item in [item for item in context.selected_objects if item.type == "MESH"]:
            name = item.name
            if item.data.users > 1:
                item.data = item.data.copy()
            top = _part_top(item)
            if top is None:
                self.report({"WARNING"}, f"'{name}' has no level face that points up")
                continue
            plane = new_object(context, f"{name} top", *top, roles.SUPPORT)
            plane.parent = item
        return {"FINISHED"}


def _part_top(item):
    """Take the highest level faces out of a mesh: ``(vertices, faces)`` in its space, or ``None``."""
    to_world = item.matrix_world
    mesh = bmesh.new()
    try:
        mesh.from_mesh(item.data)
        upward = [
            face
            for face in mesh.faces
            if (to_world.inverted_safe().transposed().to_3x3() @ face.normal).normalized().z > 0.99
        ]
        if not upward:
            return None
        highest = max((to_world @ face.calc_center_median()).z for face in upward)
        top = [face for face in upward if highest - (to_world @ face.calc_center_median()).z < 1e-3]
        corners = {vertex: None for face in top for vertex in face.verts}
        places = [vertex.co.copy() for vertex in corners]
        number = {vertex: index for index, vertex in enumerate(corners)}
        faces = [[number[vertex] for vertex in face.verts] for face in top]
        bmesh.ops.delete(mesh, geom=top, context="FACES_ONLY")
        mesh.to_mesh(item.data)
        item.data.update()
        return places, faces
    finally:
        mesh.free()


classes = (AddRoom, AddBox, AddTop)

"""From a click to a place: on the floor plane, or on the panorama through a viewport or an image editor."""

import math

import bpy
from bpy_extras.view3d_utils import region_2d_to_origin_3d, region_2d_to_vector_3d
from mathutils import Matrix, Vector

from . import roles


def region_under_mouse(context, event, area_type):
    """The drawing region of an editor that the mouse is over.

    Returns:
        ``(area, region, (x, y) in the region's pixels)``, or ``None``.
    """
    for area in context.window.screen.areas:
        if area.type != area_type:
            continue
        for region in area.regions:
            x, y = event.mouse_x - region.x, event.mouse_y - region.y
            if region.type == "WINDOW" and 0 <= x < region.width and 0 <= y < region.height:
                return area, region, (x, y)
    return None


def ray(area, region, position):
    """Origin and unit direction, in the world, of what is seen at a place of a 3D viewport."""
    view = area.spaces.active.region_3d
    return region_2d_to_origin_3d(region, view, position), region_2d_to_vector_3d(region, view, position).normalized()


def on_floor(origin: Vector, direction: Vector) -> Vector | None:
    """Where a ray meets the floor plane z = 0, or ``None`` where it does not."""
    if abs(direction.z) < 1e-6:
        return None
    distance = -origin.z / direction.z
    return origin + distance * direction if distance > 0.0 else None


def seen_from_capture(context, origin: Vector, direction: Vector) -> Vector:
    """Direction in light space of what a ray shows: a point of a real surface, or the panorama at infinity."""
    capture = context.scene.lightdepth.capture.matrix_world
    towards = direction
    start = origin
    graph = context.evaluated_depsgraph_get()
    while True:
        hit, place, _, _, item, _ = context.scene.ray_cast(graph, start, direction)
        if not hit:
            break
        if item.lightdepth.role in roles.REAL:
            towards = place - capture.translation
            break
        start = place + 1e-4 * direction  # new objects are not part of the photograph
    return capture.to_3x3().normalized().transposed() @ towards


def panorama_coordinates(direction: Vector) -> tuple[float, float]:
    """``(u, v)`` in [0, 1] of a direction of light space; v is 0 at the zenith."""
    x, y, z = direction
    return (math.atan2(x, y) / (2.0 * math.pi) + 0.5) % 1.0, math.atan2(math.hypot(x, y), z) / math.pi


def panorama_direction(u: float, v: float) -> Vector:
    """Unit vector of light space at panorama coordinates: the inverse of :func:`panorama_coordinates`."""
    theta, phi = math.pi * v, 2.0 * math.pi * (u - 0.5)
    return Vector((math.sin(theta) * math.sin(phi), math.sin(theta) * math.cos(phi), math.cos(theta)))


def on_image(region, position) -> tuple[float, float] | None:
    """The place ``(u, v)`` of an image editor's panorama at a place of its region, or ``None`` beside the picture."""
    u, upward = region.view2d.region_to_view(*position)
    return (u, 1.0 - upward) if 0.0 <= u <= 1.0 and 0.0 <= upward <= 1.0 else None


def capture_pose(settings) -> Matrix:
    """Light space of the first panorama to world, without scale."""
    return without_scale(settings.capture.matrix_world)


def without_scale(matrix: Matrix) -> Matrix:
    """A matrix's translation and rotation alone."""
    return Matrix.Translation(matrix.translation) @ matrix.to_quaternion().to_matrix().to_4x4()


def tag_redraw(context) -> None:
    """Draw the 3D viewports and image editors again."""
    for area in context.window.screen.areas:
        if area.type in {"VIEW_3D", "IMAGE_EDITOR"}:
            area.tag_redraw()


_NAVIGATION = {"MIDDLEMOUSE", "WHEELUPMOUSE", "WHEELDOWNMOUSE", *(f"NUMPAD_{digit}" for digit in range(10))}


class Clicks:
    """Base of the operators that collect clicks: left adds one, Backspace takes one back, Escape gives up.

    Subclasses say where clicks count (``point_at``), how many are needed (``needed``; ``None``: until Enter, or until
    the first one is clicked again) and what follows (``finish``).
    """

    needed: int | None = None
    help_text = ""

    def point_at(self, context, event):
        """The point that a click here means, or ``None``."""
        raise NotImplementedError

    def finish(self, context, points):
        """All points are there; returns the operator's result."""
        raise NotImplementedError

    def closes(self, context, event, points) -> bool:
        """Whether a click here ends the list instead of adding a point."""
        return False

    def draw_points(self, points, cursor) -> None:
        """Draw what was clicked so far."""

    space_type = bpy.types.SpaceView3D
    draw_stage = "POST_VIEW"

    def invoke(self, context, event):
        """Begin to collect clicks."""
        self._points, self._cursor = [], None
        self._handle = self.space_type.draw_handler_add(self._draw, (), "WINDOW", self.draw_stage)
        context.workspace.status_text_set(self.help_text)
        context.window.cursor_modal_set("CROSSHAIR")
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def _draw(self):
        self.draw_points(self._points, self._cursor)

    def modal(self, context, event):
        """Collect one click, or end."""
        if event.type in _NAVIGATION or event.type.startswith("NDOF"):
            return {"PASS_THROUGH"}
        if event.type == "MOUSEMOVE":
            self._cursor = self.point_at(context, event)
            tag_redraw(context)
            return {"RUNNING_MODAL"}
        if event.value not in {"PRESS", "DOUBLE_CLICK"}:
            return {"RUNNING_MODAL"}
        if event.type in {"ESC", "RIGHTMOUSE"}:
            self._stop(context)
            return {"CANCELLED"}
        if event.type == "BACK_SPACE" and self._points:
            self._points.pop()
            tag_redraw(context)
        if event.type in {"RET", "NUMPAD_ENTER"} and self.needed is None:
            return self._done(context)
        if event.type == "LEFTMOUSE":
            if self.closes(context, event, self._points):
                return self._done(context)
            point = self.point_at(context, event)
            if point is None:
                return {"PASS_THROUGH"}  # a click into another editor or a panel is not ours
            self._points.append(point)
            if len(self._points) == self.needed:
                return self._done(context)
            tag_redraw(context)
        return {"RUNNING_MODAL"}

    def _done(self, context):
        self._stop(context)
        return self.finish(context, self._points)

    def _stop(self, context):
        self.space_type.draw_handler_remove(self._handle, "WINDOW")
        context.workspace.status_text_set(None)
        context.window.cursor_modal_restore()
        tag_redraw(context)


def draw_lines(points, colour=(1.0, 0.6, 0.1, 1.0), closed=False) -> None:
    """Draw points joined by lines in the current drawing handler."""
    import gpu
    from gpu_extras.batch import batch_for_shader

    if not points:
        return
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    shader.bind()
    shader.uniform_float("color", colour)
    places = [tuple(point) if len(point) == 3 else (*point, 0.0) for point in points]
    gpu.state.line_width_set(2.0)
    gpu.state.point_size_set(8.0)
    batch_for_shader(shader, "POINTS", {"pos": places}).draw(shader)
    if len(places) > 1:
        batch_for_shader(shader, "LINE_STRIP", {"pos": [*places, places[0]] if closed else places}).draw(shader)
    gpu.state.line_width_set(1.0)

"""Click the corners of a rug at region coordinates, in an image editor and in a viewport, and solve the pose.

Without a window no event loop brings clicks, so the tools' own functions are called with what a click brings them.
"""

import json
import math
import sys
from types import SimpleNamespace

import bpy
import numpy as np
from mathutils import Vector
from session import answer, begin, module, pose_from_corners, refused

folder = sys.argv[1]
with open(f"{folder}/truth.json") as file:
    truth = json.load(file)
scene = begin()
settings = scene.lightdepth
tool, picking = module("calibration").ClickCorners, module("picking")
found = {}


def editor(name, kind):
    """A workspace's largest editor of a kind, its drawing region, and the context while that workspace is shown."""
    screen = bpy.data.screens[name]
    area = max((area for area in screen.areas if area.type == kind), key=lambda area: area.width)
    context = SimpleNamespace(
        window=SimpleNamespace(screen=screen),
        scene=scene,
        evaluated_depsgraph_get=bpy.context.evaluated_depsgraph_get,
    )
    return area, next(region for region in area.regions if region.type == "WINDOW"), context


def click(region, position):
    """An event at a place of a region, which may lie between pixels so that only the arithmetic is judged."""
    return SimpleNamespace(mouse_x=region.x + position[0], mouse_y=region.y + position[1])


def solve(points):
    """Keep the corners and solve, as the buttons do; returns where the capture point then stands."""
    tool.finish(None, bpy.context, points)
    return pose_from_corners(settings, truth["width"])


found["before a panorama"] = refused(bpy.ops.lightdepth.calibrate)
bpy.ops.lightdepth.load_panorama(filepath=f"{folder}/room.exr")
found["before clicking"] = refused(bpy.ops.lightdepth.calibrate)

# The image editor: v2d maps linearly, so the place of (u, v) in the region follows from two of its places.
_, region, context = editor("Rendering", "IMAGE_EDITOR")
low, high = (np.array(region.view2d.region_to_view(*place)) for place in ((0, 0), (region.width, region.height)))
on_image = SimpleNamespace(_editor="IMAGE_EDITOR")


def place_of(u, v):
    return (np.array((u, 1.0 - v)) - low) / (high - low) * (region.width, region.height)


points = [tool.point_at(on_image, context, click(region, place_of(u, v))) for u, v in truth["corners"]]
found["beside the picture"] = tool.point_at(on_image, context, click(region, place_of(-0.01, 0.5)))
found["outside the editor"] = tool.point_at(on_image, context, click(region, (-5.0, 10.0)))
found["image editor"] = solve(points)
grid = bpy.data.objects["Floor grid"]
places = np.array([vertex.co for vertex in grid.data.vertices])
found["grid"] = {
    "bounds": [places.min(axis=0).tolist(), places.max(axis=0).tolist()],
    "matrix": [list(row) for row in grid.matrix_world],
    "rendered": not grid.hide_render,
    "visible": grid.visible_get(),
}

# The viewport shows what its stored matrices say; instead of the view, the capture point is turned before each click.
area, region, context = editor("Layout", "VIEW_3D")
view = area.spaces.active.region_3d
to_clip, eye = np.array(view.perspective_matrix), np.array(view.view_matrix.inverted().translation)
in_view = SimpleNamespace(_editor="VIEW_3D")


def seen_at(position):
    """Direction of what is seen at a place of the region, from the perspective matrix alone."""
    x, y = (2.0 * p / size - 1.0 for p, size in zip(position, (region.width, region.height)))
    far = np.linalg.inv(to_clip) @ (x, y, 0.9, 1.0)
    direction = far[:3] / far[3] - eye
    return Vector(direction / np.linalg.norm(direction))


def region_place(point):
    """Where a point of the world is in the region."""
    x, y, _, w = to_clip @ (*point, 1.0)
    return 0.5 * (x / w + 1.0) * region.width, 0.5 * (y / w + 1.0) * region.height


def light_direction(u, v):
    theta, phi = math.pi * v, 2.0 * math.pi * (u - 0.5)
    return Vector((math.sin(theta) * math.sin(phi), math.sin(theta) * math.cos(phi), math.cos(theta)))


capture = settings.capture
capture.rotation_mode = "QUATERNION"
points = []
for index, (u, v) in enumerate(truth["corners"]):
    position = (region.width * (0.3 + 0.1 * index), region.height * (0.7 - 0.15 * index))
    capture.location = (index, -2.0, 1.0)
    capture.rotation_quaternion = light_direction(u, v).rotation_difference(seen_at(position))
    bpy.context.view_layer.update()
    points.append(tool.point_at(in_view, context, click(region, position)))
found["viewport"] = solve(points)

# On a modelled floor, a click means the place of the floor, seen from the capture point; a new object is looked through.
bpy.ops.mesh.primitive_plane_add(size=20.0)
bpy.ops.lightdepth.set_role(role="SUPPORT")
bpy.ops.mesh.primitive_uv_sphere_add(radius=0.3, location=Vector(eye) * 0.5)  # before the view's centre
places = [(0.0, 0.0, 0.0), (2.0, 0.5, 0.0), (-1.0, 2.0, 0.0)]
found["on the floor"] = [
    [tool.point_at(in_view, context, click(region, region_place(place))) for place in places],
    places,
    [list(row) for row in capture.matrix_world],
]
clicks = module("modelling").AddRoom
found["floor tool"] = [list(clicks.point_at(None, context, click(region, region_place(place)))) for place in places]

settings.corners[1].u, settings.corners[1].v = 0.5, 0.1  # a corner above the horizon
found["no floor"] = refused(bpy.ops.lightdepth.calibrate)
found["pose after refusal"] = [list(row) for row in capture.matrix_world]
answer(**found)

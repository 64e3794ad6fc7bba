"""In a window, with the mouse and the keyboard: calibrate, model, undo, render, stop a rendering."""

import json
import subprocess
import sys
from pathlib import Path

import window

bpy = window.open_window()

import os  # noqa: E402 - Blender's own modules are there only now

from bpy_extras.view3d_utils import location_3d_to_region_2d  # noqa: E402
from mathutils import Matrix, Quaternion, Vector  # noqa: E402
from session import add_camera, answer, begin, module  # noqa: E402

folder = Path(sys.argv[1])
truth = json.loads((folder / "truth.json").read_text())
found = {}
DRAWN = 0.3
"""Seconds in which a software-drawn window shows what changed and takes what was typed."""


def steps():
    scene = begin()
    bpy.context.preferences.view.render_display_type = "AREA"
    bpy.context.preferences.view.show_splash = False
    settings = scene.lightdepth
    viewport = window.editor("VIEW_3D")
    with bpy.context.temp_override(**viewport):
        bpy.ops.lightdepth.load_panorama(filepath=str(folder / "room.exr"))
    found["shown"] = viewport["area"].spaces.active.shading.type
    viewport["area"].spaces.active.shading.type = "SOLID"  # clicks mean the same, and software draws it fast
    viewport["area"].spaces.active.show_region_ui = True
    yield DRAWN
    yield from calibrate_on_the_image(settings)
    yield from calibrate_in_the_viewport(settings)
    yield from model(scene)
    yield from render(scene)
    answer(**found)


def click_corners(where, places):
    """Start the tool and click; the last click ends it."""
    with bpy.context.temp_override(**where):
        bpy.ops.lightdepth.click_corners("INVOKE_DEFAULT")
    yield DRAWN
    for place in places():
        window.click(where, *place)
        yield DRAWN


def solved(settings):
    with bpy.context.temp_override(**window.editor("VIEW_3D")):
        settings.known, settings.known_length = "WIDTH", truth["width"]
        bpy.ops.lightdepth.calibrate()
        bpy.context.view_layer.update()
    return {
        "corners": [[corner.u, corner.v] for corner in settings.corners],
        "matrix": [list(row) for row in settings.capture.matrix_world],
        "residual": settings.residual,
    }


def calibrate_on_the_image(settings):
    where = window.editor("IMAGE_EDITOR")
    where["area"].spaces.active.show_region_ui = True
    yield DRAWN
    where = window.editor("IMAGE_EDITOR")
    where["area"].spaces.active.image = settings.image
    yield DRAWN
    with bpy.context.temp_override(**where):
        bpy.ops.image.view_all(fit_view=True)
    yield DRAWN
    to_region = where["region"].view2d.view_to_region
    yield from click_corners(where, lambda: [to_region(u, 1.0 - v, clip=False) for u, v in truth["corners"]])
    found["pixel"] = 1.0 / (to_region(1.0, 0.5, clip=False)[0] - to_region(0.0, 0.5, clip=False)[0])
    found["image editor"] = solved(settings)
    settings.corners.clear()


def calibrate_in_the_viewport(settings):
    """From the capture point a person turns the view before each click; so does this."""
    where = window.editor("VIEW_3D")
    yield DRAWN
    where = window.editor("VIEW_3D")
    view = where["area"].spaces.active.region_3d
    settings.capture.location, settings.capture.rotation_euler = (0.0, 0.0, 1.6), (0.0, 0.0, 0.0)
    bpy.context.view_layer.update()
    with bpy.context.temp_override(**where):
        bpy.ops.lightdepth.click_corners("INVOKE_DEFAULT")
    for u, v in truth["corners"]:
        toward = module("picking").panorama_direction(u, v)
        aside = Quaternion((0.0, 1.0, 0.0), 0.15)  # not in the middle, where every lens would be right
        view.view_rotation = (aside @ toward).to_track_quat("-Z", "Y")
        with bpy.context.temp_override(**where):
            bpy.ops.lightdepth.view_from_capture()
        yield DRAWN
        eye = view.view_matrix.inverted().translation
        window.click(where, *location_3d_to_region_2d(where["region"], view, eye + toward))
        yield DRAWN
    found["viewport"] = solved(settings)


def model(scene):
    """From above: a room closed by a click on its first corner, a box in it; then Ctrl-Z twice and Ctrl-Shift-Z twice."""
    where = window.editor("VIEW_3D")
    view = where["area"].spaces.active.region_3d
    view.view_perspective, view.view_rotation = "ORTHO", Matrix.Identity(3).to_quaternion()
    view.view_location, view.view_distance = Vector((0.5, 1.0, 0.0)), 12.0
    yield DRAWN

    def place(x, y):
        return location_3d_to_region_2d(where["region"], view, (x, y, 0.0))

    for operator, corners in (
        (bpy.ops.lightdepth.add_room, [(-1, -2), (3, -2), (3, 4), (-1, 4), (-1, -2)]),
        (bpy.ops.lightdepth.add_box, [(0, 2), (1, 2), (1, 2.5)]),
    ):
        with bpy.context.temp_override(**where):
            operator("INVOKE_DEFAULT")
        yield DRAWN
        for corner in corners:
            window.click(where, *place(*corner))
            yield DRAWN
    bpy.context.view_layer.update()
    found["bounds"] = {
        name: [
            list(map(function, *((item.matrix_world @ vertex.co)[:] for vertex in item.data.vertices)))
            for function in (min, max)
        ]
        for name, item in ((name, bpy.data.objects[name]) for name in ("Floor", "Walls", "Box"))
    }
    found["undone"] = []
    for keys in ("ctrl+z", "ctrl+z", "ctrl+shift+z", "ctrl+shift+z"):
        window.press(keys)
        yield DRAWN
        found["undone"].append(sorted(item.name for item in bpy.data.objects if item.type == "MESH"))
    with bpy.context.temp_override(**where):
        bpy.ops.lightdepth.show_roles()
    shading = where["area"].spaces.active.shading
    found["roles shown"] = [shading.type, shading.color_type]


def render(scene):
    """F12 to its end; F12 and Escape."""
    scene = bpy.context.window_manager.windows[0].scene
    with bpy.context.temp_override(**window.editor("VIEW_3D")):
        bpy.ops.mesh.primitive_uv_sphere_add(radius=0.3, location=(0.5, 1.0, 0.3))
    add_camera(scene, (48, 32), rotation=(1.2, 0.0, 0.0))
    scene.render.engine = "LIGHTDEPTH"
    settings = scene.lightdepth
    settings.samples, settings.max_bounces = 2, 3
    window.press("F12")
    yield DRAWN
    found["rendering"] = bpy.app.is_job_running("RENDER")
    while bpy.app.is_job_running("RENDER"):
        yield DRAWN
    shown("finished")
    found["renderers after"] = renderers()
    window.press("Escape")  # back from the render result to what the editor was
    yield DRAWN
    settings.samples = 1_000_000
    # Another size, so that what is shown is not the picture above.
    scene.render.resolution_x = 40
    window.press("F12")
    while not (renderers() and shown("progressing") == 40):
        yield 1.0
    found["renderers"] = len(renderers())
    window.press("Escape")
    yield DRAWN
    while bpy.app.is_job_running("RENDER"):
        yield DRAWN
    shown("stopped")
    found["renderers after Escape"] = renderers()


def shown(name):
    """Save what the render window shows; returns its width in pixels, 0 where there is nothing yet."""
    path = folder / f"{name}.png"
    try:
        bpy.data.images["Render Result"].save_render(str(path))
    except RuntimeError:
        return 0
    return int.from_bytes(path.read_bytes()[16:20], "big")


def renderers():
    """Processes of the renderer that this Blender started."""
    listed = subprocess.run(
        ["ps", "-o", "pid=,args=", "--ppid", str(os.getpid())], capture_output=True, text=True, check=False
    )
    return [line for line in listed.stdout.splitlines() if "lightdepth" in line and "render" in line]


window.run(steps())

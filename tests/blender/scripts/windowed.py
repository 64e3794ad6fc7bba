"""In a window, with the mouse and the keyboard: calibrate, ask the renderer, model, undo, render, stop a rendering."""

import json
import math
import subprocess
import sys
from pathlib import Path

import window
from window import drawn, tools, until

bpy = window.open_window()

import os  # noqa: E402 - Blender's own modules are there only now

import numpy as np  # noqa: E402
from bpy_extras.view3d_utils import location_3d_to_region_2d  # noqa: E402
from mathutils import Matrix, Quaternion, Vector  # noqa: E402
from session import MODULE, add_camera, answer, begin, module, pose, pose_from_corners, write_program  # noqa: E402

folder = Path(sys.argv[1])
truth = json.loads((folder / "truth.json").read_text())
found = {}


def steps():
    scene = begin()
    preferences = bpy.context.preferences
    preferences.view.render_display_type = "AREA"
    preferences.view.show_splash = False
    # Without a graphics card each drawing takes its time.
    preferences.view.smooth_view, preferences.system.viewport_aa = 0, "OFF"
    settings = scene.lightdepth
    viewport = window.editor("VIEW_3D")
    with bpy.context.temp_override(**viewport):
        bpy.ops.lightdepth.load_panorama(filepath=str(folder / "room.exr"))
    found["shown"] = viewport["area"].spaces.active.shading.type
    viewport["area"].spaces.active.shading.type = "SOLID"  # clicks mean the same, and software draws it fast
    viewport["area"].spaces.active.show_region_ui = True
    yield from drawn()
    yield from calibrate_on_the_image(settings)
    yield from calibrate_in_the_viewport(settings)
    yield from give_up_on_a_renderer_that_hangs(settings)
    yield from model(scene)
    yield from render(scene)
    yield from preview()
    yield from match_pictures()
    answer(**found)


def begin_tool(operator, where):
    """Begin a tool; returns it."""
    with bpy.context.temp_override(**where):
        operator("INVOKE_DEFAULT")
    return tools()[0]


def clicked(tool, where, place):
    """Click, and wait until the tool has the click; a tool that has all it needs is gone."""
    count = len(tool._points)
    window.click(where, *place)
    yield from until(lambda: not tools() or len(tool._points) > count)


def calibrate_on_the_image(settings):
    where = window.editor("IMAGE_EDITOR")
    where["area"].spaces.active.show_region_ui = True
    yield from drawn()
    where = window.editor("IMAGE_EDITOR")
    where["area"].spaces.active.image = settings.image
    yield from drawn()
    with bpy.context.temp_override(**where):
        bpy.ops.image.view_all(fit_view=True)
    yield from drawn()
    to_region = where["region"].view2d.view_to_region
    tool = begin_tool(bpy.ops.lightdepth.click_corners, where)
    for u, v in truth["corners"]:
        yield from clicked(tool, where, to_region(u, 1.0 - v, clip=False))
    found["pixel"] = 1.0 / (to_region(1.0, 0.5, clip=False)[0] - to_region(0.0, 0.5, clip=False)[0])
    with bpy.context.temp_override(**window.editor("VIEW_3D")):
        found["image editor"] = pose_from_corners(settings, truth["width"])
    settings.corners.clear()


def calibrate_in_the_viewport(settings):
    """From the capture point a person turns the view before each click; so does this. The button is pressed here."""
    where = window.editor("VIEW_3D")
    yield from drawn()
    where = window.editor("VIEW_3D")
    view = where["area"].spaces.active.region_3d
    settings.capture.location, settings.capture.rotation_euler = (0.0, 0.0, 1.6), (0.0, 0.0, 0.0)
    settings.residual = -1.0
    bpy.context.view_layer.update()
    tool = begin_tool(bpy.ops.lightdepth.click_corners, where)
    for u, v in truth["corners"]:
        toward = module("picking").panorama_direction(u, v)
        aside = Quaternion((0.0, 1.0, 0.0), 0.15)  # not in the middle, where every lens would be right
        view.view_rotation = (aside @ toward).to_track_quat("-Z", "Y")
        with bpy.context.temp_override(**where):
            bpy.ops.lightdepth.view_from_capture()
        yield from drawn()
        eye = view.view_matrix.inverted().translation
        yield from clicked(tool, where, location_3d_to_region_2d(where["region"], view, eye + toward))
    begin_tool(bpy.ops.lightdepth.calibrate, where)
    yield from until(lambda: not tools())
    found["viewport"] = pose(settings)


def give_up_on_a_renderer_that_hangs(settings):
    """Blender goes on while the renderer does not answer, and Escape ends it."""
    preferences = bpy.context.preferences.addons[MODULE].preferences
    preferences.command = write_program(folder / "hanging", "touch $0.started; sleep 600")
    where, before = window.editor("VIEW_3D"), settings.residual
    begin_tool(bpy.ops.lightdepth.calibrate, where)
    yield from until((folder / "hanging.started").exists)
    view = where["area"].spaces.active.region_3d
    distance = view.view_distance
    window.move(where, 100, 100, "key", "Home")  # shows all that there is
    yield from until(lambda: view.view_distance != distance)
    found["asked"] = len(renderers())
    window.press("Escape")
    yield from until(lambda: not tools())
    found["asked after Escape"] = [len(renderers()), settings.residual == before]
    found["told after Escape"] = reports()
    preferences.command = os.environ["LIGHTDEPTH_RENDERER"]


def reports():
    """What Blender told so far, as its info editor has it."""
    area = next(area for area in bpy.context.screen.areas if area.type == "DOPESHEET_EDITOR")
    area.type = "INFO"
    with bpy.context.temp_override(area=area, region=next(each for each in area.regions if each.type == "WINDOW")):
        bpy.ops.info.select_all(action="SELECT")
        bpy.ops.info.report_copy()
    area.type = "DOPESHEET_EDITOR"
    return bpy.context.window_manager.clipboard


def model(scene):
    """From above: a room closed by a click on its first corner, a box in it; then Ctrl-Z twice and Ctrl-Shift-Z twice."""
    where = window.editor("VIEW_3D")
    view = where["area"].spaces.active.region_3d
    view.view_perspective, view.view_rotation = "ORTHO", Matrix.Identity(3).to_quaternion()
    view.view_location, view.view_distance = Vector((0.5, 1.0, 0.0)), 12.0
    yield from drawn()

    def place(x, y):
        return location_3d_to_region_2d(where["region"], view, (x, y, 0.0))

    for operator, corners in (
        (bpy.ops.lightdepth.add_room, [(-1, -2), (3, -2), (3, 4), (-1, 4), (-1, -2)]),
        (bpy.ops.lightdepth.add_box, [(0, 2), (1, 2), (1, 2.5)]),
    ):
        tool = begin_tool(operator, where)
        for corner in corners:
            yield from clicked(tool, where, place(*corner))
        yield from drawn()
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
        before = meshes()
        window.press(keys)
        yield from until(lambda before=before: meshes() != before)
        found["undone"].append(meshes())
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
    settings.draft, settings.max_bounces = True, 3
    window.press("F12")
    yield from until(is_rendering)
    yield from until(lambda: not is_rendering())
    shown_width("finished")
    found["renderers after"] = renderers()
    window.press("Escape")  # back from the render result to what the editor was
    yield from drawn()
    settings.draft, settings.samples = False, 1_000_000
    # Another size, so that what is shown is not the picture above.
    scene.render.resolution_x = 40
    window.press("F12")
    yield from until(lambda: renderers() and shown_width("progressing") == 40, every=0.3)
    found["renderers"] = renderers()
    window.press("Escape")
    yield from until(lambda: not is_rendering())
    shown_width("stopped")
    found["renderers after Escape"] = renderers()


def preview():
    """A shining ball in the viewport's pictures: it is moved, the view is turned, F12 comes first, and the mode is left."""
    scene = bpy.context.window_manager.windows[0].scene
    window.press("Escape")  # back from the render result
    yield from drawn()
    ball = bpy.data.objects["Sphere"]
    glow = bpy.data.materials.new("Glow")
    glow.use_nodes = True
    shader = glow.node_tree.nodes["Principled BSDF"]
    scene.view_settings.view_transform = "Standard"
    shader.inputs["Base Color"].default_value = (0.0, 0.0, 0.0, 1.0)
    shader.inputs["Emission Color"].default_value = (0.0, 1.0, 0.0, 1.0)
    shader.inputs["Emission Strength"].default_value = 1.0
    ball.data.materials.append(glow)
    ball.select_set(False)
    scene.lightdepth.samples = 2
    where = window.editor("VIEW_3D")
    space = where["area"].spaces.active
    view = space.region_3d
    scene.camera.rotation_euler = (ball.location - scene.camera.location).to_track_quat("-Z", "Y").to_euler()
    view.view_perspective = "CAMERA"
    space.overlay.show_overlays = space.show_gizmo = space.show_region_ui = space.show_region_toolbar = False
    space.shading.type = "RENDERED"
    viewport = module("viewport")
    yield from until(lambda: viewport._live)

    def live():
        return next(iter(viewport._live))

    found["green"] = {}
    number = [0]

    def look(name):
        """Wait for the finest picture; note which share of what shines is within the ball, and which share of it shines."""
        yield from until(lambda: settled(live()) and live()._preview.picture.number > number[0])
        number[0] = live()._preview.picture.number
        yield from drawn()
        yield 0.2
        to_world, centre = view.view_matrix.inverted(), ball.matrix_world.translation
        outline = 0.3 / math.sqrt(
            1.0 - (0.3 / (to_world.translation - centre).length) ** 2
        )  # of a sphere, seen from near
        x, y = location_3d_to_region_2d(where["region"], view, centre)
        edge = location_3d_to_region_2d(where["region"], view, centre + outline * to_world.col[0].xyz)
        region, height = where["region"], bpy.context.window_manager.windows[0].height
        pixels = window.screen(folder)[height - region.y - region.height : height - region.y, region.x :]
        pixels = pixels[:, : region.width].astype(float)
        shines = (pixels[..., 1] > 200) & (pixels[..., 1] > 2.0 * pixels[..., 0])
        rows, columns = np.nonzero(shines)
        inside = np.hypot(columns + 0.5 - x, region.height - rows - 0.5 - y) < abs(edge.x - x)
        found["green"][name] = [
            float(inside.mean()) if len(rows) else 0.0,
            float(inside.sum() / (np.pi * (edge.x - x) ** 2)),
        ]

    yield from look("first")
    found["preview's renderer"] = renderers()
    ball.location.x += 0.3
    yield from look("moved")
    blur = scene.camera.data.dof
    blur.use_dof, blur.aperture_fstop, blur.focus_distance = True, 2.8, 2.0
    yield from until(lambda: settled(live()) and all("aperture" in text for text, _ in live()._asked[1:]))
    blur.use_dof = False
    yield from until(lambda: settled(live()) and not any("aperture" in text for text, _ in live()._asked[1:]))
    number[0] = live()._preview.picture.number
    view.view_perspective, view.view_location, view.view_distance = "PERSP", ball.location.copy(), 1.5
    view.view_rotation = Vector((0.4, 0.8, -0.5)).to_track_quat("-Z", "Y")
    yield from look("turned")
    # Something that takes too long, and F12 meanwhile.
    scene.lightdepth.samples = 1_000_000
    scene.update_tag()
    yield from until(lambda: "samples" in live()._preview.status)
    before, scene.lightdepth.samples = live()._preview.picture.number, 1
    scene.update_tag()
    scene.render.resolution_x = 44
    bpy.context.preferences.view.render_display_type = "NONE"  # or the viewport would make room for the picture
    window.press("F12")
    yield from until(is_rendering)
    yield from until(lambda: not is_rendering())
    found["F12 beside the preview"] = shown_width("beside")
    yield from until(lambda: settled(live()) and live()._preview.picture.number > before)
    view.view_perspective = "ORTHO"
    yield from until(lambda: "orthographic" in live()._preview.status)
    space.shading.type = "SOLID"
    yield from until(lambda: not viewport._live)
    found["renderers after the preview"] = renderers()


def match_pictures():
    """Points clicked in turn on the first panorama and on a second one, then on the first and on a plate."""
    scene = bpy.context.window_manager.windows[0].scene
    settings = scene.lightdepth
    window.editor("IMAGE_EDITOR")["area"].spaces.active.show_region_ui = True
    yield from drawn()
    where = window.editor("IMAGE_EDITOR")
    sidebar = next(region for region in where["area"].regions if region.type == "UI")
    sidebar.active_panel_category = "lightdepth"
    camera = add_camera(scene)
    with bpy.context.temp_override(**where):
        bpy.ops.lightdepth.add_panorama(filepath=str(folder / "second.exr"))
        bpy.ops.lightdepth.load_plate(filepath=str(folder / "plate.exr"))
    plate = camera.data.lightdepth.plate
    found["matched"] = {}
    for name, index, owner in (("second", 0, settings.further[0]), ("plate", -1, plate)):
        with bpy.context.temp_override(**where):
            bpy.ops.lightdepth.click_shared_points("INVOKE_DEFAULT", index=index)
        tool = tools()[0]
        for pair in truth["pairs"][name]:
            for place in pair:
                yield from drawn()
                with bpy.context.temp_override(**where):
                    bpy.ops.image.view_all(fit_view=True)
                yield from drawn()
                yield from clicked(
                    tool, where, where["region"].view2d.view_to_region(place[0], 1.0 - place[1], clip=False)
                )
        window.press("Return")
        yield from until(lambda: not tools())
        found["matched"][name] = [[list(pair.first), list(pair.other)] for pair in owner.points]
    yield from drawn()


def settled(shown):
    """Whether the preview has done what it was asked."""
    preview = shown._preview
    return preview.picture is not None and not preview.status and not shown._changed and not preview.is_asked


def is_rendering():
    return bpy.app.is_job_running("RENDER")


def meshes():
    return sorted(item.name for item in bpy.data.objects if item.type == "MESH")


def shown_width(name):
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
    return [line for line in listed.stdout.splitlines() if "lightdepth" in line or "hanging" in line]


window.run(steps())

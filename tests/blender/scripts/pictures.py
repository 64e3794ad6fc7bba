"""Take the pictures of docs/blender.md, in a real window.

Arguments: the folder to write into, and the repository's. The extension must be installed (``install.py`` does that),
LIGHTDEPTH_RENDERER must name the renderer, and DISPLAY a display of 1280 x 800 pixels.
"""

import math
import sys
from pathlib import Path

import window

bpy = window.open_window()

import bmesh  # noqa: E402 - Blender's own modules are there only now
from bpy_extras.view3d_utils import location_3d_to_region_2d  # noqa: E402
from mathutils import Euler, Matrix, Quaternion, Vector  # noqa: E402
from session import MODULE, add_camera, begin, module  # noqa: E402

folder, repository = Path(sys.argv[1]), Path(sys.argv[2])
POSITION, ROTATION = (0.0, 0.0, 1.3), [math.radians(angle) for angle in (-0.343, 0.128, 30.43)]
FLOOR = [(-1.384, -1.38), (1.848, -1.38), (1.848, 1.453), (-1.384, 1.453)]
"""The hotel room's floor without its corridor, as examples/lounge/model_room.py measured it; metres."""
DRAWN = 3.0
"""Seconds in which a window without a graphics card shows what changed."""
COMPILED = 90.0
"""Seconds in which it compiles the shaders of its material preview."""


def steps():
    scene = begin()
    bpy.context.preferences.view.render_display_type = "AREA"
    bpy.context.preferences.view.show_splash = False
    scene.eevee.taa_samples = 2  # each costs seconds without a graphics card
    settings = scene.lightdepth
    where = window.editor("VIEW_3D")
    with bpy.context.temp_override(**where):
        bpy.ops.lightdepth.load_panorama(filepath=str(repository / "examples/lounge/hotel_room.exr"))
    space = where["area"].spaces.active
    space.show_region_ui, space.lens = True, 30.0
    yield COMPILED
    for region in where["area"].regions:
        if region.type == "UI":
            region.active_panel_category = "lightdepth"
    yield from calibrate(settings)
    settings.capture.location, settings.capture.rotation_euler = POSITION, ROTATION
    yield from model(scene)
    yield from holes(scene)
    yield from viewport(scene)
    yield from render(scene)
    yield from preferences()


def look(where, toward):
    """Turn the viewport's eye at the capture point."""
    view = where["area"].spaces.active.region_3d
    view.view_rotation = Vector(toward).to_track_quat("-Z", "Y")
    with bpy.context.temp_override(**where):
        bpy.ops.lightdepth.view_from_capture()
    return view


def calibrate(settings):
    """In the image editor: three corners clicked; then the pose solved, with the grid in the viewport."""
    picking = module("picking")
    to_light = Matrix.LocRotScale(POSITION, Euler(ROTATION), None).inverted()
    rug = [(-1.384, -1.38), (0.36, -1.38), (0.36, 1.453), (-1.384, 1.453)]
    corners = [picking.panorama_coordinates(to_light @ Vector((*corner, 0.0))) for corner in rug]
    where = window.editor("IMAGE_EDITOR")
    where["area"].spaces.active.show_region_ui = True
    yield DRAWN
    where = window.editor("IMAGE_EDITOR")
    where["area"].spaces.active.image = settings.image
    for region in where["area"].regions:
        if region.type == "UI":
            region.active_panel_category = "lightdepth"
    yield DRAWN
    with bpy.context.temp_override(**where):
        bpy.ops.image.view_all(fit_view=True)
        bpy.ops.lightdepth.click_corners("INVOKE_DEFAULT")
    yield DRAWN
    to_region = where["region"].view2d.view_to_region
    places = [to_region(u, 1.0 - v, clip=False) for u, v in corners]
    for place in places[:3]:
        window.click(where, *place)
        yield DRAWN
    window.move(where, *places[3])
    yield DRAWN
    window.picture(folder / "corners.png")
    window.click(where, *places[3])
    yield DRAWN
    settings.known, settings.known_length = "CAMERA", 1.3
    where = window.editor("VIEW_3D")
    yield DRAWN
    with bpy.context.temp_override(**where):
        bpy.ops.lightdepth.calibrate()
    bpy.context.view_layer.update()
    look(where, (0.3, 1.0, -1.0))
    for wait in (2 * DRAWN, DRAWN):  # the sidebar moves its panels apart in a second drawing
        for region in where["area"].regions:
            region.tag_redraw()
        yield wait
    window.picture(folder / "calibrated.png")
    bpy.data.objects.remove(bpy.data.objects["Floor grid"])


def model(scene):
    """The floor while it is clicked, the place with a bed and a new object, and the colours of roles."""
    where = window.editor("VIEW_3D")
    bpy.context.view_layer.update()
    view = look(where, (0.15, 1.0, -1.1))
    yield DRAWN
    with bpy.context.temp_override(**where):
        bpy.ops.lightdepth.add_room("INVOKE_DEFAULT")
    for corner in ((-0.5, 0.75), (0.6, 0.75), (0.6, 1.45)):
        window.click(where, *location_3d_to_region_2d(where["region"], view, (*corner, 0.0)))
        yield DRAWN
    window.move(where, *location_3d_to_region_2d(where["region"], view, (-0.5, 1.45, 0.0)))
    yield DRAWN
    window.picture(folder / "floor.png")
    window.press("Escape")
    yield DRAWN
    with bpy.context.temp_override(**where):
        bpy.ops.lightdepth.add_room(corners=[{"name": "", "position": corner} for corner in FLOOR], height=2.7)
        bpy.ops.lightdepth.add_box(
            corners=[{"name": "", "position": corner} for corner in ((0.36, -0.58), (1.848, -0.58), (1.848, 0.86))],
            height=0.55,
        )
        bpy.context.object.name = "Bed"
        bpy.ops.lightdepth.add_top()
        bpy.ops.mesh.primitive_monkey_add(size=0.5, location=(-0.2, 0.95, 0.2), rotation=(-0.6, 0.0, 0.3))
    monkey = bpy.context.object
    bpy.context.view_layer.update()
    monkey.location.z -= min((monkey.matrix_world @ vertex.co).z for vertex in monkey.data.vertices)  # on the floor
    for face in monkey.data.polygons:
        face.use_smooth = True
    copper = bpy.data.materials.new("Copper")
    copper.use_nodes = True
    shader = copper.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (0.9, 0.45, 0.3, 1.0)
    shader.inputs["Metallic"].default_value, shader.inputs["Roughness"].default_value = 1.0, 0.15
    monkey.data.materials.append(copper)
    camera = add_camera(scene, (640, 400), POSITION)
    camera.rotation_euler = Vector((0.15, 1.0, -0.9)).to_track_quat("-Z", "Y").to_euler()
    camera.data.lens = 20.0
    camera.hide_set(True)  # seen from where it stands it would hide the place
    look(where, (0.25, 1.0, -0.9))
    yield COMPILED
    window.picture(folder / "place.png")
    view.view_distance, view.view_location = 4.0, Vector((0.2, 0.0, 0.8))
    view.view_rotation = Quaternion((0.0, 0.0, 1.0), 0.6) @ Quaternion((1.0, 0.0, 0.0), 0.9)
    with bpy.context.temp_override(**where):
        bpy.ops.lightdepth.show_roles()
    yield DRAWN
    window.picture(folder / "roles.png")


def holes(scene):
    """A wall forgotten: red patches where it was."""
    walls = bpy.data.objects["Walls"]
    kept = walls.data.copy()
    mesh = bmesh.new()
    mesh.from_mesh(walls.data)
    mesh.faces.ensure_lookup_table()
    bmesh.ops.delete(mesh, geom=[mesh.faces[1]], context="FACES_ONLY")
    mesh.to_mesh(walls.data)
    mesh.free()
    where = window.editor("VIEW_3D")
    with bpy.context.temp_override(**where):
        bpy.ops.lightdepth.check()
    bpy.context.view_layer.update()
    look(where, (1.0, 0.5, -0.35))
    yield DRAWN
    window.scroll_sidebar(where, 12)
    window.move(where, 200, 300)
    yield 5 * DRAWN
    window.picture(folder / "holes.png")
    walls.data = kept
    bpy.data.objects.remove(bpy.data.objects["Holes"])


def viewport(scene):
    """The renderer's picture in the viewport, with the object selected and the passes of the view layer beside it."""
    where = window.editor("VIEW_3D")
    scene.render.engine, scene.lightdepth.samples = "LIGHTDEPTH", 32
    space = where["area"].spaces.active
    monkey = bpy.data.objects["Suzanne"]
    for item in bpy.context.selected_objects:
        item.select_set(False)
    monkey.select_set(True)
    bpy.context.view_layer.objects.active = monkey
    look(where, (0.15, 1.0, -0.9))
    window.move(where, 200, 300)  # away from buttons, which would show what they do
    properties = next(area for area in where["window"].screen.areas if area.type == "PROPERTIES")
    properties.spaces.active.context = "VIEW_LAYER"
    before, space.shading.type = space.shading.type, "RENDERED"
    while not module("viewport")._live:
        yield DRAWN
    preview = next(iter(module("viewport")._live))._preview
    while preview.is_asked or preview.picture is None:
        yield DRAWN
    yield 2 * DRAWN
    window.picture(folder / "viewport.png")
    space.shading.type = before


def render(scene):
    """A dome camera's settings beside the viewport; then F12 while it works."""
    where = window.editor("VIEW_3D")
    camera, size = scene.camera, (scene.render.resolution_x, scene.render.resolution_y)
    scene.render.engine = "LIGHTDEPTH"
    bpy.ops.lightdepth.add_camera(kind="DOME")
    dome = scene.camera
    properties = next(area for area in where["window"].screen.areas if area.type == "PROPERTIES")
    for item in bpy.context.selected_objects:
        item.select_set(False)
    dome.select_set(True)
    bpy.context.view_layer.objects.active = dome
    yield DRAWN
    properties.spaces.active.context = "DATA"
    for _ in range(4):  # as far as it is drawn, each time
        window.scroll_sidebar(where, 15)
        yield DRAWN
    window.move(where, 200, 300)
    yield DRAWN
    window.picture(folder / "cameras.png")
    bpy.data.objects.remove(dome)
    scene.camera, (scene.render.resolution_x, scene.render.resolution_y) = camera, size
    properties.spaces.active.context = "RENDER"
    scene.lightdepth.samples = 512
    window.press("F12")
    path = folder / "rendered.png"
    while not path.exists():
        yield DRAWN
        if bpy.app.is_job_running("RENDER"):
            try:
                bpy.data.images["Render Result"].save_render(str(path))
            except RuntimeError:
                continue
    yield 10 * DRAWN
    window.picture(folder / "render.png")
    path.unlink()
    window.press("Escape")
    while bpy.app.is_job_running("RENDER"):
        yield DRAWN
    window.press("Escape")
    yield DRAWN


def preferences():
    """The preferences, after the test button."""
    where = window.editor("PREFERENCES")
    bpy.context.preferences.active_section = "ADDONS"
    bpy.context.window_manager.addon_search = "lightdepth"
    bpy.ops.lightdepth.test_renderer()
    bpy.context.preferences.addons[MODULE].preferences.command = ""
    with bpy.context.temp_override(**where):
        bpy.ops.preferences.addon_expand(module=MODULE)
    yield 2 * DRAWN
    window.picture(folder / "preferences.png")


window.run(steps())

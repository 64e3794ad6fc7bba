"""Export cameras, and let Blender's path tracer paint the direction of each of their pixels."""

import sys

import bpy
import numpy as np
from session import add_camera, answer, begin, cycles, rendered, room

folder = sys.argv[1]
scene = begin()
room(folder)
item = add_camera(scene, rotation=(1.1, 0.2, 0.7))
camera = item.data
panoramic = camera if hasattr(camera, "panorama_type") else camera.cycles
world = bpy.data.worlds.new("directions")
world.use_nodes = True
nodes, links = world.node_tree.nodes, world.node_tree.links
shift = nodes.new("ShaderNodeVectorMath")
shift.operation = "MULTIPLY_ADD"
shift.inputs[1].default_value = shift.inputs[2].default_value = (0.5, 0.5, 0.5)
links.new(nodes.new("ShaderNodeTexCoord").outputs["Generated"], shift.inputs[0])
links.new(shift.outputs[0], nodes["Background"].inputs["Color"])


def lens(fit, shift_x, shift_y):
    camera.type, camera.lens, camera.sensor_width, camera.sensor_height = "PERSP", 28.0, 36.0, 20.0
    camera.sensor_fit, camera.shift_x, camera.shift_y = fit, shift_x, shift_y


def panorama(kind, **settings):
    camera.type, camera.shift_x, camera.shift_y, camera.sensor_fit = "PANO", 0.0, 0.0, "AUTO"
    panoramic.panorama_type = kind
    for name, value in settings.items():
        setattr(panoramic, name, value)


CASES = {
    "wide": ((32, 20), lambda: lens("AUTO", 0.1, 0.2)),
    "tall": ((20, 32), lambda: lens("AUTO", 0.1, -0.2)),
    "fit to the width": ((20, 32), lambda: lens("HORIZONTAL", 0.1, 0.2)),
    "fit to the height": ((32, 20), lambda: lens("VERTICAL", 0.1, 0.2)),
    "equidistant": ((32, 32), lambda: panorama("FISHEYE_EQUIDISTANT", fisheye_fov=3.5)),
    "equisolid": ((32, 32), lambda: panorama("FISHEYE_EQUISOLID", fisheye_fov=3.1, fisheye_lens=10.5)),
    "equirectangular": ((64, 32), lambda: panorama("EQUIRECTANGULAR")),
}
meshes = [each for each in scene.objects if each.type == "MESH"]
for name, ((width, height), set_up) in CASES.items():
    scene.render.resolution_x, scene.render.resolution_y = width, height
    set_up()
    bpy.ops.lightdepth.export_scene(filepath=f"{folder}/{name}.toml")
    before = scene.world
    scene.world = world
    for mesh in meshes:
        mesh.hide_render = True
    cycles(scene)
    np.save(f"{folder}/{name}.npy", rendered(scene, f"{folder}/{name}.exr")[:, :, :3] * 2.0 - 1.0)
    scene.world = before
    for mesh in meshes:
        mesh.hide_render = False

# The buttons for new cameras, with a capture point that is turned and a little crooked.
capture = scene.lightdepth.capture
capture.location, capture.rotation_euler = (0.5, 0.25, 1.5), (0.02, -0.01, 0.5)
bpy.context.view_layer.update()
added = {}
for kind in ("PANORAMA", "DOME", "PERSPECTIVE"):
    bpy.ops.lightdepth.add_camera(kind=kind)
    bpy.context.view_layer.update()
    bpy.ops.lightdepth.export_scene(filepath=f"{folder}/{kind}.toml")
    added[kind] = scene.camera.name
answer(cases=list(CASES), added=added)

"""What Blender's path tracer sees from the capture point must be the panorama, whatever is modelled."""

import sys

import bpy
import numpy as np
from mathutils import Matrix
from session import add_camera, answer, begin, corners, cycles, rendered, write_panorama

folder = sys.argv[1]
scene = begin()
pixels = write_panorama(f"{folder}/panorama.exr", height=64)
bpy.ops.lightdepth.load_panorama(filepath=f"{folder}/panorama.exr")
capture = scene.lightdepth.capture
capture.location, capture.rotation_euler = (0.3, -0.2, 1.5), (0.1, 0.2, 0.8)
bpy.context.view_layer.update()
camera = add_camera(scene, (128, 64))
camera.data.type = "PANO"
(camera.data if hasattr(camera.data, "panorama_type") else camera.data.cycles).panorama_type = "EQUIRECTANGULAR"
upright = Matrix(((1, 0, 0), (0, 0, -1), (0, 1, 0)))  # Blender's camera looking along +y with z up
camera.matrix_world = capture.matrix_world @ upright.to_4x4()
cycles(scene)
worst = {}


def look(name):
    seen = rendered(scene, f"{folder}/{name}.exr")
    worst[name] = float(np.abs(seen - pixels)[2:-2, :, :3].max())


look("world")
bpy.ops.lightdepth.add_room(corners=corners((-2, -2), (2, -2), (2, 3), (-2, 3)), height=2.6)
scene.world = bpy.data.worlds.new("black")
look("room")
bpy.ops.lightdepth.add_box(corners=corners((-1.5, 1), (-0.5, 1.2), (-0.6, 1.8)), height=0.7)
bpy.ops.lightdepth.add_top()
look("furniture")
walls = bpy.data.objects["Walls"]
for item in scene.objects:
    item.select_set(item == walls)
bpy.ops.lightdepth.store_rest()
look("rest")
for vertex in walls.data.vertices:
    vertex.co.x *= 0.7
look("deformed")
bpy.ops.lightdepth.clear_rest()
look("cleared")
answer(worst=worst)

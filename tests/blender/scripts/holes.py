"""Check a room without a ceiling, with it, and with a sphere in it; the renderer looks for holes as well."""

import sys

import bpy
from session import answer, begin, corners, room

folder = sys.argv[1]
scene = begin()
room(folder)
walls = bpy.data.objects["Walls"]
bpy.data.objects.remove(walls)
bpy.data.objects.remove(bpy.data.objects["Floor"])
bpy.ops.lightdepth.add_room(corners=corners((-2, -2), (2, -2), (2, 3), (-2, 3)), height=2.5, ceiling=False)
bpy.ops.mesh.primitive_uv_sphere_add(radius=0.3, location=(0.0, 0.0, 2.2))  # new objects fill no hole
bpy.ops.lightdepth.check()
holes = bpy.data.objects["Holes"]
shader = holes.data.materials[0].node_tree.nodes["Emission"]
found = {
    "coverage": scene.lightdepth.coverage,
    "notes": [line.text for line in scene.lightdepth.check_notes],
    "cells": [
        [list(holes.matrix_world.to_3x3() @ holes.data.vertices[corner].co) for corner in face.vertices]
        for face in holes.data.polygons
    ],
    "around": list(holes.matrix_world.translation),
    "colours": [
        list(holes.color),
        list(shader.inputs["Color"].default_value),
        list(holes.data.materials[0].diffuse_color),
    ],
    "rendered": not holes.hide_render,
}
for item in list(scene.objects):
    if item.type == "MESH":
        bpy.data.objects.remove(item)
bpy.ops.lightdepth.add_room(corners=corners((-2, -2), (2, -2), (2, 3), (-2, 3)), height=2.5)
bpy.ops.lightdepth.check()
found["closed"] = [scene.lightdepth.coverage, "Holes" in bpy.data.objects]
answer(**found)

"""Render something that takes far too long; the test cancels it."""

import sys

import bpy
from session import add_camera, begin, room

scene = begin()
room(sys.argv[1])
bpy.ops.mesh.primitive_uv_sphere_add(radius=0.4, location=(0.0, 1.6, 0.4))
add_camera(scene, (320, 240))
scene.render.engine = "LIGHTDEPTH"
scene.lightdepth.samples = 1_000_000
bpy.ops.render.render()

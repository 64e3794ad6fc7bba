"""A USD file with an arm that bends, a lump that swells, and a camera that travels, by Blender's exporter.

Argument: the file. Answers where everything is at some frames.
"""

import sys

import bpy
import numpy as np
from session import answer

FRAMES = (1, 5, 8, 12)
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.frame_start, scene.frame_end = 1, 12

# An arm: a bar that is bent by the second of two bones.
bpy.ops.object.armature_add(location=(1.0, 0.0, 0.0))
rig = bpy.context.object
rig.rotation_euler = (0.0, 0.3, 0.0)
bpy.ops.object.mode_set(mode="EDIT")
first = rig.data.edit_bones[0]
second = rig.data.edit_bones.new("second")
second.head, second.tail, second.parent = first.tail, (0.0, 0.0, 2.0), first
bpy.ops.object.mode_set(mode="OBJECT")
bpy.ops.mesh.primitive_cylinder_add(radius=0.2, depth=2.0, vertices=8, location=(1.0, 0.0, 1.0))
bar = bpy.context.object
bpy.ops.object.mode_set(mode="EDIT")
bpy.ops.mesh.subdivide(number_cuts=4)
bpy.ops.object.mode_set(mode="OBJECT")
bar.select_set(True)
rig.select_set(True)
bpy.context.view_layer.objects.active = rig
bpy.ops.object.parent_set(type="ARMATURE_AUTO")
bone = rig.pose.bones["second"]
bone.rotation_mode = "XYZ"
for frame, angle in ((1, 0.0), (12, 1.2)):
    bone.rotation_euler.x = angle
    bone.keyframe_insert("rotation_euler", frame=frame)

# A lump with a shape key.
bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=2, location=(-2.0, 0.5, 1.0))
lump = bpy.context.object
lump.shape_key_add(name="Basis")
key = lump.shape_key_add(name="swollen")
for point in key.data:
    point.co.z *= 2.0
for frame, value in ((1, 0.0), (12, 1.0)):
    key.value = value
    key.keyframe_insert("value", frame=frame)

camera = bpy.data.objects.new("shot", bpy.data.cameras.new("shot"))
camera.data.lens = 28.0
scene.collection.objects.link(camera)
for frame, place, turn in ((1, (0.0, -6.0, 1.5), (1.4, 0.1, 0.0)), (12, (2.0, -5.0, 2.0), (1.3, 0.0, 0.4))):
    camera.location, camera.rotation_euler = place, turn
    camera.keyframe_insert("location", frame=frame)
    camera.keyframe_insert("rotation_euler", frame=frame)

bpy.ops.wm.usd_export(
    filepath=sys.argv[1], export_animation=True, export_armatures=True, export_shapekeys=True,
    convert_world_material=False,
)  # fmt: skip


def shape(thing):
    mesh = thing.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    mesh.transform(thing.matrix_world)
    mesh.calc_loop_triangles()
    points = np.array([v.co for v in mesh.vertices])
    area = sum(triangle.area for triangle in mesh.loop_triangles)
    return {"low": points.min(0).tolist(), "high": points.max(0).tolist(), "area": area}


found = {}
for frame in FRAMES:
    scene.frame_set(frame)
    matrix = camera.matrix_world
    found[frame] = {
        "bar": shape(bar),
        "lump": shape(lump),
        "camera": [list(row) for row in matrix],
        "fov": camera.data.angle,
    }
answer(frames=found, rate=scene.render.fps, version=bpy.app.version[:2])

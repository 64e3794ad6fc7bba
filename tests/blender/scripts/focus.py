"""Depth of field by distance, object and bone, all animated: exported, and how far Cycles spreads a small bright ball."""

import sys

import bpy
import numpy as np
from mathutils import Vector
from session import add_camera, answer, begin, cycles, rendered, room

folder = sys.argv[1]
scene = begin()
room(folder)
item = add_camera(scene, (64, 64), rotation=(1.1, 0.2, 0.7))
lens = item.data
lens.lens, lens.dof.aperture_fstop = 50.0, 0.1
bpy.context.view_layer.update()
to_world = item.matrix_world.copy()
bpy.ops.mesh.primitive_uv_sphere_add(radius=0.05, location=to_world.translation - 2.0 * to_world.col[2].to_3d())
shining = bpy.data.materials.new("shining")
shining.use_nodes = True
shining.node_tree.nodes["Principled BSDF"].inputs["Emission Strength"].default_value = 1.0
bpy.context.object.data.materials.append(shining)
target = bpy.data.objects.new("Target", None)
scene.collection.objects.link(target)
bpy.ops.object.armature_add(location=to_world.translation)
armature = bpy.context.object
armature.rotation_mode, armature.rotation_quaternion = "QUATERNION", to_world.to_quaternion()
bone = armature.pose.bones[0]
DEPTHS = (4.0, 1.0)
for frame, depth in enumerate(DEPTHS, 1):
    aside = (1.5, 0.5, -depth)  # what is in focus need not be in the middle, only as far along the axis
    lens.dof.focus_distance, target.location = depth, to_world @ Vector(aside)
    bone.matrix.translation = aside
    lens.dof.keyframe_insert("focus_distance", frame=frame)
    target.keyframe_insert("location", frame=frame)
    bone.keyframe_insert("location", frame=frame)
real = [each for each in scene.objects if each.lightdepth.role != "SYNTHETIC"]


def spread(name):
    """Mean squared distance of Cycles' light from its middle, square pixels."""
    before, engine = scene.world, scene.render.engine
    scene.world = None
    for each in real:
        each.hide_render = True
    cycles(scene, samples=128)
    picture = rendered(scene, f"{folder}/{name}.exr")[:, :, 0]
    scene.world, scene.render.engine = before, engine
    for each in real:
        each.hide_render = False
    y, x = np.indices(picture.shape)
    share = picture / picture.sum()
    return sum(float((share * (places - (share * places).sum()) ** 2).sum()) for places in (x, y))


found = {"sharp": spread("sharp"), "cases": {}}
lens.dof.use_dof = True
for name, focus, subtarget in (("distance", None, ""), ("object", target, ""), ("bone", armature, bone.name)):
    lens.dof.focus_object = focus
    if focus is not None:
        lens.dof.focus_subtarget = subtarget
    for frame, depth in enumerate(DEPTHS, 1):
        scene.frame_set(frame)
        bpy.ops.lightdepth.export_scene(filepath=f"{folder}/{name}{frame}.toml")
        found["cases"][f"{name}{frame}"] = {"depth": depth, "spread": spread(f"{name}{frame}")}
answer(**found)

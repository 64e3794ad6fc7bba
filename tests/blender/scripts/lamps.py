"""Irradiance that Blender's path tracer measures under each lamp, and the tables that stand for the lamp."""

import sys

import bpy
import numpy as np
from session import add_camera, add_lamp, answer, begin, cycles, module, rendered

scene = begin()
scene.world = bpy.data.worlds.new("black")
scene.world.use_nodes = True
scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0, 0, 0, 1)
bpy.ops.mesh.primitive_plane_add(size=40.0)
white = bpy.data.materials.new("white")
white.use_nodes = True
nodes = white.node_tree.nodes
nodes.clear()
diffuse, output = nodes.new("ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeOutputMaterial")
diffuse.inputs["Color"].default_value = (1, 1, 1, 1)
white.node_tree.links.new(diffuse.outputs[0], output.inputs["Surface"])
bpy.context.object.data.materials.append(white)
add_camera(scene, (8, 8), (0, 0, 1), (0, 0, 0)).data.lens = 2000.0
cycles(scene, samples=256)
scene.cycles.max_bounces = 0

LAMPS = {
    "point": ("POINT", {"shadow_soft_size": 0.1, "energy": 30.0}),
    "square": ("AREA", {"shape": "SQUARE", "size": 0.5, "energy": 30.0}),
    "rectangle": ("AREA", {"shape": "RECTANGLE", "size": 0.5, "size_y": 1.0, "energy": 30.0}),
    "disk": ("AREA", {"shape": "DISK", "size": 0.7, "energy": 30.0}),
    "ellipse": ("AREA", {"shape": "ELLIPSE", "size": 0.7, "size_y": 0.3, "energy": 30.0}),
    "spot": ("SPOT", {"shadow_soft_size": 0.1, "spot_size": 1.0, "spot_blend": 0.0, "energy": 30.0}),
    "sun": ("SUN", {"angle": 0.02, "energy": 2.0}),
}
found = {}
for name, (kind, settings) in LAMPS.items():
    for normalize in (True, False):
        lamp = add_lamp(scene, kind, name, (0.0, 0.0, 2.0), color=(1.0, 0.5, 0.25), **settings)
        if not normalize and not hasattr(lamp.data, "normalize"):
            bpy.data.objects.remove(lamp)
            continue
        if not normalize:
            lamp.data.normalize = False
        lamp.scale = (2.0, 1.0, 1.0) if kind == "AREA" else (1.0, 1.0, 1.0)
        bpy.context.view_layer.update()
        tables, notes = module("lights").emitters(name, lamp.data, lamp.matrix_world)
        measured = np.pi * rendered(scene, f"{sys.argv[1]}/lamp.exr")[:, :, :3].mean(axis=(0, 1))
        found[f"{name}, {'watts' if normalize else 'not normalized'}"] = {
            "measured": measured.tolist(),
            "tables": tables,
            "notes": notes,
        }
        bpy.data.objects.remove(lamp)
# Nodes inside a lamp, and a lamp that only shows Cycles where light comes from.
for name in ("emission node", "portal"):
    lamp = add_lamp(scene, "AREA", name, (0.0, 0.0, 2.0), shape="SQUARE", size=0.5, energy=30.0)
    if name == "portal":
        lamp.data.cycles.is_portal = True
    else:
        lamp.data.use_nodes = True
        emission = next(node for node in lamp.data.node_tree.nodes if node.type == "EMISSION")
        emission.inputs["Color"].default_value, emission.inputs["Strength"].default_value = (0.25, 0.5, 1.0, 1.0), 3.0
    bpy.context.view_layer.update()
    tables, notes = module("lights").emitters(name, lamp.data, lamp.matrix_world)
    measured = np.pi * rendered(scene, f"{sys.argv[1]}/lamp.exr")[:, :, :3].mean(axis=(0, 1))
    found[name] = {"measured": measured.tolist(), "tables": tables, "notes": notes}
    bpy.data.objects.remove(lamp)
answer(lamps=found)

"""Suns marked real and clipped sources: exported, imported into another scene, edited, written back, and recovered."""

import math
import sys
from pathlib import Path

import bpy
from mathutils import Euler
from session import add_lamp, answer, begin, module, refused, room

folder = Path(sys.argv[1])
scene = begin()
room(folder)
settings = scene.lightdepth
bpy.ops.mesh.primitive_plane_add(size=1.0, location=(1.9, 0.0, 1.4), rotation=(0.0, -math.pi / 2, 0.0))
pane = bpy.context.object
pane.name, pane.lightdepth.role, pane.lightdepth.opening = "Pane", "ENVIRONMENT", True


def tables(name):
    bpy.ops.lightdepth.export_scene(filepath=str(folder / name))
    return [line.text for line in settings.export_notes]


# A sun as a person sets it, with a mask that was made for this direction; a lamp that cannot be real; a clipped source.
sun = add_lamp(scene, "SUN", "Low sun", color=(1.0, 0.75, 0.5), energy=200.0, angle=math.radians(0.6))
sun.rotation_euler = Euler((math.radians(-20.0), math.radians(60.0), 0.3))
bpy.context.view_layer.update()
sun.lightdepth.real_light = True
sun.lightdepth.mask, sun.lightdepth.mask_extent = str(folder / "mask.exr"), (-1.0, -0.5, 1.0, 1.5)
sun.lightdepth.mask_direction = module("suns").toward(sun.matrix_world)
add_lamp(scene, "POINT", "Bulb").lightdepth.real_light = True
entry = settings.clipped.add()
entry.name, entry.pixel, entry.radiance, entry.diameter = (
    "Ceiling lamp",
    (20.5, 4.5),
    (40.0, 35.0, 30.0),
    math.radians(12),
)
off = settings.clipped.add()
off.name, off.pixel, off.use = "Off", (1.0, 1.0), False
found = {"notes": tables("lights.toml"), "toward": list(module("suns").toward(sun.matrix_world))}

sun.rotation_euler.z += 0.1
found["turned"] = tables("turned.toml")

# Into a scene without lights, edited there, and back.
bpy.data.objects.remove(sun)
settings.clipped.clear()
bpy.ops.lightdepth.import_lights(filepath=str(folder / "hand.toml"))
suns = [item for item in scene.objects if item.type == "LIGHT" and item.data.type == "SUN"]
found["imported"] = {
    item.name: {
        "toward": list(module("suns").toward(item.matrix_basis)),
        "irradiance": [channel * item.data.energy for channel in item.data.color],
        "diameter": math.degrees(item.data.angle),
        "real": item.lightdepth.real_light,
        "mask": item.lightdepth.mask,
    }
    for item in suns
}
found["clipped"] = [[each.name, list(each.pixel), list(each.radiance)] for each in settings.clipped]
bpy.ops.lightdepth.import_lights(filepath=str(folder / "hand.toml"))
found["again"] = [len(scene.objects), len(settings.clipped)]
found["objects"] = len([item for item in scene.objects if item.type == "LIGHT" and item.data.type == "SUN"])
scene.objects["window sun"].data.energy *= 2.0
settings.clipped[0].radiance = (50.0, 50.0, 50.0)
bpy.ops.lightdepth.write_lights(filepath=str(folder / "hand.toml"))

found["refused"] = [
    refused(bpy.ops.lightdepth.import_lights, filepath=str(folder / "missing.toml")),
    refused(bpy.ops.lightdepth.import_lights, filepath=str(folder / "turned_meshes" / "Walls.ply")),
    refused(bpy.ops.lightdepth.write_lights, filepath=str(folder / "inline.toml")),
    refused(bpy.ops.lightdepth.recover_sun),
]
bpy.ops.lightdepth.recover_clipped()
found["said"] = [line.text for line in settings.light_notes]
answer(**found)

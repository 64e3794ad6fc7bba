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


# A sun as a person sets it, with a mask that was made for this direction; a lamp that cannot be real; clipped lamps.
sun = add_lamp(scene, "SUN", "Low sun", color=(1.0, 0.75, 0.5), energy=200.0, angle=math.radians(0.6))
sun.rotation_euler = Euler((math.radians(-20.0), math.radians(60.0), 0.3))
bpy.context.view_layer.update()
sun.lightdepth.real_light = True
sun.lightdepth.mask, sun.lightdepth.mask_extent = str(folder / "mask.exr"), (-1.0, -0.5, 1.0, 1.5)
sun.lightdepth.mask_direction = module("suns").toward(sun.matrix_world)
add_lamp(scene, "AREA", "Strip").lightdepth.real_light = True
RADIUS, RADIANCE = 0.1, 40.0
watts = RADIANCE * 4.0 * math.pi**2 * RADIUS**2
lamp = add_lamp(scene, "POINT", "Ceiling lamp", color=(1.0, 0.875, 0.75), energy=watts, shadow_soft_size=RADIUS)
pose = settings.capture.matrix_world
width, height = settings.image.size
lamp.location = pose @ (1.1 * module("picking").panorama_direction(20.5 / width, 4.5 / height))
lamp.lightdepth.real_light, lamp.lightdepth.clipped_diameter = True, math.radians(12)
off = add_lamp(scene, "POINT", "Off")
off.lightdepth.real_light, off.hide_render = True, True
bpy.context.view_layer.update()
found = {"notes": tables("lights.toml"), "toward": list(module("suns").toward(sun.matrix_world))}

sun.rotation_euler.z += 0.1
found["turned"] = tables("turned.toml")

# Into a scene without lights, edited there, and back.
for item in [item for item in scene.objects if item.type == "LIGHT"]:
    bpy.data.objects.remove(item)
bpy.ops.lightdepth.import_lights(filepath=str(folder / "hand.toml"))
suns = [item for item in scene.objects if item.type == "LIGHT" and item.data.type == "SUN"]
found["imported"] = {
    item.name: {
        "toward": list(module("suns").toward(item.matrix_basis)),
        "irradiance": [channel * item.data.energy for channel in item.data.color],
        "diameter": math.degrees(item.data.angle),
        "real": item.lightdepth.real_light,
        "mask": item.lightdepth.mask,
        "recover": item.lightdepth.recover_mask,
    }
    for item in suns
}
item = scene.objects["lamp"]
bpy.context.view_layer.update()
radiance = item.data.energy / (4.0 * math.pi**2 * item.data.shadow_soft_size**2)
there = pose.inverted() @ item.matrix_world.translation
hit = scene.ray_cast(bpy.context.evaluated_depsgraph_get(), pose.translation, pose.to_3x3() @ there.normalized())
found["clipped"] = {
    "real": item.lightdepth.real_light,
    "uv": list(module("picking").panorama_coordinates(there)),
    "size": list(settings.image.size),
    "radiance": [radiance * channel for channel in item.data.color],
    "before": there.length / (hit[1] - pose.translation).length,
}
bpy.ops.lightdepth.import_lights(filepath=str(folder / "hand.toml"))
lamps = [item.data.type for item in scene.objects if item.type == "LIGHT" and item.lightdepth.real_light]
found["again"] = sorted(lamps)
scene.objects["window sun"].data.energy *= 2.0
scene.objects["lamp"].data.energy *= 1.5
bpy.ops.lightdepth.write_lights(filepath=str(folder / "hand.toml"))

found["refused"] = [
    refused(bpy.ops.lightdepth.import_lights, filepath=str(folder / "missing.toml")),
    refused(bpy.ops.lightdepth.import_lights, filepath=str(folder / "turned_meshes" / "Walls.ply")),
    refused(bpy.ops.lightdepth.write_lights, filepath=str(folder / "inline.toml")),
    refused(bpy.ops.lightdepth.recover_sun),
]
# No photograph shows the patch of this sun, from which a mask could be recovered.
scene.objects["door sun"].lightdepth.recover_mask = False
bpy.ops.lightdepth.recover_clipped()
found["said"] = [line.text for line in settings.light_notes]
answer(**found)

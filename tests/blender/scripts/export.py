"""A scene with one of everything, exported; and what Blender itself says of it."""

import sys
from dataclasses import asdict
from importlib import import_module

import bpy
import numpy as np
from mathutils import Matrix
from session import MODULE, add_camera, add_lamp, answer, begin, refused, room

folder = sys.argv[1]
scene = begin()
found = {"no panorama": refused(bpy.ops.lightdepth.export_scene, filepath=f"{folder}/none.toml")}
room(folder)
scene.lightdepth.capture.rotation_euler = (0.0, 0.0, 0.5)
bpy.data.objects["Floor"].lightdepth.use_gloss = True
walls = bpy.data.objects["Walls"]
for item in scene.objects:
    item.select_set(item == walls)
bpy.ops.lightdepth.store_rest()
for vertex in walls.data.vertices:
    vertex.co.z *= 1.1


def material(name, node_type, **inputs):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    nodes = made.node_tree.nodes
    nodes.clear()
    shader, output = nodes.new(node_type), nodes.new("ShaderNodeOutputMaterial")
    made.node_tree.links.new(shader.outputs[0], output.inputs["Surface"])
    for key, value in inputs.items():
        shader.inputs[key.replace("_", " ")].default_value = value
    return made, shader


plastic, shader = material("Plastic", "ShaderNodeBsdfPrincipled", Base_Color=(0.8, 0.1, 0.05, 1), Roughness=0.25)
picture = bpy.data.images.new("picture", 4, 4)
picture.pixels.foreach_set(np.tile(np.array([0.0, 1.0, 0.0, 1.0], np.float32), 16))
picture.pack()
textured, shader = material("Textured", "ShaderNodeBsdfPrincipled")
node = textured.node_tree.nodes.new("ShaderNodeTexImage")
node.image = picture
textured.node_tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
glass, shader = material("Glass", "ShaderNodeBsdfGlass", IOR=1.4, Roughness=0.0)
glowing, shader = material("Glowing", "ShaderNodeEmission", Color=(1.0, 0.5, 0.25, 1), Strength=3.0)
wood, shader = material("Wood", "ShaderNodeBsdfPrincipled")
noise = wood.node_tree.nodes.new("ShaderNodeTexNoise")
wood.node_tree.links.new(noise.outputs[0], shader.inputs["Roughness"])

bpy.ops.mesh.primitive_cube_add(size=0.2, location=(0.5, 1.0, 0.3))
cube = bpy.context.object
cube.name = 'Würfel "A"'
cube.rotation_euler = (0.3, -0.4, 1.2)
cube.data.materials.append(plastic)
subdivision = cube.modifiers.new("smooth", "SUBSURF")
subdivision.levels, subdivision.render_levels = 0, 2
twin = bpy.data.objects.new("Twin", cube.data)
twin.location, twin.scale = (-0.5, 1.0, 0.3), (1.0, 2.0, -1.0)
scene.collection.objects.link(twin)
bpy.ops.mesh.primitive_uv_sphere_add(segments=8, ring_count=4, radius=0.1, location=(0, 1, 0.5))
ball = bpy.context.object
ball.data.materials.append(glass)
for index in range(3):
    copy = bpy.data.objects.new(f"Ball copy {index}", ball.data)
    copy.location = (0.3 * index, 1.5, 0.5)
    scene.collection.objects.link(copy)
group = bpy.data.collections.new("group")
piece = bpy.data.objects.new("Piece", ball.data)
group.objects.link(piece)
holder = bpy.data.objects.new("Holder", None)
holder.instance_type, holder.instance_collection = "COLLECTION", group
holder.location, holder.scale = (1.0, 1.0, 1.0), (0.5, 0.5, 0.5)
scene.collection.objects.link(holder)
# A collection of two objects that share a mesh, each with the material in its own slot, at forty vertices.
pair = bpy.data.collections.new("pair")
for name, made in (("Left", glass), ("Right", plastic)):
    half = bpy.data.objects.new(name, ball.data)
    half.material_slots[0].link, half.material_slots[0].material = "OBJECT", made
    pair.objects.link(half)
row = bpy.data.meshes.new("Row")
row.from_pydata([(0.02 * index - 0.4, 0.5, 0.2) for index in range(40)], [], [])
carrier, each = bpy.data.objects.new("Row", row), bpy.data.objects.new("Each", None)
each.instance_type, each.instance_collection, each.scale = "COLLECTION", pair, (0.1, -0.1, 0.1)
each.parent, carrier.instance_type = carrier, "VERTS"
scene.collection.objects.link(carrier)
scene.collection.objects.link(each)
for made, name in ((textured, "Tile"), (glowing, "Neon"), (wood, "Plank")):
    bpy.ops.mesh.primitive_plane_add(size=0.3, location=(-1.0, 1.0, 0.2 + 0.3 * len(name)))
    bpy.context.object.name = name
    bpy.context.object.data.materials.append(made)
sheared = bpy.data.objects.new("Sheared", bpy.data.objects["Tile"].data)
scene.collection.objects.link(sheared)
sheared.matrix_world = Matrix(((1, 0.5, 0, 0.2), (0, 1, 0, 0.4), (0, 0, 1, 1.2), (0, 0, 0, 1)))
parent = bpy.data.objects.new("Squeeze", None)
parent.scale, parent.rotation_euler = (1.0, 3.0, 1.0), (0.0, 0.0, 0.0)
scene.collection.objects.link(parent)
slanted = bpy.data.objects.new("Slanted", bpy.data.objects["Tile"].data)
slanted.parent, slanted.rotation_euler, slanted.location = parent, (0.0, 0.0, 0.7), (0.2, 0.4, 1.2)
scene.collection.objects.link(slanted)
bpy.ops.object.text_add(location=(0, 1.2, 1.0))
bpy.context.object.name = "Words"
hidden = bpy.data.objects.new("Hidden", ball.data)
hidden.hide_render = True
scene.collection.objects.link(hidden)
add_lamp(scene, "AREA", "Panel", energy=20.0, use_shadow=False, specular_factor=0.5)
camera = add_camera(scene, (64, 48))
camera.data.dof.use_dof, camera.data.dof.focus_distance = True, 2.0
camera.data.dof.aperture_fstop, camera.data.lens = 2.0, 40.0
flat = bpy.data.objects.new("Flat camera", bpy.data.cameras.new("Flat camera"))
flat.data.type = "ORTHO"
scene.collection.objects.link(flat)
scene.lightdepth.samples = 3
scene.render.engine = "CYCLES"
objects_before = sorted(item.name for item in bpy.data.objects)
materials_before = sorted(item.name for item in bpy.data.materials)

bpy.ops.lightdepth.export_scene(filepath=f"{folder}/scene.toml")
found["notes"] = [line.text for line in scene.lightdepth.export_notes]
found["left as it was"] = [
    scene.render.engine == "CYCLES",
    objects_before == sorted(item.name for item in bpy.data.objects),
    materials_before == sorted(item.name for item in bpy.data.materials),
    len(bpy.data.scenes) == 1,
]
graph = bpy.context.evaluated_depsgraph_get()
found["bounds"] = {}
for name in (cube.name, "Twin", "Ball copy 1", "Sheared", "Slanted"):
    item = bpy.data.objects[name]
    mesh = item.evaluated_get(graph).to_mesh()
    if name in (cube.name, "Twin"):
        subdivision.levels = 2
        bpy.context.view_layer.update()
        mesh = item.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    places = np.array([item.matrix_world @ vertex.co for vertex in mesh.vertices])
    found["bounds"][name] = [places.min(axis=0).tolist(), places.max(axis=0).tolist()]
    subdivision.levels = 0
bpy.context.view_layer.material_override = plastic
bpy.ops.lightdepth.export_scene(filepath=f"{folder}/override.toml")
bpy.context.view_layer.material_override = None
found["working space"] = hasattr(bpy.data, "colorspace")
if found["working space"]:
    bpy.ops.wm.set_working_color_space(working_space="ACEScg", convert_colors=True)
    bpy.ops.lightdepth.export_scene(filepath=f"{folder}/acescg.toml")
    bpy.ops.wm.set_working_color_space(working_space="Linear Rec.709", convert_colors=True)
# Cameras of a scene file, as `calibrate view` writes them, imported and exported again.
with open(f"{folder}/scene.toml") as file:
    tables = file.read().split("\n[")
kept = "\n[".join(table for table in tables if not table.startswith("camera"))
with open(f"{folder}/given.toml", "w") as file:
    file.write(
        kept
        + """
[camera.lens]
type = "perspective"
width = 96
height = 64
fov = 70.0
position = [0.1, -0.2, 1.4]
rotation = [-12.0, 3.0, 40.0]
principal_point = [0.47, 0.56]
distortion = [-0.08, 0.012]

[camera.looking]
type = "perspective"
width = 96
height = 64
look_at = [0.4, 1.0, 0.2]
aperture = 0.01
focus_distance = 1.5

[camera.cube]
type = "cubemap"
width = 96
position = [0.0, 0.3, 1.2]
rotation = [0.0, 0.0, 25.0]

[camera.youtube]
type = "eac"
width = 96
position = [0.0, 0.3, 1.2]
rotation = [0.0, 0.0, 25.0]

[camera.theatre]
type = "dome_master"
width = 64
"""
    )
bpy.ops.lightdepth.import_cameras(filepath=f"{folder}/given.toml")
found["resolution"] = [scene.render.resolution_x, scene.render.resolution_y, scene.camera.name]
bpy.ops.lightdepth.export_scene(filepath=f"{folder}/again.toml")
scene.camera = camera
camera.data.type = "PANO"
(camera.data if hasattr(camera.data, "panorama_type") else camera.data.cycles).panorama_type = "MIRRORBALL"
projections = import_module(f"{MODULE}.cameras").PROJECTIONS
found["projections"] = [asdict(each) for each in projections.values()]
offered = bpy.types.Camera.bl_rna.properties["lightdepth"].fixed_type.properties["projection"].enum_items
found["offered"] = [item.identifier for item in offered] == ["CAMERA", *projections]
found["mirror ball"] = refused(bpy.ops.lightdepth.export_scene, filepath=f"{folder}/flat.toml")
bpy.data.objects["Camera"].data.type = "ORTHO"
found["orthographic"] = refused(bpy.ops.lightdepth.export_scene, filepath=f"{folder}/flat.toml")
answer(**found)

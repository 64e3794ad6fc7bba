"""What Blender makes of the engine's pictures: compositor, region, transparency, indices, layers; and what fails."""

import os
import sys
from pathlib import Path

import bpy
import numpy as np
from session import add_camera, answer, as_exr, begin, module, refused, rendered, room

folder = Path(sys.argv[1])
scene = begin()
users = bpy.data.worlds.new("The user's")
scene.world = users
room(folder)
found = {"world": [scene.world.name, scene.lightdepth.world_before.name]}
bpy.ops.mesh.primitive_uv_sphere_add(radius=0.4, location=(0.0, 1.6, 0.4))
ball = bpy.context.object
ball.pass_index = 7
camera = add_camera(scene, (40, 30), rotation=(1.1, 0.0, 0.0))
scene.render.engine = "LIGHTDEPTH"
settings = scene.lightdepth
settings.samples, settings.max_bounces = 2, 2
layer = scene.view_layers[0]


def whole(name):
    """Render every pass; the channels of the file by name, first row at the top, as the test reads them."""
    as_exr(scene, folder / name, multilayer=True)
    bpy.ops.render.render(write_still=True)


MATTES = ("object_index", "material_index", "cryptomatte_object", "cryptomatte_material", "cryptomatte_asset")
for name in MATTES:
    setattr(layer, f"use_pass_{name}", True)
layer.pass_cryptomatte_depth = 4
ball.parent = bpy.data.objects.new("Toys", None)
scene.collection.objects.link(ball.parent)
found["ball"] = ball.name
for name in ("Left", "Right"):  # halves of the ball
    made = bpy.data.materials.new(name)
    made.pass_index = 3 if name == "Right" else 2
    ball.data.materials.append(made)
for polygon in ball.data.polygons:
    polygon.material_index = int(polygon.center.x > 0.0)
whole("passes.exr")
for name in MATTES:
    setattr(layer, f"use_pass_{name}", False)

# The compositor adds up what the passes say: plate x (1 - coverage) + change + synthetic.
if hasattr(scene, "compositing_node_group"):
    tree = bpy.data.node_groups.new("sum", "CompositorNodeTree")
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    scene.compositing_node_group = tree
    output, mix = tree.nodes.new("NodeGroupOutput"), "ShaderNodeMix"
else:
    scene.use_nodes = True
    tree, mix = scene.node_tree, "ShaderNodeMix"
    tree.nodes.clear()
    output = tree.nodes.new("CompositorNodeComposite")
    mix = "CompositorNodeMixRGB"
source = tree.nodes.new("CompositorNodeRLayers")


def blended(kind, first, second):
    made = tree.nodes.new(mix)
    made.blend_type = kind
    if mix == "ShaderNodeMix":
        made.data_type = "RGBA"
    factor, *sockets = [each for each in made.inputs if each.enabled]
    factor.default_value = 1.0
    for socket, value in zip(sockets, (first, second)):
        if isinstance(value, tuple):
            socket.default_value = value
        else:
            tree.links.new(value, socket)
    return next(each for each in made.outputs if each.enabled)


rest = blended("SUBTRACT", (1.0, 1.0, 1.0, 1.0), source.outputs["Coverage"])
total = blended("ADD", blended("MULTIPLY", source.outputs["Plate"], rest), source.outputs["Change"])
tree.links.new(blended("ADD", total, source.outputs["Synthetic"]), output.inputs[0])
np.save(folder / "sum.npy", rendered(scene, folder / "sum.exr"))
tree.links.new(source.outputs["Image"], output.inputs[0])
np.save(folder / "combined.npy", rendered(scene, folder / "combined.exr"))
if hasattr(scene, "compositing_node_group"):
    scene.compositing_node_group = None
else:
    scene.use_nodes = False

scene.render.film_transparent = True
np.save(folder / "transparent.npy", rendered(scene, folder / "transparent.exr"))
scene.render.film_transparent = False

# Regions: of a lens, and of a panorama, which the renderer makes whole.
scene.render.use_border = scene.render.use_crop_to_border = True
scene.render.border_min_x, scene.render.border_max_x = 0.25, 0.77
scene.render.border_min_y, scene.render.border_max_y = 0.1, 0.6
whole("region.exr")
camera.data.type = "PANO"
(camera.data if hasattr(camera.data, "panorama_type") else camera.data.cycles).panorama_type = "EQUIRECTANGULAR"
scene.render.resolution_y = 20
whole("panorama region.exr")
scene.render.use_border = False
whole("pano.exr")


# Two eyes, 40 cm apart, and single cameras where they stand.
def stereo(name, eyes):
    """Render both eyes, and those that are named by themselves."""
    scene.render.use_multiview = True  # a file for each eye
    whole(f"{name}.exr")
    scene.render.use_multiview = False
    across = camera.matrix_world.to_3x3().col[0]
    for eye, side in eyes.items():
        camera.location += 0.2 * side * across
        whole(f"{eye}.exr")
        camera.location -= 0.2 * side * across


camera.data.stereo.convergence_mode, camera.data.stereo.interocular_distance = "PARALLEL", 0.4
camera.data.stereo.use_spherical_stereo, camera.data.stereo.pivot = True, "CENTER"
stereo("ods", {"ods left": -1, "ods right": 1})
camera.data.type, scene.render.resolution_y = "PERSP", 30
stereo("stereo", {"left eye": -1})

# A second view layer that does not have the ball.
other = scene.view_layers.new("Without")
group = bpy.data.collections.new("balls")
scene.collection.children.link(group)
for collection in ball.users_collection:
    collection.objects.unlink(ball)
group.objects.link(ball)
other.layer_collection.children["balls"].exclude = True
whole("layers.exr")
scene.view_layers.remove(other)

# Whatever fails while exporting is told, and no picture is written.
as_exr(scene, folder / "failed")
scene.frame_start, scene.frame_end = 1, 2
export = sys.modules[module("engine").__name__]


def broken(*arguments, **settings):
    raise ValueError("the disk is full of eels")


kept, export.export_scene = export.export_scene, broken
found["failed"] = [refused(bpy.ops.render.render, write_still=True), refused(bpy.ops.render.render, animation=True)]
export.export_scene = kept
blocked = folder / "blocked"
blocked.mkdir()
kept, os.environ["TMPDIR"] = os.environ.get("TMPDIR"), str(blocked / "gone")
import tempfile  # noqa: E402

tempfile.tempdir = str(blocked / "gone")
found["no folder"] = refused(bpy.ops.render.render, write_still=True)
tempfile.tempdir = None
os.environ.pop("TMPDIR")
if kept is not None:
    os.environ["TMPDIR"] = kept
found["written"] = sorted(path.name for path in folder.glob("failed*"))

# A second scene has a panorama and materials of its own; roles keep what is linked to the object.
ball.data.materials.clear()
red, blue = bpy.data.materials.new("Red"), bpy.data.materials.new("Blue")
ball.data.materials.append(red)
ball.material_slots[0].link, ball.material_slots[0].material = "OBJECT", blue
ball.lightdepth.role = "SUPPORT"
found["while support"] = ball.material_slots[0].material.name
ball.lightdepth.role = "SYNTHETIC"
found["slot again"] = [ball.material_slots[0].link, ball.material_slots[0].material.name]
second = bpy.data.scenes.new("second")
capture = bpy.data.objects.new("other capture", None)
second.collection.objects.link(capture)
second.lightdepth.capture, second.lightdepth.image = capture, settings.image
found["two scenes"] = second.lightdepth.projection != settings.projection and second.world != scene.world
bpy.ops.wm.save_as_mainfile(filepath=str(folder / "kept.blend"))
bpy.ops.wm.open_mainfile(filepath=str(folder / "kept.blend"))
found["worlds kept"] = "The user's" in bpy.data.worlds
scene = bpy.data.scenes["Scene"]
scene.lightdepth.image = None
found["world again"] = scene.world.name
answer(**found)

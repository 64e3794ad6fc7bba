"""Model, give roles, refuse what makes no place, keep everything in a .blend, undo twice."""

import sys

import bpy
from session import add_camera, answer, begin, corners, module, refused, room

folder = sys.argv[1]
scene = begin()
room(folder)
found = {}

found["crossing"] = refused(bpy.ops.lightdepth.add_room, corners=corners((0, 0), (1, 1), (1, 0), (0, 1)))
found["two corners"] = refused(bpy.ops.lightdepth.add_room, corners=corners((0, 0), (1, 1)))
found["line"] = refused(bpy.ops.lightdepth.add_box, corners=corners((0, 0), (1, 0), (2, 0)))
found["no image"] = refused(bpy.ops.lightdepth.load_panorama, filepath=f"{folder}/missing.exr")
square = bpy.data.images.new("square", 8, 8, float_buffer=True)
square.file_format, square.filepath_raw = "OPEN_EXR", f"{folder}/square.exr"
square.save()
found["square"] = refused(bpy.ops.lightdepth.load_panorama, filepath=f"{folder}/square.exr")

bpy.ops.lightdepth.add_box(corners=corners((-1.5, 1), (-0.5, 1.2), (-0.6, 1.8)), height=0.7)
bpy.ops.lightdepth.add_top()
top = bpy.data.objects["Box top"]
found["top"] = [list(top.matrix_world @ vertex.co) for vertex in top.data.vertices]
found["box faces"] = len(bpy.data.objects["Box"].data.polygons)


def shown(name):
    """Names of the materials that an object shows."""
    return [slot.material.name if slot.material else "" for slot in bpy.data.objects[name].material_slots]


for index in range(2):
    bpy.ops.mesh.primitive_cube_add(location=(index, 1, 1), size=0.2)
for item in scene.objects:
    item.select_set(item.name in {"Cube", "Cube.001"})
red = bpy.data.materials.new("Red")
bpy.data.objects["Cube"].data.materials.append(red)
bpy.ops.lightdepth.set_role(role="SUPPORT")
found["roles"] = {item.name: item.lightdepth.role for item in scene.objects if item.type == "MESH"}
found["colours"] = {item.name: list(item.color) for item in scene.objects if item.type == "MESH"}
found["projected"] = [shown("Cube"), shown("Cube.001")]
bpy.ops.lightdepth.set_role(role="SYNTHETIC")
found["not projected"] = [shown("Cube"), shown("Cube.001")]

walls = bpy.data.objects["Walls"]
for item in scene.objects:
    item.select_set(item == walls)
bpy.ops.lightdepth.store_rest()
scene.lightdepth.samples, scene.lightdepth.noise, scene.lightdepth.method = 7, 0.25, "envpath"
bpy.data.objects["Floor"].lightdepth.use_gloss = True
for place in ((0.1, 0.7), (0.2, 0.7), (0.2, 0.8), (0.1, 0.8)):
    corner = scene.lightdepth.corners.add()
    corner.u, corner.v = place
add_camera(scene)
scene.render.engine = "LIGHTDEPTH"
graph = bpy.context.evaluated_depsgraph_get()
found["holes"] = len(module("checking").hole_cells(graph, scene.lightdepth))
walls.hide_set(True)
graph = bpy.context.evaluated_depsgraph_get()
cells = module("checking").hole_cells(graph, scene.lightdepth)
module("checking").show_holes(bpy.context, cells)
found["holes without walls"] = len(cells)
found["patches"] = [len(bpy.data.objects["Holes"].data.polygons), bpy.data.objects["Holes"].hide_render]
walls.hide_set(False)

bpy.ops.wm.save_as_mainfile(filepath=f"{folder}/place.blend")
bpy.ops.wm.open_mainfile(filepath=f"{folder}/place.blend")
scene = bpy.context.scene
settings = scene.lightdepth
found["kept"] = {
    "image": settings.image.name,
    "capture": settings.capture.name,
    "samples": settings.samples,
    "noise": settings.noise,
    "method": settings.method,
    "gloss": bpy.data.objects["Floor"].lightdepth.use_gloss,
    "roles": {item.name: item.lightdepth.role for item in scene.objects if item.type == "MESH"},
    "corners": [[corner.u, corner.v] for corner in settings.corners],
    "rest": "rest" in bpy.data.objects["Walls"].data.attributes,
    "engine": scene.render.engine,
    "world": scene.world.name,
}
# The kept drivers still follow the capture point.
settings.capture.location.x = 0.25
bpy.context.view_layer.update()
material = bpy.data.objects["Floor"].material_slots[0].material.evaluated_get(bpy.context.evaluated_depsgraph_get())
found["driven"] = [
    node.inputs["Location"].default_value[0]
    for node in material.node_tree.nodes
    if node.type == "MAPPING" and node.vector_type == "TEXTURE"
]

bpy.context.preferences.edit.use_global_undo = True
bpy.ops.ed.undo_push(message="before")
bpy.ops.lightdepth.add_box(corners=corners((1, 1), (1.5, 1), (1.5, 1.5)))
bpy.ops.ed.undo_push(message="box")
bpy.ops.lightdepth.add_top()
bpy.ops.ed.undo_push(message="top")
counts = [len(bpy.data.objects)]
for operator in (bpy.ops.ed.undo, bpy.ops.ed.undo, bpy.ops.ed.redo, bpy.ops.ed.redo):
    operator()
    counts.append(len(bpy.data.objects))
    module("panorama").rebuild(bpy.context.scene)
found["undone"] = counts
scene = bpy.context.scene
scene.collection.objects.unlink(scene.lightdepth.capture)
found["capture point deleted"] = refused(bpy.ops.lightdepth.export_scene, filepath=f"{folder}/none.toml")
bpy.ops.lightdepth.load_panorama(filepath=f"{folder}/panorama.exr")
found["capture point again"] = scene.lightdepth.capture.name in scene.objects
answer(**found)

"""Blender's default objects through each of its mesh exporters: one file for each object and format.

Arguments: the folder for the files. OBJ is exported with z up, as lightdepth takes it.
"""

import sys
from pathlib import Path

import bpy
import numpy as np
from session import answer

folder = Path(sys.argv[1])
OBJECTS = {
    "plane": bpy.ops.mesh.primitive_plane_add,
    "cube": bpy.ops.mesh.primitive_cube_add,
    "circle": lambda: bpy.ops.mesh.primitive_circle_add(fill_type="NGON"),
    "uv_sphere": lambda: bpy.ops.mesh.primitive_uv_sphere_add(segments=16, ring_count=8),
    "ico_sphere": bpy.ops.mesh.primitive_ico_sphere_add,
    "cylinder": bpy.ops.mesh.primitive_cylinder_add,
    "cone": bpy.ops.mesh.primitive_cone_add,
    "torus": lambda: bpy.ops.mesh.primitive_torus_add(major_segments=12, minor_segments=8),
    "grid": lambda: bpy.ops.mesh.primitive_grid_add(x_subdivisions=4, y_subdivisions=4),
    "monkey": bpy.ops.mesh.primitive_monkey_add,
}


def concave():
    """A wall of one polygon with a notch."""
    mesh = bpy.data.meshes.new("wall")
    outline = [(0, 0), (4, 0), (4, 3), (3, 3), (3, 1), (1, 1), (1, 3), (0, 3)]
    mesh.from_pydata([(x, 0, z) for x, z in outline], [], [range(8)])
    thing = bpy.data.objects.new("wall", mesh)
    bpy.context.collection.objects.link(thing)
    bpy.context.view_layer.objects.active = thing
    thing.select_set(True)


def exports():
    """Formats with their operators."""
    z_up = {"forward_axis": "Y", "up_axis": "Z"}
    yield "obj", ".obj", lambda path: bpy.ops.wm.obj_export(filepath=path, **z_up)
    yield "obj-smooth", ".obj", lambda path: bpy.ops.wm.obj_export(
        filepath=path, export_smooth_groups=True, export_normals=False, export_colors=True, export_pbr_extensions=True,
        **z_up,
    )  # fmt: skip
    yield "ply", ".ply", lambda path: bpy.ops.wm.ply_export(filepath=path)
    yield "ply-ascii", ".ply", lambda path: bpy.ops.wm.ply_export(
        filepath=path, ascii_format=True, export_normals=True, export_uv=False, export_colors="LINEAR"
    )  # fmt: skip
    yield "stl", ".stl", lambda path: bpy.ops.wm.stl_export(filepath=path)
    yield "stl-ascii", ".stl", lambda path: bpy.ops.wm.stl_export(filepath=path, ascii_format=True)
    yield "glb", ".glb", lambda path: bpy.ops.export_scene.gltf(filepath=path)
    yield "gltf", ".gltf", lambda path: bpy.ops.export_scene.gltf(
        filepath=path, export_format="GLTF_SEPARATE", export_tangents=True, export_normals=False
    )  # fmt: skip
    yield "draco", ".glb", lambda path: bpy.ops.export_scene.gltf(
        filepath=path, export_draco_mesh_compression_enable=True
    )  # fmt: skip
    yield "usdc", ".usdc", lambda path: bpy.ops.wm.usd_export(filepath=path, convert_world_material=False)


def area_and_bounds(thing):
    """Of an object as it is evaluated, in the world."""
    mesh = thing.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    mesh.transform(thing.matrix_world)
    mesh.calc_loop_triangles()
    points = np.array([v.co for v in mesh.vertices])
    return (
        sum(triangle.area for triangle in mesh.loop_triangles),
        points.min(axis=0).tolist(),
        points.max(axis=0).tolist(),
    )


found = {}
skipped = []
for name, add in {**OBJECTS, "wall": concave}.items():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    add()
    thing = bpy.context.active_object
    thing.location, thing.rotation_euler, thing.scale = (1.0, 2.0, 3.0), (0.0, 0.0, 0.5), (1.0, 1.0, 1.5)
    if name in ("cube", "monkey"):
        material = bpy.data.materials.new("red")
        material.use_nodes = True
        material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.8, 0.1, 0.1, 1.0)
        thing.data.materials.append(material)
    if name == "uv_sphere":
        colors = thing.data.color_attributes.new("Color", "BYTE_COLOR", "POINT")
        for entry in colors.data:
            entry.color = (0.5, 0.25, 0.0, 1.0)
    bpy.context.view_layer.update()
    area, low, high = area_and_bounds(thing)
    files = {}
    for label, suffix, export in exports():
        path = folder / f"{name}-{label}{suffix}"
        try:
            export(str(path))
        except (RuntimeError, TypeError) as error:
            skipped.append(f"{label}: {error}")
            continue
        if path.is_file():
            files[label] = path.name
    found[name] = {"area": area, "low": low, "high": high, "files": files}
answer(objects=found, skipped=sorted(set(skipped)))

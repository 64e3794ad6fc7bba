"""Sample models through Blender's glTF importer: bounds and area of each. Arguments: the files."""

import sys

import bpy
import numpy as np
from session import answer

found = {}
for path in sys.argv[1:]:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    try:
        bpy.ops.import_scene.gltf(filepath=path)
    except RuntimeError as error:
        found[path] = {"refused": str(error)}
        continue
    graph = bpy.context.evaluated_depsgraph_get()
    points, area = [], 0.0
    for instance in graph.object_instances:
        # The importer adds a small ball to show bones as, which is no part of the model.
        if instance.object.type != "MESH" or instance.object.original.name.startswith("Icosphere"):
            continue
        mesh = instance.object.to_mesh()
        mesh.transform(instance.matrix_world)
        mesh.calc_loop_triangles()
        at = np.array([vertex.co for vertex in mesh.vertices])
        faces = np.array([triangle.vertices for triangle in mesh.loop_triangles])
        if not len(faces):
            continue
        points.append(at[np.unique(faces)])
        corner = at[faces]
        area += 0.5 * np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1).sum()
    if points:
        points = np.concatenate(points)
        found[path] = {"low": points.min(0).tolist(), "high": points.max(0).tolist(), "area": float(area)}
answer(models=found)

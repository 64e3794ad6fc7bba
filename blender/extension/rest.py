"""Rest positions: where on the real place each vertex takes its colour from, while the mesh is deformed."""

from typing import ClassVar

import bpy
import numpy as np

from . import roles
from .panorama import REST


def positions_in_world(mesh: bpy.types.Mesh, to_world) -> np.ndarray:
    """A mesh's vertices, shape (n, 3), float64, world, metres."""
    vertices = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", vertices)
    matrix = np.array(to_world, np.float64)
    return vertices.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]


def _real_meshes(context):
    return [
        item
        for item in context.selected_objects
        if item.type == "MESH" and item.mode == "OBJECT" and item.lightdepth.role in roles.REAL
    ]


class StoreRest(bpy.types.Operator):
    """Remember where the vertices are now as the place that they take their colour from"""

    bl_idname = "lightdepth.store_rest"
    bl_label = "Store Rest Positions"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        """A real mesh is selected, in object mode."""
        return bool(_real_meshes(context))

    def execute(self, context):
        """Store the vertex positions, in the world, as an attribute of the mesh."""
        for item in _real_meshes(context):
            mesh = item.data
            attribute = mesh.attributes.get(REST) or mesh.attributes.new(REST, "FLOAT_VECTOR", "POINT")
            attribute.data.foreach_set("vector", positions_in_world(mesh, item.matrix_world).astype(np.float32).ravel())
            roles.show_role(item)
        return {"FINISHED"}


class ClearRest(bpy.types.Operator):
    """Forget the stored rest positions; the surface takes its colour from where it is"""

    bl_idname = "lightdepth.clear_rest"
    bl_label = "Clear Rest Positions"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        """A real mesh with rest positions is selected, in object mode."""
        return any(REST in item.data.attributes for item in _real_meshes(context))

    def execute(self, context):
        """Remove the attribute."""
        for item in _real_meshes(context):
            if REST in item.data.attributes:
                item.data.attributes.remove(item.data.attributes[REST])
                roles.show_role(item)
        return {"FINISHED"}


classes = (StoreRest, ClearRest)

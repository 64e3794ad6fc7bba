"""Plain meshes handed to Mitsuba: the one place that knows how its meshes name their parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import mitsuba as mi

    from lightdepth.scene.model import Mesh


def to_mitsuba_mesh(name: str, mesh: Mesh, bsdf: Any = None, emitter: Any = None) -> mi.Mesh:
    """Make a Mitsuba mesh.

    Args:
        name: a name for messages.
        mesh: the triangles, world space; without normals the faces are flat.
        bsdf: a Mitsuba BSDF; black where ``None``.
        emitter: a Mitsuba area emitter, or ``None``.
    """
    import mitsuba as mi

    properties = mi.Properties()
    properties["bsdf"] = bsdf if bsdf is not None else mi.load_dict({"type": "diffuse", "reflectance": 0.0})
    if emitter is not None:
        properties["emitter"] = emitter
    properties["face_normals"] = mesh.normals is None
    result = mi.Mesh(
        name,
        vertex_count=len(mesh.vertices),
        face_count=len(mesh.faces),
        has_vertex_normals=mesh.normals is not None,
        has_vertex_texcoords=mesh.texture_coordinates is not None,
        props=properties,
    )
    parameters = mi.traverse(result)
    parameters["vertex_positions"] = np.ascontiguousarray(mesh.vertices, dtype=np.float32).reshape(-1)
    parameters["faces"] = np.ascontiguousarray(mesh.faces, dtype=np.uint32).reshape(-1)
    if mesh.normals is not None:
        parameters["vertex_normals"] = np.ascontiguousarray(mesh.normals, dtype=np.float32).reshape(-1)
    if mesh.texture_coordinates is not None:
        parameters["vertex_texcoords"] = np.ascontiguousarray(mesh.texture_coordinates, dtype=np.float32).reshape(-1)
    parameters.update()
    return result

"""Triangles of Blender's evaluated meshes as arrays, and the PLY files of real surfaces."""

from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix

from .graph import GENERATED, OBJECT, Lay
from .panorama import REST
from .rest import positions_in_world


@dataclass(frozen=True)
class Triangles:
    """A mesh's triangles by their corners; arrays of ``foreach_get``, single precision.

    Attributes:
        positions: of the vertices, shape (n, 3).
        vertices: of each triangle, shape (m, 3).
        loops: corners of each triangle in the mesh's order, shape (m, 3).
        slots: material slot of each triangle, shape (m,).
        normals: of every corner, or ``None`` where all faces are flat.
        uv: coordinates of every corner by the name of their map, v upward.
        active_uv: name of the map that is active for rendering, or ``None``.
        colours: linear colour of every corner by the name of the attribute, shape (corners, 3).
        local: positions of the vertices in the object's own coordinates, by which generated and object coordinates go.
        generated: Blender's texture space: centre and half size.
        corner_count: corners that there are.
    """

    positions: np.ndarray
    vertices: np.ndarray
    loops: np.ndarray
    slots: np.ndarray
    normals: np.ndarray | None
    uv: dict[str, np.ndarray]
    active_uv: str | None
    colours: dict[str, np.ndarray]
    local: np.ndarray
    generated: tuple[np.ndarray, np.ndarray]
    corner_count: int

    def transformed(self, matrix: np.ndarray) -> "Triangles":
        """Under a matrix of shape (4, 4); a mirrored mesh keeps its outside."""
        return repeated(self, matrix[None])


def triangles_of(mesh: bpy.types.Mesh) -> Triangles | None:
    """The triangles of a mesh, modifiers applied; ``None`` where it has no faces."""
    if not mesh.polygons:
        return None
    mesh.calc_loop_triangles()
    count = len(mesh.loop_triangles)
    vertices, loops = (
        _got(mesh.loop_triangles, "vertices", 3 * count, np.int32),
        _got(mesh.loop_triangles, "loops", 3 * count, np.int32),
    )
    polygons = _got(mesh.loop_triangles, "polygon_index", count, np.int32)
    slots = _got(mesh.polygons, "material_index", len(mesh.polygons), np.int32)[polygons]
    smooth = _got(mesh.polygons, "use_smooth", len(mesh.polygons), bool)
    normals = None
    if smooth.any() or mesh.has_custom_normals:
        normals = _got(mesh.corner_normals, "vector", 3 * len(mesh.loops), np.float32).reshape(-1, 3)
    uv = {
        layer.name: _got(layer.uv, "vector", 2 * len(mesh.loops), np.float32).reshape(-1, 2) for layer in mesh.uv_layers
    }
    active = next((layer.name for layer in mesh.uv_layers if layer.active_render), None)
    centre, size = np.array(mesh.texspace_location), np.array(mesh.texspace_size)
    positions = _got(mesh.vertices, "co", 3 * len(mesh.vertices), np.float32).reshape(-1, 3)
    return Triangles(
        positions,
        vertices.reshape(-1, 3),
        loops.reshape(-1, 3),
        slots,
        normals,
        uv,
        active,
        {attribute.name: _colours(mesh, attribute) for attribute in mesh.color_attributes},
        positions,
        (centre, np.where(size == 0.0, 1.0, size)),
        len(mesh.loops),
    )


def triangles_of_object(item) -> Triangles | None:
    """The triangles of an evaluated object."""
    mesh = item.to_mesh()
    try:
        return None if mesh is None else triangles_of(mesh)
    finally:
        item.to_mesh_clear()


def repeated(triangles: Triangles, places: np.ndarray) -> Triangles:
    """A mesh at several places as one mesh.

    Args:
        triangles: the mesh.
        places: matrices, shape (k, 4, 4).
    """
    linear = places[:, :3, :3]
    count, vertices, corners = len(places), len(triangles.positions), triangles.corner_count
    mirrored = np.linalg.det(linear) < 0.0
    normals = triangles.normals
    if normals is not None:
        cofactors = np.stack([np.cross(linear[:, i - 2], linear[:, i - 1]) for i in range(3)], axis=1)
        normals = np.einsum("kij,nj->kni", cofactors * np.where(mirrored, -1.0, 1.0)[:, None, None], normals)
        lengths = np.linalg.norm(normals, axis=-1, keepdims=True)
        normals = (normals / np.where(lengths > 0.0, lengths, 1.0)).astype(np.float32).reshape(-1, 3)

    def shifted(indices: np.ndarray, step: int) -> np.ndarray:
        all_of_them = indices[None] + step * np.arange(count, dtype=np.int64)[:, None, None]
        all_of_them[mirrored] = all_of_them[mirrored][..., ::-1]
        return all_of_them.reshape(-1, 3)

    positions = np.einsum("kij,nj->kni", linear, triangles.positions) + places[:, None, :3, 3]
    return Triangles(
        positions.astype(np.float32).reshape(-1, 3),
        shifted(triangles.vertices, vertices),
        shifted(triangles.loops, corners),
        np.tile(triangles.slots, count),
        normals,
        {name: np.tile(values, (count, 1)) for name, values in triangles.uv.items()},
        triangles.active_uv,
        {name: np.tile(values, (count, 1)) for name, values in triangles.colours.items()},
        np.tile(triangles.local, (count, 1)),
        triangles.generated,
        corners * count,
    )


def _got(collection, name: str, length: int, kind) -> np.ndarray:
    values = np.empty(length, kind)
    collection.foreach_get(name, values)
    return values


def _colours(mesh, attribute) -> np.ndarray:
    """A colour attribute at every corner, linear."""
    flat = _got(attribute.data, "color", 4 * len(attribute.data), np.float32).reshape(-1, 4)[:, :3]
    if attribute.domain == "POINT":
        return flat[_got(mesh.loops, "vertex_index", len(mesh.loops), np.int32)]
    return flat


def coordinates(triangles: Triangles, lay: Lay, which: np.ndarray) -> np.ndarray | None:
    """Texture coordinates of corners, v upward, before the lay's matrix where that is two-dimensional.

    Args:
        triangles: the mesh.
        lay: how the image lies.
        which: the triangles, shape (k,).

    Returns:
        Shape (k, 3, 2), or ``None`` where the mesh lacks the UV map.
    """
    matrix = np.array(lay.matrix)
    if lay.source not in {GENERATED, OBJECT}:
        name = lay.name or triangles.active_uv
        if name not in triangles.uv:
            return None
        flat = triangles.uv[name][triangles.loops[which]]
        if is_flat(lay):
            return flat
        places = np.concatenate([flat, np.zeros((*flat.shape[:-1], 1), np.float32)], axis=-1)
    else:
        places = triangles.local[triangles.vertices[which]].astype(np.float64)
        if lay.source == GENERATED:
            centre, half = triangles.generated
            places = (places - centre) / (2.0 * half) + 0.5
    # As Cycles' box mapping: along the axis that the face looks to most.
    if lay.box:
        corners = triangles.local[triangles.vertices[which]].astype(np.float64)
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        return _boxed(places @ matrix[:3, :3].T + matrix[:3, 3], normals)
    return (places @ matrix[:3, :3].T + matrix[:3, 3])[..., :2]


def is_flat(lay: Lay) -> bool:
    """Whether a lay's matrix is a scale, a turn and a shift of the plane, which a texture's own transform can have."""
    matrix = np.array(lay.matrix)[:2, :2]
    return not lay.box and lay.source not in {GENERATED, OBJECT} and abs(float(matrix[:, 0] @ matrix[:, 1])) < 1e-5


def _boxed(places: np.ndarray, normals: np.ndarray) -> np.ndarray:
    x, y, z = np.moveaxis(places, -1, 0)
    axis = np.abs(normals).argmax(axis=-1)[:, None]
    sign = np.take_along_axis(normals, axis, axis=1)
    along_x = np.stack([np.where(sign < 0.0, 1.0 - y, y), z], axis=-1)
    along_y = np.stack([np.where(sign > 0.0, 1.0 - x, x), z], axis=-1)
    along_z = np.stack([np.where(sign > 0.0, 1.0 - y, y), x], axis=-1)
    axis = axis[..., None]
    return np.where(axis == 0, along_x, np.where(axis == 1, along_y, along_z))


def real_data(mesh: bpy.types.Mesh, to_world: Matrix, offset: np.ndarray) -> tuple[bytes, np.ndarray]:
    """A mesh as binary PLY of triangles.

    Args:
        mesh: the mesh, modifiers applied.
        to_world: its matrix.
        offset: taken off all positions, shape (3,).

    Returns:
        The file's bytes, and the smallest and the largest coordinates, shape (2, 3).
    """
    mesh.calc_loop_triangles()
    columns = ["x", "y", "z"]
    vertices = positions_in_world(mesh, to_world) - offset
    rest = mesh.attributes.get(REST)
    bounds = np.array([vertices.min(axis=0), vertices.max(axis=0)])
    if rest is not None and rest.domain == "POINT" and rest.data_type == "FLOAT_VECTOR":
        positions = _got(rest.data, "vector", 3 * len(mesh.vertices), np.float32)
        vertices = np.hstack([vertices, positions.reshape(-1, 3) - offset])
        columns += [f"{REST}_{axis}" for axis in "xyz"]
    triangles = _got(mesh.loop_triangles, "vertices", 3 * len(mesh.loop_triangles), np.int32).reshape(-1, 3)
    if to_world.determinant() < 0.0:
        triangles = triangles[:, ::-1]
    faces = np.empty(len(triangles), np.dtype([("count", "u1"), ("corners", "<i4", 3)]))
    faces["count"], faces["corners"] = 3, triangles
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(vertices)}",
        *(f"property float {name}" for name in columns),
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        "end_header\n",
    ]
    return "\n".join(header).encode() + vertices.astype("<f4").tobytes() + faces.tobytes(), bounds

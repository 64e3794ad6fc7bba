"""Meshes and analytic shapes as Mitsuba shapes. The names of Mitsuba's mesh parameters stand here only."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

import lightdepth.kernel.metallic_roughness  # noqa: F401 - registers the BSDF
from lightdepth.errors import InputError
from lightdepth.kernel.arrays import aligned
from lightdepth.kernel.loading import load
from lightdepth.kernel.textures import TextureCache
from lightdepth.scene.materials import Material
from lightdepth.scene.model import AnalyticShape, Mesh, Scene


def synthetic_shapes(scene: Scene) -> list[tuple[int, mi.Shape]]:
    """The shapes of the synthetic objects, with their BSDFs and emitters.

    Returns:
        Pairs of an index into ``scene.synthetic`` and a shape; an object of several parts has several shapes.

    Raises:
        InputError: Mitsuba refuses a material.
    """
    builder = _Builder()
    shapes = []
    for index, thing in enumerate(scene.synthetic):
        for part in thing.parts:
            try:
                shapes.append((index, builder.shape(part.geometry, part.material)))
            except _RefusedMaterialError as error:
                place = f'[[synthetic]] {index + 1} ("{thing.name}"): material'
                raise InputError(f"{scene.path or 'scene'}: {place}: {error}") from error
    return shapes


def mesh_shape(mesh: Mesh, bsdf: mi.BSDF | None = None, emitter: mi.Emitter | None = None) -> mi.Mesh:
    """A mesh as a Mitsuba shape, with its colours as the attribute ``vertex_color``.

    Args:
        mesh: triangles in world space. Without normals its faces are flat.
        bsdf: its material; Mitsuba's grey by default.
        emitter: an area light of its own, not shared with another shape.
    """
    properties = mi.Properties()
    if bsdf is not None:
        properties["bsdf"] = bsdf
    if emitter is not None:
        properties["emitter"] = emitter
    properties["face_normals"] = mesh.normals is None
    shape = mi.Mesh(
        "mesh",
        vertex_count=len(mesh.vertices),
        face_count=len(mesh.faces),
        has_vertex_normals=mesh.normals is not None,
        has_vertex_texcoords=mesh.texture_coordinates is not None,
        props=properties,
    )
    parameters = mi.traverse(shape)
    parameters["vertex_positions"] = _flat(mesh.vertices)
    parameters["faces"] = mi.UInt32(aligned(mesh.faces, np.uint32))
    if mesh.normals is not None:
        parameters["vertex_normals"] = _flat(mesh.normals)
    if mesh.texture_coordinates is not None:
        # Mitsuba's bitmaps have their first row at v = 0.
        parameters["vertex_texcoords"] = _flat(mesh.texture_coordinates * [1.0, -1.0] + [0.0, 1.0])
    parameters.update()
    if mesh.colors is not None:
        shape.add_attribute("vertex_color", 3, _flat(mesh.colors))
    return shape


def is_polished(shape: mi.Shape) -> bool:
    """Whether its material throws light into some directions rather than others."""
    return any(mi.has_flag(shape.bsdf().flags(), kind) for kind in (mi.BSDFFlags.Glossy, mi.BSDFFlags.Delta))


def enclosing_sphere(shape: mi.Shape) -> tuple[np.ndarray, float]:
    """A sphere around a shape: centre of its bounding box, shape (3,), world, and radius, both in metres."""
    box = shape.bbox()
    low, high = np.array(box.min).ravel(), np.array(box.max).ravel()
    centre = 0.5 * (low + high)
    if isinstance(shape, mi.Mesh):
        vertices = shape.vertex_position(dr.arange(mi.UInt32, shape.vertex_count())).numpy().T
        return centre, float(np.linalg.norm(vertices - centre, axis=1).max())
    if shape.shape_type() == int(mi.ShapeType.Sphere):
        return centre, 0.5 * float((high - low).max())
    return centre, 0.5 * float(np.linalg.norm(high - low))


def _flat(values: np.ndarray) -> mi.Float:
    return mi.Float(aligned(values))


class _RefusedMaterialError(Exception):
    """What Mitsuba says of a material that it does not accept."""


class _Builder:
    """Makes shapes; materials and textures that several of them use are made once."""

    def __init__(self) -> None:
        self._textures = TextureCache()
        self._bsdfs: dict[tuple[int, bool], tuple[Material, mi.BSDF]] = {}

    def shape(self, geometry: Mesh | AnalyticShape, material: Material) -> mi.Shape:
        analytic = isinstance(geometry, AnalyticShape)
        bsdf = self._bsdf(material, v_up=analytic)
        light = material.plugins().get("emitter")
        light = None if light is None else self._textures.plugin(light, v_up=analytic)
        if isinstance(geometry, Mesh):
            return mesh_shape(geometry, bsdf, None if light is None else load(light))
        description: dict[str, Any] = {"type": geometry.kind, "bsdf": bsdf}
        description["to_world"] = mi.ScalarTransform4f(geometry.to_world)
        if light is not None:
            description["emitter"] = light
        return load(description)

    def _bsdf(self, material: Material, v_up: bool) -> mi.BSDF:
        key = (id(material), v_up)
        if key not in self._bsdfs:
            description = self._textures.plugin(material.plugins()["bsdf"], v_up)
            try:
                bsdf = load(description)
            except (RuntimeError, ValueError, TypeError) as error:
                raise _RefusedMaterialError(_last_sentence(str(error))) from error
            if not isinstance(bsdf, mi.BSDF):
                raise _RefusedMaterialError(f"'{description['type']}' is not a BSDF")
            self._bsdfs[key] = (material, bsdf)
        return self._bsdfs[key][1]


def _last_sentence(message: str) -> str:
    """Mitsuba's message without the places in its own source."""
    return " ".join(message.split("] ", 1)[-1].split())

"""Meshes and analytic shapes as Mitsuba shapes. The names of Mitsuba's mesh parameters stand here only."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

import lightdepth.kernel.metallic_roughness  # noqa: F401 - registers the BSDF
from lightdepth.errors import InputError
from lightdepth.kernel.arrays import aligned
from lightdepth.kernel.loading import load
from lightdepth.kernel.textures import TextureCache
from lightdepth.kernel.tracing import Instances, Prototype
from lightdepth.scene.identity import digest
from lightdepth.scene.materials import Material
from lightdepth.scene.meshes.geometry import expanded
from lightdepth.scene.model import AnalyticShape, Mesh, Scene, SyntheticPart

CELL = 4.0
"""Edge of the cells in which prototypes of instances stand, in which they reach from -1 to 1."""
FEW_TRIANGLES = 16
"""Of a mesh that takes less memory at each of its places than a place does."""
NUMBERS = 128
"""Shapes of this many parts, of all scenes in memory, for which kernels stay the same."""
Extent = tuple[tuple[np.ndarray, float], tuple[np.ndarray, np.ndarray] | None]
"""A sphere around a shape, and the vertices, shape (n, 3), and faces, shape (m, 3), of a mesh, ``None`` of another."""


@dataclass(frozen=True, eq=False)
class SyntheticShapes:
    """The shapes of the synthetic objects, with their BSDFs and emitters.

    Attributes:
        numbered: pairs of an index into ``scene.synthetic`` and a shape; an object of several parts has several shapes.
        spheres: around each of them in the world, with all its instances: centre, shape (3,), and radius, in metres.
        parts: of those that are no instances, spheres around each, and the vertices, shape (n, 3), and faces, shape
            (m, 3), of meshes.
        around_instances: centres, shape (n, 3), and radii, shape (n,), of spheres around what stands at each place.
        plain: those that stand where they are in the world.
        instances: the others; ``None`` where there are none.
        unseen: those that cameras do not see by themselves.
    """

    numbered: tuple[tuple[int, mi.Shape], ...]
    spheres: tuple[tuple[np.ndarray, float], ...]
    parts: tuple[Extent, ...]
    around_instances: tuple[np.ndarray, np.ndarray]
    plain: tuple[mi.Shape, ...]
    instances: Instances | None
    unseen: tuple[mi.Shape, ...] = ()


def synthetic_shapes(scene: Scene) -> SyntheticShapes:
    """The shapes of the synthetic objects.

    What is the same as in the last scene is the same shape, so that a moved object makes no other work than its own.

    Raises:
        InputError: Mitsuba refuses a material.
    """
    global _last
    _hold_numbers()
    builder = _Builder(_last)
    parts = [(index, part) for index, thing in enumerate(scene.synthetic) for part in thing.parts]
    # What cameras do not see is left out of a scene by its shape.
    limits = [
        scene.render.parameters.transport.expanded_triangles if scene.synthetic[index].visible_to_camera else None
        for index, _ in parts
    ]
    prototypes = _prototypes([part for _, part in parts], limits)
    owners = {number: prototype for prototype in prototypes for number in prototype.parts}
    shapes, spheres = [], []
    for number, (index, part) in enumerate(parts):
        prototype = owners.get(number)
        try:
            shape = builder.shape(part if prototype is None else prototype.in_cell(part))
        except _RefusedMaterialError as error:
            place = f'[[synthetic]] {index + 1} ("{scene.synthetic[index].name}"): material'
            raise InputError(f"{scene.path or 'scene'}: {place}: {error}") from error
        shapes.append((index, shape))
        spheres.append(builder.extent(shape)[0] if prototype is None else prototype.sphere())
    _last = builder.without_predecessor()
    plain = tuple(shape for number, (_, shape) in enumerate(shapes) if number not in owners)
    outline = [builder.extent(shape) for number, (_, shape) in enumerate(shapes) if number not in owners]
    around = [prototype.spheres() for prototype in prototypes] or [(np.zeros((0, 3)), np.zeros(0))]
    centres, radii = (np.concatenate(values) for values in zip(*around, strict=True))
    instances = None
    if prototypes:
        instances = Instances([each.traced() for each in prototypes], [shapes[number][1] for number in owners])
    unseen = tuple(shape for index, shape in shapes if not scene.synthetic[index].visible_to_camera)
    return SyntheticShapes(tuple(shapes), tuple(spheres), tuple(outline), (centres, radii), plain, instances, unseen)


@dataclass(frozen=True, eq=False)
class _Prototype:
    """Parts of an object that stand together at many places, in a cell of their own.

    Attributes:
        parts: their numbers.
        low: smallest coordinates of their box, shape (3,).
        high: the largest.
        cell: middle of the cell, shape (3,).
        places: matrices to the world, shape (n, 4, 4).
    """

    parts: tuple[int, ...]
    low: np.ndarray
    high: np.ndarray
    cell: np.ndarray
    places: np.ndarray

    @property
    def _middle(self) -> np.ndarray:
        return 0.5 * (self.low + self.high)

    @property
    def _size(self) -> float:
        return 0.5 * float((self.high - self.low).max())

    def in_cell(self, part: SyntheticPart) -> SyntheticPart:
        """One of the parts as it stands in the cell, which it fills from -1 to 1."""
        assert isinstance(part.geometry, Mesh)
        vertices = (part.geometry.vertices - self._middle) / self._size + self.cell
        return SyntheticPart(replace(part.geometry, vertices=vertices.astype(np.float32)), part.material)

    def traced(self) -> Prototype:
        """The same for rays."""
        from_cell = np.eye(4)
        from_cell[:3] = np.column_stack([self._size * np.eye(3), self._middle - self._size * self.cell])
        low, high = ((end - self._middle) / self._size + self.cell for end in (self.low, self.high))
        return Prototype(low, high, self.places @ from_cell)

    def sphere(self) -> tuple[np.ndarray, float]:
        """Around all that stands in the world."""
        points = self._corners
        centre = 0.5 * (points.min(axis=(0, 1)) + points.max(axis=(0, 1)))
        return centre, float(np.linalg.norm(points - centre, axis=2).max())

    def spheres(self) -> tuple[np.ndarray, np.ndarray]:
        """Around what stands at each place: centres, shape (n, 3), and radii, shape (n,)."""
        points = self._corners
        centres = 0.5 * (points.min(axis=1) + points.max(axis=1))
        return centres, np.linalg.norm(points - centres[:, None], axis=2).max(axis=1)

    @cached_property
    def _corners(self) -> np.ndarray:
        """Of the boxes at all places, in the world, shape (n, 8, 3)."""
        ends = np.stack([self.low, self.high])
        corners = np.stack([ends[(index >> np.arange(3)) & 1, np.arange(3)] for index in range(8)])
        return np.einsum("nij,cj->nci", self.places[:, :3, :3], corners) + self.places[:, None, :3, 3]


def _prototypes(parts: Sequence[SyntheticPart], limits: Sequence[int | None]) -> list[_Prototype]:
    """Parts that are too much to be expanded, those at the same places together.

    Args:
        parts: of all objects.
        limits: most triangles that are expanded; ``None`` expands all.
    """
    together: dict[int, list[int]] = {}
    for number, (part, limit) in enumerate(zip(parts, limits, strict=True)):
        if limit is not None and _stays_instanced(part, limit):
            together.setdefault(id(part.places), []).append(number)
    edge = next(edge for edge in itertools.count(1) if edge**3 >= len(together))
    prototypes = []
    for index, numbers in enumerate(together.values()):
        vertices = [parts[number].geometry.vertices for number in numbers]  # type: ignore[union-attr]
        low = np.min([each.min(axis=0) for each in vertices], axis=0).astype(np.float64)
        high = np.max([each.max(axis=0) for each in vertices], axis=0).astype(np.float64)
        cell = CELL * (np.array(np.unravel_index(index, (edge,) * 3)) - 0.5 * (edge - 1))
        places = parts[numbers[0]].places
        assert places is not None
        prototypes.append(_Prototype(tuple(numbers), low, high, cell, places))
    return prototypes


def _stays_instanced(part: SyntheticPart, expanded_triangles: int) -> bool:
    """Whether a part stands once in memory: lamps do not, which are sampled by their surface, and what is as small."""
    if part.places is None or "emitter" in part.material.plugins():
        return False
    assert isinstance(part.geometry, Mesh)
    triangles = len(part.geometry.faces)
    return triangles > FEW_TRIANGLES and triangles * len(part.places) > expanded_triangles


def _hold_numbers() -> None:
    """Keep the highest number of a shape where it is, whatever shapes come and go below it.

    Dr.Jit lays out a kernel's tables of calls by that number: without this, each moved object would compile kernels.
    """
    global _highest
    if _highest is None:
        shapes = [mesh_shape(Mesh(np.zeros((3, 3), np.float32), np.zeros((1, 3), np.int32))) for _ in range(NUMBERS)]
        _highest = shapes[-1]


def forget_shapes() -> None:
    """Free the shapes of the scene that was prepared last."""
    global _last
    _last = None


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


def moved_copy(shape: mi.Shape, offset: np.ndarray) -> mi.Shape:
    """The geometry of a shape once more.

    Args:
        shape: a mesh or an analytic shape.
        offset: by which the copy is moved, world, metres, shape (3,).
    """
    parameters = mi.traverse(shape)
    if "vertex_positions" in parameters:
        vertices, faces = mesh_of(shape)  # type: ignore[misc]
        return mesh_shape(Mesh((vertices + offset).astype(np.float32), faces.astype(np.int32)))
    to_world = np.array(parameters["to_world"].matrix, np.float64).reshape(4, 4)
    to_world[:3, 3] += offset
    return _with_place_as_data(load({"type": shape.class_name().lower(), "to_world": mi.ScalarTransform4f(to_world)}))


def _with_place_as_data(shape: mi.Shape) -> mi.Shape:
    """An analytic shape whose transformation is no part of the program: each place of a moving lamp would compile one.

    Of Mitsuba's shapes only rectangles need it.
    """
    if shape.shape_type() == int(mi.ShapeType.Rectangle):
        parameters = mi.traverse(shape)
        to_world = mi.Transform4f(parameters["to_world"])
        dr.make_opaque(to_world)
        parameters["to_world"] = to_world
        parameters.update()
    return shape


def is_polished(shape: mi.Shape) -> bool:
    """Whether its material throws light into some directions rather than others."""
    return any(mi.has_flag(shape.bsdf().flags(), kind) for kind in (mi.BSDFFlags.Glossy, mi.BSDFFlags.Delta))


def mesh_of(shape: mi.Shape) -> tuple[np.ndarray, np.ndarray] | None:
    """Vertices, shape (n, 3), world, metres, and faces, shape (m, 3), of a mesh; ``None`` of another shape."""
    if not isinstance(shape, mi.Mesh):
        return None
    vertices = shape.vertex_position(dr.arange(mi.UInt32, shape.vertex_count())).numpy().T
    return vertices, shape.face_indices(dr.arange(mi.UInt32, shape.face_count())).numpy().T


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
    """Makes shapes; materials and textures that several of them use are made once.

    Args:
        last: takes over what it made of the same content.
    """

    def __init__(self, last: _Builder | None = None) -> None:
        self._predecessor = last
        self._textures = TextureCache()
        self._bsdfs: dict[str, mi.BSDF] = {}
        self._shapes: dict[str, mi.Shape] = {}
        self._extents: dict[int, Extent] = {}

    def without_predecessor(self) -> _Builder:
        """The same, for a successor; what the predecessor made, and nothing uses now, is free."""
        self._predecessor = None
        return self

    def shape(self, part: SyntheticPart) -> mi.Shape:
        key = digest(part)
        while key in self._shapes:  # The same once more at the same place is another shape.
            key += "+"
        known = None if self._predecessor is None else self._predecessor._shapes.get(key)
        # The BSDF is taken over with its shape.
        bsdf = self._bsdf(part.material, v_up=isinstance(part.geometry, AnalyticShape))
        self._shapes[key] = known or self._made(part, bsdf)
        return self._shapes[key]

    def extent(self, shape: mi.Shape) -> Extent:
        """A sphere around one of the shapes, and its mesh: the same arrays for the same shape."""
        key = id(shape)  # Both builders keep their shapes.
        known = None if self._predecessor is None else self._predecessor._extents.get(key)
        if key not in self._extents:
            self._extents[key] = known or (enclosing_sphere(shape), mesh_of(shape))
        return self._extents[key]

    def _made(self, part: SyntheticPart, bsdf: mi.BSDF) -> mi.Shape:
        geometry = part.geometry
        if part.places is not None and isinstance(geometry, Mesh):
            geometry = expanded(geometry, part.places)
        light = part.material.plugins().get("emitter")
        light = None if light is None else self._textures.plugin(light, v_up=isinstance(geometry, AnalyticShape))
        if isinstance(geometry, Mesh):
            return mesh_shape(geometry, bsdf, None if light is None else load(light))
        description: dict[str, Any] = {"type": geometry.kind, "bsdf": bsdf}
        description["to_world"] = mi.ScalarTransform4f(geometry.to_world)
        if light is not None:
            description["emitter"] = light
        return _with_place_as_data(load(description))

    def _bsdf(self, material: Material, v_up: bool) -> mi.BSDF:
        key = digest(material, v_up)
        known = None if self._predecessor is None else self._predecessor._bsdfs.get(key)
        if known is not None:
            self._bsdfs[key] = known
        if key not in self._bsdfs:
            description = self._textures.plugin(material.plugins()["bsdf"], v_up)
            try:
                bsdf = load(description)
            except (RuntimeError, ValueError, TypeError) as error:
                raise _RefusedMaterialError(_last_sentence(str(error))) from error
            if not isinstance(bsdf, mi.BSDF):
                raise _RefusedMaterialError(f"'{description['type']}' is not a BSDF")
            self._bsdfs[key] = bsdf
        return self._bsdfs[key]


_last: _Builder | None = None
_highest: mi.Mesh | None = None


def _last_sentence(message: str) -> str:
    """Mitsuba's message without the places in its own source."""
    return " ".join(message.split("] ", 1)[-1].split())

"""The real and the synthetic surfaces as Mitsuba scenes, traced side by side, and tables of the real faces.

What is removed is there before the change, and not afterwards: it is in ``real``, but not in ``kept``, ``all`` and
``shown``. In its place, ``synthetic`` and ``all`` have shapes that let light pass, where paths find that it is gone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, fields

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightdepth.kernel.arrays import aligned, aligned_empty
from lightdepth.kernel.device import ON_GPU
from lightdepth.kernel.loading import load
from lightdepth.kernel.materials import Materials, registered
from lightdepth.kernel.shapes import SyntheticShapes, mesh_shape, moved_copy
from lightdepth.kernel.tracing import Cell, Instances, Traced, WithInstances, first_hit, side_by_side
from lightdepth.place.real_surfaces import FaceKind, RealSurfaces
from lightdepth.scene.meshes.geometry import face_normals
from lightdepth.scene.model import Mesh

RAY_EPSILON = 1e-4
"""Offset of a ray's origin from the surface it leaves, relative to ``1 + |p|``."""
SHADOW_RAY_END = 0.999
"""Where shadow rays end, as a share of the way to the light."""

TRACED = ("all", "seen", "shown", "synthetic", "real", "kept", "blockers", "kept_blockers")
"""Attributes of :class:`TracedSurfaces` that are traced, the largest first."""


@dataclass
class RealHit:
    """First real surfaces along rays.

    Attributes:
        valid: false where the ray meets none (sky).
        distance: metres along the ray.
        point: world, metres.
        normal: unit, world, as the face is wound.
        face: index into the faces of :class:`RealSurfaces`.
        uv: barycentric coordinates of the face's second and third vertex.
        kind: :class:`FaceKind`; ENVIRONMENT where not valid.
        gloss: 0 for none, else 1 + index of the specular lobe.
    """

    valid: mi.Bool
    distance: mi.Float
    point: mi.Point3f
    normal: mi.Vector3f
    face: mi.UInt32
    uv: mi.Point2f
    kind: mi.UInt32
    gloss: mi.UInt32


class TracedSurfaces:
    """The real surfaces, the synthetic ones, and both together, as scenes to trace rays in.

    Args:
        surfaces: the real surfaces.
        shapes: the synthetic shapes.

    Attributes:
        kinds: that occur among the real faces.
        changes: whether what any real surface shows may change: support that is not relit, or environment with gloss.
        materials: of the synthetic shapes.
        blockers: the real surfaces that are not openings.
        kept_blockers: these without what is removed.
        kept: the real surfaces that are not removed.
        synthetic: the synthetic surfaces.
        all: both together.
        emitting: the same without instances, which give no light.
        has_unseen: whether there are synthetic surfaces that cameras do not see by themselves.
        seen: ``all`` without these.
        shown: those that are kept, and the synthetic ones that cameras see.
    """

    def __init__(self, surfaces: RealSurfaces, shapes: SyntheticShapes | None = None) -> None:
        self.has_real = len(surfaces.faces) > 0
        self.deformed = surfaces.deformed
        self.kinds = frozenset(FaceKind(int(kind)) for kind in np.unique(surfaces.kind))
        self.changes = bool((surfaces.scattering & (surfaces.kind != FaceKind.RELIT)).any())
        black = load({"type": "diffuse", "reflectance": 0.0})
        self._real_shapes = {"real": mesh_shape(surfaces.mesh(), black)} if self.has_real else {}
        # Robust, since light and depth are looked up along rays through vertices; elsewhere it would cost a tenth more.
        self.real = _scene(self._real_shapes, robust=True)
        solid = surfaces.kind != FaceKind.OPENING
        self.blockers = self._only(surfaces, solid, black)
        self.kept, self.kept_blockers = self.real, self.blockers
        self.has_removed = FaceKind.REMOVED in self.kinds
        if self.has_removed:
            # Faces of no area are never met; so the others keep their numbers.
            faces = np.where((surfaces.kind == FaceKind.REMOVED)[:, None], surfaces.faces[:, :1], surfaces.faces)
            self._real_shapes = {"real": mesh_shape(Mesh(surfaces.vertices, faces), black)}
            self.kept = _scene(self._real_shapes, robust=True)
            self.kept_blockers = self._only(surfaces, solid & (surfaces.kind != FaceKind.REMOVED), black)
        self._real_shape = mi.UInt32(0)
        if self.has_real:
            self._real_shape = dr.opaque(mi.UInt32, registered(mi.ShapePtr(self._real_shapes["real"])))
        self._fill_tables(surfaces)
        self._add_synthetic(shapes, None)

    def with_synthetic(self, shapes: SyntheticShapes, removed: mi.Shape | None = None) -> TracedSurfaces:
        """The same real surfaces with these synthetic shapes.

        Args:
            shapes: the synthetic shapes.
            removed: stands for what is removed, lets all light pass, and is met before it.
        """
        traced = copy(self)
        traced._add_synthetic(shapes, removed)
        return traced

    def _add_synthetic(self, shapes: SyntheticShapes | None, removed: mi.Shape | None) -> None:
        every = [] if shapes is None else [shape for _, shape in shapes.numbered]
        new = {f"synthetic_{index}": shape for index, shape in enumerate(() if shapes is None else shapes.plain)}
        instances = None if shapes is None else shapes.instances
        passed = {} if removed is None else {"removed": removed}
        self._removed_shape = None if removed is None else dr.opaque(mi.UInt32, registered(mi.ShapePtr(removed)))
        self.has_synthetic = len(every) > 0 or removed is not None
        # Robust as well: built without spatial splits, in a quarter of the time, and traced as fast.
        self.synthetic = _with(_scene({**new, **passed}, robust=True), instances)
        self.emitting = _scene({**self._real_shapes, **new, **passed})
        self.all = _with(self.emitting, instances)
        unseen = () if shapes is None else shapes.unseen
        self.has_unseen = len(unseen) > 0
        self._unseen = _table_of([registered(mi.ShapePtr(shape)) for shape in unseen])
        seen = {name: shape for name, shape in new.items() if shape not in unseen}
        self.seen, self.shown = self.all, self.all
        if self.has_unseen:
            self.seen = _with(_scene({**self._real_shapes, **seen, **passed}), instances)
        if removed is not None or self.has_unseen:
            self.shown = _with(_scene({**self._real_shapes, **seen}), instances)
        self.materials = Materials([*every, *passed.values()])
        if ON_GPU:
            self._join()

    def _join(self) -> None:
        """Let a kernel trace all scenes as one."""
        traced: dict[str, Traced] = {name: getattr(self, name) for name in TRACED}
        alone = {name: _alone(scene) for name, scene in traced.items()}
        instances = next((each.instances for each in traced.values() if isinstance(each, WithInstances)), None)
        within = [] if instances is None else [_alone(instances.scene)]
        distinct = list({id(scene): scene for scene in (*alone.values(), *within)}.values())
        cells = dict(zip(map(id, distinct), side_by_side(distinct, moved_copy), strict=True))
        if instances is not None:
            instances = instances.within(cells[id(within[0])])
        for name, scene in traced.items():
            cell = cells[id(alone[name])]
            setattr(self, name, _with(cell, instances if isinstance(scene, WithInstances) else None))

    def _only(self, surfaces: RealSurfaces, chosen: NDArray[np.bool_], black: mi.BSDF) -> mi.Scene:
        """Some of the real faces: those that keep a declared sun out."""
        if chosen.all():
            return self.real
        if not chosen.any():
            return _scene({})
        return _scene({"solid": mesh_shape(Mesh(surfaces.vertices, surfaces.faces[chosen]), black)}, robust=True)

    def receives(self, hit: RealHit) -> mi.Bool:
        """Whether real surfaces that were met receive the influence of the new objects."""
        return (hit.kind == int(FaceKind.SUPPORT)) | (hit.kind == int(FaceKind.RELIT))

    def scatters(self, hit: RealHit) -> mi.Bool:
        """Whether real surfaces that were met send on light of the new objects: those that receive, and glossy ones.

        Environment with gloss mirrors the new objects; what it sends besides does not change.
        """
        return self.receives(hit) | ((hit.kind == int(FaceKind.ENVIRONMENT)) & (hit.gloss > 0))

    def with_values(self, surfaces: RealSurfaces) -> TracedSurfaces:
        """The same geometry with other values at its vertices and faces."""
        traced = copy(self)
        traced._fill_tables(surfaces)
        return traced

    def _fill_tables(self, surfaces: RealSurfaces) -> None:
        count = len(surfaces.faces)
        facts = np.zeros((max(count, 1), 4), np.uint32)
        facts[:count, 0] = surfaces.first_node
        facts[:count, 1] = surfaces.divisions
        facts[:count, 3] = surfaces.kind | (surfaces.gloss << 3)
        self._facts = mi.UInt32(aligned(facts, np.uint32))
        self._normals = mi.Float(_padded(face_normals(surfaces.vertices, surfaces.faces)))
        self._irradiance = mi.Float(_padded(surfaces.irradiance))
        albedos = [(0.0, 0.0, 0.0), *(gloss.albedo for gloss in surfaces.glosses)]
        self._typical_albedo = mi.Float(_padded(np.array(albedos))) if surfaces.glosses else None
        self._rest = mi.Float(_padded(surfaces.rest[surfaces.faces].reshape(-1, 3))) if self.deformed else None
        self.has_unseen_albedo = bool(surfaces.unseen_albedo.any())
        self._unseen_albedo = mi.Float(_padded(surfaces.unseen_albedo)) if self.has_unseen_albedo else None

    def first_real(self, ray: mi.Ray3f, active: mi.Bool, coherent: bool = False) -> RealHit:
        """The first real surface along rays, looking through all synthetic ones: ``q(x, w)``.

        Args:
            ray: world.
            active: which of them count.
            coherent: rays of neighbouring lanes run side by side, which makes them several times as fast.
        """
        found = first_hit(self.real, ray, coherent=coherent, active=active)
        return self.real_hit(ray, found, active & found.is_valid())

    def is_real(self, found: mi.PreliminaryIntersection3f) -> mi.Bool:
        """Whether intersections with everything lie on a real surface."""
        if not self.has_real:
            return mi.Bool(False)
        return found.is_valid() & (dr.reinterpret_array(mi.UInt32, found.shape) == self._real_shape)

    def is_removed(self, found: mi.PreliminaryIntersection3f) -> mi.Bool:
        """Whether intersections with everything lie where something was removed."""
        if self._removed_shape is None:
            return mi.Bool(False)
        return found.is_valid() & (dr.reinterpret_array(mi.UInt32, found.shape) == self._removed_shape)

    def is_unseen(self, found: mi.PreliminaryIntersection3f, active: mi.Bool) -> mi.Bool:
        """Which of the active intersections with everything cameras do not see by themselves."""
        if not self.has_unseen:
            return mi.Bool(False)
        index = dr.reinterpret_array(mi.UInt32, found.shape)
        inside = active & found.is_valid() & (index < dr.width(self._unseen))
        return inside & (dr.gather(mi.UInt32, self._unseen, index, inside) > 0)

    def leaves_with_objects(self, hit: RealHit) -> mi.Bool:
        """Whether what real surfaces that were met send is not there after the change: relit and removed ones."""
        return (hit.kind == int(FaceKind.RELIT)) | (hit.kind == int(FaceKind.REMOVED))

    def real_hit(self, ray: mi.Ray3f, found: mi.PreliminaryIntersection3f, valid: mi.Bool) -> RealHit:
        """Look up the values of the real faces that were hit, where ``valid``."""
        face = dr.select(valid, found.prim_index, 0)
        flags = dr.gather(mi.UInt32, self._facts, 4 * face + 3, valid)
        normal = dr.gather(mi.Vector4f, self._normals, face, valid)
        return RealHit(
            valid,
            found.t,
            ray(dr.select(valid, found.t, 0.0)),
            mi.Vector3f(normal.x, normal.y, normal.z),
            face,
            mi.Point2f(found.prim_uv),
            dr.select(valid, flags & 7, int(FaceKind.ENVIRONMENT)),
            flags >> 3,
        )

    def irradiance(self, hit: RealHit, active: mi.Bool) -> mi.Color3f:
        """E at points of support surfaces, interpolated in barycentric coordinates."""
        value = self._interpolate(self._irradiance, hit, active)
        return mi.Color3f(value.x, value.y, value.z)

    def typical_albedo(self, hit: RealHit, active: mi.Bool) -> mi.Color3f:
        """Typical diffuse albedo of the glossy surfaces that were met, 0 for others."""
        if self._typical_albedo is None:
            return mi.Color3f(0.0)
        value = dr.gather(mi.Vector4f, self._typical_albedo, hit.gloss, active)
        return mi.Color3f(value.x, value.y, value.z)

    def unseen_radiance(self, hit: RealHit, active: mi.Bool) -> tuple[mi.Color3f, mi.Bool]:
        """Radiance of unseen points, ``rho E / pi``, and where it was recovered."""
        if self._unseen_albedo is None:
            return mi.Color3f(0.0), mi.Bool(False)
        albedo = dr.gather(mi.Vector4f, self._unseen_albedo, hit.face, active)
        valid = active & (dr.max(albedo) > 0.0)
        return mi.Color3f(albedo.x, albedo.y, albedo.z) * self.irradiance(hit, valid) * dr.inv_pi, valid

    def rest_point(self, hit: RealHit, active: mi.Bool) -> mi.Point3f:
        """Where points of real surfaces take their colour from (paper, section 5.8), world, metres."""
        if self._rest is None:
            return hit.point
        value = dr.zeros(mi.Vector4f)
        for corner, weight in enumerate((1.0 - hit.uv.x - hit.uv.y, hit.uv.x, hit.uv.y)):
            value += weight * dr.gather(mi.Vector4f, self._rest, 3 * hit.face + corner, active)
        return mi.Point3f(value.x, value.y, value.z)

    def _interpolate(self, table: mi.Float, hit: RealHit, active: mi.Bool) -> mi.Vector4f:
        """Values between the nodes of a face's grid, which cut it into small triangles.

        Two of them form a parallelogram and share the nodes to its right and above; the lower one has the node between
        these besides, the upper one that opposite to it.
        """
        facts = dr.gather(mi.Vector4u, self._facts, hit.face, active)
        divisions = facts.y
        at = hit.uv * mi.Float(divisions)
        row = dr.minimum(mi.UInt32(at.y), divisions - 1)
        column = dr.minimum(mi.UInt32(at.x), divisions - 1 - row)
        x, y = at.x - mi.Float(column), at.y - mi.Float(row)
        upper = (x + y > 1.0) & (row + column + 1 < divisions)
        between = facts.x + column + row * (2 * divisions + 3 - row) // 2
        right, above = between + 1, between + divisions + 1 - row
        third = dr.select(upper, above + 1, between)
        return (
            dr.gather(mi.Vector4f, table, right, active) * dr.select(upper, 1.0 - y, x)
            + dr.gather(mi.Vector4f, table, above, active) * dr.select(upper, 1.0 - x, y)
            + dr.gather(mi.Vector4f, table, third, active) * dr.select(upper, x + y - 1.0, 1.0 - x - y)
        )


def select_hit(choice: mi.Bool, first: RealHit, second: RealHit) -> RealHit:
    """``first`` where ``choice``, else ``second``."""
    names = (field.name for field in fields(RealHit))
    return RealHit(*(dr.select(choice, getattr(first, name), getattr(second, name)) for name in names))


def leave(
    point: mi.Point3f, normal: mi.Vector3f, direction: mi.Vector3f, length: mi.Float | float = dr.inf
) -> mi.Ray3f:
    """A ray that leaves a surface on the side to which ``direction`` points.

    Args:
        point: on the surface, world, metres.
        normal: of the surface, either side.
        direction: unit vector.
        length: where the ray ends, metres.
    """
    ray = mi.Ray3f(_beside(point, normal, direction), direction)
    ray.maxt = length
    return ray


def shadow_ray(point: mi.Point3f, normal: mi.Vector3f, direction: mi.Vector3f, distance: mi.Float) -> mi.Ray3f:
    """A ray that leaves a surface and ends just before a light.

    It starts beside the surface and still ends at the light: a parallel ray could be blocked by a near light itself.

    Args:
        point: on the surface, world, metres.
        normal: of the surface, either side.
        direction: from the point to the light, unit, world.
        distance: from the point to the light, metres, inf for sky.
    """
    origin = _beside(point, normal, direction)
    offset = dr.fma(direction, distance, point) - origin
    length = dr.norm(offset)
    finite = dr.isfinite(distance)
    ray = mi.Ray3f(origin, dr.select(finite, offset * dr.rcp(dr.maximum(length, 1e-20)), direction))
    ray.maxt = dr.select(finite, length * SHADOW_RAY_END, dr.inf)
    return ray


def _beside(point: mi.Point3f, normal: mi.Vector3f, direction: mi.Vector3f) -> mi.Point3f:
    offset = RAY_EPSILON * (1.0 + dr.max(dr.abs(point)))
    return dr.fma(normal, dr.mulsign(offset, dr.dot(normal, direction)), point)


def _table_of(indices: Sequence[int]) -> mi.UInt32:
    """1 at each of some indices, 0 elsewhere."""
    table = np.zeros(max(indices, default=0) + 1, np.uint32)
    table[list(indices)] = 1
    return mi.UInt32(aligned(table, np.uint32))


def _with(scene: mi.Scene | Cell, instances: Instances | None) -> Traced:
    return scene if instances is None else WithInstances(scene, instances)


def _alone(scene: Traced) -> mi.Scene:
    """A scene without its instances and by itself."""
    if isinstance(scene, WithInstances):
        scene = scene.scene
    return scene.alone if isinstance(scene, Cell) else scene


def _scene(shapes: Mapping[str, mi.Shape], robust: bool = False) -> mi.Scene:
    return load({"type": "scene", "embree_use_robust_intersections": robust, **shapes})


def _padded(vectors: np.ndarray) -> np.ndarray:
    """Vectors of shape (n, 3) as a flat array of groups of four, which are gathered at once; never empty."""
    padded = aligned_empty((max(len(vectors), 1), 4))
    padded[:] = 0.0
    padded[: len(vectors), :3] = vectors
    return padded.reshape(-1)

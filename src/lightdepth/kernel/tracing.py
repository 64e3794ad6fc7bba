"""Rays against Mitsuba's scenes, on every device.

The place and the new objects are scenes of their own, which a path traces one beside the other. On a GPU, OptiX traces a
single scene in a kernel: there these scenes stand side by side in one (:class:`Cell`).

Meshes that stand at many places are a scene too, in which each stands once (:class:`Instances`). Mitsuba has instances of
its own, but Dr.Jit compiles one call for each of them, which takes minutes for thousands.

The module is imported after ``kernel.start``; nothing else calls Mitsuba's ray tracing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightdepth.kernel.arrays import aligned
from lightdepth.kernel.device import ON_GPU
from lightdepth.kernel.instance_tree import END, instance_tree
from lightdepth.kernel.loading import load
from lightdepth.kernel.materials import registered

MARGIN = 1e-4
"""By which boxes around instances are larger than these, relative to their size and to their distance from the origin."""
SMALLEST_COMPONENT = 1e-20
"""Of a direction, where it is divided by."""


@dataclass(frozen=True)
class Prototype:
    """What stands at many places.

    Attributes:
        low: smallest coordinates of its box, shape (3,), in the coordinates of its shapes.
        high: the largest.
        to_world: a matrix for each place, from these coordinates to the world, shape (n, 4, 4), float64, of
            determinants above 0.
    """

    low: NDArray[np.float64]
    high: NDArray[np.float64]
    to_world: NDArray[np.float64]


class Instances:
    """Shapes of which each stands once in memory and at many places in the world.

    Rays go through a tree of boxes around all instances, and into the shapes in the coordinates of these.

    Args:
        prototypes: whose boxes do not overlap.
        shapes: of all prototypes.

    Attributes:
        scene: the shapes, in their own coordinates.
    """

    def __init__(self, prototypes: Sequence[Prototype], shapes: Sequence[mi.Shape]) -> None:
        named = {f"shape_{index}": shape for index, shape in enumerate(shapes)}
        self.scene: mi.Scene | Cell = load({"type": "scene", "embree_use_robust_intersections": True, **named})
        boxes = [_boxes(prototype) for prototype in prototypes]
        tree = instance_tree(np.concatenate([low for low, _ in boxes]), np.concatenate([high for _, high in boxes]))
        self._first_leaf, self._count = len(tree.leaves) - 1, len(tree.low)
        nodes = np.concatenate([tree.low, tree.axis[:, None], tree.high, np.zeros((self._count, 1))], axis=1)
        self._nodes, self._onward = mi.Float(aligned(nodes)), mi.UInt32(aligned(tree.onward, np.uint32))
        # By leaf; what no leaf has is never met.
        which = np.maximum(tree.leaves, 0)
        to_world = np.concatenate([prototype.to_world for prototype in prototypes])[which]
        self._to_world = mi.Float(aligned(to_world[:, :3]))
        self._to_local = mi.Float(aligned(np.linalg.inv(to_world)[:, :3]))
        margins = [MARGIN * (prototype.high - prototype.low).max() for prototype in prototypes]
        corners = [
            [*(each.low - margin), 0.0, *(each.high + margin), 0.0]
            for each, margin in zip(prototypes, margins, strict=True)
        ]
        self._corners = mi.Float(aligned(np.array(corners)))
        owner = np.repeat(np.arange(len(prototypes)), [len(prototype.to_world) for prototype in prototypes])[which]
        self._prototype = mi.UInt32(aligned(owner, np.uint32))

    def within(self, cell: Cell) -> Instances:
        """The same with its scene as a cell."""
        instances = copy(self)
        instances.scene = cell
        return instances

    def rows_to_world(self, number: mi.UInt32, active: mi.Bool) -> list[mi.Vector4f]:
        """The three rows of the matrices of instances, by their number."""
        return _rows(self._to_world, number, active)

    def local_ray(self, ray: mi.Ray3f, number: mi.UInt32, active: mi.Bool) -> mi.Ray3f:
        """Rays in the coordinates of instances' shapes, by the same parameter; others stay."""
        rows = _rows(self._to_local, number, active)
        local = mi.Ray3f(ray)
        local.o = dr.select(active, _point(rows, ray.o), ray.o)
        local.d = dr.select(active, _vector(rows, ray.d), ray.d)
        return local

    @dr.syntax
    def first_hit(
        self, ray: mi.Ray3f, found: mi.PreliminaryIntersection3f, active: mi.Bool, any_hit: bool = False
    ) -> mi.PreliminaryIntersection3f:
        """The first instance along rays, or what was found before it.

        Args:
            ray: world, metres.
            found: the first other surface, whose ``shape_index`` becomes 0.
            active: which rays are traced.
            any_hit: end with any instance that is met.

        Returns:
            With the instance's number plus 1 as ``shape_index``.
        """
        distance = dr.select(found.valid, found.t, ray.maxt)
        uv, face = mi.Point2f(found.prim_uv), mi.UInt32(found.prim_index)
        shape, met = mi.ShapePtr(found.shape), dr.zeros(mi.UInt32, dr.width(found.t))
        rcp = dr.rcp(_without_zeros(ray.d))
        octant = mi.UInt32(0)
        for axis in range(3):
            octant = octant | dr.select(rcp[axis] < 0.0, mi.UInt32(1 << axis), 0)
        node = dr.select(active, mi.UInt32(0), END)
        while dr.hint(node != END, mode="symbolic"):
            leaf = mi.UInt32(END)
            while dr.hint((node != END) & (leaf == END), mode="symbolic"):
                low = dr.gather(mi.Vector4f, self._nodes, 2 * node)
                high = dr.gather(mi.Vector4f, self._nodes, 2 * node + 1)
                enters, leaves = _span(low, high, ray.o, rcp)
                leaves = dr.minimum(leaves, distance)
                inside, is_leaf = enters <= leaves, node >= self._first_leaf
                leaf = dr.select(inside & is_leaf, node - self._first_leaf, leaf)
                backward = (octant >> mi.UInt32(low.w)) & 1
                onward = dr.gather(mi.UInt32, self._onward, octant * self._count + node)
                node = dr.select(inside & ~is_leaf, 2 * node + 1 + backward, onward)
            local, begins, there = self._inside(self.local_ray(ray, leaf, leaf != END), leaf, distance, leaf != END)
            near = first_hit(self.scene, local, there)
            there &= near.is_valid()
            distance = dr.select(there, begins + near.t, distance)
            uv = dr.select(there, near.prim_uv, uv)
            face = dr.select(there, near.prim_index, face)
            shape = dr.select(there, near.shape, shape)
            met = dr.select(there, leaf + 1, met)
            if dr.hint(any_hit, mode="scalar"):
                node = dr.select(there, END, node)
        result = mi.PreliminaryIntersection3f(found)
        there = met > 0
        result.valid = found.valid | there
        result.t = dr.select(there, distance, found.t)
        result.prim_uv, result.prim_index, result.shape, result.shape_index = uv, face, shape, met
        return result

    def _inside(
        self, local: mi.Ray3f, leaf: mi.UInt32, end: mi.Float, active: mi.Bool
    ) -> tuple[mi.Ray3f, mi.Float, mi.Bool]:
        """The parts of rays inside the boxes of their prototypes, where these begin, and which there are.

        Other prototypes lie beside these boxes, and numbers are finest there.
        """
        prototype = dr.gather(mi.UInt32, self._prototype, leaf, active)
        low = dr.gather(mi.Vector4f, self._corners, 2 * prototype, active)
        high = dr.gather(mi.Vector4f, self._corners, 2 * prototype + 1, active)
        enters, leaves = _span(low, high, local.o, dr.rcp(_without_zeros(local.d)))
        leaves = dr.minimum(leaves, end)
        part = mi.Ray3f(local)
        part.o = local(enters)
        part.maxt = leaves - enters
        return part, enters, active & (enters <= leaves)


@dataclass(frozen=True)
class WithInstances:
    """A scene and instances in it.

    Attributes:
        scene: all else.
        instances: what stands at many places.
    """

    scene: mi.Scene | Cell
    instances: Instances


@dataclass(frozen=True)
class Cell:
    """A scene that stands beside others in one, so that a kernel can trace them all.

    Rays are moved into its box and end there. What they meet is reported as the shape of the scene itself.

    Attributes:
        alone: the scene itself, which is not traced.
        whole: all scenes, side by side.
        offset: by which this one was moved.
        low: smallest coordinates of its box, where it stands now.
        high: the largest.
        originals: the shape that each shape of ``whole`` is a copy of; both by their index in Dr.Jit's registry.
    """

    alone: mi.Scene
    whole: mi.Scene
    offset: mi.Vector3f
    low: mi.Vector4f
    high: mi.Vector4f
    originals: mi.UInt32

    def bbox(self) -> mi.ScalarBoundingBox3f:
        """The box of the scene itself."""
        return self.alone.bbox()

    def first_hit(self, ray: mi.Ray3f, active: mi.Bool | bool, coherent: bool) -> mi.PreliminaryIntersection3f:
        """The first surface along rays; as for :func:`first_hit`."""
        part, begins, there = self._inside(ray, active)
        found = self.whole.ray_intersect_preliminary(part, coherent=coherent, active=there)
        met = there & found.is_valid()
        found.t = dr.select(met, begins + found.t, dr.inf)
        original = dr.gather(mi.UInt32, self.originals, dr.reinterpret_array(mi.UInt32, found.shape), met)
        found.shape = dr.reinterpret_array(mi.ShapePtr, original)
        return found

    def meets(self, ray: mi.Ray3f, active: mi.Bool) -> mi.Bool:
        """Which rays meet any surface before they end."""
        part, _, there = self._inside(ray, active)
        return there & self.whole.ray_test(part, coherent=False, active=there)

    def _inside(self, ray: mi.Ray3f, active: mi.Bool | bool) -> tuple[mi.Ray3f, mi.Float, mi.Bool]:
        """The parts of rays in the box, moved there, where these begin, and which there are."""
        origin = mi.Point3f(ray.o) + self.offset
        enters, leaves = _span(self.low, self.high, origin, dr.rcp(_without_zeros(ray.d)))
        leaves = dr.minimum(leaves, ray.maxt)
        part = mi.Ray3f(ray)
        part.o = origin + enters * ray.d
        part.maxt = leaves - enters
        return part, enters, mi.Bool(active) & (enters <= leaves)


def side_by_side(scenes: Sequence[mi.Scene], copies: Callable[[mi.Shape, NDArray[np.float64]], mi.Shape]) -> list[Cell]:
    """Scenes as cells of a single one, in the order given; the first stays where it is.

    Args:
        scenes: what is to be traced in one kernel.
        copies: makes a copy of a shape, moved by an offset, shape (3,), metres.
    """
    boxes = [scene.bbox() for scene in scenes]
    ends = [
        np.array([box.min, box.max], np.float64).reshape(2, 3) if box.valid() else np.zeros((2, 3)) for box in boxes
    ]
    margins = [MARGIN * (1.0 + np.abs(each).max()) for each in ends]
    axis = int(np.argmin(np.ptp(ends[0], axis=0)))
    offsets: list[NDArray[np.float64]] = []
    reached = ends[0][0, axis]
    for (low, high), margin in zip(ends, margins, strict=True):
        offset = np.zeros(3)
        if offsets:
            # Nearly touching boxes would do; the distance leaves room for rounding.
            offset[axis] = reached + 4.0 * margin - low[axis]
        offsets.append(offset)
        reached = high[axis] + offset[axis] + 4.0 * margin
    shapes, originals = [], {}
    for scene, offset in zip(scenes, offsets, strict=True):
        for shape in scene.shapes():
            moved = copies(shape, offset) if offset.any() else shape
            shapes.append(moved)
            originals[registered(mi.ShapePtr(moved))] = registered(mi.ShapePtr(shape))
    table = np.zeros(max(originals, default=0) + 1, np.uint32)
    table[list(originals)] = list(originals.values())
    whole = load({"type": "scene", **{f"shape_{index}": shape for index, shape in enumerate(shapes)}})
    cells = []
    for scene, (low, high), margin, offset in zip(scenes, ends, margins, offsets, strict=True):
        if not scene.shapes():
            low, high = np.ones(3), -np.ones(3)  # Which no ray meets.
        begin, end = (mi.Vector4f(*corner.tolist(), 0.0) for corner in (low + offset - margin, high + offset + margin))
        moved_by = mi.Vector3f(offset.tolist())
        dr.make_opaque(begin, end, moved_by)
        cells.append(Cell(scene, whole, moved_by, begin, end, mi.UInt32(aligned(table, np.uint32))))
    return cells


Traced = mi.Scene | WithInstances | Cell
"""What rays can meet."""


def first_hit(
    scene: Traced, ray: mi.Ray3f, active: mi.Bool | bool = True, coherent: bool = False
) -> mi.PreliminaryIntersection3f:
    """The first surface along rays.

    Args:
        scene: what is traced.
        ray: world, metres.
        active: which are traced; the others meet nothing.
        coherent: whether neighbouring rays run alike.
    """
    if isinstance(scene, WithInstances):
        found = first_hit(scene.scene, ray, active, coherent)
        return scene.instances.first_hit(ray, found, mi.Bool(active))
    if isinstance(scene, Cell):
        return scene.first_hit(ray, active, coherent)
    found = scene.ray_intersect_preliminary(ray, coherent=coherent, active=active)
    if ON_GPU:
        dr.eval(found)  # Beside those of another scene, they could not be in one kernel.
    return found


def interaction(
    scene: Traced, found: mi.PreliminaryIntersection3f, ray: mi.Ray3f, active: mi.Bool
) -> mi.SurfaceInteraction3f:
    """All that materials ask of surfaces that were found along rays.

    Args:
        scene: what was traced.
        found: by :func:`first_hit`.
        ray: which was traced.
        active: lanes to evaluate.
    """
    if not isinstance(scene, WithInstances):
        return found.compute_surface_interaction(ray, mi.RayFlags.All, active)
    there, number = active & (found.shape_index > 0), found.shape_index - 1
    local = scene.instances.local_ray(ray, number, there)
    si = found.compute_surface_interaction(local, mi.RayFlags.All, active)
    rows = scene.instances.rows_to_world(number, there)
    axes = [mi.Vector3f(row.x, row.y, row.z) for row in rows]
    cofactors = [dr.cross(axes[i - 2], axes[i - 1]) for i in range(3)]  # take normals along

    def turned(normal: mi.Normal3f) -> mi.Normal3f:
        along = mi.Normal3f(*[dr.dot(row, mi.Vector3f(normal)) for row in cofactors])
        return dr.select(there, dr.normalize(along), normal)

    si.p = dr.select(there, _point(rows, si.p), si.p)
    si.n, si.sh_frame.n = turned(si.n), turned(si.sh_frame.n)
    si.dp_du = dr.select(there, _vector(rows, si.dp_du), si.dp_du)
    si.dp_dv = dr.select(there, _vector(rows, si.dp_dv), si.dp_dv)
    si.initialize_sh_frame()
    si.wi = dr.select(there, si.to_local(-ray.d), si.wi)
    return si


def first_interaction(scene: Traced, ray: mi.Ray3f, active: mi.Bool) -> mi.SurfaceInteraction3f:
    """The first surface along rays with all that materials ask of it; as for :func:`first_hit`."""
    return interaction(scene, first_hit(scene, ray, active), ray, active)


def meets(scene: Traced, ray: mi.Ray3f, active: mi.Bool) -> mi.Bool:
    """Which rays meet any surface before they end; as for :func:`first_hit`."""
    if isinstance(scene, WithInstances):
        met = meets(scene.scene, ray, active)
        nothing = dr.zeros(mi.PreliminaryIntersection3f, dr.width(ray.o))
        return met | (scene.instances.first_hit(ray, nothing, active & ~met, any_hit=True).shape_index > 0)
    if isinstance(scene, Cell):
        return scene.meets(ray, active)
    met = scene.ray_test(ray, coherent=False, active=active)
    if ON_GPU:
        dr.eval(met)
    return met


def _boxes(prototype: Prototype) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Boxes around the instances of a prototype in the world, a little larger, each of shape (n, 3)."""
    ends = np.stack([prototype.low, prototype.high])
    corners = np.stack([ends[(index >> np.arange(3)) & 1, np.arange(3)] for index in range(8)])
    placed = np.einsum("nij,cj->nci", prototype.to_world[:, :3, :3], corners) + prototype.to_world[:, None, :3, 3]
    low, high = placed.min(axis=1), placed.max(axis=1)
    margin = MARGIN * ((high - low).max(axis=1) + 0.01 * np.abs(placed).max(axis=(1, 2)))[:, None]
    return low - margin, high + margin


def _span(low: mi.Vector4f, high: mi.Vector4f, origin: mi.Point3f, rcp: mi.Vector3f) -> tuple[mi.Float, mi.Float]:
    """Where rays enter boxes, 0 if they begin inside, and where they leave them, which is before for those that miss.

    Args:
        low: smallest coordinates.
        high: the largest; where they are smaller, no ray meets the box.
        origin: of the rays.
        rcp: one over their direction.
    """
    enters, leaves = mi.Float(0.0), mi.Float(dr.inf)
    for axis in range(3):
        backward = rcp[axis] < 0.0
        near, far = dr.select(backward, high[axis], low[axis]), dr.select(backward, low[axis], high[axis])
        enters = dr.maximum(enters, (near - origin[axis]) * rcp[axis])
        leaves = dr.minimum(leaves, (far - origin[axis]) * rcp[axis])
    return enters, leaves


def _rows(table: mi.Float, number: mi.UInt32, active: mi.Bool) -> list[mi.Vector4f]:
    return [dr.gather(mi.Vector4f, table, 3 * number + index, active) for index in range(3)]


def _point(rows: Sequence[mi.Vector4f], point: mi.Point3f) -> mi.Point3f:
    vector = _vector(rows, mi.Vector3f(point))
    return mi.Point3f(vector.x + rows[0].w, vector.y + rows[1].w, vector.z + rows[2].w)


def _vector(rows: Sequence[mi.Vector4f], vector: mi.Vector3f) -> mi.Vector3f:
    return mi.Vector3f(*[row.x * vector.x + row.y * vector.y + row.z * vector.z for row in rows])


def _without_zeros(direction: mi.Vector3f) -> mi.Vector3f:
    tiny = dr.abs(direction) < SMALLEST_COMPONENT
    return dr.select(tiny, dr.mulsign(mi.Vector3f(SMALLEST_COMPONENT), direction), direction)

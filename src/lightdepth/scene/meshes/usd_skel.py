"""Skeletons and blend shapes of USD: where the points of a mesh are at a time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdSkel, Vt

from lightdepth.errors import InputError
from lightdepth.scene.meshes.part import Note
from lightdepth.scene.meshes.usd_file import UsdFile


@dataclass(frozen=True)
class Pose:
    """What a skeleton does to a mesh.

    Attributes:
        space: the prim in whose space the points are then.
        query: of the mesh, for its influences and blend shapes.
        joints: of the mesh, from its bind pose to the skeleton's space, shape (k, 4, 4), for column vectors; ``None`` where
            no joint moves it.
        weights: of the mesh's blend shapes; ``None`` where it has none.
    """

    space: Usd.Prim
    query: UsdSkel.SkinningQuery
    joints: NDArray[np.float64] | None
    weights: Vt.FloatArray | None


class UsdPoses:
    """The poses of all skinned meshes of a file at a time.

    Args:
        file: the file.
        time: the time.
        note: called with what is taken otherwise.
    """

    def __init__(self, file: UsdFile, time: Usd.TimeCode, note: Note) -> None:
        self._file, self._time, self._note = file, time, note
        self._cache = UsdSkel.Cache()
        self._found: dict[str, tuple[UsdSkel.SkeletonQuery, UsdSkel.SkinningQuery]] = {}
        proxies = Usd.TraverseInstanceProxies()
        for prim in Usd.PrimRange(file.stage.GetPseudoRoot(), proxies):
            if not prim.IsA(UsdSkel.Root):
                continue
            root = UsdSkel.Root(prim)
            self._cache.Populate(root, proxies)
            for binding in self._cache.ComputeSkelBindings(root, proxies):
                skeleton = self._cache.GetSkelQuery(binding.GetSkeleton())
                for query in binding.GetSkinningTargets():
                    self._found[str(query.GetPrim().GetPath())] = skeleton, query

    def of(self, prim: Usd.Prim) -> Pose | None:
        """The pose of a mesh, or ``None`` where no skeleton moves it."""
        found = self._found.get(str(prim.GetPath()))
        if found is None:
            return None
        skeleton, query = found
        weights, animation = None, skeleton.GetAnimQuery() if skeleton else None
        if query.HasBlendShapes() and animation:
            weights = animation.ComputeBlendShapeWeights(self._time)
            if mapper := query.GetBlendShapeMapper():
                weights = mapper.Remap(weights)
        if not skeleton or not query.HasJointInfluences():
            return None if weights is None else Pose(prim, query, None, weights)
        matrices = skeleton.ComputeSkinningTransforms(self._time)
        if matrices is None:
            raise InputError(
                f"{self._file.path}: {skeleton.GetPrim().GetPath()}: the skeleton has no bind or rest pose"
            )
        if mapper := query.GetJointMapper():
            matrices = mapper.RemapTransforms(matrices)
        joints = np.array(matrices, np.float64).reshape(-1, 4, 4).transpose(0, 2, 1)
        if query.GetSkinningMethod() == UsdSkel.Tokens.dualQuaternion:
            self._note(f"{prim.GetPath()} is skinned by dual quaternions; its joints are blended linearly")
        bind = np.array(query.GetGeomBindTransform(self._time), np.float64).T
        return Pose(skeleton.GetPrim(), query, joints @ bind, weights)


def shaped(pose: Pose, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points moved by the blend shapes of their mesh, shape (n, 3)."""
    if pose.weights is None:
        return points
    shapes = UsdSkel.BlendShapeQuery(UsdSkel.BindingAPI(pose.query.GetPrim()))
    offsets, indices = shapes.ComputeSubShapePointOffsets(), shapes.ComputeBlendShapePointIndices()
    moved = points.copy()
    for weight, shape, sub in zip(*shapes.ComputeSubShapeWeights(pose.weights), strict=True):
        some = np.array(indices[shape], np.int64)
        way = weight * np.array(offsets[sub], np.float64).reshape(-1, 3)
        if len(some):
            if some.min() < 0 or some.max() >= len(points) or len(some) != len(way):
                raise ValueError("the points of a blend shape are not those of its mesh")
            np.add.at(moved, some, way)
        else:
            if len(way) != len(points):
                raise ValueError(f"a blend shape has {len(way)} offsets, but the mesh has {len(points)} points")
            moved += way
    return moved


def blended(pose: Pose, count: int, time: Usd.TimeCode) -> NDArray[np.float64] | None:
    """The matrix of each point by its joints, shape (n, 3, 4); ``None`` where no joint moves them.

    Raises:
        ValueError: influences do not fit the mesh or the skeleton.
    """
    if pose.joints is None:
        return None
    found = pose.query.ComputeVaryingJointInfluences(count, time)
    if found is None:
        raise ValueError("its joint influences do not fit its points")
    indices = np.array(found[0], np.int64).reshape(count, -1)
    weights = np.array(found[1], np.float64).reshape(count, -1)
    used = indices[weights != 0.0]
    if len(used) and (used.min() < 0 or used.max() >= len(pose.joints)):
        raise ValueError(f"it refers to joint {used.max()} of a skeleton that gives it {len(pose.joints)}")
    total = weights.sum(axis=1)
    if (bare := ~(np.abs(total) > 1e-6)).any():
        raise ValueError(f"{bare.sum()} points have no weight at any joint")
    safe = np.where(weights != 0.0, indices, 0)
    matrices = np.einsum("nk,nkij->nij", weights / total[:, None], pose.joints[safe][:, :, :3])
    return np.asarray(matrices, np.float64)

"""What a USD file shows: its meshes in their places, with their materials."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom, UsdLux

from lightdepth.errors import InputError
from lightdepth.scene.meshes.geometry import transformed
from lightdepth.scene.meshes.part import MeshPart, Note
from lightdepth.scene.meshes.usd_file import UsdFile
from lightdepth.scene.meshes.usd_material import UsdMaterials
from lightdepth.scene.meshes.usd_mesh import UsdMesh
from lightdepth.scene.meshes.usd_skel import UsdPoses

LINES = frozenset({"Points", "BasisCurves", "HermiteCurves", "NurbsCurves", "Volume"})
"""Geometry without a surface, which is left out."""
HIDDEN = (UsdGeom.Tokens.guide, UsdGeom.Tokens.proxy)
"""Purposes of what final pictures do not show."""
MOST_INSTANCES = 1 << 20


class UsdReader:
    """Reads one file, at one time after the other; images are read once.

    Args:
        path: the file.
        with_materials: read the materials, too.
        note: called with what is left out or taken otherwise.

    Raises:
        InputError: the file, or a layer that it names, cannot be read.
    """

    def __init__(self, path: Path, with_materials: bool, note: Note) -> None:
        self._file, self._note = UsdFile(path, note), note
        self._materials = UsdMaterials(self._file, note) if with_materials else None

    def parts(self, animation: str | None = None, time: float = 0.0, loop: bool = False) -> list[MeshPart]:
        """All that is shown, turned to z up and metres.

        Args:
            animation: ``timeline``, or ``None`` for the first time code.
            time: in it, seconds.
            loop: begin it again where it ends.

        Raises:
            InputError: the file is broken, has surfaces other than meshes, or has no such animation.
        """
        with self._file.reporting():
            return list(
                _Moment(self._file, self._materials, self._note, self._file.time(animation, time, loop)).parts()
            )


class _Moment:
    """A file at one time."""

    def __init__(self, file: UsdFile, materials: UsdMaterials | None, note: Note, time: Usd.TimeCode) -> None:
        self._file, self._materials, self._note, self._time = file, materials, note, time
        self._places = UsdGeom.XformCache(time)
        self._poses = UsdPoses(file, time, note)

    def parts(self) -> Iterator[MeshPart]:
        for part in self._below(self._file.stage.GetPseudoRoot()):
            yield replace(part, mesh=transformed(part.mesh, self._file.to_scene))

    def _below(self, root: Usd.Prim, within_instancer: bool = False) -> Iterator[MeshPart]:
        """Parts of a prim and of all below it, in the stage's space."""
        wanted = Usd.PrimIsActive & Usd.PrimIsLoaded if within_instancer else Usd.PrimDefaultPredicate
        prims = iter(Usd.PrimRange(root, Usd.TraverseInstanceProxies(wanted)))  # Prototypes may be classes.
        for prim in prims:
            imageable = UsdGeom.Imageable(prim)
            if not imageable:
                continue
            if not self._is_shown(imageable):
                prims.PruneChildren()
                continue
            if prim.HasAPI(UsdLux.LightAPI):  # A mesh, too, may be a light.
                self._note(f"its lights are left out, the first is {prim.GetPath()}")
            if prim.IsA(UsdGeom.PointInstancer):
                prims.PruneChildren()
                if within_instancer:
                    raise InputError(
                        f"{self._file.path}: {prim.GetPath()}: instancers within instancers are not supported"
                    )
                yield from self._instances(UsdGeom.PointInstancer(prim))
            elif prim.IsA(UsdGeom.Mesh):
                yield from self._mesh(prim)
            elif prim.IsA(UsdGeom.Gprim):
                kind = prim.GetTypeName()
                if kind not in LINES:
                    raise InputError(
                        f"{self._file.path}: {prim.GetPath()} is a {kind}; only meshes are read, make one of it"
                    )
                self._note(f"points, curves and volumes are left out, the first is {prim.GetPath()}")

    def _is_shown(self, prim: UsdGeom.Imageable) -> bool:
        """Whether a prim whose parent is shown is shown, too."""
        if prim.GetVisibilityAttr().Get(self._time) == UsdGeom.Tokens.invisible:
            return False
        return prim.GetPurposeAttr().Get() not in HIDDEN

    def _mesh(self, prim: Usd.Prim) -> Iterator[MeshPart]:
        pose = self._poses.of(prim)
        mesh = UsdMesh(self._file, prim, self._time, self._note, pose)
        world = _matrix(self._places.GetLocalToWorldTransform(prim if pose is None else pose.space))
        materials = self._materials
        if materials is None:
            shape = transformed(mesh.mesh(None, mesh.default_uv()), world)
            if len(shape.faces):
                yield MeshPart(shape)
            return
        for material, faces in mesh.materials():
            uv = materials.uv_set(material) or mesh.default_uv()
            colours = materials.colour_set(material)
            shape = transformed(mesh.mesh(faces, uv, colours), world)
            if not len(shape.faces):
                continue
            name = None if material is None else material.GetPrim().GetName()
            yield MeshPart(shape, materials.principled(material, shape, self._time), name)

    def _instances(self, instancer: UsdGeom.PointInstancer) -> Iterator[MeshPart]:
        """Each prototype wherever it is."""
        path = instancer.GetPath()
        world = _matrix(self._places.GetLocalToWorldTransform(instancer.GetPrim()))
        matrices = instancer.ComputeInstanceTransformsAtTime(
            self._time, self._time, UsdGeom.PointInstancer.IncludeProtoXform, UsdGeom.PointInstancer.ApplyMask
        )
        which = np.array(instancer.GetProtoIndicesAttr().Get(self._time) or [], np.int64)
        if mask := instancer.ComputeMaskAtTime(self._time):
            which = which[np.array(mask, bool)]
        prototypes = instancer.GetPrototypesRel().GetForwardedTargets()
        if len(which) != len(matrices) or (len(which) and not 0 <= which.min() <= which.max() < len(prototypes)):
            raise InputError(f"{self._file.path}: {path}: its protoIndices do not fit its positions and prototypes")
        if len(which) > MOST_INSTANCES:
            raise InputError(f"{self._file.path}: {path}: has {len(which)} instances, too many")
        for number, target in enumerate(prototypes):
            prototype = self._file.stage.GetPrimAtPath(target)
            if not prototype or not (which == number).any():
                continue
            away = np.linalg.inv(_matrix(self._places.GetLocalToWorldTransform(prototype)))
            parts = list(self._below(prototype, within_instancer=True))
            for one in np.flatnonzero(which == number):
                place = world @ _matrix(matrices[int(one)]) @ away
                yield from (replace(part, mesh=transformed(part.mesh, place)) for part in parts)


def _matrix(matrix: object) -> NDArray[np.float64]:
    """A matrix of USD, which multiplies rows, as one that multiplies columns."""
    return np.array(matrix, np.float64).T

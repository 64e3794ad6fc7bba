"""Mesh prims of USD: polygons with what lies on their points, corners and faces."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom, UsdShade

from lightdepth.errors import InputError
from lightdepth.scene.meshes.geometry import bent, unit
from lightdepth.scene.meshes.part import Note
from lightdepth.scene.meshes.polygons import triangulated
from lightdepth.scene.meshes.rows import unique_rows
from lightdepth.scene.meshes.usd_file import UsdFile
from lightdepth.scene.meshes.usd_skel import Pose, blended, shaped
from lightdepth.scene.model import Mesh

COLOURS = "displayColor"
DEFAULT_UV = "st"
_TOKENS = UsdGeom.Tokens


class UsdMesh:
    """A mesh prim at a time.

    Args:
        file: the file.
        prim: the prim.
        time: the time.
        note: called with what is left out.
        pose: what a skeleton does to it; its points are then in the space of ``pose.space``.

    Raises:
        InputError: the mesh is broken.
    """

    def __init__(self, file: UsdFile, prim: Usd.Prim, time: Usd.TimeCode, note: Note, pose: Pose | None) -> None:
        self._file, self._prim, self._time, self._note = file, prim, time, note
        mesh = UsdGeom.Mesh(prim)
        points = self._triples(mesh.GetPointsAttr())
        sizes = self._integers(mesh.GetFaceVertexCountsAttr())
        indices = self._integers(mesh.GetFaceVertexIndicesAttr())
        if sizes.sum() != len(indices) or (sizes < 0).any():
            self._fail(f"its faceVertexCounts add up to {sizes.sum()}, but there are {len(indices)} faceVertexIndices")
        if len(indices) and not 0 <= indices.min() <= indices.max() < len(points):
            self._fail(f"a face names point {indices.max()}, but there are {len(points)} points")
        self._points_of_corners, self._sizes = indices, sizes
        self._matrices: NDArray[np.float64] | None = None
        if pose is not None:
            try:
                points = shaped(pose, points)
                self._matrices = blended(pose, len(points), time)
            except ValueError as error:
                self._fail(str(error))
        self._rest = points
        self._points = points if self._matrices is None else bent(self._matrices, points, None)[0]
        self._triangles, self._owners = self._triangulated(mesh)
        self._normals = self._corner_normals(mesh)

    def default_uv(self) -> str | None:
        """The texture coordinates that are used where no material says which."""
        primvars = UsdGeom.PrimvarsAPI(self._prim)
        if primvars.FindPrimvarWithInheritance(DEFAULT_UV).HasValue():
            return DEFAULT_UV
        flat = (
            Sdf.ValueTypeNames.TexCoord2fArray,
            Sdf.ValueTypeNames.TexCoord2hArray,
            Sdf.ValueTypeNames.TexCoord2dArray,
        )
        found = [each for each in primvars.FindPrimvarsWithInheritance() if each.GetTypeName() in flat]
        return str(found[0].GetPrimvarName()) if found else None

    def materials(self) -> Iterator[tuple[UsdShade.Material | None, NDArray[np.bool_]]]:
        """The materials in use, and the faces of each, shape (number of faces,)."""
        left = np.ones(len(self._sizes), np.bool_)
        for subset in UsdShade.MaterialBindingAPI(self._prim).GetMaterialBindSubsets():
            faces = self._integers(subset.GetIndicesAttr())
            if len(faces) and not 0 <= faces.min() <= faces.max() < len(left):
                self._fail(f"its subset {subset.GetPrim().GetName()} names face {faces.max()} of {len(left)}")
            mine = np.zeros(len(left), np.bool_)
            mine[faces] = True
            mine &= left
            left &= ~mine
            if mine.any():
                yield _bound(subset.GetPrim()), mine
        if left.any():
            yield _bound(self._prim), left

    def mesh(self, faces: NDArray[np.bool_] | None, uv: str | None, colours: str | None = None) -> Mesh:
        """Triangles of some faces.

        Args:
            faces: which, shape (number of faces,); ``None`` for all.
            uv: name of the primvar with the texture coordinates.
            colours: name of the primvar with the colours.
        """
        triangles = self._triangles if faces is None else self._triangles[faces[self._owners]]
        used, of_used = np.unique(triangles, return_inverse=True)
        tables = {
            "normals": self._normals,
            "texture_coordinates": self._of_corners(uv, 2),
            "colors": self._of_corners(colours, 3),
        }
        columns = [self._points_of_corners[used]]
        for values in tables.values():
            if values is not None:
                columns.append(unique_rows(values[used])[1])
        first, of_row = unique_rows(np.stack(columns, axis=1))
        corners = used[first]
        found = {name: None if v is None else v[corners].astype(np.float32) for name, v in tables.items()}
        return Mesh(
            vertices=self._points[self._points_of_corners[corners]],
            faces=of_row[of_used.reshape(-1)].reshape(-1, 3).astype(np.int32),
            **found,
        )

    def _triangulated(self, mesh: UsdGeom.Mesh) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Corners of triangles, shape (m, 3), and the face of each."""
        starts = np.cumsum(self._sizes) - self._sizes
        kept = self._sizes >= 3
        holes = self._integers(mesh.GetHoleIndicesAttr())
        kept[holes[(holes >= 0) & (holes < len(kept))]] = False
        if (self._sizes < 3).any():
            self._note(f"{self._prim.GetPath()}: faces of fewer than three corners are left out")
        which = np.flatnonzero(kept)
        corners = np.concatenate(
            [starts[face] + np.arange(self._sizes[face]) for face in which] or [np.zeros(0, np.int64)]
        )
        found = triangulated(self._points[self._points_of_corners[corners]], self._sizes[which])
        if len(found.crossing):
            self._note(f"{self._prim.GetPath()}: {len(found.crossing)} faces have outlines that cross themselves")
        triangles = corners[found.corners]
        if mesh.GetOrientationAttr().Get(self._time) == _TOKENS.leftHanded:
            triangles = triangles[:, ::-1]
        return triangles, which[found.polygon]

    def _corner_normals(self, mesh: UsdGeom.Mesh) -> NDArray[np.float64] | None:
        """Normals at all corners, shape (n, 3); ``None`` for flat faces."""
        if mesh.GetSubdivisionSchemeAttr().Get(self._time) not in (_TOKENS.none, _TOKENS.bilinear):
            if len(self._sizes):
                self._note(
                    f"{self._prim.GetPath()} is a subdivision surface; its control mesh is shown, smoothly shaded"
                )
            return self._smooth()
        primvar = UsdGeom.PrimvarsAPI(self._prim).GetPrimvar("normals")
        if primvar and primvar.HasValue():
            normals = self._of_corners("normals", 3)
        else:
            values = self._triples(mesh.GetNormalsAttr())
            normals = self._spread(values, mesh.GetNormalsInterpolation(), "normals") if len(values) else None
        if normals is None or self._matrices is None:
            return normals
        at = self._points_of_corners
        return bent(self._matrices[at], self._rest[at], normals)[1]

    def _smooth(self) -> NDArray[np.float64]:
        """Means of the faces around each point, at the corners."""
        around = np.zeros_like(self._points)
        a, b, c = (self._points[self._points_of_corners[self._triangles[:, corner]]] for corner in range(3))
        for corner in range(3):
            np.add.at(around, self._points_of_corners[self._triangles[:, corner]], np.cross(b - a, c - a))
        return unit(around).astype(np.float64)[self._points_of_corners]

    def _of_corners(self, name: str | None, width: int) -> NDArray[np.float64] | None:
        """A primvar at all corners, shape (n, width); ``None`` where the mesh does not have it."""
        if name is None:
            return None
        primvar = UsdGeom.PrimvarsAPI(self._prim).FindPrimvarWithInheritance(name)
        values = primvar.ComputeFlattened(self._time) if primvar and primvar.HasValue() else None
        if values is None:
            return None
        numbers = np.array(values, np.float64)
        if numbers.ndim == 1 and numbers.size == width:  # One value that is no array.
            numbers = numbers[None]
        if numbers.ndim != 2 or numbers.shape[1] < width:
            self._fail(f"primvars:{name} must have {width} numbers in a value")
        return self._spread(numbers[:, :width], primvar.GetInterpolation(), f"primvars:{name}")

    def _spread(self, values: NDArray[np.float64], interpolation: str, name: str) -> NDArray[np.float64]:
        """Values as they are interpolated, at all corners."""
        corners = len(self._points_of_corners)
        index, needed = {
            _TOKENS.constant: (np.zeros(corners, np.int64), 1),
            _TOKENS.uniform: (np.repeat(np.arange(len(self._sizes)), self._sizes), len(self._sizes)),
            _TOKENS.faceVarying: (np.arange(corners), corners),
        }.get(interpolation, (self._points_of_corners, len(self._points)))
        if len(values) < needed:
            self._fail(f"{name} has {len(values)} values, but its interpolation, {interpolation}, needs {needed}")
        return np.asarray(values[index])

    def _integers(self, attribute: Usd.Attribute) -> NDArray[np.int64]:
        value = attribute.Get(self._time)
        return np.zeros(0, np.int64) if value is None else np.array(value, np.int64)

    def _triples(self, attribute: Usd.Attribute) -> NDArray[np.float64]:
        value = attribute.Get(self._time)
        return np.zeros((0, 3)) if value is None else np.array(value, np.float64).reshape(-1, 3)

    def _fail(self, what: str) -> NoReturn:
        raise InputError(f"{self._file.path}: {self._prim.GetPath()}: {what}")


def _bound(prim: Usd.Prim) -> UsdShade.Material | None:
    material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial(UsdShade.Tokens.preview)
    return material or None

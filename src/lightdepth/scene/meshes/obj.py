"""Wavefront OBJ: polygons of any kind with the materials of its .mtl files."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError
from lightdepth.scene.materials import Principled, VertexColors
from lightdepth.scene.materials.texture import decoded_srgb
from lightdepth.scene.meshes.geometry import unit
from lightdepth.scene.meshes.mtl import MtlLibrary
from lightdepth.scene.meshes.part import MeshPart, Note
from lightdepth.scene.meshes.polygons import triangulated
from lightdepth.scene.meshes.rows import unique_rows
from lightdepth.scene.meshes.text_file import decoded, logical_lines, named_file
from lightdepth.scene.model import Mesh

_WITHOUT_EFFECT = frozenset({"g", "o", "mg", "lod", "bevel", "c_interp", "d_interp", "shadow_obj", "trace_obj"})
_FREE_FORM = frozenset({"curv", "curv2", "surf", "call", "csh"})
"""Geometry that is not polygons, or that is elsewhere."""
_OF_FREE_FORM = frozenset(
    {"vp", "cstype", "deg", "bmat", "step", "parm", "trim", "hole", "scrv", "sp", "end", "con", "stech", "ctech"}
)
_NO_GROUP = ("off", "0", "")


def read_obj(path: Path, with_materials: bool, note: Note) -> list[MeshPart]:
    """Read an OBJ file: one part for each material, split where faces have and lack texture coordinates or normals.

    Faces of a smoothing group that have no normals are smooth. Colours of vertices are sRGB and multiply the material.

    Raises:
        InputError: the file is broken, has geometry other than polygons, or names a material file that is not there.
    """
    content = _Content(path, note)
    text = decoded(path.read_bytes())
    content.read(text)
    if "\n#MRGB" in text:
        note("colours that ZBrush wrote as comments (#MRGB) are left out")
    library = MtlLibrary(note)
    if with_materials:
        for name in content.libraries:
            _add_libraries(library, path, name)
        if library.materials and None in content.materials:
            note("faces before any 'usemtl' have no material of the file and get the default one")
    return content.parts(library if with_materials else None)


def _add_libraries(library: MtlLibrary, path: Path, names: str) -> None:
    """Read what one ``mtllib`` line names: a file, whose name may have spaces, or several files."""
    whole = named_file(path.parent, names)
    for name in [names] if whole is not None else names.split():
        found = named_file(path.parent, name)
        if found is None:
            raise InputError(f"{path}: its material file {path.parent / name} does not exist")
        library.add(found)


@dataclass
class _Content:
    """The statements of a file.

    Attributes:
        corners: what each corner of a face joins, rows of vertex, texture coordinates, normal (-1 where it has none)
            and smoothing group.
        faces: the corners of all faces, one after the other.
        sizes: how many corners each face has.
        face_lines: the line that each face stands on.
        face_materials: its material's number in ``materials``.
        materials: numbers of the materials in use by their names; ``None`` before the first ``usemtl``.
        libraries: what stands behind each ``mtllib``.
    """

    path: Path
    note: Note
    vertices: list[list[str]] = field(default_factory=list)
    texture_coordinates: list[list[str]] = field(default_factory=list)
    normals: list[list[str]] = field(default_factory=list)
    lines: dict[str, list[int]] = field(default_factory=lambda: defaultdict(list))
    corners: list[tuple[int, int, int, int]] = field(default_factory=list)
    faces: list[int] = field(default_factory=list)
    sizes: list[int] = field(default_factory=list)
    face_lines: list[int] = field(default_factory=list)
    face_materials: list[int] = field(default_factory=list)
    materials: dict[str | None, int] = field(default_factory=dict)
    libraries: list[str] = field(default_factory=list)

    def read(self, text: str) -> None:
        """Take all lines of a file."""
        rows = {"v": self.vertices, "vt": self.texture_coordinates, "vn": self.normals}
        material: str | None = None
        smoothing: dict[str, int] = {}
        group = 0
        # A corner that is written alike in the same smoothing group is the same corner.
        known: dict[int, dict[str, int]] = defaultdict(dict)
        for number, line in enumerate(logical_lines(text), start=1):
            words = line.split()
            if not words or words[0].startswith("#"):
                continue
            key, values = words[0], words[1:]
            if "#" in line and key not in ("usemtl", "mtllib", "g", "o"):
                values = line.split("#")[0].split()[1:]
            if key in ("f", "fo"):
                if len(values) < 3:
                    self.note(f"faces of fewer than three corners are left out, the first is on line {number}")
                    continue
                corners = known[group]
                try:
                    self.faces += [corners[word] for word in values]
                except KeyError:
                    self.faces += self._new_corners(values, number, group, corners)
                self.sizes.append(len(values))
                self.face_lines.append(number)
                self.face_materials.append(self.materials.setdefault(material, len(self.materials)))
            elif key in rows:
                rows[key].append(values)
                self.lines[key].append(number)
            elif key == "usemtl":
                material = line.split(None, 1)[1].strip() if values else None
            elif key == "mtllib":
                if values:
                    self.libraries.append(line.split(None, 1)[1].strip())
            elif key == "s":
                name = values[0] if values else ""
                group = 0 if name in _NO_GROUP else smoothing.setdefault(name, len(smoothing) + 1)
            else:
                self._other(key, number)

    def _other(self, key: str, number: int) -> None:
        """A statement without polygons."""
        if key in _FREE_FORM:
            raise InputError(
                f"{self.path}: line {number}: '{key}' is geometry other than polygons, which is not supported; "
                "export the file as polygons"
            )
        if key in ("p", "l"):
            self.note("points and lines are left out")
        elif key not in _WITHOUT_EFFECT and key not in _OF_FREE_FORM:
            self.note(f"statements '{key[:20]}' are not known and are left out, the first is on line {number}")

    def _new_corners(self, words: list[str], number: int, group: int, known: dict[str, int]) -> list[int]:
        """The corners of a face of which some are not known yet."""
        found = []
        for word in words:
            corner = known.get(word)
            if corner is None:
                corner = len(self.corners)
                self.corners.append((*self._corner(word, number), group))
                if "-" not in word:  # Relative ones mean others further down.
                    known[word] = corner
            found.append(corner)
        return found

    def _corner(self, word: str, number: int) -> tuple[int, int, int]:
        """Positions in the lists of vertices, texture coordinates and normals, -1 for none."""
        counts = (len(self.vertices), len(self.texture_coordinates), len(self.normals))
        pieces = word.split("/")
        found = [-1, -1, -1]
        if len(pieces) > 3 or not pieces[0]:
            raise InputError(f"{self.path}: line {number}: {word[:40]!r} is not a corner of a face")
        for which, piece in enumerate(pieces):
            if not piece:
                continue
            try:
                index = int(piece)
            except ValueError:
                raise InputError(f"{self.path}: line {number}: {word[:40]!r} is not a corner of a face") from None
            index = index - 1 if index > 0 else counts[which] + index
            if not 0 <= index < 2**31 or piece.lstrip("+-").strip("0") == "":
                what = ("vertex", "texture coordinate", "normal")[which]
                raise InputError(f"{self.path}: line {number}: there is no {what} {piece[:20]}")
            found[which] = index
        return found[0], found[1], found[2]

    def parts(self, library: MtlLibrary | None) -> list[MeshPart]:
        """The faces as triangles, by material; without a library, the parts have none."""
        if not self.sizes:
            return []
        vertices, colors = self._positions()
        texture_coordinates = self._numbers("vt", self.texture_coordinates, 2, pad=True)
        normals = self._numbers("vn", self.normals, 3)
        corners = np.array(self.corners, np.int64).reshape(-1, 4)
        self._check(corners, (len(vertices), len(texture_coordinates), len(normals)))
        faces, sizes = np.array(self.faces, np.int64), np.array(self.sizes, np.int64)
        found = triangulated(vertices[corners[faces, 0]], sizes)
        if len(found.crossing):
            line = self.face_lines[found.crossing[0]]
            self.note(f"{len(found.crossing)} faces cross themselves, the first is on line {line}; check their shape")
        triangles = faces[found.corners]
        attributes = _Attributes(vertices, texture_coordinates, normals, colors, corners)
        has_uv = (corners[triangles, 1] >= 0).all(axis=1)
        has_normals = ((corners[triangles, 2] >= 0) | (corners[triangles, 3] > 0)).all(axis=1)
        attributes.add_smooth_normals(triangles)
        names = list(self.materials)
        kind = np.array(self.face_materials, np.int64)[found.polygon] * 4 + has_uv * 2 + has_normals
        parts = []
        for value in np.unique(kind):
            mesh = attributes.mesh(triangles[kind == value], bool(value & 2), bool(value & 1))
            name = None if library is None else names[value // 4]
            material = None if library is None else library.material(name, bool(value & 2))
            parts.append(replace(_with_colours(mesh, material, library is not None), material_name=name))
        return parts

    def _positions(self) -> tuple[NDArray[np.float64], NDArray[np.float32] | None]:
        """Vertices, and their linear colours where they have some.

        A line has three numbers, which a weight may follow, or a colour.
        """
        most = max(map(len, self.vertices), default=3)
        plain = self._numbers("v", self.vertices, 3)
        if most < 6 or any(len(row) < 6 for row in self.vertices):
            if any(len(row) >= 6 for row in self.vertices):
                self.note("only some vertices have colours; these are left out")
            return plain, None
        codes = self._numbers("v", [row[3:6] for row in self.vertices], 3)
        if codes.size and codes.max() > 1.0:
            self.note("colours of vertices go beyond 1 and are taken as codes from 0 to 255")
            codes = codes / 255.0
        return plain, decoded_srgb(np.clip(codes, 0.0, 1.0)).astype(np.float32)

    def _numbers(self, key: str, rows: list[list[str]], width: int, pad: bool = False) -> NDArray[np.float64]:
        """The first numbers of each row, shape (n, width); short rows may be filled up with zeros."""
        if pad:
            rows = [row if len(row) >= width else [*row, *["0"] * (width - len(row))] for row in rows]
        try:
            found = np.array([float(word) for row in rows for word in row[:width]], np.float64)
        except ValueError:
            found = np.zeros(0)
        if len(found) == width * len(rows):
            return found.reshape(-1, width)
        for number, row in zip(self.lines[key], rows, strict=True):
            if len(row) < width or not all(_is_number(word) for word in row[:width]):
                line = " ".join(row)[:60]
                raise InputError(f"{self.path}: line {number}: '{key}' needs {width} numbers, found '{line}'")
        raise InputError(f"{self.path}: its '{key}' lines are not numbers")

    def _check(self, corners: NDArray[np.int64], counts: tuple[int, int, int]) -> None:
        """Refuse faces that name what the file does not have."""
        for which, (what, count) in enumerate(zip(("vertices", "texture coordinates", "normals"), counts, strict=True)):
            beyond = corners[:, which] >= count
            if beyond.any():
                corner = int(beyond.argmax())
                face = int(np.searchsorted(np.cumsum(self.sizes), self.faces.index(corner), side="right"))
                raise InputError(
                    f"{self.path}: line {self.face_lines[face]}: the face refers to number {corners[corner, which] + 1} "
                    f"of the {what}, but there are {count}"
                )


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _with_colours(mesh: Mesh, material: Principled | None, wanted: bool) -> MeshPart:
    """A part whose colours of vertices multiply the material's."""
    if not wanted or mesh.colors is None:
        return MeshPart(Mesh(mesh.vertices, mesh.faces, mesh.normals, mesh.texture_coordinates), material)
    if material is None:
        return MeshPart(mesh, Principled(base_color=VertexColors()))
    colors, base = mesh.colors, material.base_color
    if isinstance(base, tuple):
        colors, base = (colors * np.array(base)).astype(np.float32), VertexColors()
    elif not isinstance(base, VertexColors):
        base = VertexColors(base)
    coloured = Mesh(mesh.vertices, mesh.faces, mesh.normals, mesh.texture_coordinates, colors)
    return MeshPart(coloured, material.model_copy(update={"base_color": base}))


@dataclass
class _Attributes:
    """What corners point to."""

    vertices: NDArray[np.float64]
    texture_coordinates: NDArray[np.float64]
    normals: NDArray[np.float64]
    colors: NDArray[np.float32] | None
    corners: NDArray[np.int64]

    def add_smooth_normals(self, triangles: NDArray[np.int64]) -> None:
        """Give corners of smoothing groups that have no normal the mean of their group's faces around the vertex."""
        lacking = (self.corners[:, 2] < 0) & (self.corners[:, 3] > 0)
        if not lacking.any():
            return
        used = triangles[lacking[triangles].any(axis=1)]
        points = self.vertices[self.corners[used, 0]]
        normals = unit(np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]))
        first, place = unique_rows(self.corners[lacking][:, [0, 3]])
        of_corner = np.full(len(self.corners), -1, np.int64)
        of_corner[lacking] = place
        sums = np.zeros((len(first), 3))
        for i in range(3):
            concerned = lacking[used[:, i]]
            # Weighted by the angle there, so that it does not matter how polygons were cut into triangles.
            ahead, back = unit(points[:, i - 2] - points[:, i]), unit(points[:, i - 1] - points[:, i])
            angles = np.arccos(np.clip(np.sum(ahead * back, axis=1), -1.0, 1.0))
            np.add.at(sums, of_corner[used[concerned, i]], (normals * angles[:, None])[concerned])
        self.corners = self.corners.copy()
        self.corners[lacking, 2] = len(self.normals) + of_corner[lacking]
        self.normals = np.concatenate([self.normals, sums])

    def mesh(self, triangles: NDArray[np.int64], with_uv: bool, with_normals: bool) -> Mesh:
        """Triangles of corners as a mesh, its vertices in the order of the file's."""
        used, of_used = np.unique(triangles, return_inverse=True)
        rows = self.corners[used, :3]
        first, of_row = unique_rows(rows[:, [0, *([1] if with_uv else []), *([2] if with_normals else [])]])
        unique, index = rows[first], of_row[of_used.reshape(-1)]
        uv = self.texture_coordinates[unique[:, 1]].astype(np.float32) if with_uv else None
        return Mesh(
            vertices=self.vertices[unique[:, 0]],
            faces=index.reshape(-1, 3).astype(np.int32),
            normals=unit(self.normals[unique[:, 2]]) if with_normals else None,
            texture_coordinates=uv,
            colors=None if self.colors is None else self.colors[unique[:, 0]],
        )

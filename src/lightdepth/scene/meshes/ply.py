"""Stanford PLY: polygons and strips with normals, texture coordinates, colours, textures and rest positions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError
from lightdepth.scene.materials import Principled, Texture, VertexColors
from lightdepth.scene.materials.image import Content, read_texture
from lightdepth.scene.materials.texture import decoded_srgb
from lightdepth.scene.meshes.part import MeshPart, Note
from lightdepth.scene.meshes.ply_file import Element, Lists, PlyFile, read_ply_file
from lightdepth.scene.meshes.polygons import triangulated
from lightdepth.scene.meshes.rows import unique_rows
from lightdepth.scene.meshes.strips import strip_triangles
from lightdepth.scene.meshes.text_file import named_file
from lightdepth.scene.model import Mesh

TEXTURE_COORDINATE_NAMES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("s0", "t0"))
COLOUR_NAMES = (("red", "green", "blue"), ("r", "g", "b"), ("diffuse_red", "diffuse_green", "diffuse_blue"))
ALPHA_NAMES = ("alpha", "a", "diffuse_alpha")
REST_NAMES = ("rest_x", "rest_y", "rest_z")
"""Environment texture coordinates: three float properties of each vertex, in the coordinates of the file."""
_FACE_NAMES = ("vertex_indices", "vertex_index")
_NORMALS = ("nx", "ny", "nz")
_USED = {
    "vertex": {"x", "y", "z", *REST_NAMES},
    "face": {*_FACE_NAMES, "texcoord", "texnumber"},
    "tristrips": {*_FACE_NAMES},
}
"""Elements and their properties that are read, beside normals, colours and texture coordinates."""
_MEASUREMENTS = ("quality", "confidence", "intensity", "flags", "radius", "curvature", "label", "value", "scalar")
"""What scanners' and other programs' properties begin with that say nothing about how a thing looks."""
_TEXTURE_KEYWORDS = ("texturefile", "texture")


def read_ply(path: Path, with_materials: bool, note: Note) -> list[MeshPart]:
    """Read a PLY file, ASCII or binary: one part for each texture.

    Colours are sRGB, scaled by their type: 255 of a ``uchar``, 65535 of a ``ushort`` and 1 of a ``float`` are full.

    Raises:
        InputError: the file is broken or has no faces.
    """
    file = read_ply_file(path)
    vertex = file.elements.get("vertex", Element(0))
    positions = _columns(vertex, ("x", "y", "z"))
    if positions is None:
        raise InputError(f"{path}: its vertices have no x, y and z")
    faces = _faces(path, file, len(positions), with_materials, note)
    found = [_columns(vertex, names) for names in TEXTURE_COORDINATE_NAMES]
    mesh = Mesh(
        vertices=positions.astype(np.float64),
        faces=np.zeros((0, 3), np.int32),
        normals=_as_floats(_columns(vertex, _NORMALS)),
        texture_coordinates=_as_floats(next((uv for uv in found if uv is not None), None)),
        colors=_colours(vertex, "vertices", note) if with_materials else None,
        rest=None if (rest := _columns(vertex, REST_NAMES)) is None else rest.astype(np.float64),
    )
    _note_what_is_left_out(file, note)
    if not with_materials:
        return [_part(mesh, faces, None)]
    if faces.colors is not None and mesh.colors is not None:
        note("colours of faces are left out, the vertices have colours as well")
    if file.elements.keys() & {"material", "multi_texture_vertex", "multi_texture_face"}:
        note("materials and several textures of a face are left out")
    names = _texture_files(file)
    if not names:
        return [_part(mesh, faces, None)]
    if faces.corner_uv is None and mesh.texture_coordinates is None:
        note(f"its texture '{names[0][:80]}' is left out, as there are no texture coordinates to map it by")
        return [_part(mesh, faces, None)]
    if faces.texture is None and len(names) > 1:
        note(f"only the first of its {len(names)} textures is used, as the faces do not say which is theirs")
    numbers = np.zeros(len(faces.corners), np.int64) if faces.texture is None else faces.texture
    parts = []
    for number in np.unique(numbers):
        name = names[number] if 0 <= number < len(names) else None
        texture = None if name is None else _texture(path, name, note)
        if name is None:
            note(f"faces with texture number {number} have no texture; the file names {len(names)}")
        parts.append(_part(mesh, faces.of(numbers == number), texture))
    if mesh.colors is not None and any(_has_texture(part) for part in parts):
        note("colours are left out where there is a texture")
    return parts


def _note_what_is_left_out(file: PlyFile, note: Note) -> None:
    """Name the elements and properties that are not known, and what stands behind them."""
    looks = {*_NORMALS, *ALPHA_NAMES, *(name for names in (*COLOUR_NAMES, *TEXTURE_COORDINATE_NAMES) for name in names)}
    for name, element in file.elements.items():
        if not element.count or name in ("material", "multi_texture_vertex", "multi_texture_face", "camera"):
            continue
        if name not in _USED:
            note(f"its {element.count} elements '{name[:40]}' are left out")
            continue
        own = (p.name for p in element.properties)
        strange = [p for p in own if p not in _USED[name] | looks and not p.lower().startswith(_MEASUREMENTS)]
        if strange:
            note(f"properties of its elements '{name}' are left out: {', '.join(strange)[:100]}")
    for tail in file.behind:
        note(f"{tail} behind its elements are left out")


@dataclass(frozen=True)
class _Faces:
    """Triangles.

    Attributes:
        corners: vertices, shape (m, 3).
        corner_uv: texture coordinates of each corner, shape (m, 3, 2), or ``None``.
        colors: linear colours of each face, shape (m, 3), or ``None``.
        texture: which of the file's textures each face has, shape (m,), or ``None``.
    """

    corners: NDArray[np.int64]
    corner_uv: NDArray[np.float32] | None = None
    colors: NDArray[np.float32] | None = None
    texture: NDArray[np.int64] | None = None

    def of(self, which: NDArray[np.bool_]) -> _Faces:
        """Some of them."""
        uv = None if self.corner_uv is None else self.corner_uv[which]
        return _Faces(self.corners[which], uv, None if self.colors is None else self.colors[which])


def _faces(path: Path, file: PlyFile, count: int, with_colors: bool, note: Note) -> _Faces:
    """The triangles of faces and of strips."""
    face = file.elements.get("face", Element(0))
    polygons = next((face.lists[name] for name in _FACE_NAMES if name in face.lists), None)
    strips = file.elements.get("tristrips", Element(0))
    lists = next((strips.lists[name] for name in _FACE_NAMES if name in strips.lists), None)
    if polygons is None and face.count:
        raise InputError(f"{path}: its faces have no list 'vertex_indices'")
    if (polygons is None or not face.count) and lists is None:
        if count:
            raise InputError(
                f"{path}: the mesh has no triangles, only {count} points; 'lightdepth reconstruct from-points' makes "
                "surfaces of the points of a scan"
            )
        return _Faces(np.zeros((0, 3), np.int64))
    found = _Faces(np.zeros((0, 3), np.int64))
    if polygons is not None and face.count:
        found = _filled(path, file, face, polygons, with_colors, note)
    if lists is not None:
        triangles = strip_triangles(_whole(path, lists.values), lists.lengths)
        _check(path, triangles, count, "strip")
        if len(found.corners):
            note("attributes of its faces are left out, as there are strips as well")
        found = _Faces(np.concatenate([found.corners, triangles]))
    return found


def _whole(path: Path, values: NDArray[np.generic]) -> NDArray[np.int64]:
    """Indices as whole numbers; some programs write them as floats."""
    whole: NDArray[np.int64] = values.astype(np.float64).astype(np.int64, casting="unsafe")
    if values.dtype.kind == "f" and not np.array_equal(whole.astype(np.float64), values.astype(np.float64)):
        raise InputError(f"{path}: its faces refer to vertices by numbers that are not integers")
    return whole


def _check(path: Path, corners: NDArray[np.int64], count: int, what: str) -> None:
    """Refuse what names no vertex."""
    outside = (corners < 0) | (corners >= count)
    if outside.any():
        row = int(outside.reshape(len(corners), -1).any(axis=1).argmax())
        raise InputError(f"{path}: {what} {row} refers to vertices {corners[row].tolist()}, but there are {count}")


def _filled(path: Path, file: PlyFile, face: Element, polygons: Lists, with_colors: bool, note: Note) -> _Faces:
    """Triangles of the polygons, with what the polygons have."""
    kept = polygons.lengths >= 3
    if not kept.all():
        note(f"{(~kept).sum()} faces of fewer than three corners are left out")
    owner = np.repeat(np.arange(len(polygons.lengths)), polygons.lengths)
    indices = _whole(path, polygons.values)
    count = file.elements["vertex"].count
    outside = (indices < 0) | (indices >= count)
    if outside.any():
        number = int(owner[outside.argmax()])
        raise InputError(
            f"{path}: face {number} refers to vertices {indices[owner == number].tolist()[:12]}, but there are {count}"
        )
    corners = indices[kept[owner]]
    vertex = file.elements["vertex"]
    positions = _columns(vertex, ("x", "y", "z"))
    assert positions is not None
    found = triangulated(positions.astype(np.float64)[corners], polygons.lengths[kept])
    if len(found.crossing):
        number = int(np.flatnonzero(kept)[found.crossing[0]])
        note(f"{len(found.crossing)} faces cross themselves, the first is face {number}; check their shape")
    source = np.flatnonzero(kept)[found.polygon]
    colors = _colours(face, "faces", note) if with_colors else None
    texture = face.columns.get("texnumber")
    return _Faces(
        corners[found.corners],
        _wedges(face, polygons, kept, found.corners, note),
        None if colors is None else colors[source],
        None if texture is None else texture.astype(np.int64)[source],
    )


def _wedges(
    face: Element, polygons: Lists, kept: NDArray[np.bool_], triangles: NDArray[np.int64], note: Note
) -> NDArray[np.float32] | None:
    """Texture coordinates of the triangles' corners, where faces have two for each corner."""
    wedges = face.lists.get("texcoord")
    if wedges is None:
        return None
    full = wedges.lengths == 2 * polygons.lengths
    if not full.any():
        if wedges.lengths.any():
            note("texture coordinates of faces are left out: two for each corner are needed")
        return None
    if not full[kept].all():
        note(f"{(~full[kept]).sum()} faces have no texture coordinates, or not two for each corner")
    uv = np.zeros((int(polygons.lengths.sum()), 2), np.float32)
    to_corner = np.repeat(full, polygons.lengths)
    from_value = np.repeat(full, wedges.lengths)
    uv[to_corner] = wedges.values[from_value].astype(np.float32).reshape(-1, 2)
    return uv[np.repeat(kept, polygons.lengths)][triangles]


def _part(mesh: Mesh, faces: _Faces, texture: Texture | None) -> MeshPart:
    """The triangles as a part; where neighbours differ at a vertex, each has its own."""
    colors, uv = mesh.colors, mesh.texture_coordinates
    by_face = texture is None and colors is None and faces.colors is not None
    if faces.corner_uv is None and not by_face:
        used = Mesh(mesh.vertices, faces.corners.astype(np.int32), mesh.normals, uv, colors, mesh.rest)
        return MeshPart(used, _material(texture, colors is not None))
    rows = [faces.corners.reshape(-1, 1).astype(np.float64)]
    if faces.corner_uv is not None:
        rows.append(faces.corner_uv.reshape(-1, 2).astype(np.float64))
    if by_face:
        assert faces.colors is not None
        rows.append(np.repeat(faces.colors, 3, axis=0).astype(np.float64))
    table = np.concatenate(rows, axis=1)
    first, index = unique_rows(table)
    table = table[first]
    source = table[:, 0].astype(np.int64)
    uv = None if uv is None else uv[source]
    colors = None if colors is None else colors[source]
    if faces.corner_uv is not None:
        uv = table[:, 1:3].astype(np.float32)
    if by_face:
        colors = table[:, -3:].astype(np.float32)
    used = Mesh(
        mesh.vertices[source],
        index.reshape(-1, 3).astype(np.int32),
        None if mesh.normals is None else mesh.normals[source],
        uv,
        colors,
        None if mesh.rest is None else mesh.rest[source],
    )
    return MeshPart(used, _material(texture, colors is not None))


def _material(texture: Texture | None, has_colors: bool) -> Principled | None:
    if texture is not None:
        return Principled(base_color=texture)
    return Principled(base_color=VertexColors()) if has_colors else None


def _has_texture(part: MeshPart) -> bool:
    return isinstance(part.material, Principled) and isinstance(part.material.base_color, Texture)


def _texture_files(file: PlyFile) -> list[str]:
    """The textures that comments name."""
    found = []
    for comment in file.comments:
        keyword, _, name = comment.partition(" ")
        if keyword.lower().rstrip(":") in _TEXTURE_KEYWORDS and name.strip():
            found.append(name.strip())
    return found


def _texture(path: Path, name: str, note: Note) -> Texture | None:
    found = named_file(path.parent, name)
    if found is None:
        note(f"its texture '{name[:80]}' does not exist; the mesh is without it")
        return None
    try:
        return read_texture(found, Content.COLOUR)
    except ValueError as error:
        note(f"its texture is left out: {error}")
        return None


def _colours(element: Element, what: str, note: Note) -> NDArray[np.float32] | None:
    """Linear colours, shape (n, 3)."""
    names = next((n for n in COLOUR_NAMES if all(name in element.columns for name in n)), None)
    if names is None or not element.count:
        return None
    alpha = next((element.columns[name] for name in ALPHA_NAMES if name in element.columns), None)
    if alpha is not None and (_scaled(alpha) < 1.0).any():
        note(f"the alpha of its {what}' colours is left out")
    codes = np.stack([_scaled(element.columns[name]) for name in names], axis=1)
    kind = element.columns[names[0]].dtype
    most = float(np.nanmax(codes, initial=0.0))
    if kind.kind == "f" and most > 1.0:
        note(f"colours of its {what} go to {most:.4g} and are taken as codes from 0 to 255")
        codes = codes / 255.0
    elif kind.kind == "u" and kind.itemsize > 1 and 0.0 < most * _full(kind) < 255.5:
        note(f"colours of its {what} are no greater than 255 and are taken as codes from 0 to 255")
        codes = codes * (_full(kind) / 255.0)
    return decoded_srgb(np.clip(np.nan_to_num(codes, nan=0.0), 0.0, 1.0)).astype(np.float32)


def _scaled(values: NDArray[Any]) -> NDArray[np.float64]:
    """Numbers by their type, as shares."""
    exact = values.astype(np.float64)
    if values.dtype.kind == "f":
        return exact
    if values.dtype.kind == "u" and values.dtype.itemsize <= 2:
        return exact / _full(values.dtype)
    # What has a sign, or 32 bits, is written by programs that have no smaller type.
    return exact / (255.0 if exact.max(initial=0.0) <= 255.0 else 65535.0)


def _full(kind: np.dtype[Any]) -> float:
    """The largest number of a type without sign."""
    return float(2 ** (8 * kind.itemsize) - 1)


def _columns(element: Element, names: Sequence[str]) -> NDArray[Any] | None:
    """Properties side by side, shape (n, len(names)), or ``None`` where the file lacks one."""
    if any(name not in element.columns for name in names):
        return None
    return np.column_stack([element.columns[name] for name in names])


def _as_floats(values: NDArray[Any] | None) -> NDArray[np.float32] | None:
    return None if values is None else values.astype(np.float32)

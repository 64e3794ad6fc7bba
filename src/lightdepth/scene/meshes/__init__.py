"""Mesh files. A new format is a file in this folder and a line in ``READERS``."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Protocol

import numpy as np

from lightdepth.errors import InputError, warn
from lightdepth.files import is_file
from lightdepth.scene.meshes.geometry import checked
from lightdepth.scene.meshes.gltf import GltfReader, read_gltf
from lightdepth.scene.meshes.obj import read_obj
from lightdepth.scene.meshes.part import MeshPart, Note
from lightdepth.scene.meshes.ply import read_ply
from lightdepth.scene.meshes.stl import read_stl
from lightdepth.scene.meshes.usd import FORMATS, open_usd, read_usd

READERS: dict[str, Callable[[Path, bool, Note], list[MeshPart]]] = {
    ".ply": read_ply,
    ".obj": read_obj,
    ".stl": read_stl,
    ".gltf": read_gltf,
    ".glb": read_gltf,
    **dict.fromkeys(FORMATS, read_usd),
}
"""Readers by file name extension. They take the file, whether materials are wanted, and a function for notes."""


class Posable(Protocol):
    """An open file whose meshes move."""

    def parts(self, animation: str | None = None, time: float = 0.0, loop: bool = False) -> list[MeshPart]:
        """The parts at a time; see :meth:`AnimatedMesh.parts`."""


ANIMATED: dict[str, Callable[[Path, bool, Note], Posable]] = {
    ".gltf": GltfReader,
    ".glb": GltfReader,
    **dict.fromkeys(FORMATS, open_usd),
}
"""What opens the formats that have animations, likewise."""


def read_mesh_file(path: Path, with_materials: bool, keep_flat: bool = False) -> list[MeshPart]:
    """Read a mesh file and check it; each thing that it says and that is left out, or taken otherwise, is warned of.

    Args:
        path: the file.
        with_materials: read the materials, too; without, the parts have none.
        keep_flat: keep triangles without area, so that faces stay numbered as in the file.

    Returns:
        The file's parts in its own coordinates, z up, metres.

    Raises:
        InputError: the file is missing, of an unknown format, unreadable, empty, or has broken vertices or faces.
    """
    reader = _reader(path)
    with _named(path):
        parts = reader(path, with_materials, _noting(path))
    return _checked(path, parts, keep_flat)


class AnimatedMesh:
    """A mesh file in one pose of its animation after the other; what does not move is read once.

    Args:
        path: a file of one of the formats ``ANIMATED``.
        with_materials: read the materials, too.

    Raises:
        InputError: as for :func:`read_mesh_file`, or files of this format have no animations.
    """

    def __init__(self, path: Path, with_materials: bool) -> None:
        _reader(path)
        opening = ANIMATED.get(path.suffix.lower())
        if opening is None:
            raise InputError(f"{path}: '{path.suffix}' files have no animations; allowed are {', '.join(ANIMATED)}")
        self._path = path
        with _named(path):
            self._file = opening(path, with_materials, _noting(path))

    def parts(self, animation: str, time: float, loop: bool) -> list[MeshPart]:
        """The file's parts, as :func:`read_mesh_file` gives them, at a time of an animation.

        Args:
            animation: its name.
            time: in it, seconds.
            loop: begin again where it ends.

        Raises:
            InputError: as for :func:`read_mesh_file`, or there is no such animation.
        """
        with _named(self._path):
            parts = self._file.parts(animation, time, loop)
        return _checked(self._path, parts)


def _reader(path: Path) -> Callable[[Path, bool, Note], list[MeshPart]]:
    if not is_file(path):
        raise InputError(f"{path}: no such file")
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: '{path.suffix}' is not a mesh format; allowed are {', '.join(READERS)}")
    return reader


def _noting(path: Path) -> Note:
    """Warns of each thing once."""
    noted: set[str] = set()

    def note_once(message: str) -> None:
        if message not in noted:
            noted.add(message)
            warn(f"{path}: {message}")

    return note_once


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """A file that cannot be read in here is named."""
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # What is not finite is found by ``_checked``.
            yield
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error


def _checked(path: Path, parts: list[MeshPart], keep_flat: bool = False) -> list[MeshPart]:
    if not parts:
        raise InputError(f"{path}: the mesh has no triangles")
    try:
        return [replace(part, mesh=checked(part.mesh, keep_flat)) for part in parts]
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error


__all__ = ["READERS", "AnimatedMesh", "MeshPart", "read_mesh_file"]

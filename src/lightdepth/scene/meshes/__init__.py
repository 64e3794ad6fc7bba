"""Mesh files. A new format is a file in this folder and a line in ``READERS``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from lightdepth.errors import InputError, warn
from lightdepth.files import is_file
from lightdepth.scene.meshes.geometry import checked
from lightdepth.scene.meshes.gltf import read_gltf
from lightdepth.scene.meshes.obj import read_obj
from lightdepth.scene.meshes.part import MeshPart, Note
from lightdepth.scene.meshes.ply import read_ply
from lightdepth.scene.meshes.stl import read_stl

READERS: dict[str, Callable[[Path, bool, Note], list[MeshPart]]] = {
    ".ply": read_ply,
    ".obj": read_obj,
    ".stl": read_stl,
    ".gltf": read_gltf,
    ".glb": read_gltf,
}
"""Readers by file name extension. They take the file, whether materials are wanted, and a function for notes."""


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
    if not is_file(path):
        raise InputError(f"{path}: no such file")
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: '{path.suffix}' is not a mesh format; allowed are {', '.join(READERS)}")
    noted: set[str] = set()

    def note_once(message: str) -> None:
        if message not in noted:
            noted.add(message)
            warn(f"{path}: {message}")

    try:
        with np.errstate(over="ignore", invalid="ignore"):  # What is not finite is found below.
            parts = reader(path, with_materials, note_once)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    if not parts:
        raise InputError(f"{path}: the mesh has no triangles")
    try:
        return [replace(part, mesh=checked(part.mesh, keep_flat)) for part in parts]
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error


__all__ = ["READERS", "MeshPart", "read_mesh_file"]

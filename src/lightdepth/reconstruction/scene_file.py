"""Meshes of a place on disk, and their ``[[real]]`` tables in the scene file."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import tomlkit
import trimesh
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import AoT

from lightdepth.errors import InputError
from lightdepth.images.writing import whole_file
from lightdepth.reconstruction.place import Place
from lightdepth.scene.model import RealSurface


@dataclass(frozen=True)
class WrittenSurface:
    """A surface and the PLY file that holds it."""

    surface: RealSurface
    path: Path


def write_meshes(surfaces: Sequence[RealSurface], folder: Path) -> list[WrittenSurface]:
    """Write each surface as ``NAME.ply`` (binary) into a folder, which is made where it is missing.

    Raises:
        InputError: the folder or a file cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made ({error.strerror})") from error
    written = []
    for surface in surfaces:
        path = folder / f"{surface.name}.ply"
        mesh = trimesh.Trimesh(surface.mesh.vertices, surface.mesh.faces, process=False)
        with whole_file(path) as temporary:
            temporary.write_bytes(mesh.export(file_type="ply"))
        written.append(WrittenSurface(surface, path))
    return written


def with_surfaces(scene: Path, place: Place, written: Sequence[WrittenSurface]) -> str:
    """The text of a scene file with a ``[[real]]`` table for each surface; all else stays as the person wrote it.

    A table of the same name gets the new mesh and role and loses a placement, for the mesh is in world space. Where the
    file does not exist, it is begun with the panorama and its pose.

    Args:
        scene: the scene file; paths in it are relative to its folder.
        place: what the surfaces were made for.
        written: the surfaces.

    Raises:
        InputError: the file is not a readable TOML file or its ``real`` is no array of tables.
    """
    document = _parsed(scene) if scene.exists() else _new_document(scene, place)
    tables = document.setdefault("real", tomlkit.aot())
    if not isinstance(tables, AoT):
        raise InputError(f"{scene}: 'real' must be an array of tables, each under its own [[real]]")
    for item in written:
        surface = item.surface
        table = next((table for table in tables if table.get("name") == surface.name), None)
        if table is None:
            table = tomlkit.table()
            table["name"] = surface.name
            tables.append(table)
        table["mesh"] = _relative(item.path, scene)
        table["role"] = surface.role.value
        for key in ("position", "rotation", "scale", "rest", *(["gloss"] if surface.role.value != "support" else [])):
            table.pop(key, None)
    return tomlkit.dumps(document)


def write_scene(scene: Path, text: str) -> None:
    """Write a scene file, whole or not at all.

    Raises:
        InputError: it cannot be written.
    """
    with whole_file(scene) as temporary:
        temporary.write_bytes(text.encode("utf-8"))


def _parsed(scene: Path) -> tomlkit.TOMLDocument:
    try:
        return tomlkit.parse(scene.read_bytes().decode("utf-8"))
    except (TOMLKitError, OSError, UnicodeDecodeError) as error:
        raise InputError(f"{scene}: not a readable TOML file ({error})") from error


def _new_document(scene: Path, place: Place) -> tomlkit.TOMLDocument:
    if place.image is None:
        raise InputError(f"{scene}: no such file; to begin it, a panorama is needed")
    panorama = tomlkit.table()
    panorama["image"] = _relative(place.image, scene)
    panorama["position"] = [round(float(x), 5) for x in place.pose.position]
    panorama["rotation"] = [float(x) for x in place.rotation_degrees]
    document = tomlkit.document()
    document["panorama"] = panorama
    return document


def _relative(path: Path, scene: Path) -> str:
    return Path(os.path.relpath(path.resolve(), scene.resolve().parent)).as_posix()

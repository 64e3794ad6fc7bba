"""Meshes of a place on disk, and their ``[[real]]`` tables in the scene file."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import tomlkit
import trimesh
from numpy.typing import NDArray
from tomlkit.items import AoT

from lightdepth.directions import euler_rotation
from lightdepth.errors import InputError, warn
from lightdepth.files import exists
from lightdepth.images.writing import whole_file
from lightdepth.parameters.reconstruction import DEFAULT, ReviewParameters
from lightdepth.reconstruction.posed_panorama import PosedPanorama
from lightdepth.scene.model import RealSurface
from lightdepth.toml_file import document_bytes, first_panorama, read_document


def write_meshes(surfaces: Sequence[RealSurface], folder: Path) -> None:
    """Write each surface as ``NAME.ply`` (binary) into a folder, which is made where it is missing.

    Raises:
        InputError: the folder or a file cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be created ({error.strerror})") from error
    for surface in surfaces:
        mesh = trimesh.Trimesh(surface.mesh.vertices, surface.mesh.faces, process=False)
        with whole_file(mesh_path(surface, folder)) as temporary:
            temporary.write_bytes(mesh.export(file_type="ply"))


def mesh_path(surface: RealSurface, folder: Path) -> Path:
    """Where a surface's mesh is written."""
    return folder / f"{surface.name}.ply"


def with_surfaces(
    scene: Path,
    panorama: PosedPanorama,
    surfaces: Sequence[RealSurface],
    folder: Path,
    sky: bool,
    tuned: ReviewParameters = DEFAULT.review,
) -> bytes:
    """The content of a scene file with a ``[[real]]`` table for each surface; all else stays as the person wrote it.

    A warning says where the file's pose is another one than that of the surfaces, which then do not lie on the picture.

    A table of the same name gets the new mesh and role and loses a placement, for the mesh is in world space. Where the
    file does not exist, it is begun with the panorama and its pose.

    Args:
        scene: the scene file; paths in it are relative to its folder.
        panorama: that the surfaces were made for.
        surfaces: of the place.
        folder: of their meshes.
        sky: declare what the surfaces leave open sky.
        tuned: which poses are the same.

    Raises:
        InputError: the file is not a readable TOML file or its ``real`` is no array of tables.
    """
    if exists(scene):
        document = read_document(scene)
        _warn_of_another_pose(scene, document, panorama, tuned)
    else:
        document = _new_document(scene, panorama)
    tables = document.get("real")
    if tables is None:
        if not document.as_string().endswith("\n\n"):
            document.add(tomlkit.nl())
        tables = document["real"] = tomlkit.aot()
    if not isinstance(tables, AoT):
        raise InputError(f"{scene}: 'real' must be an array of tables, each under its own [[real]]")
    if sky:
        document.setdefault("panorama", tomlkit.table())
        first_panorama(document)["sky"] = True
    for surface in surfaces:
        table = next((table for table in tables if table.get("name") == surface.name), None)
        if table is None:
            tables.append(tomlkit.table())
            table = tables[-1]
            table["name"] = surface.name
        table["mesh"] = _relative(mesh_path(surface, folder), scene)
        table["role"] = surface.role.value
        for key in ("position", "rotation", "scale", "rest"):
            table.pop(key, None)
    return document_bytes(document)


def write_scene(scene: Path, content: bytes) -> None:
    """Write a scene file, whole or not at all.

    Raises:
        InputError: it cannot be written.
    """
    with whole_file(scene) as temporary:
        temporary.write_bytes(content)


def _warn_of_another_pose(
    scene: Path, document: tomlkit.TOMLDocument, panorama: PosedPanorama, tuned: ReviewParameters
) -> None:
    table = first_panorama(document)
    if not isinstance(table, dict) or "image" not in table:
        return
    pose = panorama.pose
    found = []
    position, rotation = table.get("position", [0.0, 0.0, 0.0]), table.get("rotation", [0.0, 0.0, 0.0])
    if _is_three(position) and np.abs(np.subtract(position, pose.position)).max() > tuned.same_position:
        found.append(f"position is {_shown(position)}, and the surfaces were made for {_shown(pose.position)}")
    if _is_three(rotation) and np.abs(euler_rotation(rotation) - pose.rotation).max() > tuned.same_rotation:
        found.append(
            f"rotation is {_shown(rotation)}, and the surfaces were made for {_shown(panorama.rotation_degrees)}"
        )
    if found:
        warn(
            f"{scene}: [panorama] {'; its '.join(found)}: they do not lie on the picture. Correct the pose there, or give "
            "the scene file instead of the panorama"
        )


def _is_three(values: object) -> bool:
    """Whether a key holds three numbers; keys of a sequence are another form, which nothing is compared with."""
    return isinstance(values, list) and len(values) == 3 and all(isinstance(x, int | float) for x in values)


def _shown(values: Sequence[float] | NDArray[np.float64]) -> str:
    return ", ".join(f"{float(value):g}" for value in values)


def _new_document(scene: Path, panorama: PosedPanorama) -> tomlkit.TOMLDocument:
    if panorama.image is None:
        raise InputError(f"{scene}: no such file; to begin it, a panorama is needed")
    table = tomlkit.table()
    table["image"] = _relative(panorama.image, scene)
    table["position"] = [round(float(x), 5) for x in panorama.pose.position]
    table["rotation"] = [float(x) for x in panorama.rotation_degrees]
    document = tomlkit.document()
    document["panorama"] = table
    return document


def _relative(path: Path, scene: Path) -> str:
    return Path(os.path.relpath(path.resolve(), scene.resolve().parent)).as_posix()

"""The pose in a scene file, which otherwise stays as the person wrote it."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.items import InlineTable

from lightdepth.errors import InputError
from lightdepth.images.writing import whole_file
from lightdepth.toml_file import document_bytes, first_panorama, read_document


def write_pose(
    scene: Path, rotation: Sequence[float] | None, position: Sequence[float] | None, image: Path | None = None
) -> Path:
    """Put a pose into the first ``[[panorama]]`` table of a scene file; comments, order and all else are kept.

    Args:
        scene: the scene file; it is replaced whole or not at all. Where there is none, it is begun.
        rotation: light space to world, XYZ Euler, degrees, three numbers; ``None`` leaves the file's as it is.
        position: capture point, world, metres, three numbers; ``None`` leaves the file's as it is.
        image: the panorama, which a new file names; ``None`` where the file must exist.

    Returns:
        The panorama image that the scene names.

    Raises:
        InputError: the file is missing, is not TOML, has no panorama with an image, or cannot be written.
    """
    document = read_document(scene) if image is None or scene.exists() else _begun(scene, image)
    panorama = _calibrated(scene, document)
    if position is not None:
        panorama["position"] = _numbers(position)
    if rotation is not None:
        panorama["rotation"] = _numbers(rotation)
    with whole_file(scene) as temporary:
        temporary.write_bytes(document_bytes(document))
    return scene.parent / panorama["image"]


def write_further_pose(scene: Path, image: Path, rotation: Sequence[float], position: Sequence[float]) -> None:
    """Put the pose of a further panorama into a scene file: into the ``[[panorama]]`` of its image, or into a new one.

    Args:
        scene: the scene file; it is replaced whole or not at all.
        image: the panorama.
        rotation: light space to world, XYZ Euler, degrees, three numbers.
        position: capture point, world, metres, three numbers.

    Raises:
        InputError: the file is missing, is not TOML, has no other panorama as its first, or cannot be written.
    """
    document = read_document(scene)
    _calibrated(scene, document)
    tables = document["panorama"]
    if not isinstance(tables, list):
        listed, table = tomlkit.aot(), tables
        if isinstance(tables, InlineTable):
            table = tomlkit.table()
            table.update(tables)
        listed.append(table)
        document["panorama"] = tables = listed
    named = [(scene.parent / str(table.get("image"))).resolve() for table in tables]
    if named[0] == image.resolve():
        raise InputError(f"{scene}: {image} is the scene's first panorama; only a further one gets its pose from it")
    if image.resolve() in named:
        table = tables[named.index(image.resolve())]
    else:
        table = tomlkit.table()
        table["image"] = Path(os.path.relpath(image.resolve(), scene.resolve().parent)).as_posix()
        table["position"], table["rotation"] = _numbers(position), _numbers(rotation)
        table.add(tomlkit.nl())
        tables.append(table)
    table["position"], table["rotation"] = _numbers(position), _numbers(rotation)
    with whole_file(scene) as temporary:
        temporary.write_bytes(document_bytes(document))


def _calibrated(scene: Path, document: tomlkit.TOMLDocument) -> Any:
    """The table of the first panorama, which names an image."""
    panorama = first_panorama(document)
    if not isinstance(panorama, dict) or not isinstance(panorama.get("image"), str):
        raise InputError(f"{scene}: has no [panorama] table with an image; write one, then calibrate")
    return panorama


def write_camera(scene: Path, name: str, values: Mapping[str, Any]) -> None:
    """Put a perspective camera into a scene file: into its ``[camera.NAME]`` table, or into a new one.

    Args:
        scene: the scene file; it is replaced whole or not at all.
        name: of the camera.
        values: its keys; ``None`` takes a key away, others of the table stay, except those that say the same.

    Raises:
        InputError: the file is missing, is not TOML, has a camera of that name of another type, or cannot be written.
    """
    document = read_document(scene)
    cameras = document.get("camera")
    if cameras is None:
        cameras = document["camera"] = tomlkit.table(is_super_table=True)
    if not isinstance(cameras, dict) or not isinstance(cameras.get(name, {}), dict):
        raise InputError(f"{scene}: 'camera' must hold tables, each under its own [camera.NAME]")
    if name not in cameras:
        cameras[name] = tomlkit.table()
    table = cameras[name]
    if table.get("type", "perspective") != "perspective":
        raise InputError(
            f"{scene}: camera '{name}' is of type '{table['type']}'; choose another --name for the photograph"
        )
    for key in ("shift", "look_at"):
        table.pop(key, None)
    for key, value in ({"type": "perspective"} | dict(values)).items():
        if value is None:
            table.pop(key, None)
        else:
            table[key] = value
    with whole_file(scene) as temporary:
        temporary.write_bytes(document_bytes(document))


def _begun(scene: Path, image: Path) -> tomlkit.TOMLDocument:
    document = tomlkit.document()
    document["panorama"] = tomlkit.table()
    document["panorama"]["image"] = Path(os.path.relpath(image.resolve(), scene.resolve().parent)).as_posix()
    return document


def _numbers(values: Sequence[float]) -> list[float]:
    """Five decimals, which is finer than any calibration, and no negative zero."""
    return [round(float(value), 5) + 0.0 for value in values]

"""Cameras of glTF files: where they are, which way they look, and how wide."""

from __future__ import annotations

import math
from functools import lru_cache
from pathlib import Path

from lightdepth.errors import InputError, warn
from lightdepth.scene.meshes.file_camera import Y_UP_TO_Z_UP, FileCamera, listed, turned
from lightdepth.scene.meshes.gltf_accessors import GltfAccessors
from lightdepth.scene.meshes.gltf_animation import GltfAnimation
from lightdepth.scene.meshes.gltf_file import GltfFile
from lightdepth.scene.meshes.gltf_nodes import GltfNodes
from lightdepth.scene.meshes.gltf_schema import CameraEntry, checked_part


def read_camera(path: Path, name: str | None, animation: str | None, time: float, loop: bool) -> FileCamera:
    """A camera out of a glTF file; see :func:`~lightdepth.scene.camera_file.read_camera`."""
    try:
        status = path.stat()
        file, accessors = _opened(path, status.st_mtime_ns, status.st_size)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    number, entry = _found(file, name)
    if entry.perspective is None:
        raise InputError(f"{path}: its camera is of type '{entry.type[:40]}'; only perspective cameras are read")
    nodes = GltfNodes(file)
    if animation is not None:
        moving = GltfAnimation(file, accessors, animation, lambda message: warn(f"{path}: {message}"))
        nodes = GltfNodes(file, moving.nodes_at(time, loop))
    world = nodes.world(number)
    rotation = turned(world[:3, :3])
    if rotation is None:
        raise InputError(f"{path}: the node of its camera is scaled to nothing at {time:g} seconds")
    # Glance and up of a glTF camera are -z and +y, ours +y and +z: the same turn as that of the world.
    return FileCamera(
        Y_UP_TO_Z_UP @ world[:3, 3],
        Y_UP_TO_Z_UP @ rotation @ Y_UP_TO_Z_UP.T,
        math.degrees(entry.perspective.yfov),
        entry.perspective.aspect_ratio,
    )


@lru_cache(maxsize=4)
def _opened(path: Path, _changed: int, _size: int) -> tuple[GltfFile, GltfAccessors]:
    """A file, opened once for all frames."""
    file = GltfFile(path)
    return file, GltfAccessors(file)


def _found(file: GltfFile, name: str | None) -> tuple[int, CameraEntry]:
    """Number of the node with the camera, and the camera."""
    found: list[tuple[int, CameraEntry, str]] = []
    for number, node in enumerate(file.header.nodes):
        if node.camera is None:
            continue
        document = file.entry(file.header.cameras, node.camera, "camera")
        try:
            entry = checked_part(CameraEntry, document, f"cameras[{node.camera}]")
        except ValueError as error:
            raise InputError(f"{file.path}: {error}") from error
        found.append((number, entry, node.name or entry.name or str(number)))
    if not found:
        raise InputError(f"{file.path}: no node of it has a camera")
    names = listed([called for *_, called in found])
    if name is None:
        if len(found) > 1:
            raise InputError(f"{file.path}: has {len(found)} cameras, and node must name one of them: {names}")
        return found[0][:2]
    for number, entry, called in found:
        if name in (called, entry.name):
            return number, entry
    raise InputError(f"{file.path}: has no camera '{name[:100]}'; it has {names}")

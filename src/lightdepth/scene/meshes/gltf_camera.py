"""Cameras of glTF files: where they are, which way they look, and how wide."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError, warn
from lightdepth.files import is_file
from lightdepth.scene.meshes.gltf_accessors import GltfAccessors
from lightdepth.scene.meshes.gltf_animation import MOST_LISTED, GltfAnimation
from lightdepth.scene.meshes.gltf_file import GltfFile
from lightdepth.scene.meshes.gltf_nodes import GltfNodes
from lightdepth.scene.meshes.gltf_schema import CameraEntry, checked_part

FORMATS = (".gltf", ".glb")
Y_UP_TO_Z_UP = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
"""(x, y, z) becomes (x, -z, y)."""


@dataclass(frozen=True)
class FileCamera:
    """A camera of a file.

    Attributes:
        position: shape (3,), float64, metres, z up.
        rotation: camera space (x to the right, y forward, z up) to the file's, z up, shape (3, 3), float64.
        vertical_fov: degrees.
        aspect: width over height of its picture; ``None`` where the file does not say.
    """

    position: NDArray[np.float64]
    rotation: NDArray[np.float64]
    vertical_fov: float
    aspect: float | None


def read_camera(path: Path, name: str | None, animation: str | None, time: float, loop: bool) -> FileCamera:
    """A camera out of a glTF file, as it is at a time.

    Args:
        path: the file.
        name: of the camera, or of the node that has it; ``None`` where there is one camera only.
        animation: name of the animation that moves it; ``None`` takes the pose without.
        time: in the animation, seconds.
        loop: begin the animation again where it ends.

    Raises:
        InputError: the file is missing or broken, or has no such camera or no such animation.
    """
    if path.suffix.lower() not in FORMATS:
        raise InputError(f"{path}: cameras are read from {' and '.join(FORMATS)} files, not from '{path.suffix}'")
    if not is_file(path):
        raise InputError(f"{path}: no such file")
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
    turned = _turned(world[:3, :3])
    if turned is None:
        raise InputError(f"{path}: the node of its camera is scaled to nothing at {time:g} seconds")
    # Glance and up of a glTF camera are -z and +y, ours +y and +z: the same turn as that of the world.
    return FileCamera(
        Y_UP_TO_Z_UP @ world[:3, 3],
        Y_UP_TO_Z_UP @ turned @ Y_UP_TO_Z_UP.T,
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
    listed = ", ".join(f"'{called[:60]}'" for *_, called in found[:MOST_LISTED])
    if name is None:
        if len(found) > 1:
            raise InputError(f"{file.path}: has {len(found)} cameras, and node must name one of them: {listed}")
        return found[0][:2]
    for number, entry, called in found:
        if name in (called, entry.name):
            return number, entry
    raise InputError(f"{file.path}: has no camera '{name[:100]}'; it has {listed}")


def _turned(linear: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """The rotation in a matrix of shape (3, 3): where it looks and its upright, without scale, shear and mirroring."""
    back, up = linear[:, 2], linear[:, 1]
    right = np.cross(up, back)
    if not min(np.linalg.norm(back), np.linalg.norm(right)) > 0.0:
        return None
    back, right = back / np.linalg.norm(back), right / np.linalg.norm(right)
    return np.stack([right, np.cross(back, right), back], axis=1)

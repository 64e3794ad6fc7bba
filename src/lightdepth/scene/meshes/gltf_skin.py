"""Skins of glTF: vertices moved by their joints, in the pose that the nodes have."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError
from lightdepth.scene.meshes.geometry import bent
from lightdepth.scene.meshes.gltf_accessors import GltfAccessors
from lightdepth.scene.meshes.gltf_file import GltfFile
from lightdepth.scene.meshes.gltf_nodes import GltfNodes
from lightdepth.scene.meshes.gltf_primitive import Decoded, GltfPrimitive


def skinned(
    file: GltfFile, accessors: GltfAccessors, nodes: GltfNodes, skin: int, primitive: GltfPrimitive, base: Decoded
) -> Decoded:
    """A primitive in the world. Where its node is does not matter; the joints alone say where it goes.

    Raises:
        InputError: the skin is broken, or the primitive lacks joints and weights.
    """
    entry = file.entry(file.header.skins, skin, "skin")
    matrices = np.stack([nodes.world(joint) for joint in entry.joints]) if entry.joints else np.zeros((0, 4, 4))
    if entry.inverse_bind_matrices is not None:
        inverse = accessors.floats(entry.inverse_bind_matrices, 16).reshape(-1, 4, 4).transpose(0, 2, 1)
        if len(inverse) < len(matrices):
            raise InputError(
                f"{file.path}: skin {skin} has {len(matrices)} joints, but {len(inverse)} inverse bind matrices"
            )
        matrices = matrices @ inverse[: len(matrices)]
    blended = _blended(file, skin, primitive, matrices, len(base.positions))
    positions, normals = bent(blended, base.positions, base.normals)
    mirrored = np.linalg.det(blended[:, :, :3]) < 0.0
    faces = base.faces
    if len(mirrored) and mirrored.mean() > 0.5:
        faces = faces[:, ::-1]
    return Decoded(positions, faces, normals)


def _blended(
    file: GltfFile, skin: int, primitive: GltfPrimitive, matrices: NDArray[np.float64], count: int
) -> NDArray[np.float64]:
    """Matrix of each vertex, shape (n, 3, 4)."""
    blended = np.zeros((count, 3, 4))
    total = np.zeros(count)
    number = 0
    while (joints := primitive.joints(f"JOINTS_{number}")) is not None:
        weights = primitive.attribute(f"WEIGHTS_{number}")
        if weights is None:
            raise InputError(f"{file.path}: a mesh with skin {skin} has JOINTS_{number}, but no WEIGHTS_{number}")
        used = joints[weights != 0.0]
        if len(used) and (used.max() >= len(matrices) or used.min() < 0):
            raise InputError(
                f"{file.path}: a mesh refers to joint {used.max()} of skin {skin}, which has {len(matrices)}"
            )
        for k in range(4):
            weight = weights[:, k]
            safe = np.where(weight != 0.0, joints[:, k], 0)
            if len(matrices):
                blended += weight[:, None, None] * matrices[safe, :3]
            total += weight
        number += 1
    if number == 0:
        raise InputError(f"{file.path}: a mesh with skin {skin} has no JOINTS_0 and WEIGHTS_0")
    if (bare := ~(np.abs(total) > 1e-6)).any():
        raise InputError(f"{file.path}: {bare.sum()} vertices of a mesh with skin {skin} have no weight at any joint")
    return blended / total[:, None, None]

"""The node hierarchy of glTF: where each node is, and which are shown."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError
from lightdepth.scene.meshes.gltf_accessors import GltfAccessors
from lightdepth.scene.meshes.gltf_file import GltfFile
from lightdepth.scene.meshes.gltf_schema import Node

Matrix = NDArray[np.float64]


class GltfNodes:
    """The nodes of one file, in one pose.

    Args:
        file: the file.
        entries: its nodes, moved by an animation; by default as the file has them.

    Attributes:
        entries: the nodes.
        shown: world matrix of each node of the scene that is visible, in depth-first order, by its number.
    """

    def __init__(self, file: GltfFile, entries: Sequence[Node] | None = None) -> None:
        self._file = file
        header = file.header
        self.entries = header.nodes if entries is None else entries
        children = {child for node in self.entries for child in node.children}
        self._forest_roots = [n for n in range(len(self.entries)) if n not in children]
        if header.scenes:
            number = header.scene or 0
            roots = file.entry(header.scenes, number, "scene").nodes
        else:
            roots = self._forest_roots
        self._worlds: dict[int, Matrix] = {}
        self.shown: dict[int, Matrix] = {}
        self._walk(roots, shown=True)

    def world(self, number: int) -> Matrix:
        """World matrix of any node; joints may lie outside the scene.

        Raises:
            InputError: there is no such node.
        """
        self._file.entry(self.entries, number, "node")
        if number not in self._worlds:
            self._walk([root for root in self._forest_roots if root not in self._worlds], shown=False)
        if number not in self._worlds:
            raise InputError(f"{self._file.path}: node {number} is its own ancestor")
        return self._worlds[number]

    def _walk(self, roots: list[int], shown: bool) -> None:
        """Place nodes and all below them, parents first."""
        waiting = [(root, np.eye(4), shown) for root in reversed(roots)]
        while waiting:
            number, parent, visible = waiting.pop()
            node = self._file.entry(self.entries, number, "node")
            if number in self._worlds:
                raise InputError(f"{self._file.path}: node {number} is the child of two nodes, or its own ancestor")
            if node.matrix is not None and not np.allclose(node.matrix[3::4], (0.0, 0.0, 0.0, 1.0), atol=1e-5):
                raise InputError(
                    f"{self._file.path}: the last row of node {number}'s matrix is {node.matrix[3::4]}; it must be "
                    "0, 0, 0, 1"
                )
            world = self._worlds[number] = parent @ local_matrix(node)
            visible = visible and node.extensions.KHR_node_visibility.visible
            if visible:
                self.shown[number] = world
            waiting += [(child, world, visible) for child in reversed(node.children)]


def local_matrix(node: Node) -> Matrix:
    """A node's own matrix, shape (4, 4)."""
    if node.matrix is not None:
        return np.array(node.matrix, np.float64).reshape(4, 4).T
    matrices = trs_matrices(np.array([node.translation]), np.array([node.rotation]), np.array([node.scale]))
    matrix: Matrix = matrices[0]
    return matrix


def trs_matrices(
    translations: NDArray[np.float64], rotations: NDArray[np.float64], scales: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Matrices that scale, then turn by quaternions (x, y, z, w), then move, shape (n, 4, 4)."""
    lengths = np.linalg.norm(rotations, axis=1, keepdims=True)
    unit = np.where(lengths > 0.0, rotations / np.where(lengths > 0.0, lengths, 1.0), [0.0, 0.0, 0.0, 1.0])
    x, y, z, w = unit.T
    turned = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrices = np.tile(np.eye(4), (len(translations), 1, 1))
    matrices[:, :3, :3] = np.moveaxis(turned, 2, 0) * scales[:, None, :]
    matrices[:, :3, 3] = translations
    return matrices


def instance_matrices(file: GltfFile, accessors: GltfAccessors, node: Node) -> NDArray[np.float64] | None:
    """Where ``EXT_mesh_gpu_instancing`` puts a node's mesh, shape (n, 4, 4), or ``None`` where it has none.

    Raises:
        InputError: its attributes do not have the same number of elements.
    """
    instancing = node.extensions.EXT_mesh_gpu_instancing
    if instancing is None:
        return None
    defaults = {"TRANSLATION": [0.0, 0.0, 0.0], "ROTATION": [0.0, 0.0, 0.0, 1.0], "SCALE": [1.0, 1.0, 1.0]}
    named = {name: index for name, index in instancing.attributes.items() if name in defaults}
    counts = {accessors.count(index) for index in instancing.attributes.values()}
    if len(counts) > 1:
        raise InputError(f"{file.path}: EXT_mesh_gpu_instancing has attributes with different counts of instances")
    if not named:
        return np.tile(np.eye(4), (min(counts, default=1), 1, 1)) if counts else np.eye(4)[None]
    columns = {
        name: accessors.floats(named[name], len(default)) if name in named else np.tile(default, (min(counts), 1))
        for name, default in defaults.items()
    }
    return trs_matrices(columns["TRANSLATION"], columns["ROTATION"], columns["SCALE"])

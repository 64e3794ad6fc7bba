"""Values at the vertices of a refined mesh, laid out as regular grids on larger triangles.

Rays are traced the faster the fewer triangles they may meet, and what they meet is looked up the faster the closer it
lies together. Halving edges puts all vertices on regular grids of the faces that were halved, so that nothing is lost.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

from lightdepth.parameters.recovery import DEFAULT, RecoveryParameters
from lightdepth.recovery.mesh_refinement import RefinedMesh

FINEST = 1 << 20
"""Parts of an edge beyond which no halving goes."""


@dataclass(frozen=True)
class Grids:
    """Grids on the faces of a mesh, for values at the vertices of one that was refined from it, or of itself.

    Attributes:
        mesh: the coarser one.
        divisions: into how many parts each face's grid divides its edges, shape (m,), uint32.
        first_node: where the nodes of each face begin, shape (m,), uint32.
        interpolation: from values at the finer mesh's vertices to values at the nodes, shape (k, n).
    """

    mesh: RefinedMesh
    divisions: NDArray[np.uint32]
    first_node: NDArray[np.uint32]
    interpolation: csr_array

    def at_nodes(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Values at the finer mesh's vertices, shape (n, 3), as values at the nodes, shape (k, 3)."""
        return np.asarray(self.interpolation @ values, np.float32)

    def of_faces(self, chosen: NDArray[np.bool_]) -> Grids:
        """Those of some of the coarser mesh's faces; all nodes stay."""
        mesh = replace(
            self.mesh, **{name: getattr(self.mesh, name)[chosen] for name in ("faces", "parent", "places", "piece_of")}
        )
        return replace(self, mesh=mesh, divisions=self.divisions[chosen], first_node=self.first_node[chosen])


def lay_out(finest: RefinedMesh, parameters: RecoveryParameters = DEFAULT) -> Grids:
    """Grids for values at the vertices of a mesh, on that of the meshes it was refined from which costs least.

    Larger triangles are fewer and share more of their nodes, but where a part of one is fine, all of it has to be.
    """
    if finest.coarser is None:  # A scan, perhaps of millions of faces.
        corners = finest.faces.reshape(-1)
        each, shape = np.arange(len(corners) + 1, dtype=np.int32), (len(corners), len(finest.points))
        themselves = csr_array((np.ones(len(corners), np.float32), corners, each), shape)
        first = each[:-1:3].astype(np.uint32)
        return Grids(finest, np.ones_like(first), first, themselves)
    mesh, block = finest, np.arange(len(finest.faces))
    best: tuple[RefinedMesh, NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]] | None = None
    least = np.inf
    while True:
        steps, divisions = _on_grid(finest, mesh, block)
        cost = int(_count(divisions).sum()) + parameters.triangle_cost * len(divisions)
        if cost < least:
            best, least = (mesh, block, steps, divisions), cost
        if mesh.coarser is None or cost > parameters.far_from_best * least:
            break
        mesh, block = mesh.coarser, mesh.piece_of[block]
    assert best is not None
    mesh, block, steps, divisions = best
    counts = _count(divisions)
    first_node = np.cumsum(counts) - counts
    interpolation = _interpolation(finest, steps, divisions[block], first_node[block], int(counts.sum()))
    return Grids(mesh, divisions.astype(np.uint32), first_node.astype(np.uint32), interpolation)


def _count(divisions: NDArray[np.int64]) -> NDArray[np.int64]:
    """Nodes of grids."""
    return (divisions + 1) * (divisions + 2) // 2


def _on_grid(
    fine: RefinedMesh, coarse: RefinedMesh, block: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Where the corners of faces are on the coarsest grids that have all of them.

    Args:
        fine: the faces.
        coarse: the mesh whose faces carry the grids.
        block: its face that each face is a piece of, shape (m,).

    Returns:
        Steps along the grids' first and second edge, shape (m, 3, 2), and the grids' divisions.
    """
    first = coarse.places[:, 0]
    (a, b), (c, d) = (coarse.places[:, 1] - first).T, (coarse.places[:, 2] - first).T
    offset = fine.places - first[block][:, None]
    # Halves of halves: all of this is exact.
    inverse = (FINEST / (a * d - b * c) * np.stack([d, -c, -b, a]))[:, block, None]
    steps = np.empty(offset.shape, np.int64)
    for axis in range(2):
        steps[..., axis] = np.rint(inverse[2 * axis] * offset[..., 0] + inverse[2 * axis + 1] * offset[..., 1])
    of_block = np.full(len(coarse.faces), FINEST, np.int64)
    np.bitwise_or.at(of_block, block, np.bitwise_or.reduce(steps.reshape(-1, 6), axis=1))
    unit = of_block & -of_block
    steps //= unit[block][:, None, None]
    return steps, FINEST // unit


def _interpolation(
    fine: RefinedMesh,
    steps: NDArray[np.int64],
    divisions: NDArray[np.int64],
    first_node: NDArray[np.int64],
    nodes: int,
) -> csr_array:
    """Weights of the faces' corners at the nodes that lie in them, shape (nodes, vertices).

    Args:
        fine: the faces.
        steps: where their corners are on their grids, shape (m, 3, 2).
        divisions: of the grid that each face lies on, shape (m,).
        first_node: of that grid, shape (m,).
        nodes: of all grids.
    """
    # Of every node in the box around a face it is seen whether the face holds it.
    low = steps.min(axis=1)
    columns, rows = (steps.max(axis=1) - low + 1).T
    face = np.repeat(np.arange(len(steps)), columns * rows)
    index = np.arange(len(face)) - np.repeat(np.cumsum(columns * rows) - columns * rows, columns * rows)
    x, y = low[face, 0] + index % columns[face], low[face, 1] + index // columns[face]
    corner = steps[face]
    weights = np.stack([_doubled_area(corner[:, k - 2], corner[:, k - 1], x, y) for k in range(3)], axis=1)
    whole = weights.sum(axis=1)
    inside = (weights * np.sign(whole)[:, None] >= 0).all(axis=1)
    face, x, y, weights, whole = face[inside], x[inside], y[inside], weights[inside], whole[inside]
    node = first_node[face] + x + y * (2 * divisions[face] + 3 - y) // 2
    shared = np.bincount(node, minlength=nodes)[node]  # By faces that meet there, which agree.
    value = (weights / (whole * shared)[:, None]).reshape(-1)
    return coo_array(
        (value, (np.repeat(node, 3), fine.faces[face].reshape(-1))), shape=(nodes, len(fine.points))
    ).tocsr()


def _doubled_area(
    start: NDArray[np.int64], end: NDArray[np.int64], x: NDArray[np.int64], y: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Twice the signed area of triangles, exactly; two corners have shape (n, 2)."""
    return (end[:, 0] - start[:, 0]) * (y - start[:, 1]) - (end[:, 1] - start[:, 1]) * (x - start[:, 0])

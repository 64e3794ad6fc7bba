"""Conforming refinement of triangle meshes: marked edges are halved and no hanging vertex is left."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Edges:
    """The edges of a mesh.

    Attributes:
        ends: the two vertices of each edge, shape (e, 2), the smaller index first.
        of_face: the edges of each face, opposite to its corners 2, 0, 1 (so edge k joins corners k and k + 1),
            shape (m, 3).
    """

    ends: NDArray[np.int64]
    of_face: NDArray[np.int64]


def find_edges(faces: NDArray[np.int32]) -> Edges:
    """Number the edges of triangles of shape (m, 3)."""
    pairs = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2).astype(np.int64)
    pairs.sort(axis=1)
    ends, of_face = np.unique(pairs, axis=0, return_inverse=True)
    return Edges(ends, of_face.reshape(-1, 3))


def close_marks(edges: Edges, lengths: NDArray[np.float64], marked: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Mark the longest edge of every face that has a marked edge, which keeps triangles from becoming slivers."""
    marked = marked.copy()
    longest = edges.of_face[np.arange(len(edges.of_face)), np.argmax(lengths[edges.of_face], axis=1)]
    while True:
        wanted = longest[marked[edges.of_face].any(axis=1)]
        if marked[wanted].all():
            return marked
        marked[wanted] = True


def split_edges(
    faces: NDArray[np.int32], edges: Edges, lengths: NDArray[np.float64], middle: NDArray[np.int64]
) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Split every face at the middles of its marked edges.

    Args:
        faces: shape (m, 3).
        edges: their edges, with marks closed by :func:`close_marks`.
        lengths: of the edges.
        middle: index of the new vertex in the middle of each edge, or -1 where it is not split, shape (e,).

    Returns:
        ``(faces, parent)``: the new faces, shape (k, 3), and the index of the face that each came from.
    """
    # Turn each face so that its longest edge, which is marked if any is, joins corners 0 and 1.
    turn = np.argmax(lengths[edges.of_face], axis=1)
    order = (turn[:, None] + np.arange(3)) % 3
    corners = np.take_along_axis(faces.astype(np.int64), order, axis=1)
    a, b, c = corners.T
    ab, bc, ca = middle[np.take_along_axis(edges.of_face, order, axis=1)].T
    parent = np.arange(len(faces))
    whole = ab < 0
    groups = [(whole, [(a, b, c)])]
    split_bc, split_ca = bc >= 0, ca >= 0
    groups.append((~whole & ~split_bc & ~split_ca, [(a, ab, c), (ab, b, c)]))
    groups.append((~whole & split_bc & ~split_ca, [(a, ab, c), (ab, b, bc), (ab, bc, c)]))
    groups.append((~whole & ~split_bc & split_ca, [(ab, b, c), (a, ab, ca), (ab, c, ca)]))
    groups.append((~whole & split_bc & split_ca, [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]))
    new_faces, parents = [], []
    for chosen, pieces in groups:
        for piece in pieces:
            new_faces.append(np.stack(piece, axis=1)[chosen])
            parents.append(parent[chosen])
    return np.concatenate(new_faces).astype(np.int32), np.concatenate(parents)

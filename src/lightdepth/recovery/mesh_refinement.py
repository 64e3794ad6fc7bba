"""Conforming refinement of triangle meshes: marked edges are halved and no hanging vertex is left."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lightdepth.scene.meshes.geometry import face_normals


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
    """Index the edges of triangles of shape (m, 3)."""
    pairs = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2).astype(np.int64)
    pairs.sort(axis=1)
    # One key per edge sorts many times faster than pairs do.
    count = int(faces.max(initial=0)) + 1
    key, of_face = np.unique(pairs[:, 0] * count + pairs[:, 1], return_inverse=True)
    return Edges(np.stack([key // count, key % count], axis=1), of_face.reshape(-1, 3))


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
    faces: NDArray[np.int32],
    places: NDArray[np.float64],
    edges: Edges,
    lengths: NDArray[np.float64],
    middle: NDArray[np.int64],
) -> tuple[NDArray[np.int32], NDArray[np.float64], NDArray[np.int64]]:
    """Split every face at the middles of its marked edges.

    Args:
        faces: shape (m, 3).
        places: where their corners are, in coordinates of any kind, shape (m, 3, d).
        edges: their edges, with marks closed by :func:`close_marks`.
        lengths: of the edges.
        middle: index of the new vertex in the middle of each edge, or -1 where it is not split, shape (e,).

    Returns:
        ``(faces, places, piece_of)``: the new faces, shape (k, 3), where their corners are, and the index of the face
        that each is a piece of.
    """
    # Turn each face so that its longest edge, which is marked if any is, joins corners 0 and 1.
    turn = np.argmax(lengths[edges.of_face], axis=1)
    order = (turn[:, None] + np.arange(3)) % 3
    middles = middle[np.take_along_axis(edges.of_face, order, axis=1)]
    vertices = np.concatenate([np.take_along_axis(faces, order, axis=1), middles], axis=1)
    corners = np.take_along_axis(places, order[..., None], axis=1)
    places = np.concatenate([corners, 0.5 * (corners + np.roll(corners, -1, axis=1))], axis=1)
    split_ab, split_bc, split_ca = (middles >= 0).T
    a, b, c, ab, bc, ca = range(6)
    groups = (
        (~split_ab, [(a, b, c)]),
        (split_ab & ~split_bc & ~split_ca, [(a, ab, c), (ab, b, c)]),
        (split_ab & split_bc & ~split_ca, [(a, ab, c), (ab, b, bc), (ab, bc, c)]),
        (split_ab & ~split_bc & split_ca, [(ab, b, c), (a, ab, ca), (ab, c, ca)]),
        (split_ab & split_bc & split_ca, [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]),
    )
    pieces = [(np.flatnonzero(chosen), piece) for chosen, cut in groups for piece in cut]
    return (
        np.concatenate([vertices[chosen][:, piece] for chosen, piece in pieces]).astype(np.int32),
        np.concatenate([places[chosen][:, piece] for chosen, piece in pieces]),
        np.concatenate([chosen for chosen, _ in pieces]),
    )


@dataclass(frozen=True)
class RefinedMesh:
    """Triangles that are refined, with what each came from.

    Attributes:
        points: where the vertices were when they were photographed, shape (n, 3), float32, world, metres.
        vertices: where they are, likewise.
        faces: shape (m, 3), int32.
        parent: index of the face of the first mesh that each face is a piece of, shape (m,).
        places: where each face's corners are in that face: weights of its second and third vertex, shape (m, 3, 2).
        coarser: the mesh that this one was refined from, or ``None``; it has the first of its points.
        piece_of: index of the face of that mesh that each face is a piece of, shape (m,).
    """

    points: NDArray[np.float32]
    vertices: NDArray[np.float32]
    faces: NDArray[np.int32]
    parent: NDArray[np.int64]
    places: NDArray[np.float64]
    coarser: RefinedMesh | None
    piece_of: NDArray[np.int64]

    @classmethod
    def unrefined(
        cls, points: NDArray[np.float32], vertices: NDArray[np.float32], faces: NDArray[np.int32]
    ) -> RefinedMesh:
        """A first mesh."""
        each = np.arange(len(faces))
        places = np.broadcast_to([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], (len(faces), 3, 2))
        return cls(points, vertices, faces, each, places, None, each)

    def lengths(self, edges: Edges) -> NDArray[np.float64]:
        """Of the edges, metres, shape (e,)."""
        ends = edges.ends
        return np.asarray(np.linalg.norm(self.points[ends[:, 0]] - self.points[ends[:, 1]], axis=1), np.float64)

    def middles(self, edges: Edges, inward: float) -> NDArray[np.float32]:
        """Of the edges, world, metres, shape (e, 3); where light is estimated, and so moved as :meth:`inside` has it."""
        middle = self.points[edges.ends].mean(axis=1, dtype=np.float64)
        total, count = np.zeros(middle.shape), np.zeros(len(middle))
        centre = self.points[self.faces].mean(axis=1)
        for side in range(3):
            np.add.at(total, edges.of_face[:, side], centre)
            np.add.at(count, edges.of_face[:, side], 1.0)
        return np.asarray(middle + inward * (total / np.maximum(count, 1.0)[:, None] - middle), np.float32)

    def vertex_normals(self) -> NDArray[np.float32]:
        """Normal at each vertex, that of any of its faces, which must agree; 0 at vertices without faces."""
        normals = np.zeros_like(self.points)
        for corner in range(3):
            normals[self.faces[:, corner]] = face_normals(self.points, self.faces)
        return normals

    def inside(self, inward: float) -> NDArray[np.float32]:
        """Vertices moved a little into their faces, so that none lies exactly in the plane of a neighbouring wall.

        Args:
            inward: share of the way to the middle of the faces around.
        """
        total, count = np.zeros(self.points.shape), np.zeros(len(self.points))
        centre = self.points[self.faces].mean(axis=1)
        for corner in range(3):
            np.add.at(total, self.faces[:, corner], centre)
            np.add.at(count, self.faces[:, corner], 1.0)
        toward = np.where(count[:, None] > 0, total / np.maximum(count, 1)[:, None] - self.points, 0.0)
        return (self.points + inward * toward).astype(np.float32)

    def halved(self, edges: Edges, lengths: NDArray[np.float64], marked: NDArray[np.bool_]) -> RefinedMesh:
        """The mesh whose faces are split at the middles of marked edges, which become vertices in the order of the edges.

        Args:
            edges: of this mesh.
            lengths: of the edges.
            marked: which edges to halve, as :func:`close_marks` gives them.
        """
        middle = np.full(len(edges.ends), -1, np.int64)
        middle[marked] = len(self.points) + np.arange(int(marked.sum()))
        faces, places, piece_of = split_edges(self.faces, self.places, edges, lengths, middle)
        ends = edges.ends[marked]
        points = np.concatenate([self.points, self.points[ends].mean(axis=1).astype(np.float32)])
        vertices = np.concatenate([self.vertices, self.vertices[ends].mean(axis=1).astype(np.float32)])
        return RefinedMesh(points, vertices, faces, self.parent[piece_of], places, self, piece_of)

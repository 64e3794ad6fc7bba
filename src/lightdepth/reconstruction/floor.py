"""The floor in measured points: found by RANSAC, then made a flat surface of its own.

Fischler and Bolles, Random Sample Consensus, 1981.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

from lightdepth.errors import InputError, warn
from lightdepth.parameters.reconstruction import DEFAULT, FloorParameters, ReconstructionParameters
from lightdepth.reconstruction.pose import Pose
from lightdepth.reconstruction.simplification import simplified
from lightdepth.scene.model import Mesh

FloatArray = NDArray[np.float64]

UNITS = {"feet": 3.2808, "inches": 39.37, "centimetres": 100.0, "millimetres": 1000.0}
"""What other programs than ours may count in, units in a metre."""
LAID_FLAT = 1e-4
"""Metres that a vertex laid onto the floor is off by rounding, at most."""


@dataclass(frozen=True)
class Plane:
    """The points x with ``normal . x = offset``.

    Attributes:
        normal: unit, upward, world, shape (3,), float64.
        offset: metres.
        share: part of the points that were looked at that lie on it, in [0, 1].
    """

    normal: FloatArray
    offset: float
    share: float

    def heights(self, points: FloatArray) -> FloatArray:
        """Signed distances of points of shape (n, 3) from the plane, metres, positive above it."""
        return points @ self.normal - self.offset

    @property
    def tilt(self) -> float:
        """Angle to the horizontal, degrees."""
        return float(np.degrees(np.arccos(np.clip(self.normal[2], -1.0, 1.0))))


def warn_of_height(path: Path, floor: Plane | None, pose: Pose, tuned: FloorParameters = DEFAULT.floor) -> None:
    """Warn where the floor lies as far below the lens as if the file's unit were another than was taken.

    Args:
        path: the file, for messages.
        floor: as found; ``None`` where none was asked for.
        pose: of the panorama, whose height is usually that above the floor.
        tuned: how high a lens may be.
    """
    if floor is None:
        return
    stated = float(pose.position[2])
    above = float(floor.heights(pose.position[None])[0])
    low, high = 1.0 - tuned.same_unit, 1.0 + tuned.same_unit
    unit = next((name for name, units in UNITS.items() if stated > 0.2 and low < above / stated / units < high), None)
    if unit is not None:
        warn(
            f"{path}: its floor lies {above:.4g} m below the lens, and the pose has the lens {stated:.3g} m above the "
            f"origin; if the file is in {unit}, --scale {1.0 / UNITS[unit]:.4g} converts it"
        )
    elif above > tuned.highest:
        warn(f"{path}: its floor lies {above:.4g} m below the lens; if the file is not in metres, --scale converts it")


def find_floor(
    points: FloatArray,
    capture_point: FloatArray,
    tolerance: float = 0.03,
    tuned: FloorParameters = DEFAULT.floor,
    seed: int = 0,
) -> Plane:
    """Find the lowest large, nearly level plane below the capture point.

    Args:
        points: spread evenly over the surfaces, world, metres, shape (n, 3).
        capture_point: world, metres, shape (3,).
        tolerance: largest distance of a point that is on the plane, metres.
        tuned: how it is found.
        seed: of the random trials.

    Raises:
        InputError: no such plane holds ``tuned.least_share`` of the points.
    """
    random = np.random.default_rng(seed)
    if len(points) > tuned.points:
        points = points[random.choice(len(points), tuned.points, replace=False)]
    below = points[points[:, 2] < capture_point[2] - tuned.lower_step]
    floor = None
    while len(below) >= 3:
        found = _ransac(below, tolerance, tuned, random)
        needed = (tuned.least_share if floor is None else tuned.lower_share * floor.share) * len(points)
        if found is None:
            break
        heights = np.abs(found.heights(points))
        on_plane, beside = np.count_nonzero(heights < tolerance), np.count_nonzero(heights < 2.0 * tolerance)
        # A level slice through walls holds no more points than the slices beside it.
        if on_plane < max(needed, tuned.fewest_points) or on_plane < tuned.contrast * (beside - on_plane):
            break
        floor = Plane(found.normal, found.offset, on_plane / len(points))
        below = below[floor.heights(below) < -tuned.lower_step]
    if floor is None:
        raise InputError(
            f"no floor found: no plane below the capture point (height {capture_point[2]:.2f} m) that is level within "
            f"{tuned.largest_tilt:g} degrees holds {100.0 * tuned.least_share:g} % of the points; check the pose, the "
            "scale and which axis is up, or ask for no floor"
        )
    return floor


def _ransac(points: FloatArray, tolerance: float, tuned: FloorParameters, random: np.random.Generator) -> Plane | None:
    """The nearly level plane with the most points, fitted to them by least squares."""
    smallest_cosine = np.cos(np.radians(tuned.largest_tilt))
    corners = points[random.integers(len(points), size=(tuned.trials, 3))]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    normals[lengths > 0] /= lengths[lengths > 0, None]
    normals[normals[:, 2] < 0] *= -1.0
    # Three noisy points close together determine their height well and their slope badly: each is also tried as level.
    normals = np.concatenate([normals, np.broadcast_to([0.0, 0.0, 1.0], normals.shape)])
    offsets = np.einsum("ij,ij->i", normals, np.tile(corners[:, 0], (2, 1)))
    level = normals[:, 2] >= smallest_cosine
    if not level.any():
        return None
    normals, offsets = normals[level], offsets[level]
    counts = [np.count_nonzero(np.abs(points @ n - d) < tolerance) for n, d in zip(normals, offsets, strict=True)]
    best = int(np.argmax(counts))
    normal, offset = normals[best], offsets[best]
    for _ in range(3):
        on_plane = points[np.abs(points @ normal - offset) < tolerance]
        centre = on_plane.mean(axis=0)
        fitted = np.linalg.eigh(np.cov((on_plane - centre).T))[1][:, 0] if len(on_plane) > 3 else normal
        fitted = fitted * (np.sign(fitted[2]) or 1.0)
        if fitted[2] < smallest_cosine:
            break
        normal, offset = fitted, float(fitted @ centre)
    return Plane(normal, offset, 0.0)


def split_floor(
    mesh: Mesh,
    floor: Plane,
    tolerance: float = 0.03,
    most_faces: int | None = None,
    tuned: ReconstructionParameters = DEFAULT,
) -> tuple[Mesh, Mesh]:
    """Part a mesh into its floor, laid flat onto the plane, and the rest.

    The two still meet without a gap: the vertices that they share are moved in both.

    Args:
        mesh: world, metres.
        floor: its floor plane.
        tolerance: largest distance of a floor vertex from the plane, metres.
        most_faces: of both together, which are simplified to these; ``None`` keeps all.
        tuned: what can be laid flat, and how far surfaces may move.

    Returns:
        The floor and the rest; either may have no faces.
    """
    vertices = mesh.vertices.astype(np.float64)
    heights = floor.heights(vertices)
    near = np.abs(heights) < tolerance
    on_floor = np.asarray(
        near[mesh.faces].all(axis=1) & _is_flat(vertices, mesh.faces, floor, tuned.floor.flattest), dtype=bool
    )
    used = np.unique(mesh.faces[on_floor])
    vertices[used] -= heights[used, None] * floor.normal
    flat = Mesh(vertices.astype(np.float32), mesh.faces)
    if most_faces is not None:
        flat = simplified(flat, most_faces, tuned.depth.unseen_error)
        vertices = flat.vertices.astype(np.float64)
        near = np.abs(floor.heights(vertices)) < LAID_FLAT
        on_floor = np.asarray(near[flat.faces].all(axis=1), dtype=bool)
    return part_of(flat, on_floor), part_of(flat, ~on_floor)


def _is_flat(vertices: FloatArray, faces: NDArray[np.int32], floor: Plane, flattest: float) -> NDArray[np.bool_]:
    """Whether each face can be laid onto the floor, shape (m,)."""
    one, two, three = (vertices[faces[:, corner]] for corner in range(3))
    normals = np.cross(two - one, three - one)
    return np.abs(normals @ floor.normal) > flattest * np.linalg.norm(normals, axis=1)


def part_of(mesh: Mesh, chosen: NDArray[np.bool_]) -> Mesh:
    """The faces where a mask of shape (m,) is true, with only the vertices that they use."""
    faces = mesh.faces[chosen]
    used, compact = np.unique(faces, return_inverse=True)
    return Mesh(mesh.vertices[used], compact.reshape(faces.shape).astype(np.int32))


def spread_points(mesh: Mesh, count: int = DEFAULT.floor.points, seed: int = 0) -> FloatArray:
    """Points spread evenly over a mesh's area, shape (count, 3)."""
    surface = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    points, _ = trimesh.sample.sample_surface(surface, count, seed=seed)
    return np.asarray(points, dtype=np.float64)

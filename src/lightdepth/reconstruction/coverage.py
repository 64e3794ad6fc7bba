"""Does every direction from the capture point hit something? And what it hits first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy import ndimage

from lightdepth.directions import pixel_directions, pixel_solid_angles
from lightdepth.kernel.raycasting import Hits, RayCaster
from lightdepth.parameters.reconstruction import DEFAULT, ReviewParameters
from lightdepth.reconstruction.pose import Pose
from lightdepth.regions import connected_regions
from lightdepth.scene.model import Mesh, RealSurface, Role


@dataclass(frozen=True)
class Coverage:
    """Shares of the sphere of directions around the capture point; the three sum to 1.

    Attributes:
        hit: part that meets a surface.
        sky: part that meets none and is declared sky.
        open: part that meets none though it should.
        hole: middle of the largest open region, degrees to the right of the panorama's centre and above its horizon;
            ``None`` where nothing is open.
        hole_share: part of the sphere that this region takes.
    """

    hit: float
    sky: float
    open: float
    hole: tuple[float, float] | None = None
    hole_share: float = 0.0

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        hole = None if self.hole is None else {"right": self.hole[0], "up": self.hole[1], "share": self.hole_share}
        return {"hit": self.hit, "sky": self.sky, "open": self.open, "largest_hole": hole}


def view(surfaces: Sequence[RealSurface], pose: Pose, height: int) -> Hits:
    """What the pixels of a panorama of ``height`` rows meet first, in their order, row by row."""
    directions = pose.to_world(pixel_directions(height, 2 * height).reshape(-1, 3))
    return RayCaster([surface.mesh for surface in surfaces]).cast(pose.position, directions)


def measure_coverage(
    surfaces: Sequence[RealSurface],
    pose: Pose,
    sky: NDArray[np.bool_] | bool = False,
    tuned: ReviewParameters = DEFAULT.review,
) -> Coverage:
    """Cast a ray in every direction.

    Args:
        surfaces: of the place.
        pose: of the panorama.
        sky: what is declared sky: a mask of shape (height, 2 height), everything that meets nothing, or nothing.
        tuned: how many rays are cast.
    """
    height = tuned.coverage_rows
    missed = ~np.isfinite(view(surfaces, pose, height).distance).reshape(height, 2 * height)
    if isinstance(sky, np.ndarray):
        rows = (np.arange(height) * len(sky)) // height
        columns = (np.arange(2 * height) * sky.shape[1]) // (2 * height)
        # The cut between a surface and the sky belongs to the sky.
        margin = 1 + -(-height // len(sky))
        wrapped = np.pad(sky[np.ix_(rows, columns)], ((0, 0), (margin, margin)), mode="wrap")
        declared = ndimage.binary_dilation(wrapped, np.ones((3, 3)), iterations=margin)[:, margin:-margin]
    else:
        declared = np.full(missed.shape, sky)
    weights = np.repeat(pixel_solid_angles(height, 2 * height)[:, None], 2 * height, axis=1) / (4.0 * np.pi)
    gaps = missed & ~declared
    hit, beyond = float(weights[~missed].sum()), float(weights[missed & declared].sum())
    if not gaps.any():
        return Coverage(hit, beyond, 0.0)
    regions, count = connected_regions(gaps)
    shares = ndimage.sum_labels(weights, regions, np.arange(1, count + 1))
    largest = regions == 1 + int(np.argmax(shares))
    middle = np.einsum("ij,ijk->k", weights * largest, pixel_directions(height, 2 * height))
    right, up = np.degrees(np.arctan2(middle[0], middle[1])), np.degrees(np.arctan2(middle[2], np.hypot(*middle[:2])))
    return Coverage(hit, beyond, float(weights[gaps].sum()), (float(right), float(up)), float(shares.max()))


def enclosing_shell(
    surfaces: Sequence[RealSurface], pose: Pose, tuned: ReviewParameters = DEFAULT.review
) -> RealSurface:
    """A box around everything, faces inward, that closes what the surfaces leave open.

    Args:
        surfaces: of the place.
        pose: of the panorama; the capture point is inside as well.
        tuned: how far outside of them it is.
    """
    points = np.concatenate([pose.position[None], *(surface.mesh.vertices for surface in surfaces)])
    low, high = points.min(axis=0), points.max(axis=0)
    room = max(tuned.shell_margin, tuned.shell_share * float((high - low).max()))
    box = trimesh.creation.box(bounds=[low - room, high + room])
    mesh = Mesh(np.asarray(box.vertices, dtype=np.float32), np.asarray(box.faces[:, ::-1], dtype=np.int32))
    return RealSurface("shell", mesh, Role.ENVIRONMENT)

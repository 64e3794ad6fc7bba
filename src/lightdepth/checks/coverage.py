"""How much of what the panorama shows has geometry, and where the largest hole is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lightdepth.checks.problem import Problem, Severity
from lightdepth.checks.sampling import unseen_shares
from lightdepth.checks.view import CaptureView
from lightdepth.parameters.checks import DEFAULT, ChecksParameters
from lightdepth.regions import connected_regions
from lightdepth.scene.model import Scene


@dataclass(frozen=True)
class Hole:
    """A connected region of directions without geometry.

    Attributes:
        share: of all directions, in [0, 1].
        azimuth: of its middle, degrees, 0 at the panorama's centre column, growing to the right.
        elevation: of its middle, degrees above the panorama's horizon.
        row: the panorama's pixel there; ``None`` where its image could not be read.
        column: likewise.
        direction: the same in world space, unit.
    """

    share: float
    azimuth: float
    elevation: float
    row: int | None
    column: int | None
    direction: tuple[float, float, float]


@dataclass(frozen=True)
class Coverage:
    """What the capture point sees of the real geometry.

    Attributes:
        share: directions in which it sees a real surface, as a share of all, in [0, 1]; weighted by solid angle.
        sky: directions that meet none and are declared sky, as a share of all, in [0, 1].
        by_surface: as ``share``, for each real surface by its name.
        unseen: share of the area that no photograph sees, in [0, 1], for each real surface by its name.
        largest_hole: of the directions that meet none and are not sky; ``None`` where there is none.
    """

    share: float
    sky: float
    by_surface: Mapping[str, float]
    unseen: Mapping[str, float]
    largest_hole: Hole | None


def measure_coverage(view: CaptureView, scene: Scene, views: Sequence[CaptureView] = ()) -> Coverage:
    """Measure the coverage of the real meshes, or of the depth image where the scene has no meshes.

    Args:
        view: of the capture point whose coverage it is.
        scene: the scene.
        views: of all capture points; by default that one's alone.
    """
    missing = view.surface < 0
    sky = scene.panorama.sky
    depth = scene.panorama.depth
    if not scene.real and depth is not None:
        rows = (np.arange(missing.shape[0]) * depth.shape[0]) // missing.shape[0]
        columns = (np.arange(missing.shape[1]) * depth.shape[1]) // missing.shape[1]
        missing, sky = ~np.isfinite(depth[np.ix_(rows, columns)]), True
    uncovered = view.share(missing)
    return Coverage(
        share=1.0 - uncovered,
        sky=uncovered if sky else 0.0,
        by_surface={name: view.share(view.surface == index) for index, name in enumerate(view.names)},
        unseen=unseen_shares(scene, views or [view]),
        largest_hole=None if sky else _largest_hole(view, missing, scene.panorama.radiance.shape[0]),
    )


def hole_problems(coverage: Coverage, unread: int = 0, tuned: ChecksParameters = DEFAULT) -> list[Problem]:
    """Tell of holes: light that comes from a surface would be placed infinitely far away.

    Args:
        coverage: of the real surfaces that are there.
        unread: how many further ones could not be read.
        tuned: what is a hole.
    """
    hole = coverage.largest_hole
    if hole is None or 1.0 - coverage.share < tuned.smallest_hole:
        return []
    x, y, z = hole.direction
    pixel = "" if hole.row is None else f"row {hole.row}, column {hole.column}; "
    without = f", without {_surfaces(unread)} that could not be read," if unread else ""
    return [
        Problem(
            Severity.WARNING if hole.share < tuned.smallest_hole else Severity.ERROR,
            f"[[real]]: {_percent(1.0 - coverage.share)} of all directions{without} hit no real surface; the largest "
            f"hole ({_percent(hole.share)}) is around azimuth {hole.azimuth:.1f}, elevation {hole.elevation:.1f} "
            f"degrees of the panorama ({pixel}world direction {x:.3f} {y:.3f} {z:.3f}). Close it with a mesh; where "
            "nothing but sky is left open, write `sky = true` in [panorama]",
        )
    ]


def _largest_hole(view: CaptureView, missing: NDArray[np.bool_], panorama_height: int) -> Hole | None:
    if not missing.any():
        return None
    regions, _ = connected_regions(missing)
    shares = np.bincount(regions.ravel(), weights=np.broadcast_to(view.solid_angles, regions.shape).ravel())
    shares[0] = 0.0
    inside = regions == np.argmax(shares)
    weights = np.broadcast_to(view.solid_angles, inside.shape)[inside]
    centre = weights @ view.directions[inside]
    # The middle of a ring lies outside it: take the pixel of the hole that is nearest to the middle.
    nearest = int(np.argmax(view.directions[inside] @ centre))
    row, column = np.argwhere(inside)[nearest]
    height, width = inside.shape
    x, y, z = view.directions[row, column].tolist()
    scale = panorama_height / height
    return Hole(
        share=float(shares.max()),
        azimuth=float(360.0 * ((column + 0.5) / width - 0.5)),
        elevation=float(90.0 - 180.0 * (row + 0.5) / height),
        row=int((row + 0.5) * scale) if panorama_height else None,
        column=int((column + 0.5) * scale) if panorama_height else None,
        direction=(x, y, z),
    )


def _surfaces(count: int) -> str:
    return f"{count} surface{'' if count == 1 else 's'}"


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %"

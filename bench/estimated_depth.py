"""Depth as a network estimates it, of places whose truth is known, and what `reconstruct from-depth` makes of it.

``python -m bench.estimated_depth``. The estimate is a place's exact distances, blurred, with a smooth relative error, and
in an unknown unit: as distances, or as disparity (reciprocal distance) with an unknown shift as well.
"""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from bench.places import PLACES, Place
from lightdepth import api
from lightdepth.directions import euler_rotation, pixel_directions, pixel_solid_angles
from lightdepth.kernel.raycasting import RayCaster
from lightdepth.reconstruction.coverage import enclosing_shell
from lightdepth.reconstruction.from_estimate import surfaces_from_estimate
from lightdepth.reconstruction.pose import Pose
from lightdepth.scene.model import Mesh, RealSurface

FloatArray = NDArray[np.float64]

UNIT = 0.37
SHIFT = 0.2
"""Of disparity, as a share of its median."""
BLUR = 1.0 / 512.0
"""Standard deviation of the blur as a share of the panorama's width: two pixels of 1024."""
ERROR = 0.05
"""Standard deviation of the relative error over all directions."""
DEGREE = 4
"""Of the spherical harmonics that the error is made of."""


def pose_of(place: Place) -> Pose:
    """The pose of a place's panorama."""
    return Pose(np.asarray(place.position, dtype=np.float64), euler_rotation(place.rotation))


def exact_depth(place: Place, width: int) -> FloatArray:
    """Distances along the rays of a place's panorama, metres, shape (width / 2, width)."""
    pose = pose_of(place)
    directions = pose.to_world(pixel_directions(width // 2, width).reshape(-1, 3))
    hits = RayCaster([part.mesh for part in place.parts]).cast(pose.position, directions)
    return hits.distance.reshape(width // 2, width).astype(np.float64)


def smooth_error(height: int, seed: int) -> FloatArray:
    """A smooth random field with mean 0 and standard deviation 1 over the sphere, shape (height, 2 height)."""
    random = np.random.default_rng(seed)
    x, y, z = np.moveaxis(pixel_directions(height, 2 * height), -1, 0)
    field = np.zeros(x.shape)
    for _ in range(24):
        axis = random.normal(size=3)
        axis /= np.linalg.norm(axis)
        along = axis[0] * x + axis[1] * y + axis[2] * z
        field += random.normal() * np.polynomial.legendre.legval(
            along, [0.0] * int(random.integers(1, DEGREE + 1)) + [1.0]
        )
    weights = np.repeat(pixel_solid_angles(height, 2 * height)[:, None], 2 * height, axis=1) / (4.0 * np.pi)
    field -= (weights * field).sum()
    return field / np.sqrt((weights * field**2).sum())


def estimated(depth: FloatArray, *, disparity: bool = False, seed: int = 0) -> FloatArray:
    """What a network would make of exact distances, in no known unit.

    Args:
        depth: metres, shape (height, 2 height).
        disparity: as reciprocal distances with a shift, scaled to [0, 1].
        seed: of the smooth error.
    """
    height = len(depth)
    values = 1.0 / depth if disparity else depth
    values = gaussian_filter(values, BLUR * 2 * height, mode=("nearest", "wrap"))
    values = values * np.exp(ERROR * smooth_error(height, seed))
    if not disparity:
        return UNIT * values
    values = values + SHIFT * np.median(values)
    return (values - values.min()) / (values.max() - values.min())


@dataclass(frozen=True)
class Outcome:
    """What came out for one place and kind of estimate.

    Attributes:
        place: its name.
        what: the kind.
        floor: largest distance of a floor vertex from the floor, metres.
        tilt: of the floor, degrees.
        wall: largest error of a large plane's distance from the capture point, as a share of it.
        typical: median relative error of all distances.
        most: the error that 95 % of all directions do not exceed.
        faces: of all surfaces.
    """

    place: str
    what: str
    floor: float
    tilt: float
    wall: float
    typical: float
    most: float
    faces: int


def outcome(name: str, what: str, width: int = 1024, seed: int = 1) -> tuple[Outcome, list[RealSurface]]:
    """Reconstruct a place of :data:`bench.places.PLACES` from an estimate and compare.

    Args:
        name: of the place.
        what: ``distances``, ``disparity``, or either with ``, 8 bit`` after it.
        width: of the depth image.
        seed: of the smooth error.
    """
    place = PLACES[name]()
    pose = pose_of(place)
    exact = exact_depth(place, width)
    values = estimated(exact, disparity=what.startswith("disparity"), seed=seed)
    if what.endswith("8 bit"):
        values = np.round(255.0 * (values - values.min()) / np.ptp(values))
    found = surfaces_from_estimate(values, pose, float(pose.position[2]), Path(name))
    surfaces = list(found.measured.surfaces)
    directions = pose.to_world(pixel_directions(width // 4, width // 2).reshape(-1, 3))
    rays = RayCaster([surface.mesh for surface in surfaces]).cast(pose.position, directions).distance
    truth = RayCaster([part.mesh for part in place.parts]).cast(pose.position, directions)
    error = np.abs(rays / truth.distance - 1.0)
    error = error[np.isfinite(error)]
    normals = np.abs(truth.normal)
    wall = 0.0
    for vector in found.planes.vectors[1:]:
        distance = 1.0 / float(np.linalg.norm(vector))
        # Where the plane's own normal is what the truth has as well, the truth says how far away that is.
        along = vector * distance
        same = (normals @ np.abs(along) > 0.97) & (np.abs(directions @ along) > 0.3)
        same &= directions @ along > 0.0
        far = truth.distance[same] * (directions[same] @ along)
        wall = max(wall, float(np.abs(far / distance - 1.0).min()))
    floor = surfaces[0].mesh
    result = Outcome(
        place=name,
        what=what,
        floor=float(np.abs(floor.vertices[:, 2]).max()),
        tilt=_tilt(floor),
        wall=wall,
        typical=float(np.median(error)),
        most=float(np.percentile(error, 95)),
        faces=sum(len(surface.mesh.faces) for surface in surfaces),
    )
    return result, surfaces


def _tilt(mesh: Mesh) -> float:
    points = mesh.vertices.astype(np.float64)
    normal = np.linalg.eigh(np.cov((points - points.mean(axis=0)).T))[1][:, 0]
    return float(np.degrees(np.arccos(min(1.0, abs(normal[2])))))


def preparation(place: Place, surfaces: list[RealSurface] | None) -> float:
    """Processor seconds for preparing a place as it is, or of these surfaces.

    Args:
        place: with its photograph.
        surfaces: instead of its own; ``None`` takes its own.
    """
    scene = place.scene(512, 16)
    if surfaces is not None:
        shell = enclosing_shell(surfaces, pose_of(place))
        scene = replace(scene, real=(*surfaces, shell))
    start = time.process_time()
    api._prepare(scene, "difference", False)
    return time.process_time() - start


def main() -> None:
    """Print the figures of docs/reconstruction.md."""
    for name in ("lamp_and_window", "l_shaped_room", "sunlit_room", "barred_windows"):
        for what in ("distances", "disparity", "disparity, 8 bit"):
            found, surfaces = outcome(name, what)
            print(
                f"| {name} | {what} | {1000 * found.floor:.1f} mm, {found.tilt:.2f} deg | {100 * found.wall:.2f} % | "
                f"{100 * found.typical:.2f} %, {100 * found.most:.2f} % | {found.faces} |",
                flush=True,
            )
    _, surfaces = outcome("l_shaped_room", "distances")
    place = PLACES["l_shaped_room"]()
    os.environ["LIGHTDEPTH_CACHE"] = "off"
    preparation(PLACES["lamp_and_window"](), None)  # Compiles the kernels.
    for what, real in (("clicked", None), ("estimated", surfaces)):
        print(f"preparing the {what} room: {preparation(place, real):.1f} processor seconds", flush=True)


if __name__ == "__main__":
    main()

"""Surfaces of a place from depth that a network estimated from the panorama."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from lightdepth.directions import direction_to_latlong, pixel_directions, pixel_solid_angles
from lightdepth.errors import InputError, warn
from lightdepth.lightmap.depth_mesh import mesh_from_depth
from lightdepth.parameters.reconstruction import DEFAULT, EstimateParameters, ReconstructionParameters
from lightdepth.reconstruction.depth_image import DepthImage, continued, reduced
from lightdepth.reconstruction.depth_unit import Estimate, Unit, solve_unit
from lightdepth.reconstruction.floor import Plane, part_of
from lightdepth.reconstruction.from_depth import SHELL_FACES, Measured
from lightdepth.reconstruction.pose import Pose
from lightdepth.reconstruction.room_planes import RoomPlanes, find_room_planes, nearest_planes
from lightdepth.reconstruction.simplification import simplified
from lightdepth.reconstruction.unseen_background import unseen_background
from lightdepth.scene.model import Mesh, RealSurface, Role

FloatArray = NDArray[np.float64]
Labels = NDArray[np.intp]


@dataclass(frozen=True)
class Estimated:
    """What was made of an estimate.

    Attributes:
        measured: the surfaces.
        unit: of the estimate.
        planes: of the room.
    """

    measured: Measured
    unit: Unit
    planes: RoomPlanes

    def as_dict(self) -> dict[str, object]:
        """For the report: the unit, the planes (unit normal into the world, distance in metres), and a sentence."""
        distances = 1.0 / np.linalg.norm(self.planes.vectors, axis=1)
        normals = self.planes.vectors * distances[:, None]
        ceilings = self.planes.ceilings
        names = ["floor", *["ceiling"] * ceilings, *["wall"] * (len(distances) - 1 - ceilings)]
        what = "disparity" if self.unit.kind == "disparity" else "distances"
        formula = f"{self.unit.scale:.4g} x value" + (f" {self.unit.shift:+.4g}" if self.unit.shift else "")
        walls = len(distances) - 1 - ceilings
        return {
            "kind": self.unit.kind,
            "scale": self.unit.scale,
            "shift": self.unit.shift,
            "planes": [
                {"what": name, "normal": [float(x) for x in normal], "distance": float(distance)}
                for name, normal, distance in zip(names, normals, distances, strict=True)
            ],
            "words": f"{what}, {formula} {'1/m' if self.unit.kind == 'disparity' else 'm'}; "
            f"{100.0 * self.unit.floor:.0f} % of what lies well below the horizon is floor; {ceilings} "
            f"{'ceiling' if ceilings == 1 else 'ceilings'} and {walls} {'wall' if walls == 1 else 'walls'} are planes",
        }


def surfaces_from_estimate(
    values: FloatArray,
    pose: Pose,
    camera_height: float,
    path: Path,
    *,
    kind: Estimate | None = None,
    shift: bool | None = None,
    sky: bool = False,
    sky_beyond: float | None = None,
    max_width: int = 1024,
    most_faces: int = 50_000,
    progress: Callable[[float], None] = lambda share: None,
    tuned: ReconstructionParameters = DEFAULT,
) -> Estimated:
    """Find the unit of an estimate, make floor, ceilings and walls planes, and mesh the rest as it is.

    Where the estimate leaves directions open, a warning says so.

    Args:
        values: of the file, in its unknown unit, shape (height, 2 height); NaN where nothing is known, inf for sky.
        pose: of the panorama, by which the floor is level.
        camera_height: of the capture point above the floor, metres.
        path: of the file, for messages.
        kind: what the values are; ``None`` finds out.
        shift: whether they have a shift; ``None`` finds out.
        sky: what comes out as infinitely far, or is not known, is sky.
        sky_beyond: metres from which on a distance is sky.
        max_width: wider images are reduced to at most this many columns.
        most_faces: of all surfaces together.
        progress: called with the share that is done.
        tuned: how unit, planes and surfaces are found.

    Returns:
        ``floor`` (support), ``walls``, ``ceiling``, ``furniture`` and ``behind`` (environment), as far as there are such.

    Raises:
        InputError: there is no floor, or it is not clear what the values are.
    """
    infinite = np.isinf(values)
    values = reduced(DepthImage(np.where(infinite, np.nan, values)), max_width).depth
    step = len(infinite) // len(values)
    infinite = infinite[step // 2 :: step, step // 2 :: step]
    rows, columns = values.shape
    directions = pose.to_world(pixel_directions(rows, columns))
    solid_angles = np.repeat(pixel_solid_angles(rows, columns)[:, None], columns, axis=1)
    few = max(1, rows // tuned.unit.rows)
    some = (slice(few // 2, None, few), slice(few // 2, None, few))
    try:
        rise = directions[some][..., 2]
        unit = solve_unit(values[some], rise, solid_angles[some], camera_height, kind, shift, tuned.unit)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    reciprocal = unit.reciprocal(values)
    declared = infinite | (sky & (reciprocal <= 0.0))
    if sky_beyond is not None:
        declared |= (reciprocal < 1.0 / sky_beyond) & np.isfinite(values)
    reciprocal[declared] = 0.0
    progress(0.1)
    planes = find_room_planes(_levelled(reciprocal, pose), camera_height, unit, tuned.planes)
    progress(0.5)
    missing = (reciprocal <= 0.0) & ~declared
    corrected = planes.correction(directions, reciprocal, unit)
    if missing.any():
        corrected = continued(corrected, missing, ~missing & ~declared, tuned.depth)
    corrected[declared] = 0.0
    corrected = _sharpened(corrected, tuned.estimate)
    label = _labels(corrected, directions, planes, solid_angles, tuned.estimate)
    label[declared] = -1
    exact = _exact(corrected, label, directions, planes, declared, tuned.estimate.above_floor)
    progress(0.6)
    surfaces = _surfaces(exact, label, directions, planes, pose, camera_height, most_faces, progress, tuned)
    floor_height = float(pose.position[2] - camera_height)
    floor = Plane(np.array([0.0, 0.0, 1.0]), floor_height, float(solid_angles[label == 0].sum() / (4.0 * np.pi)))
    measured = Measured(surfaces, floor, declared if declared.any() else None)
    unknown = float(solid_angles[missing].sum() / (4.0 * np.pi))
    if unknown > tuned.estimate.much_unknown:
        warn(
            f"{path}: in {100 * unknown:.2g} % of all directions the estimate means nothing or infinity; that was closed "
            "like a hole. If it is sky, give --sky, or --sky-beyond METRES"
        )
    return Estimated(measured, unit, planes)


def _levelled(reciprocal: FloatArray, pose: Pose) -> FloatArray:
    """The image turned to the world's directions."""
    rows, columns = reciprocal.shape
    u, v = direction_to_latlong(pixel_directions(rows, columns) @ pose.rotation)
    margin = 2
    wrapped = np.pad(reciprocal, ((0, 0), (margin, margin)), mode="wrap").astype(np.float32)
    x, y = (u * columns - 0.5 + margin).astype(np.float32), (v * rows - 0.5).astype(np.float32)
    return cv2.remap(wrapped, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE).astype(np.float64)


def _sharpened(reciprocal: FloatArray, tuned: EstimateParameters) -> FloatArray:
    """Blurred edges made jumps: a pixel of one gets the distance of its nearer or farther side, whichever is more like."""
    reach = round(tuned.soft * reciprocal.shape[1] / 1024) or 1
    around = np.pad(reciprocal, ((0, 0), (2 * reach, 2 * reach)), mode="wrap").astype(np.float32)
    safe = np.maximum(around, 1e-9)
    bend = np.zeros_like(around)
    for axis in (0, 1):
        outer = np.roll(around, reach, axis) + np.roll(around, -reach, axis)
        bend = np.maximum(bend, np.abs(outer - 2.0 * around) / safe)
    bend[:reach] = bend[-reach:] = 0.0
    window = np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)
    near, far = cv2.dilate(around, window), cv2.erode(around, window)
    edge = (near > tuned.step * far) & (cv2.dilate(bend, window) > tuned.bent) & (far > 0.0)
    middle = np.sqrt(near * far)
    crisp = np.where(edge, np.where(around > middle, near, far), around)[:, 2 * reach : -2 * reach].astype(np.float64)
    return np.where(reciprocal > 0.0, crisp, reciprocal)


def _labels(
    corrected: FloatArray,
    directions: FloatArray,
    planes: RoomPlanes,
    solid_angles: FloatArray,
    tuned: EstimateParameters,
) -> Labels:
    """Which plane each pixel shows, -1 for none."""
    usual = tuned.plane_errors * planes.spread
    tolerance = float(np.clip(usual, tuned.least_plane_error, tuned.most_plane_error))
    label, _ = nearest_planes(planes.vectors, directions, corrected, tolerance)
    label = _majority(label, len(planes.vectors), tuned.majority)
    # Small patches of anything become what is around them.
    for index in range(-1, len(planes.vectors)):
        small = _small(label == index, solid_angles, tuned.small_patch)
        if small.any():
            nearest = _nearest(~small)
            label = np.where(small, label[nearest], label)
    # Where two planes meet, what is seen is the nearer one.
    joint = tuned.joint
    for one, other in _convex_pairs(label, directions, planes.vectors, tuned):
        beside = (_distance(label == one, 2 * joint) <= joint) & (_distance(label == other, 2 * joint) <= joint)
        beside &= (label == one) | (label == other)
        nearer = directions[beside] @ (planes.vectors[one] - planes.vectors[other]) > 0.0
        label[beside] = np.where(nearer, one, other)
    return label


def _majority(label: Labels, count: int, size: int) -> Labels:
    """The label that most pixels within a square of ``size`` pixels have."""
    padded = np.pad(label, ((0, 0), (size, size)), mode="wrap")
    shares = np.stack(
        [cv2.boxFilter((padded == index).astype(np.float32), -1, (size, size)) for index in range(-1, count)]
    )
    return (shares.argmax(axis=0) - 1)[:, size:-size].astype(np.intp)


def _small(mask: NDArray[np.bool_], solid_angles: FloatArray, largest: float) -> NDArray[np.bool_]:
    regions, count = ndimage.label(mask, np.ones((3, 3)))
    areas = np.bincount(regions.ravel(), solid_angles.ravel(), count + 1)
    # A region that is cut by the panorama's edge counts as two; one of the first or last row is at a pole.
    return mask & (areas < np.radians(1.0) ** 2 * largest)[regions]


def _nearest(known: NDArray[np.bool_]) -> tuple[NDArray, NDArray]:
    """Row and column of the nearest known pixel, for every pixel."""
    width = known.shape[1]
    margin = width // 4
    padded = np.pad(known, ((0, 0), (margin, margin)), mode="wrap")
    rows, columns = ndimage.distance_transform_edt(~padded, return_distances=False, return_indices=True)
    inner = slice(margin, margin + width)
    return rows[:, inner], (columns[:, inner] - margin) % width


def _distance(mask: NDArray[np.bool_], margin: int) -> FloatArray:
    """Distance of every pixel from a mask, pixels."""
    padded = np.pad(mask, ((0, 0), (margin, margin)), mode="wrap")
    if not mask.any():
        return np.full(mask.shape, np.inf)
    # OpenCV's is exact enough, and many times as fast as SciPy's.
    distance = cv2.distanceTransform((~padded).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return distance[:, margin:-margin].astype(np.float64)


def _convex_pairs(
    label: Labels, directions: FloatArray, vectors: FloatArray, tuned: EstimateParameters
) -> list[tuple[int, int]]:
    """Pairs of planes that meet so that the nearer one hides the other, as in the corners of a room."""
    near = [_distance(label == index, 2 * tuned.joint) <= tuned.joint for index in range(len(vectors))]
    pairs = []
    for one in range(len(vectors)):
        for other in range(one + 1, len(vectors)):
            beside = near[one] & near[other] & ((label == one) | (label == other))
            if np.count_nonzero(beside) < tuned.fewest_pixels:
                continue
            nearer = directions[beside] @ (vectors[one] - vectors[other]) > 0.0
            if np.mean(nearer == (label[beside] == one)) > tuned.convex:
                pairs.append((one, other))
    return pairs


def _exact(
    corrected: FloatArray,
    label: Labels,
    directions: FloatArray,
    planes: RoomPlanes,
    sky: NDArray[np.bool_],
    above: float,
) -> FloatArray:
    """Reciprocal distances with the planes' pixels on the planes, and all others, ``above`` times, above the floor."""
    on = label >= 0
    exact = corrected.copy()
    exact[on] = np.einsum("ij,ij->i", directions[on], planes.vectors[label[on]])
    floor = above * directions @ planes.vectors[0]
    return np.where(on | sky, exact, np.maximum(exact, floor))


def _surfaces(
    exact: FloatArray,
    label: Labels,
    directions: FloatArray,
    planes: RoomPlanes,
    pose: Pose,
    camera_height: float,
    most_faces: int,
    progress: Callable[[float], None],
    tuned: ReconstructionParameters,
) -> list[RealSurface]:
    columns = exact.shape[1]
    behind_label, beyond = _planes_behind(label, directions, planes.vectors, tuned.estimate)
    with np.errstate(divide="ignore"):
        depth = np.where(exact > 0.0, 1.0 / exact, np.inf)
        bare = np.where(beyond > 0.0, 1.0 / beyond, np.inf)
    seen = _snapped(
        mesh_from_depth(depth.astype(np.float32), pose.position, pose.rotation, columns), label, planes, pose
    )
    # The floor goes on below what stands on it.
    room = mesh_from_depth(bare.astype(np.float32), pose.position, pose.rotation, columns)
    room = _snapped(room, behind_label, planes, pose)

    def level(mesh: Mesh) -> NDArray[np.bool_]:
        near = np.abs(mesh.vertices[:, 2] - (pose.position[2] - camera_height)) < 1e-4
        return near[mesh.faces].all(axis=1)

    floor = part_of(room, level(room))
    if len(floor.faces) == 0:
        raise InputError("no floor is left: nothing in the depth lies level below the camera")
    progress(0.7)
    rest = part_of(seen, ~level(seen))
    behind = unseen_background(depth, pose, np.where(behind_label >= 0, beyond, 0.0), tuned.depth)
    progress(0.8)
    few, error = round(tuned.depth.behind_share * most_faces), tuned.depth.unseen_error
    floor = simplified(floor, few, error)
    behind = simplified(behind, few, error)
    rest = simplified(rest, most_faces - len(floor.faces) - len(behind.faces) - SHELL_FACES, error)
    progress(1.0)
    surfaces = [RealSurface("floor", floor, Role.SUPPORT)]
    owner = _plane_of_faces(rest, planes, pose)
    for name, first, last in (
        ("ceiling", 1, 1 + planes.ceilings),
        ("walls", 1 + planes.ceilings, len(planes.vectors)),
        ("furniture", -1, 1),
    ):
        own = part_of(rest, (owner >= first) & (owner < last) if first > 0 else owner < last)
        if len(own.faces):
            surfaces.append(RealSurface(name, own, Role.ENVIRONMENT))
    if len(behind.faces):
        surfaces.append(RealSurface("behind", behind, Role.ENVIRONMENT))
    return surfaces


def _planes_behind(
    label: Labels, directions: FloatArray, vectors: FloatArray, tuned: EstimateParameters
) -> tuple[Labels, FloatArray]:
    """The plane of the room that is seen, or would be seen without what stands before it; and its reciprocal distance.

    Behind an object the nearest plane goes on, and where it meets another one that is near, that one.
    """
    rows = label.shape[0]
    reach = tuned.behind_reach / 180.0 * rows
    if not (label >= 0).any():
        return label, np.zeros(label.shape)
    behind = np.where(label >= 0, label, label[_nearest(label >= 0)])
    reciprocal = np.einsum("ijk,ijk->ij", directions, vectors[behind])
    for one, other in _convex_pairs(label, directions, vectors, tuned):
        for here, there in ((one, other), (other, one)):
            chosen = (label < 0) & (behind == here) & (_distance(label == there, round(2 * reach)) < reach)
            candidate = directions[chosen] @ vectors[there]
            nearer = candidate > reciprocal[chosen]
            at = np.flatnonzero(chosen.ravel())[nearer]
            behind.ravel()[at] = there
            reciprocal.ravel()[at] = candidate[nearer]
    far = (_distance(label >= 0, round(2 * reach)) > 2.0 * reach) | (reciprocal <= 0.0)
    return np.where(far, -1, behind), np.where(far, 0.0, reciprocal)


def _snapped(mesh: Mesh, label: Labels, planes: RoomPlanes, pose: Pose) -> Mesh:
    """The mesh with its vertices exactly on their planes, and those beside a joint in the joint."""
    if len(mesh.faces) == 0:
        return mesh
    rows, columns = label.shape
    vertices = mesh.vertices.astype(np.float64) - pose.position
    distance = np.linalg.norm(vertices, axis=1)
    u, v = pose.to_panorama(mesh.vertices.astype(np.float64))
    own = label[(v * rows).astype(int).clip(0, rows - 1), (u * columns).astype(int) % columns]
    on = own >= 0
    projected = np.einsum("ij,ij->i", vertices[on], planes.vectors[own[on]])
    vertices[on] /= np.where(np.abs(projected - 1.0) < 0.05, projected, 1.0)[:, None]
    edges = np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]])
    edges = np.concatenate([edges, edges[:, ::-1]])
    across = (own[edges[:, 0]] >= 0) & (own[edges[:, 1]] >= 0) & (own[edges[:, 0]] != own[edges[:, 1]])
    count = len(planes.vectors)
    beside = np.unique(edges[across, 0] * np.int64(count) + own[edges[across, 1]])
    vertex, other = beside // count, (beside % count).astype(int)
    # The lower numbered plane's vertices move, so that those of the other keep the triangles apart.
    several = np.isin(vertex, vertex[np.flatnonzero(np.diff(vertex, prepend=-1) == 0)])
    moving = (own[vertex] < other) | several
    step = 2.0 * np.pi / columns
    chosen_vertex, chosen_other = vertex[moving], other[moving]
    for index in np.unique(chosen_vertex):
        normals = planes.vectors[[own[index], *chosen_other[chosen_vertex == index]]][:3]
        move = np.linalg.lstsq(normals, 1.0 - normals @ vertices[index], rcond=1e-3)[0]
        grazing = 1.0 / max(
            abs(float(normals[0] @ vertices[index])) / (np.linalg.norm(normals[0]) * distance[index]), 0.02
        )
        if np.linalg.norm(move) < 2.5 * step * distance[index] * min(grazing, 10.0):
            vertices[index] += move
    return Mesh((vertices + pose.position).astype(np.float32), mesh.faces)


def _plane_of_faces(mesh: Mesh, planes: RoomPlanes, pose: Pose) -> Labels:
    """The plane that each face lies in, -1 for none; shape (m,)."""
    vertices = mesh.vertices.astype(np.float64) - pose.position
    lengths = np.linalg.norm(planes.vectors, axis=1)
    off = np.abs(vertices @ planes.vectors.T - 1.0) / lengths
    worst = off[mesh.faces].max(axis=1)
    nearest = worst.argmin(axis=1)
    return np.where(worst.min(axis=1) < 1e-3, nearest, -1)

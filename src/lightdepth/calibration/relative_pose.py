"""The pose of a second panorama from points that a posed panorama shows too.

A shared point whose place is known (where the first panorama's ray meets a modelled surface) must be seen in its direction
from the second capture point; one whose place is not known must lie in the plane of its ray and the two capture points (the
epipolar constraint on spheres, by Sampson's first-order distance). Both kinds are solved together.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from lightdepth.directions import FloatArray
from lightdepth.errors import InputError
from lightdepth.parameters.calibration import DEFAULT, CalibrationParameters

LEAST_PLACED, LEAST_UNPLACED = 4, 8
"""Shared points that are needed: of known place, or otherwise."""


@dataclass(frozen=True)
class SharedPoints:
    """Points that both panoramas show.

    Attributes:
        names: for messages, one for each point.
        first: unit directions from the first capture point, world axes, shape (n, 3).
        second: unit directions in the second panorama's light space, shape (n, 3).
        places: world, metres, shape (n, 3); NaN where it is not known.
        origin: the first capture point, world, metres, shape (3,).
        click_errors: standard deviation of each pair, radians, shape (n,): of the second click where the place is known
            but for the first one's, of both clicks otherwise.
        baseline: between the two capture points, metres; ``None`` where it is not known.
        normals: unit, of the surface at each place, shape (n, 3): places on surfaces that the first ray meets at a grazing
            angle are off by more, along the ray. ``None`` takes all as facing.
    """

    names: tuple[str, ...]
    first: FloatArray
    second: FloatArray
    places: FloatArray
    origin: FloatArray
    click_errors: FloatArray
    baseline: float | None = None
    normals: FloatArray | None = None

    @property
    def placed(self) -> NDArray[np.bool_]:
        """Which points have a known place, shape (n,)."""
        return np.asarray(np.isfinite(self.places).all(axis=1))

    def some(self, chosen: NDArray) -> SharedPoints:
        """Only the points that an index or a mask chooses."""
        return replace(
            self,
            names=tuple(np.array(self.names)[chosen]),
            first=self.first[chosen],
            second=self.second[chosen],
            places=self.places[chosen],
            click_errors=self.click_errors[chosen],
            normals=None if self.normals is None else self.normals[chosen],
        )


@dataclass(frozen=True)
class RelativePose:
    """The second panorama's pose.

    Attributes:
        rotation: light space to world, shape (3, 3).
        position: world, metres, shape (3,).
        residuals: of each point, radians, shape (n,).
        centimetres: the same where the point is, shape (n,).
        direction_error: expected error of the rotation, degrees, one standard deviation.
        position_error: of the position, metres.
        misfit: root mean square of the residuals over what the click error makes them.
    """

    rotation: FloatArray
    position: FloatArray
    residuals: FloatArray
    centimetres: FloatArray
    direction_error: float
    position_error: float
    misfit: float

    @property
    def residual(self) -> float:
        """Root mean square, radians."""
        return float(np.sqrt(np.mean(self.residuals**2)))


def relate(points: SharedPoints, tuned: CalibrationParameters = DEFAULT) -> RelativePose:
    """Find the second panorama's pose from clicked points, all of which count.

    Args:
        points: the clicked points.
        tuned: how it is looked for, and what is taken for a contradiction.

    Raises:
        InputError: there are too few, nothing gives the scale, or they contradict each other; the message names the one
            without which the others agree.
    """
    check_enough(points)
    pose = _solved(points, tuned)
    if pose.misfit > tuned.second_contradiction:
        better = [(*_without(points, number, tuned), number) for number in range(len(points.names))]
        misfit, residual, worst = min(better)
        words = ""
        if misfit < tuned.second_culprit * pose.misfit:
            words = f"; without {points.names[worst]} they agree to {np.degrees(residual):.2f} degrees: look at it"
        raise InputError(
            f"the shared points contradict each other: no pose fits them better than {np.degrees(pose.residual):.2f} "
            f"degrees (clicks are taken to be right to {np.degrees(points.click_errors.max()):.2f}){words}"
        )
    return pose


def relate_robustly(
    points: SharedPoints, tolerance: float, tuned: CalibrationParameters = DEFAULT
) -> tuple[RelativePose | None, NDArray[np.bool_]]:
    """Find the pose from matches of which many may be wrong (RANSAC with the eight-point algorithm on spheres).

    Args:
        points: the matches.
        tolerance: residual of a right match, radians.
        tuned: how it is looked for.

    Returns:
        The pose from the right matches, ``None`` where they are too few for one, and which those are, shape (n,).
    """
    rng = np.random.default_rng(0)
    count = len(points.names)
    chosen = np.argsort(rng.random((tuned.second_samples, count)), axis=1)[:, :8]
    essential = _essential(points.first[chosen], points.second[chosen])
    # Rows: first . E second, and its gradients.
    forward = np.einsum("sij,nj->sni", essential, points.second)
    back = np.einsum("sji,nj->sni", essential, points.first)
    right = np.abs(_sampson(points.first, points.second, forward, back)) < tolerance
    best = int(np.argmax(right.sum(axis=1)))
    agree = np.asarray(right[best])
    starts = None
    for _ in range(tuned.second_rounds):
        kept = points.some(agree)
        if len(kept.names) < LEAST_UNPLACED or (kept.placed.sum() < LEAST_PLACED and points.baseline is None):
            return None, agree
        starts = starts or _from_essential(_essential(kept.first[None], kept.second[None])[0])
        pose = _solved(kept, tuned, starts)
        starts = [Rotation.from_matrix(pose.rotation)]
        agree = _off(points, pose.rotation, pose.position) < tolerance
    return _solved(points.some(agree), tuned, starts), agree


def refine(points: SharedPoints, pose: RelativePose, tuned: CalibrationParameters = DEFAULT) -> RelativePose:
    """The pose from points that are known better than before.

    Its expected errors are larger where the points agree less than their own errors let expect, as they do where the model
    is a little off.

    Args:
        points: all of which count.
        pose: near the solution.
        tuned: how points are weighted.
    """
    refined = _solved(points, tuned, [Rotation.from_matrix(pose.rotation)])
    count = len(points.names)
    # Two numbers a point, of which the pose fits six.
    excess = max(1.0, refined.misfit * float(np.sqrt(count / max(2 * count - 6, 1))))
    return replace(
        refined,
        direction_error=refined.direction_error * excess,
        position_error=refined.position_error * excess,
    )


def check_enough(points: SharedPoints) -> None:
    """Refuse what cannot determine the pose.

    Raises:
        InputError: too few points, or nothing that gives the scale.
    """
    placed, count = int(points.placed.sum()), len(points.names)
    if placed < LEAST_PLACED and count < LEAST_UNPLACED:
        raise InputError(
            f"{count} shared points, {placed} of them on modelled surfaces; {LEAST_PLACED} on modelled surfaces or on the "
            f"floor are needed, or {LEAST_UNPLACED} anywhere"
        )
    if not placed and points.baseline is None:
        raise InputError(
            "nothing gives the scale: no shared point is on a modelled surface of the scene; click points on the floor as "
            "--floor-match, or state the distance between the two capture points as --baseline"
        )


def _solved(points: SharedPoints, tuned: CalibrationParameters, starts: list[Rotation] | None = None) -> RelativePose:
    """The best pose by least squares, from rotations or from everywhere."""
    if starts is None:
        starts = list(Rotation.random(tuned.second_starts, random_state=0))
        if len(points.names) >= LEAST_UNPLACED:
            starts += _from_essential(_essential(points.first[None], points.second[None])[0])
    begun = []
    for rotation in starts:
        matrix = rotation.as_matrix()
        for position in _positions(points, matrix):
            off = _off(points, matrix, position) / _spread(points, position, tuned)
            behind = tuned.second_behind * np.count_nonzero(_behind(points, matrix, position))
            begun.append((float(np.log1p((off / tuned.second_start_scale) ** 2).sum()) + behind, rotation, position))
    begun.sort(key=lambda each: each[0])

    def parts(vector: FloatArray, start: Rotation) -> tuple[FloatArray, FloatArray]:
        return np.asarray((Rotation.from_rotvec(vector[:3]) * start).as_matrix()), vector[3:]

    def fitted(rotation: Rotation, position: FloatArray) -> tuple[float, Rotation, FloatArray, FloatArray]:
        """Cost, rotation, position and Jacobian near a start; points are weighted as from there."""
        whiten = _whitening(points, position, tuned)

        def errors(vector: FloatArray) -> FloatArray:
            matrix, place = parts(vector, rotation)
            off = np.einsum("nij,nj->ni", whiten, _vectors(points, matrix, place)).ravel()
            if points.baseline is not None:
                length = float(np.linalg.norm(place - points.origin))
                off = np.append(off, 100.0 * np.log(max(length, 1e-9) / points.baseline))
            return np.asarray(off)

        start, scale = [0.0, 0.0, 0.0, *position], tuned.second_scale
        found = least_squares(errors, start, loss="soft_l1", f_scale=scale, x_scale=0.1)
        matrix, place = parts(found.x, rotation)
        cost = float(found.cost) + tuned.second_behind * np.count_nonzero(_behind(points, matrix, place))
        return cost, Rotation.from_matrix(matrix), place, found.jac

    best = min(
        (fitted(rotation, position) for _, rotation, position in begun[: tuned.second_kept]), key=lambda each: each[0]
    )
    for _ in range(tuned.second_weighings):
        best = fitted(*best[1:3])
    _, turned, place, jacobian = best
    matrix = np.asarray(turned.as_matrix())
    covariance = np.linalg.pinv(jacobian.T @ jacobian)
    off = np.abs(_off(points, matrix, place))
    away = np.linalg.norm(_triangulated(points, matrix, place) - place, axis=1)
    whitened = np.einsum("nij,nj->ni", _whitening(points, place, tuned), _vectors(points, matrix, place))
    return RelativePose(
        matrix,
        place,
        off,
        100.0 * off * away,
        float(np.degrees(np.sqrt(np.trace(covariance[:3, :3])))),
        float(np.sqrt(np.trace(covariance[3:, 3:]))),
        float(np.sqrt(np.mean(whitened**2) * 3.0)),
    )


def _without(points: SharedPoints, number: int, tuned: CalibrationParameters) -> tuple[float, float]:
    """Misfit and residual without a point; infinite where too few are left."""
    rest = points.some(np.arange(len(points.names)) != number)
    try:
        check_enough(rest)
    except InputError:
        return np.inf, np.inf
    pose = _solved(rest, tuned)
    return pose.misfit, pose.residual


def _vectors(points: SharedPoints, rotation: FloatArray, position: FloatArray) -> FloatArray:
    """Angles by which the points miss, radians, shape (n, 3): tangential vectors, or one number and zeros."""
    seen = points.second @ rotation.T
    result = np.zeros_like(seen)
    placed = points.placed
    way = points.places[placed] - position
    way = way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
    across = np.cross(way, seen[placed])
    length = np.linalg.norm(across, axis=1)
    angle = np.arctan2(length, (way * seen[placed]).sum(axis=1))
    result[placed] = across * (angle / np.maximum(length, 1e-12))[:, None]
    if not placed.all():
        toward = position - points.origin
        toward = toward / max(float(np.linalg.norm(toward)), 1e-9)
        first, other = points.first[~placed], seen[~placed]
        result[~placed, 0] = _sampson(first, other, np.cross(toward, other), np.cross(first, toward))
    return result


def _behind(points: SharedPoints, rotation: FloatArray, position: FloatArray) -> NDArray[np.bool_]:
    """Which points of unknown place the rays would meet behind a capture point, shape (n,)."""
    seen = points.second @ rotation.T
    toward = position - points.origin
    cosine = (points.first * seen).sum(axis=1)
    one, other = points.first @ toward, seen @ toward
    return np.asarray(~points.placed & ((one < cosine * other) | (cosine * one < other)))


def _sampson(first: FloatArray, second: FloatArray, forward: FloatArray, back: FloatArray) -> FloatArray:
    """First-order angles to the nearest pair that fulfils ``first . forward = 0``, where both are linear in the other."""
    value = (first * forward).sum(axis=-1)
    across = (back * second).sum(axis=-1)
    squared = (forward**2).sum(axis=-1) - value**2 + (back**2).sum(axis=-1) - across**2
    return np.asarray(value / np.sqrt(np.maximum(squared, 1e-12)))


def _off(points: SharedPoints, rotation: FloatArray, position: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.norm(_vectors(points, rotation, position), axis=1))


def _spread(points: SharedPoints, position: FloatArray, tuned: CalibrationParameters, along: bool = True) -> FloatArray:
    """Standard deviation of each point's miss, radians: a place is off by the first click, seen from the second point.

    Args:
        points: the shared points.
        position: of the second capture point.
        tuned: how grazing a surface counts.
        along: the first point's ray, on which a grazing surface moves a place far; else across it.
    """
    near = np.linalg.norm(points.places - points.origin, axis=1)
    far = np.maximum(np.linalg.norm(points.places - position, axis=1), 0.1 * near)
    facing = np.ones(len(near))
    if along and points.normals is not None:
        facing = np.maximum(np.abs((points.first * points.normals).sum(axis=1)), tuned.second_grazing)
    share = np.nan_to_num(near / np.maximum(far, 1e-9) / facing)
    return points.click_errors * np.sqrt(1.0 + share**2)


def _whitening(points: SharedPoints, position: FloatArray, tuned: CalibrationParameters) -> FloatArray:
    """Matrices that turn the vectors of :func:`_vectors` into multiples of their standard deviation, shape (n, 3, 3).

    The vectors are axes of rotations: a miss along the first ray turns about the normal of the epipolar plane.
    """
    normal = np.cross(points.first, position - points.origin)
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
    along = normal[:, :, None] * normal[:, None] * points.placed[:, None, None]
    across = np.eye(3) - along
    one, other = (_spread(points, position, tuned, way)[:, None, None] for way in (True, False))
    return np.asarray(along / one + across / other)


def _positions(points: SharedPoints, rotation: FloatArray) -> list[FloatArray]:
    """Capture points that suit a rotation: by linear equations."""
    seen = points.second @ rotation.T
    placed = points.placed
    if placed.sum() >= 2:
        across = np.eye(3) - seen[placed, :, None] * seen[placed, None]
        right = (across @ points.places[placed, :, None]).sum(axis=0)
        return [np.linalg.lstsq(across.sum(axis=0), right[:, 0], rcond=None)[0]]
    normals = np.cross(points.first, seen)
    toward = np.linalg.svd(normals)[2][2]
    return [points.origin + side * (points.baseline or 1.0) * toward for side in (-1.0, 1.0)]


def _essential(first: FloatArray, second: FloatArray) -> FloatArray:
    """Essential matrices ``first . E second = 0`` of sets of points, shape (sets, 3, 3), by the eight-point algorithm."""
    rows = (first[..., :, None] * second[..., None, :]).reshape(*first.shape[:-1], 9)
    matrices = np.linalg.svd(rows, full_matrices=True)[2][..., -1, :].reshape(-1, 3, 3)
    left, _, right = np.linalg.svd(matrices)
    return np.asarray(left @ np.diag([1.0, 1.0, 0.0]) @ right)


def _from_essential(essential: FloatArray) -> list[Rotation]:
    """The two rotations that an essential matrix allows."""
    left, _, right = np.linalg.svd(essential)
    left, right = left * np.sign(np.linalg.det(left)), right * np.sign(np.linalg.det(right))
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    return [Rotation.from_matrix(left @ turn @ right) for turn in (quarter, quarter.T)]


def _triangulated(points: SharedPoints, rotation: FloatArray, position: FloatArray) -> FloatArray:
    """Where the points are: as known, or between the two rays, shape (n, 3)."""
    seen = points.second @ rotation.T
    across = 2.0 * np.eye(3) - points.first[:, :, None] * points.first[:, None] - seen[:, :, None] * seen[:, None]
    right = points.origin - points.first * (points.first @ points.origin)[:, None]
    right = right + position - seen * (seen @ position)[:, None]
    between = np.linalg.solve(across + 1e-9 * np.eye(3), right[..., None])[..., 0]
    return np.where(points.placed[:, None], points.places, between)

"""The camera of a photograph from lines, points and distances, all at once by weighted least squares."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from scipy.special import chdtrc

from lightdepth.calibration.view_cues import Distance, Line, ViewCues
from lightdepth.cameras.distortion import RadialDistortion
from lightdepth.cameras.perspective import Perspective
from lightdepth.directions import FloatArray
from lightdepth.errors import InputError
from lightdepth.parameters.calibration import DEFAULT, CalibrationParameters


@dataclass(frozen=True)
class ViewCalibration:
    """The camera of a photograph.

    Attributes:
        camera: lens and size, without a pose.
        rotation: camera space to world, shape (3, 3); the columns are right, forward and up.
        position: of the lens, world, metres, shape (3,); ``None`` where nothing says it.
        residual: root mean square distance of clicks from where the solution has them, pixels.
        residuals: the same for each cue by its name.
        direction_error: standard deviation of the rotation that the click error leads to, degrees.
        fov_error: the same of the field of view, degrees; 0 where it was given.
        position_error: the same of the position, metres; ``None`` without one.
        probability: that clicks of the stated error miss a solution by as much or more; 1 where none is to spare.
        warnings: sentences for the user.
    """

    camera: Perspective
    rotation: FloatArray
    position: FloatArray | None
    residual: float
    residuals: dict[str, float]
    direction_error: float
    fov_error: float
    position_error: float | None
    probability: float
    warnings: tuple[str, ...] = ()


def calibrate_view(cues: ViewCues, tuned: CalibrationParameters = DEFAULT) -> ViewCalibration:
    """Find the camera of a photograph.

    Args:
        cues: what is known.
        tuned: how it is looked for, and what is taken for a contradiction.

    Raises:
        InputError: what is given does not determine the camera, or contradicts itself.
    """
    _check_enough(cues)
    problem, vector = _solved(cues, tuned)
    result = _result(problem, vector)
    against = [line.name for line in cues.lines if line.directed and problem.runs_against(line, vector)]
    if against:
        raise InputError(
            f"{', '.join(against)}: runs against the other lines; click every line in the direction of its axis, from "
            "minus to plus (z upward)"
        )
    if result.probability < tuned.view_false_alarm:
        words = _contradiction(cues, result, (problem.reference, vector), tuned)
        if result.residual > tuned.view_hopeless * cues.click_error:
            raise InputError(words)
        result = replace(result, warnings=(*result.warnings, words))
    return result


def _check_enough(cues: ViewCues) -> None:
    along = {line.axis for line in cues.lines}
    if len(along) < 2 and len(cues.points) < 4 and not (along and len(cues.points) >= 2):
        raise InputError(
            f"lines along {len(along)} of the axes and {len(cues.points)} known points do not determine a camera; give "
            "lines along two axes, or lines along one axis and 2 points, or 4 points"
        )
    if cues.points and not cues.distances and cues.camera_height is None and len(cues.points) < 2:
        raise InputError(
            "one known point gives no scale: add --distance, --camera-height or a second known point (or leave the origin "
            "out: then only the rotation and the lens are found)"
        )


def _solved(
    cues: ViewCues, tuned: CalibrationParameters, near: tuple[FloatArray, FloatArray] | None = None
) -> tuple[_Problem, FloatArray]:
    """The unknowns that fit best; ``near`` is a rotation and a vector to begin with."""
    problem = _Problem(cues, tuned)
    if near is not None and len(near[1]) == problem.count:
        problem.reference, vector = near
        starts = [(0.0, vector)]
    else:
        starts = sorted(problem.starts(), key=lambda start: start[0])[: tuned.view_starts]
    if not starts:
        raise InputError(
            "the lines and points given do not determine a camera: give two or more lines along one "
            "axis and one along another, or 4 known points"
        )
    low, high = problem.bounds()
    best: Any = None
    for _, vector in starts:
        vector = np.clip(vector, low + 1e-9, high - 1e-9)
        scales = problem.scales(vector)
        found = least_squares(
            problem.errors, vector, bounds=(low, high), x_scale=scales, max_nfev=tuned.view_evaluations
        )
        if best is None or found.cost < best.cost * (1.0 - 1e-9):
            best = found
        if 2.0 * best.cost < max(1, problem.freedom(len(best.fun)) - problem.count):
            break  # As good as clicks can be; another start finds the same.
    # From here on the rotation vector is a small turn, so that its errors are angles.
    vector = np.array(best.x)
    problem.reference = problem.unpack(vector).rotation
    vector[problem.places["rotation"]] = 0.0
    return problem, vector


def _result(problem: _Problem, vector: FloatArray) -> ViewCalibration:
    cues, tuned = problem.cues, problem.tuned
    errors = problem.errors(vector)
    if not np.isfinite(errors).all():
        raise InputError(
            "no camera fits the lines and points given: is a line clicked along another axis, or a number mistyped?"
        )
    jacobian = problem.jacobian(vector)
    scaled = jacobian * problem.scales(vector)
    _, singular, right = np.linalg.svd(scaled, full_matrices=True)
    least = np.zeros(len(vector))
    least[: len(singular)] = singular
    if least.min() < tuned.view_undetermined * least.max():
        weakest = int(np.argmax(np.abs(right[-1])))
        raise InputError(
            f"the lines and points given do not determine {problem.name_of(weakest)}; {problem.advice(weakest)}"
        )
    covariance = np.linalg.inv(jacobian.T @ jacobian)
    deviation = np.sqrt(np.diag(covariance))
    free = problem.freedom(len(errors)) - len(vector)
    probability = float(chdtrc(free, np.sum(errors**2))) if free > 0 else 1.0
    parts = problem.missed(vector)
    residuals = {name: float(np.sqrt(np.mean(part**2))) for name, part in parts.items()}
    every = np.concatenate(list(parts.values()))
    state = problem.unpack(vector)
    warnings = []
    # Three angles, of which two turn the axis and one the picture.
    direction = float(np.degrees(np.sqrt(np.sum(deviation[:3] ** 2))))
    fov_error = 0.0
    if cues.fov is None:
        half = 0.5 * cues.size[0] / state.focal
        fov_error = float(np.degrees(2.0 * half / (1.0 + half * half)) * deviation[problem.places["focal"]][0])
        if deviation[problem.places["focal"]][0] > tuned.doubtful_focal_length:
            warnings.append(
                f"the focal length is only known to {100.0 * deviation[problem.places['focal']][0]:.0f} %: give --fov, or "
                "lines along another axis that recede from the camera"
            )
    if direction > tuned.doubtful_rotation:
        warnings.append(
            f"the camera's direction is only known to {direction:.1f} degrees: give more or longer lines, or more points"
        )
    position_error = None
    if state.position is not None and "position" in problem.places:
        position_error = float(np.sqrt(np.sum(deviation[problem.places["position"]] ** 2)))
    if free <= 0:
        warnings.append("there is nothing to check the clicks by: one more line or point would show a wrong one")
    return ViewCalibration(
        problem.camera(state),
        state.rotation,
        state.position,
        float(np.sqrt(np.mean(every**2))),
        residuals,
        direction,
        fov_error,
        position_error,
        probability,
        tuple(warnings),
    )


def _contradiction(
    cues: ViewCues, result: ViewCalibration, near: tuple[FloatArray, FloatArray], tuned: CalibrationParameters
) -> str:
    """Words for clicks that no camera fits, with the one without which the others agree."""
    words = (
        f"the clicks contradict each other: they miss every camera by {result.residual:.1f} pixels, where "
        f"{cues.click_error:g} are expected (--click-error)"
    )
    best: tuple[float, str] | None = None
    for name in cues.names:
        fewer = replace(
            cues,
            lines=tuple(each for each in cues.lines if each.name != name),
            points=tuple(each for each in cues.points if each.name != name),
            distances=tuple(each for each in cues.distances if each.name != name),
        )
        try:
            _check_enough(fewer)
            without = _result(*_solved(fewer, tuned, near))
        except (InputError, np.linalg.LinAlgError):
            continue
        if best is None or without.residual < best[0]:
            best = without.residual, name
    if best is not None and best[0] < tuned.view_culprit * result.residual:
        return f"{words}; without {best[1]}, {best[0]:.1f}: look at that one"
    worst = max(result.residuals, key=lambda name: result.residuals[name])
    return f"{words}; {worst} misses by most, {result.residuals[worst]:.1f}"


@dataclass(frozen=True)
class _State:
    """One guess at all that is unknown."""

    rotation: FloatArray
    position: FloatArray | None
    focal: float
    centre: FloatArray
    lens: RadialDistortion
    places: tuple[FloatArray, ...]
    """Of each distance, the parameters of its first point (and, on the floor, the second's direction)."""


class _Problem:
    """Vector of unknowns: rotation vector from a start, position, logarithm of the focal length, and so on."""

    def __init__(self, cues: ViewCues, tuned: CalibrationParameters) -> None:
        self.cues = cues
        self.tuned = tuned
        self.reference = np.eye(3)
        counts = [len(line.clicks) for line in cues.lines]
        self._clicks = np.concatenate([line.clicks for line in cues.lines]) if cues.lines else np.empty((0, 2))
        self._axes = np.array([line.axis for line in cues.lines], int)
        self._line_of = np.repeat(np.arange(len(counts)), counts)
        self._first_click = np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(int)
        self._world = np.array([point.world for point in cues.points]).reshape(-1, 3)
        self._seen = np.array([point.click for point in cues.points]).reshape(-1, 2)
        sizes = {"rotation": 3}
        if cues.placed and cues.position is None:
            sizes["position"] = 1 if cues.floats else 3
        if cues.fov is None:
            sizes["focal"] = 1
        if cues.principal_point is None:
            sizes["centre"] = 2
        if cues.distortion is None:
            sizes["lens"] = 2
        for number, distance in enumerate(cues.distances):
            sizes[f"distance {number}"] = 1 if distance.through_origin else 2 if distance.axis is not None else 3
        self.places: dict[str, slice] = {}
        at = 0
        for name, size in sizes.items():
            self.places[name] = slice(at, at + size)
            at += size
        self.count = at

    # Unknowns.

    def unpack(self, vector: FloatArray) -> _State:
        """What a vector of unknowns says."""
        cues, width = self.cues, self.cues.size[0]
        rotation = Rotation.from_rotvec(vector[self.places["rotation"]]).as_matrix() @ self.reference
        position = cues.position
        if "position" in self.places:
            found = vector[self.places["position"]]
            position = np.array([0.0, 0.0, found[0]]) if cues.floats else found
        focal = (
            float(np.exp(vector[self.places["focal"]][0]))
            if cues.fov is None
            else 0.5 * width / np.tan(np.radians(0.5 * cues.fov))
        )
        centre = np.array(cues.principal_point if cues.principal_point is not None else vector[self.places["centre"]])
        k1, k2 = cues.distortion if cues.distortion is not None else vector[self.places["lens"]]
        places = tuple(vector[self.places[f"distance {number}"]] for number in range(len(cues.distances)))
        return _State(rotation, position, focal, centre * cues.size, RadialDistortion(float(k1), float(k2)), places)

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Of the unknowns; only the lens has some."""
        low, high = np.full(self.count, -np.inf), np.full(self.count, np.inf)
        if "lens" in self.places:
            largest = self.tuned.view_largest_distortion
            low[self.places["lens"]], high[self.places["lens"]] = -largest, largest
        if "centre" in self.places:
            low[self.places["centre"]], high[self.places["centre"]] = -0.5, 1.5
        if "focal" in self.places:
            low[self.places["focal"]], high[self.places["focal"]] = np.log(self.cues.size[0] * np.array([0.1, 100.0]))
        return low, high

    def scales(self, vector: FloatArray) -> FloatArray:
        """Steps of the unknowns that matter alike."""
        scales = np.full(self.count, 0.1)
        for name, where in self.places.items():
            if name == "position" or name.startswith("distance"):
                scales[where] = 0.1 * max(1e-3, float(np.abs(vector[where]).max()))
        return scales

    def name_of(self, unknown: int) -> str:
        """Words for one of the unknowns."""
        words = {
            "rotation": "the camera's rotation",
            "position": "the camera's position or the scale",
            "focal": "the field of view",
            "centre": "the principal point",
            "lens": "the distortion",
        }
        name = next(name for name, where in self.places.items() if where.start <= unknown < where.stop)
        return words.get(name, "where the points of a --distance are")

    def advice(self, unknown: int) -> str:
        """What to do where one of the unknowns is not determined."""
        advice = {
            "rotation": "add lines along a second axis, or known points",
            "position": "add known points that are not in one line, --distance or --camera-height",
            "focal": "give --fov (or --fov exif), or lines along a second axis that recede from the camera",
            "centre": "leave it in the picture's middle, or add lines along the third axis",
            "lens": "leave the distortion out, or click several points along each of more lines, near the picture's rim",
        }
        name = next(name for name, where in self.places.items() if where.start <= unknown < where.stop)
        return advice.get(name, "its first point must be on the floor (z = 0)")

    def camera(self, state: _State) -> Perspective:
        """The lens as a camera of a scene file."""
        width, height = self.cues.size
        x, y = state.centre / self.cues.size
        settings: dict[str, Any] = {
            "type": "perspective",
            "width": width,
            "height": height,
            "fov": float(np.degrees(2.0 * np.arctan(0.5 * width / state.focal))),
        }
        if (x, y) != (0.5, 0.5):
            settings["principal_point"] = (float(x), float(y))
        if not state.lens.none:
            settings["distortion"] = (state.lens.k1, state.lens.k2)
        try:
            return Perspective(**settings)
        except ValueError as error:
            raise InputError(
                f"the clicks lead to distortion k1 {state.lens.k1:.3g}, k2 {state.lens.k2:.3g}, which folds the picture "
                "over before its corners: click points along lines near the corners, or leave the distortion out"
            ) from error

    # Errors.

    def errors(self, vector: FloatArray) -> FloatArray:
        """All errors in their standard deviations."""
        state = self.unpack(vector)
        errors = [part / self.cues.click_error for part in self._missed(state).values()]
        height = self.cues.camera_height
        if height is not None and state.position is not None:
            errors.append(np.array([(state.position[2] - height) / (self.tuned.measure_error * height)]))
        return np.nan_to_num(np.concatenate(errors), nan=1e6, posinf=1e6, neginf=-1e6).clip(-1e6, 1e6)

    def freedom(self, count: int) -> int:
        """Of ``count`` errors, those that are independent: each line goes where its clicks want it."""
        return count - len(self.cues.lines)

    def missed(self, vector: FloatArray) -> dict[str, FloatArray]:
        """Pixels by which each cue's clicks miss, along two axes or across a line."""
        return self._missed(self.unpack(vector))

    def jacobian(self, vector: FloatArray) -> FloatArray:
        """Of the errors, by central differences."""
        columns = []
        for unknown, scale in enumerate(self.scales(vector)):
            step = np.zeros(self.count)
            step[unknown] = 1e-4 * scale
            columns.append((self.errors(vector + step) - self.errors(vector - step)) / (2e-4 * scale))
        return np.stack(columns, axis=1)

    def runs_against(self, line: Line, vector: FloatArray) -> bool:
        """Whether a line was clicked from plus to minus."""
        state = self.unpack(vector)
        ends = self._rays(state, line.clicks[[0, -1]])
        return _sense(ends[0], ends[1], state.rotation[line.axis]) < 0.0

    def _missed(self, state: _State) -> dict[str, FloatArray]:
        missed: dict[str, FloatArray] = {}
        if self.cues.lines:
            parts = np.split(self._off_lines(state), self._first_click[1:])
            missed |= {line.name: part for line, part in zip(self.cues.lines, parts, strict=True)}
        if self.cues.points:
            off = self._project(state, self._world) - self._seen
            missed |= {point.name: part for point, part in zip(self.cues.points, off, strict=True)}
        for distance, place in zip(self.cues.distances, state.places, strict=True):
            ends = self._ends(distance, place)
            missed[distance.name] = (self._project(state, ends) - distance.clicks).ravel()
        return missed

    @staticmethod
    def _ends(distance: Distance, place: FloatArray) -> FloatArray:
        if distance.through_origin and distance.axis is not None:
            first = np.eye(3)[distance.axis] * place[0]
        else:
            first = np.array([place[0], place[1], 0.0])
        if distance.axis is not None:
            return np.stack([first, first + distance.metres * np.eye(3)[distance.axis]])
        return np.stack([first, first + distance.metres * np.array([np.cos(place[2]), np.sin(place[2]), 0.0])])

    def _off_lines(self, state: _State) -> FloatArray:
        """Signed distances in pixels of the lines' clicks from the best images of lines along their axes, shape (n,)."""
        rays = self._rays(state, self._clicks)
        vanishing = state.rotation[self._axes]
        # A line's image is where a plane through the lens cuts the picture, and that plane holds the axis.
        first = np.cross(vanishing, np.eye(3)[np.argmin(np.abs(vanishing), axis=1)])
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        second = np.cross(vanishing, first)
        a, b = (np.einsum("ni,ni->n", rays, basis[self._line_of]) for basis in (first, second))
        aa, bb, ab = (np.add.reduceat(product, self._first_click) for product in (a * a, b * b, a * b))
        angle = (0.5 * np.arctan2(2.0 * ab, aa - bb) + 0.5 * np.pi)[:, None]
        normal = (np.cos(angle) * first + np.sin(angle) * second)[self._line_of]
        flat = np.maximum(np.hypot(normal[:, 0], normal[:, 2]), 1e-9)
        off = np.einsum("ni,ni->n", rays, normal) / flat * state.focal
        if state.lens.none:
            return np.asarray(off)
        # A step across the line is longer or shorter in the distorted picture.
        squared = rays[:, 0] ** 2 + rays[:, 2] ** 2
        along = (rays[:, 0] * normal[:, 0] + rays[:, 2] * normal[:, 2]) ** 2 / np.maximum(squared * flat**2, 1e-20)
        gradient = np.sqrt(along / state.lens.slope(squared) ** 2 + (1.0 - along) / state.lens.scale(squared) ** 2)
        return np.asarray(off / gradient)

    def _rays(self, state: _State, clicks: FloatArray) -> FloatArray:
        """Directions of y = 1 in camera space through pixels, shape (n, 3)."""
        x, z = (clicks[:, 0] - state.centre[0]) / state.focal, (state.centre[1] - clicks[:, 1]) / state.focal
        radius = np.hypot(x, z)
        found = state.lens.undistorted(np.minimum(radius, state.lens.farthest)) if not state.lens.none else radius
        scale = np.where(radius > 1e-12, found / np.maximum(radius, 1e-12), 1.0)
        return np.stack([x * scale, np.ones_like(x), z * scale], axis=1)

    def _project(self, state: _State, world: FloatArray) -> FloatArray:
        """Pixels of world points, shape (n, 2); what is behind the camera goes far away, smoothly."""
        assert state.position is not None
        x, depth, z = ((np.atleast_2d(world) - state.position) @ state.rotation).T
        depth = np.where(depth > 1e-3, depth, 1e-3 * np.exp(np.clip(depth - 1e-3, -5.0, 0.0)))
        x, z = np.clip(x / depth, -1e4, 1e4), np.clip(z / depth, -1e4, 1e4)
        squared = np.minimum(x * x + z * z, min(state.lens.fold**2, 1e6))
        scale = state.lens.scale(squared) * state.focal
        return np.stack([state.centre[0] + scale * x, state.centre[1] - scale * z], axis=1)

    # Starts.

    def starts(self) -> list[tuple[float, FloatArray]]:
        """Vectors of unknowns to begin with, each with the cost that it has."""
        width = self.cues.size[0]
        fields = self.tuned.view_fovs if self.cues.fov is None else (self.cues.fov,)
        found = []
        for fov in fields:
            focal = 0.5 * width / np.tan(np.radians(0.5 * fov))
            centre = np.array(self.cues.principal_point or (0.5, 0.5)) * self.cues.size
            k1, k2 = self.cues.distortion or (0.0, 0.0)
            state = _State(np.eye(3), None, float(focal), centre, RadialDistortion(k1, k2), ())
            for rotation in self._rotations(state):
                vector = self._begun(replace(state, rotation=rotation))
                if vector is not None:
                    found.append((float(np.sum(self.errors(vector) ** 2)), vector))
        return found

    def _rotations(self, state: _State) -> list[FloatArray]:
        """Camera-to-world rotations that the lines, or the points, suggest for a focal length."""
        directions: dict[int, FloatArray] = {}
        single: dict[int, tuple[Line, FloatArray]] = {}
        for axis in range(3):
            lines = [line for line in self.cues.lines if line.axis == axis]
            ends = [self._rays(state, line.clicks[[0, -1]]) for line in lines]
            ends = [pair / np.linalg.norm(pair, axis=1, keepdims=True) for pair in ends]
            if len(ends) >= 2:
                normals = np.array([np.cross(*pair) for pair in ends])
                directions[axis] = np.linalg.svd(normals)[2][2]
            elif ends:
                single[axis] = lines[0], ends[0]
            votes = [
                _sense(pair[0], pair[1], directions[axis])
                for line, pair in zip(lines, ends, strict=True)
                if axis in directions and line.directed
            ]
            if sum(np.sign(votes)) < 0:
                directions[axis] = -directions[axis]
        rotations = []
        if len(directions) >= 2:
            rotations += self._from_directions(directions)
        elif directions:
            (axis, direction), *_ = directions.items()
            for other, (line, pair) in single.items():
                across = np.cross(direction, np.cross(*pair))
                across /= np.linalg.norm(across)
                sense = _sense(pair[0], pair[1], across) if line.directed else 0.0
                signs = (1.0, -1.0) if sense == 0.0 else (np.sign(sense),)
                for sign in signs:
                    rotations += self._from_directions({axis: direction, other: sign * across})
            if not rotations and len(self.cues.points) >= 2:
                helper = np.eye(3)[np.argmin(np.abs(direction))]
                across = np.cross(direction, helper)
                across /= np.linalg.norm(across)
                for angle in np.arange(self.tuned.view_spins) * 2.0 * np.pi / self.tuned.view_spins:
                    turned = np.cos(angle) * across + np.sin(angle) * np.cross(direction, across)
                    rotations += self._from_directions({axis: direction, (axis + 1) % 3: turned})
        if len(self.cues.points) >= 4:
            rotations += self._from_points(state)
        return rotations

    def _from_directions(self, directions: dict[int, FloatArray]) -> list[FloatArray]:
        """The rotation whose rows are nearest to axes of the world as the camera sees them."""
        target = np.zeros((3, 3))
        for axis, direction in directions.items():
            target[axis] = direction
        missing = [axis for axis in range(3) if axis not in directions]
        undirected = [axis for axis in directions if not self._is_directed(axis)]
        if missing:
            (axis,) = missing
            target[axis] = np.cross(target[(axis + 1) % 3], target[(axis + 2) % 3])
        elif undirected and np.linalg.det(target) < 0.0:
            target[undirected[0]] *= -1.0
        left, _, right = np.linalg.svd(target)
        rotation = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
        return [rotation]

    def _is_directed(self, axis: int) -> bool:
        return any(line.directed for line in self.cues.lines if line.axis == axis)

    def _from_points(self, state: _State) -> list[FloatArray]:
        rays = self._rays(state, np.array([point.click for point in self.cues.points]))
        image = np.stack([rays[:, 0], -rays[:, 2]], axis=1)
        world = np.array([point.world for point in self.cues.points])
        try:
            _, turns, _, _ = cv2.solvePnPGeneric(world, image, np.eye(3), None, flags=cv2.SOLVEPNP_SQPNP)
        except cv2.error:
            return []
        # OpenCV's camera has x to the right, y down and z forward.
        to_ours = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
        return [(to_ours @ cv2.Rodrigues(turn)[0]).T for turn in turns]

    def _begun(self, state: _State) -> FloatArray | None:
        """The unknowns for a rotation and a lens: position and distances by linear equations."""
        vector = np.zeros(self.count)
        vector[self.places["rotation"]] = Rotation.from_matrix(state.rotation).as_rotvec()
        if "focal" in self.places:
            vector[self.places["focal"]] = np.log(state.focal)
        if "centre" in self.places:
            vector[self.places["centre"]] = 0.5
        if not self.cues.placed:
            return vector
        position = self._position(state)
        if position is None:
            return None
        if "position" in self.places:
            vector[self.places["position"]] = position[2:] if self.cues.floats else position
        for number, distance in enumerate(self.cues.distances):
            place = self._place(state, distance, position)
            if place is None:
                return None
            vector[self.places[f"distance {number}"]] = place
        return vector

    def _position(self, state: _State) -> FloatArray | None:
        cues = self.cues
        if cues.position is not None:
            return cues.position
        if len(cues.points) >= 2:
            rows, right = [], []
            for point in cues.points:
                ray = state.rotation @ self._rays(state, point.click[None])[0]
                ray /= np.linalg.norm(ray)
                across = np.eye(3) - np.outer(ray, ray)
                rows.append(across)
                right.append(across @ point.world)
            return np.linalg.lstsq(np.concatenate(rows), np.concatenate(right), rcond=None)[0]
        # Up to scale: one metre from the known point, or one metre above the floor.
        position = np.array([0.0, 0.0, 1.0])
        if cues.points:
            ray = state.rotation @ self._rays(state, cues.points[0].click[None])[0]
            position = -ray
            anchor = cues.points[0].world
        else:
            anchor = np.zeros(3)
        if cues.camera_height is not None:
            if position[2] <= 1e-6:
                return None
            return anchor + position * (cues.camera_height - anchor[2]) / position[2]
        for distance in cues.distances:
            place = self._place(state, replace(distance, metres=1.0), position)
            if place is None:
                continue
            length = self._length(state, distance, position, place)
            if length is not None and length > 1e-6:
                return anchor + position * distance.metres / length
        return None

    def _place(self, state: _State, distance: Distance, position: FloatArray) -> FloatArray | None:
        """Where a distance's first point is, from its click."""
        rays = self._rays(state, distance.clicks) @ state.rotation.T
        if distance.through_origin and distance.axis is not None:
            return np.array([_along(position, rays[0], np.zeros(3), np.eye(3)[distance.axis])])
        if abs(rays[0, 2]) < 1e-6 or -position[2] / rays[0, 2] <= 0.0:
            return None
        first = position - rays[0] * position[2] / rays[0, 2]
        if distance.axis is not None:
            return first[:2]
        if abs(rays[1, 2]) < 1e-6 or -position[2] / rays[1, 2] <= 0.0:
            return None
        x, y, _ = position - rays[1] * position[2] / rays[1, 2] - first
        return np.array([first[0], first[1], np.arctan2(y, x)])

    def _length(self, state: _State, distance: Distance, position: FloatArray, place: FloatArray) -> float | None:
        """How long a distance would be, seen from a position."""
        rays = self._rays(state, distance.clicks) @ state.rotation.T
        if distance.axis is None:
            if abs(rays[1, 2]) < 1e-6:
                return None
            second = position - rays[1] * position[2] / rays[1, 2]
            return float(np.hypot(second[0] - place[0], second[1] - place[1]))
        first = self._ends(distance, place)[0]
        return _along(position, rays[1], first, np.eye(3)[distance.axis])


def _sense(first: FloatArray, second: FloatArray, direction: FloatArray) -> float:
    """Positive where going from one ray to another is going along a direction."""
    return float(np.cross(first, second) @ np.cross(first, direction))


def _along(position: FloatArray, ray: FloatArray, start: FloatArray, direction: FloatArray) -> float:
    """How far along a line from a start the point is that is nearest to a ray."""
    ray = ray / np.linalg.norm(ray)
    across = np.eye(3) - np.outer(ray, ray)
    line = across @ direction
    return float(line @ (across @ (position - start)) / max(float(line @ line), 1e-12))

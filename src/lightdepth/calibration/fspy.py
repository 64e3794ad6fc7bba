"""Project files of fSpy: a header, the program's state as JSON, and the photograph as it was loaded.

The format is described in fSpy's own ``project_file_format.md``; version 1 is the only one. Positions in the state are
relative, from the upper left corner in shares of width and height; the image plane of ``cameraParameters`` has y up, with
the longer side from -1 to 1. fSpy's camera looks along -z with y up, and its lens has no distortion.
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lightdepth.calibration.view_cues import AXES, Distance, Line, Point, ViewCues
from lightdepth.calibration.view_solve import ViewCalibration
from lightdepth.cameras.perspective import Perspective
from lightdepth.directions import FloatArray
from lightdepth.errors import InputError
from lightdepth.images.writing import whole_file

_START = struct.Struct("<4sIII")
_VERSION = 1
_METRES = {
    "No unit": 1.0,
    "Millimeters": 1e-3,
    "Centimeters": 1e-2,
    "Meters": 1.0,
    "Kilometers": 1e3,
    "Inches": 0.0254,
    "Feet": 0.3048,
    "Yards": 0.9144,
    "Miles": 1609.344,
}


@dataclass(frozen=True)
class FspyProject:
    """A project file.

    Attributes:
        path: the file, for messages.
        state: fSpy's state.
        image: the photograph's file as bytes; empty where the project has none.
    """

    path: Path
    state: dict[str, Any]
    image: bytes


def read_fspy(path: Path) -> FspyProject:
    """Read a project file.

    Raises:
        InputError: the file is missing, of another kind or version, cut off, or its state is damaged.
    """
    try:
        content = path.read_bytes()
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    if len(content) < _START.size or content[:4] != b"fspy":
        raise InputError(f"{path}: not an fSpy project: it does not start like one")
    _, version, state_size, image_size = _START.unpack_from(content)
    if version != _VERSION:
        raise InputError(
            f"{path}: is an fSpy project in version {version} of the format; only version {_VERSION} is read"
        )
    state, image = content[_START.size :][:state_size], content[_START.size + state_size :]
    if len(state) < state_size or len(image) < image_size:
        raise InputError(f"{path}: the fSpy project is cut off")
    try:
        found = json.loads(state)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: the state of this fSpy project is damaged: it is not JSON") from error
    if not isinstance(found, dict):
        raise InputError(f"{path}: the state of this fSpy project is damaged: it is not a JSON object")
    return FspyProject(path, found, image[:image_size])


def fspy_cues(project: FspyProject, size: tuple[int, int]) -> ViewCues:
    """What a person clicked in fSpy, as cues.

    Args:
        project: the project.
        size: width and height of its photograph, pixels.

    Raises:
        InputError: the state lacks something, or its control points have no vanishing point.
    """
    try:
        return _cues(project, size)
    except (KeyError, TypeError, IndexError, ValueError, AttributeError) as error:
        raise InputError(
            f"{project.path}: the state of this fSpy project is damaged: lines, points or settings are missing"
        ) from error


def _cues(project: FspyProject, size: tuple[int, int]) -> ViewCues:
    state = project.state
    base, controls = state["calibrationSettingsBase"], state["controlPointsStateBase"]
    scale = np.array(size, np.float64)

    def at(point: dict[str, float]) -> FloatArray:
        return np.array([float(point["x"]), float(point["y"])]) * scale

    def segments(control: dict[str, Any]) -> list[FloatArray]:
        return [np.stack([at(end) for end in segment]) for segment in control["lineSegments"]]

    first = segments(controls["firstVanishingPoint"])
    axes = [_axis(base["firstVanishingPointAxis"]), _axis(base["secondVanishingPointAxis"])]
    lines, fov = _lines(project.path, first, axes[0], True), None
    principal: tuple[float, float] | None = (0.5, 0.5)
    if state["globalSettings"]["calibrationMode"] == "OneVanishingPoint":
        settings = state["calibrationSettings1VP"]
        camera = base["cameraData"]
        sensor = camera.get("presetData") or {
            "sensorWidth": camera["customSensorWidth"],
            "sensorHeight": camera["customSensorHeight"],
        }
        longer = max(float(sensor["sensorWidth"]), float(sensor["sensorHeight"]))
        focal = float(settings["absoluteFocalLength"]) / longer * max(size)
        fov = float(np.degrees(2.0 * np.arctan(0.5 * size[0] / focal)))
        horizon = np.array([1.0, 0.0])
        if settings.get("horizonMode") == "Manual":
            ends = [at(end) for end in state["controlPointsState1VP"]["horizon"]]
            horizon = ends[1] - ends[0]
        # The second axis vanishes on the horizon, which runs through the first vanishing point: as a line along that axis.
        middle = _crossing(project.path, first)
        step = horizon / np.hypot(*horizon) * 0.2 * max(size)
        clicks = np.stack([middle - step, middle + step])
        lines += [Line("the horizon", axes[1][0], clicks if axes[1][1] > 0 else clicks[::-1])]
    else:
        settings = state["calibrationSettings2VP"]
        more = state["controlPointsState2VP"]
        second = segments(more["secondVanishingPoint"])
        if settings.get("quadModeEnabled"):
            second = [np.stack([first[0][end], first[1][end]]) for end in (0, 1)]
        lines += _lines(project.path, second, axes[1], True)
        if settings["principalPointMode"] == "FromThirdVanishingPoint":
            third = ({0, 1, 2} - {axis for axis, _ in axes}).pop()
            lines += _lines(project.path, segments(more["thirdVanishingPoint"]), (third, 1), False)
            principal = None
    if principal is not None and settings["principalPointMode"] == "Manual":
        principal = float(controls["principalPoint"]["x"]), float(controls["principalPoint"]["y"])
    points = (Point("the origin", at(controls["origin"]), np.zeros(3)),)
    distances: tuple[Distance, ...] = ()
    along = base.get("referenceDistanceAxis")
    if along is not None:
        axis, _ = _axis(along)
        metres = float(base["referenceDistance"]) * _METRES[base["referenceDistanceUnit"]]
        on_axis = [line.clicks for line in lines if line.axis == axis]
        if len(on_axis) < 2:
            raise InputError(f"{project.path}: the reference distance lies along an axis that has no lines")
        anchor = at(controls["origin"]) / scale
        toward = _crossing(project.path, on_axis) / scale - anchor
        toward /= np.hypot(*toward)
        low, high = sorted(float(offset) for offset in controls["referenceDistanceHandleOffsets"])
        clicks = np.stack([anchor + low * toward, anchor + high * toward]) * scale
        # Toward the vanishing point is along the axis where its lines were clicked so.
        forward = next(line for line in lines if line.axis == axis).clicks
        if (forward[1] - forward[0]) @ (toward * scale) < 0.0:
            clicks = clicks[::-1]
        distances = (Distance("the reference distance", clicks, metres, axis, through_origin=True),)
    return ViewCues(
        size,
        lines=tuple(lines),
        points=points if distances else (),
        distances=distances,
        fov=fov,
        principal_point=principal,
    )


def _axis(name: str) -> tuple[int, int]:
    """Axis and sign of a name such as ``xPositive``."""
    return AXES.index(name[0]), 1 if name[1:] == "Positive" else -1


def _lines(path: Path, segments: list[FloatArray], axis: tuple[int, int], directed: bool) -> list[Line]:
    """Segments as lines that run toward their vanishing point, along the axis, or against it where that is negative."""
    target = _crossing(path, segments)
    lines = []
    for number, clicks in enumerate(segments, start=1):
        toward = (clicks[1] - clicks[0]) @ (target - clicks.mean(axis=0)) > 0.0
        ordered = clicks if toward == (axis[1] > 0) else clicks[::-1]
        lines.append(Line(f"fSpy's line {number} along {AXES[axis[0]]}", axis[0], ordered, directed))
    return lines


def _crossing(path: Path, segments: list[FloatArray]) -> FloatArray:
    """Where the straight lines through the first two segments cross, pixels."""
    homogeneous = [np.cross([*segment[0], 1.0], [*segment[1], 1.0]) for segment in segments[:2]]
    crossing = np.cross(homogeneous[0], homogeneous[1])
    scale = np.linalg.norm(homogeneous[0]) * np.linalg.norm(homogeneous[1])
    if abs(crossing[2]) < 1e-12 * scale:
        raise InputError(
            f"{path}: two lines of this fSpy project are parallel in the picture, so they have no vanishing point"
        )
    return np.asarray(crossing[:2] / crossing[2])


def write_fspy(path: Path, result: ViewCalibration, image: bytes) -> list[str]:
    """Write a project file whose lines and camera are those of a solution.

    Args:
        path: where to write; an existing file is replaced.
        result: the camera.
        image: the photograph's file.

    Returns:
        What the file cannot say, as sentences.

    Raises:
        InputError: the file cannot be written.
    """
    notes = []
    camera = result.camera
    if camera.distortion != (0.0, 0.0):
        notes.append(f"{path}: fSpy knows no distortion; undistort the photograph first (lightdepth stmap write)")
    straight = camera.model_copy(update={"distortion": (0.0, 0.0)})
    position = result.position if result.position is not None else np.zeros(3)
    longer = max(camera.width, camera.height)
    half = np.array([camera.width, camera.height]) / longer
    focal = (camera.width / longer) / np.tan(np.radians(0.5 * camera.fov))
    to_world = np.eye(4)
    # fSpy's camera has x to the right, y up and z backward.
    to_world[:3, :3] = result.rotation @ np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
    to_world[:3, 3] = position
    principal = (np.array(camera.centre) * 2.0 - 1.0) * half * [1.0, -1.0]
    # Axes by how far they lead away from the camera, in the direction in which they do.
    ahead = result.rotation[:, 1]
    order = np.argsort(-np.abs(ahead))[:2]
    if abs(ahead[order[1]]) < 0.02:
        notes.append(f"{path}: only one axis recedes from the camera, so that fSpy itself cannot solve these lines")
    chosen = [(int(axis), 1 if ahead[axis] >= 0.0 else -1) for axis in order]
    third = 3 - chosen[0][0] - chosen[1][0]
    sign = 1 if np.linalg.det(np.array([s * np.eye(3)[a] for a, s in chosen] + [np.eye(3)[third]])) > 0.0 else -1
    every = [*chosen, (third, sign)]
    vanishing = [_vanishing_point(straight, s * result.rotation[a]) for a, s in every]
    controls = [{"lineSegments": _control_lines(point)} for point in vanishing]
    origin, handles = np.array([0.5, 0.5]), None
    film, ahead_of = straight.film_of((np.stack([np.zeros(3), *np.eye(3)]) - position) @ result.rotation)
    if result.position is not None and ahead_of.all():
        origin = film[0]
        axis, sign = chosen[0]
        toward = vanishing[0] - origin
        handles = [0.0, float((film[1 + axis] - origin) @ toward / np.hypot(*toward))]
    elif result.position is not None:
        notes.append(f"{path}: the world's origin is not in front of the camera, so that fSpy itself finds no position")
    view = np.linalg.inv(to_world)
    state = {
        "globalSettings": {"calibrationMode": "TwoVanishingPoints", "imageOpacity": 0.2, "overlay3DGuide": "None"},
        "calibrationSettingsBase": {
            "referenceDistanceAxis": f"{AXES[chosen[0][0]]}Positive" if handles else None,
            "referenceDistance": 1,
            "referenceDistanceUnit": "Meters",
            "cameraData": {
                "presetId": None,
                "presetData": None,
                "customSensorWidth": 36,
                "customSensorHeight": 36 * camera.height / camera.width,
            },
            "firstVanishingPointAxis": _axis_name(chosen[0]),
            "secondVanishingPointAxis": _axis_name(chosen[1]),
        },
        "calibrationSettings1VP": {
            "principalPointMode": "Default",
            "absoluteFocalLength": 18.0 / np.tan(np.radians(0.5 * camera.fov)),
        },
        "calibrationSettings2VP": {"principalPointMode": "Manual", "quadModeEnabled": False},
        "controlPointsStateBase": {
            "principalPoint": _xy(np.array(camera.centre)),
            "origin": _xy(origin),
            "referenceDistanceAnchor": _xy(origin),
            "referenceDistanceHandleOffsets": handles or [0.0, 0.1],
            "firstVanishingPoint": controls[0],
        },
        "controlPointsState1VP": {"horizon": [{"x": 0.2, "y": 0.5}, {"x": 0.8, "y": 0.5}]},
        "controlPointsState2VP": {"secondVanishingPoint": controls[1], "thirdVanishingPoint": controls[2]},
        "cameraParameters": {
            "principalPoint": _xy(principal),
            "viewTransform": {"rows": view.tolist()},
            "cameraTransform": {"rows": to_world.tolist()},
            "horizontalFieldOfView": float(np.radians(camera.fov)),
            "verticalFieldOfView": float(2.0 * np.arctan(half[1] / focal)),
            "vanishingPoints": [_xy((point * 2.0 - 1.0) * half * [1.0, -1.0]) for point in vanishing],
            "vanishingPointAxes": [_axis_name(axis) for axis in every],
            "relativeFocalLength": float(focal),
            "imageWidth": camera.width,
            "imageHeight": camera.height,
        },
        "resultDisplaySettings": {
            "orientationFormat": "AxisAngleDegrees",
            "principalPointFormat": "Absolute",
            "fieldOfViewFormat": "Degrees",
            "displayAbsoluteFocalLength": False,
        },
    }
    text = json.dumps(state).encode()
    with whole_file(path) as temporary:
        temporary.write_bytes(_START.pack(b"fspy", _VERSION, len(text), len(image)) + text + image)
    return notes


def _vanishing_point(camera: Perspective, direction: FloatArray) -> FloatArray:
    """Relative position where lines along a direction of camera space meet; far away where they hardly do."""
    depth = direction[1] if abs(direction[1]) > 1e-6 else 1e-6
    across = direction / depth
    half = np.tan(np.radians(0.5 * camera.fov))
    x, y = camera.centre
    return np.array([x + 0.5 * across[0] / half, y - 0.5 * across[2] / half * camera.width / camera.height])


def _control_lines(vanishing: FloatArray) -> list[list[dict[str, float]]]:
    """Two segments in the picture that point at a vanishing point, from corners that lie in different directions."""
    corners = np.array([[0.2, 0.2], [0.8, 0.2], [0.2, 0.8], [0.8, 0.8]])
    toward = vanishing - corners
    distance = np.hypot(*toward.T)
    angle = toward / distance[:, None]
    pairs = [(i, j) for i in range(4) for j in range(i)]
    first, second = max(pairs, key=lambda pair: abs(np.cross([*angle[pair[0]], 0], [*angle[pair[1]], 0])[2]))
    ends = [(corners[i], corners[i] + angle[i] * min(0.3, 0.8 * distance[i])) for i in (first, second)]
    return [[_xy(start), _xy(end)] for start, end in ends]


def _axis_name(axis: tuple[int, int]) -> str:
    return f"{AXES[axis[0]]}{'Positive' if axis[1] > 0 else 'Negative'}"


def _xy(point: FloatArray) -> dict[str, float]:
    return {"x": float(point[0]), "y": float(point[1])}

"""What a person knows about the camera of a photograph, and how it is written on the command line."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from lightdepth.directions import FloatArray
from lightdepth.errors import InputError

AXES = "xyz"
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_PAIR = rf"{_NUMBER}\s*,\s*{_NUMBER}"
_DISTANCE = re.compile(rf"\s*({_PAIR})[\s;]+({_PAIR})\s*=\s*({_NUMBER})\s*m?\s*(?:along\s+([xyz]))?\s*")
_POINT = re.compile(rf"\s*({_PAIR})\s*=\s*({_PAIR}\s*,\s*{_NUMBER})\s*m?\s*")
_MATCH = re.compile(rf"\s*({_PAIR})\s*=\s*({_PAIR})\s*")


@dataclass(frozen=True)
class Line:
    """A straight edge along an axis of the world.

    Attributes:
        name: for messages.
        axis: 0, 1 or 2.
        clicks: pixels, shape (n, 2), two or more; from minus to plus where ``directed``.
        directed: whether the order of the clicks says which way the axis runs.
    """

    name: str
    axis: int
    clicks: FloatArray
    directed: bool = True


@dataclass(frozen=True)
class Point:
    """A point whose place in the world is known.

    Attributes:
        name: for messages.
        click: pixels, shape (2,).
        world: metres, shape (3,).
    """

    name: str
    click: FloatArray
    world: FloatArray


@dataclass(frozen=True)
class Distance:
    """A known distance between two clicked points.

    Attributes:
        name: for messages.
        clicks: pixels, shape (2, 2).
        metres: the distance.
        axis: 0, 1 or 2: the second point lies along this axis from the first; ``None``: both are on the floor.
        through_origin: the first point lies on the axis through the world's origin; else on the floor, at z = 0.
    """

    name: str
    clicks: FloatArray
    metres: float
    axis: int | None = None
    through_origin: bool = False


@dataclass(frozen=True)
class ViewCues:
    """All that is known about a photograph's camera.

    Attributes:
        size: width and height of the photograph, pixels.
        lines: edges along the world's axes.
        points: of known place; the world's origin is one of them.
        distances: known distances.
        position: of the lens, world, metres, where that is known.
        camera_height: above the floor, metres.
        fov: horizontal, degrees, without distortion; ``None`` is solved for.
        principal_point: in shares of width and height from the upper left corner; ``None`` is solved for.
        distortion: k1 and k2; ``None`` is solved for.
        click_error: standard deviation of a click along either axis, pixels.
    """

    size: tuple[int, int]
    lines: tuple[Line, ...] = ()
    points: tuple[Point, ...] = ()
    distances: tuple[Distance, ...] = ()
    position: FloatArray | None = None
    camera_height: float | None = None
    fov: float | None = None
    principal_point: tuple[float, float] | None = (0.5, 0.5)
    distortion: tuple[float, float] | None = (0.0, 0.0)
    click_error: float = 1.0

    @property
    def names(self) -> tuple[str, ...]:
        """Of all lines, points and distances."""
        lines, points = (line.name for line in self.lines), (point.name for point in self.points)
        return (*lines, *points, *(distance.name for distance in self.distances))

    @property
    def floats(self) -> bool:
        """Whether nothing says where the world's origin is, so that it is on the floor under the camera."""
        return not self.points and self.position is None and not any(each.through_origin for each in self.distances)

    @property
    def placed(self) -> bool:
        """Whether anything says where the camera is."""
        known = self.points or self.distances or self.position is not None or self.camera_height is not None
        return bool(known)


def read_line(text: str, axis: int, number: int, size: tuple[int, int]) -> Line:
    """Read ``"x,y x,y ..."``: two or more points along an edge.

    Raises:
        InputError: other than two or more points on the photograph.
    """
    name = f"--{AXES[axis]}-line {number}"
    words = [word for word in re.split(r"[\s;]+", re.sub(r"\s*,\s*", ",", text.strip())) if word]
    clicks = np.array([_pair(word, name, size) for word in words]).reshape(-1, 2)
    if len(clicks) < 2:
        raise InputError(f"{name}: has {len(clicks)} point; two or more along the edge are needed")
    if np.hypot(*(clicks[-1] - clicks[0])) < 2.0:
        raise InputError(f"{name}: its ends are less than 2 pixels apart; click them far apart")
    return Line(name, axis, clicks)


def read_point(text: str, number: int, size: tuple[int, int]) -> Point:
    """Read ``"x,y = X,Y,Z"``: pixels, and metres in the world.

    Raises:
        InputError: anything else, or a click that is not on the photograph.
    """
    name = f"--point {number}"
    found = _POINT.fullmatch(text)
    if found is None:
        raise InputError(f"{name}: '{text}' is not understood; write \"x,y = X,Y,Z\": pixels, and metres in the world")
    world = np.array([float(word) for word in found[2].split(",")])
    return Point(name, _pair(found[1], name, size), world)


def read_match(text: str, number: int, size: tuple[int, int]) -> tuple[str, FloatArray, str]:
    """Read ``"x,y = u,v"``: pixels of the photograph and of the panorama.

    Returns:
        A name for messages, the click on the photograph, and the text of that on the panorama.

    Raises:
        InputError: anything else, or a click that is not on the photograph.
    """
    name = f"--match {number}"
    found = _MATCH.fullmatch(text)
    if found is None:
        raise InputError(
            f"{name}: '{text}' is not understood; write \"x,y = u,v\": pixels of the photograph, and of the panorama"
        )
    return name, _pair(found[1], name, size), found[2]


def read_distance(text: str, number: int, size: tuple[int, int]) -> Distance:
    """Read ``"x,y x,y = 2.0 m along z"``; without ``along`` both points are on the floor.

    Raises:
        InputError: anything else, a length that is not positive, or a click that is not on the photograph.
    """
    name = f"--distance {number}"
    found = _DISTANCE.fullmatch(text)
    if found is None:
        raise InputError(
            f"{name}: '{text}' is not understood; write \"x,y x,y = 2.0 m along z\", from a point on the floor along an "
            'axis, or "x,y x,y = 2.0 m" between two points on the floor'
        )
    metres = float(found[3])
    if not metres > 0.0:
        raise InputError(f"{name}: {metres:g} m is not a length; a positive number of metres is needed")
    clicks = np.stack([_pair(found[1], name, size), _pair(found[2], name, size)])
    return Distance(name, clicks, metres, AXES.index(found[4]) if found[4] else None)


def read_pair(text: str, option: str, size: tuple[int, int]) -> FloatArray:
    """Read one click ``"x,y"`` on the photograph.

    Raises:
        InputError: anything else.
    """
    return _pair(text, option, size)


def _pair(word: str, name: str, size: tuple[int, int]) -> FloatArray:
    try:
        x, y = (float(number) for number in word.split(","))
    except ValueError:
        raise InputError(f"{name}: '{word}' is not a point; write it as x,y in pixels") from None
    width, height = size
    if not (0.0 <= x <= width and 0.0 <= y <= height):
        raise InputError(f"{name}: {x:g},{y:g} is not on the photograph of {width} x {height} pixels")
    return np.array([x, y])

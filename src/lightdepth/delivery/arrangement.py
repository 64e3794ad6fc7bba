"""Which camera a kind of delivery needs, and how its pictures are arranged for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from lightdepth.delivery.frames import Frames
from lightdepth.delivery.spherical import Sphere, Stereo
from lightdepth.errors import InputError

Kind = Literal["dome-master", "360", "360-stereo", "vr180", "video", "stills"]
Picture = NDArray[Any]


@dataclass(frozen=True)
class Arrangement:
    """How the frames' pictures become those that are delivered.

    Attributes:
        size: width and height of what is delivered, pixels.
        sphere: what it shows of the sphere; ``None`` for a flat picture or a dome.
        arranged: makes such a picture, shape (height, width, 3), out of a frame's.
    """

    size: tuple[int, int]
    sphere: Sphere | None
    arranged: Callable[[Picture], Picture]


def arrangement(kind: Kind, frames: Frames) -> Arrangement:
    """How frames are arranged for a kind of delivery.

    Raises:
        InputError: their camera, or their proportions, do not fit.
    """
    return {
        "dome-master": _dome,
        "360": _panorama,
        "360-stereo": _stereo,
        "vr180": _half_sphere,
        "video": _as_it_is,
        "stills": _still,
    }[kind](frames)


def _dome(frames: Frames) -> Arrangement:
    _check(frames, "dome-master", ("fisheye", "dome_master"), (1, 1))
    if frames.camera.get("mapping", "equidistant") != "equidistant":
        raise InputError(
            f"{frames.first}: its fisheye mapping is {frames.camera['mapping']}; a dome master is equidistant: set "
            'mapping = "equidistant" in the camera'
        )
    return _as_it_is(frames)


def _panorama(frames: Frames) -> Arrangement:
    _check(frames, "360", ("equirectangular",), (2, 1))
    return Arrangement(frames.size, Sphere(), _same)


def _stereo(frames: Frames) -> Arrangement:
    return Arrangement(frames.size, Sphere(_layout(frames, "360-stereo")), _same)


def _half_sphere(frames: Frames) -> Arrangement:
    """The front half of each eye, side by side."""
    width, height = frames.size
    sphere = Sphere("side-by-side", half=True)
    if frames.camera.get("type") == "vr180":
        return Arrangement(frames.size, sphere, _same)
    layout = _layout(frames, "vr180")
    across = width // 2 if layout == "side-by-side" else width
    down = height // 2 if layout == "top-bottom" else height

    def arranged(picture: Picture) -> Picture:
        front = slice(across // 4, across // 4 + across // 2)
        if layout == "top-bottom":
            eyes = picture[:down, front], picture[down:, front]
        else:
            eyes = picture[:, :across][:, front], picture[:, across:][:, front]
        return np.concatenate(eyes, axis=1)

    return Arrangement((across // 2 * 2, down), sphere, arranged)


def _as_it_is(frames: Frames) -> Arrangement:
    return Arrangement(frames.size, None, _same)


def _still(frames: Frames) -> Arrangement:
    """A panorama is one; of two eyes, the left one is on top."""
    if frames.camera.get("type") == "ods":
        width, height = frames.size
        if _layout(frames, "stills") == "top-bottom":
            return Arrangement(frames.size, Sphere("top-bottom"), _same)
        return Arrangement(
            (width // 2, 2 * height),
            Sphere("top-bottom"),
            lambda picture: np.concatenate((picture[:, : width // 2], picture[:, width // 2 :]), axis=0),
        )
    whole = frames.camera.get("type") == "equirectangular" or frames.header.attributes.get("envmap") == "latlong"
    return Arrangement(frames.size, Sphere() if whole else None, _same)


def _layout(frames: Frames, kind: Kind) -> Stereo:
    """How the panoramas of two eyes are arranged, by the camera, or else by the proportions."""
    width, height = frames.size
    if frames.camera.get("layout") == "side-by-side" or (not frames.camera and width == 4 * height):
        _check(frames, kind, ("ods",), (4, 1))
        return "side-by-side"
    _check(frames, kind, ("ods",), (1, 1))
    return "top-bottom"


def _same(picture: Picture) -> Picture:
    return picture


def _check(frames: Frames, kind: Kind, cameras: tuple[str, ...], proportions: tuple[int, int]) -> None:
    camera = frames.camera.get("type")
    if camera is not None and camera not in cameras:
        raise InputError(
            f"{frames.first}: is from a camera of type '{camera}'; --as {kind} needs {' or '.join(map(repr, cameras))}"
        )
    width, height = frames.size
    if width * proportions[1] != height * proportions[0]:
        raise InputError(
            f"{frames.first}: has {width} x {height} pixels; --as {kind} needs an aspect ratio of {proportions[0]} to "
            f"{proportions[1]}"
        )

"""Photographs of a mirror ball as linear radiance, upright, with what was clipped in them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from lightdepth.capture.fisheye import parse_circle
from lightdepth.capture.merging import Progress
from lightdepth.capture.mirror_ball.finding import Optics
from lightdepth.capture.mirror_ball.geometry import BallView
from lightdepth.capture.shoot import MergeOptions, Shoot, read_shoot
from lightdepth.errors import InputError
from lightdepth.parameters.capture import DEFAULT as CAPTURE
from lightdepth.parameters.capture import CaptureParameters
from lightdepth.parameters.mirror_ball import DEFAULT, MirrorBallParameters

_UPRIGHT = {180.0: cv2.ROTATE_180, 90.0: cv2.ROTATE_90_CLOCKWISE, -90.0: cv2.ROTATE_90_COUNTERCLOCKWISE}


@dataclass(frozen=True, eq=False)
class BallPhotograph:
    """A photograph of a ball.

    Attributes:
        name: what the user calls it.
        radiance: linear RGB, upright, shape (height, width, 3), float32.
        clipped: pixels clipped in every exposure, shape (height, width), bool.
    """

    name: str
    radiance: NDArray[np.float32]
    clipped: NDArray[np.bool_]


def read_balls(
    inputs: Sequence[Path],
    options: MergeOptions,
    progress: Progress = lambda *_: None,
    tuned: MirrorBallParameters = DEFAULT,
    capture: CaptureParameters = CAPTURE,
) -> tuple[Shoot, list[BallPhotograph]]:
    """Read photographs, brackets merged, or HDR images.

    Args:
        inputs: as of :func:`lightdepth.capture.shoot.read_shoot`.
        options: how to merge.
        progress: called after each photograph.
        tuned: what is clipped in an HDR image.
        capture: how brackets are told apart, and merged.

    Raises:
        InputError: they are missing or cannot be merged, or differ in size.
    """
    shoot = read_shoot(inputs, options, progress, capture)
    found = []
    for orientation in shoot.orientations:
        radiance = orientation.radiance
        if shoot.exposure is None:
            clipped = _plateau(radiance, tuned)
        else:
            level = float(np.median(radiance.max(axis=2)))
            clipped = ~orientation.reliable & (radiance.max(axis=2) > level)
        clipped = np.asarray(clipped & orientation.seen)
        turn = _UPRIGHT.get(orientation.roll)
        if turn is not None:
            radiance, clipped = cv2.rotate(radiance, turn), cv2.rotate(clipped.astype(np.uint8), turn).astype(bool)
        found.append(BallPhotograph(orientation.name, np.asarray(radiance, np.float32), clipped))
    first = found[0]
    for other in found:
        if sorted(other.radiance.shape) != sorted(first.radiance.shape):
            raise InputError(
                f"{other.name}: is {other.radiance.shape[1]} x {other.radiance.shape[0]} pixels, {first.name} is "
                f"{first.radiance.shape[1]} x {first.radiance.shape[0]}; both must come from one lens, uncropped"
            )
    return shoot, found


def outline_given(photograph: BallPhotograph, text: str, optics: Optics, option: str) -> BallView:
    """The ball whose outline is stated as ``x,y,r``.

    Raises:
        InputError: the text is no circle, or it does not fit the camera.
    """
    try:
        circle = parse_circle(text)
    except InputError:
        raise InputError(f"{option} is '{text}'; allowed is x,y,r in pixels with a positive radius r") from None
    height, width = photograph.radiance.shape[:2]
    return optics.view(photograph.name, width, height, circle)


def _plateau(radiance: NDArray[np.float32], tuned: MirrorBallParameters) -> NDArray[np.bool_]:
    """Pixels that all have the largest value of a channel: what wrote the image had no more."""
    largest = radiance.reshape(-1, 3).max(axis=0)
    flat = np.asarray((radiance >= tuned.plateau_level * largest).any(axis=2))
    labels, count = ndimage.label(flat)
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    return np.asarray(flat & (sizes[labels] >= tuned.plateau_fewest_pixels))

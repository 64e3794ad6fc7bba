"""What clipped sources really send, from a grey ball beside the mirror ball.

Its matte surface faces all directions: what is brighter there than the panorama's light makes it, and how that falls off
from one side to the other, is the missing light of the sources that were clipped (Debevec, SIGGRAPH 2003 and 2012 courses).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.optimize import least_squares

from lightdepth.capture.mirror_ball.geometry import BallView
from lightdepth.capture.mirror_ball.unwrapping import Ball
from lightdepth.directions import FloatArray, direction_to_latlong, pixel_directions, pixel_solid_angles
from lightdepth.errors import InputError
from lightdepth.parameters.mirror_ball import DEFAULT, MirrorBallParameters


@dataclass(frozen=True)
class ClippedLight:
    """A source that was clipped.

    Attributes:
        pixel: x, y of a place in it, in the panorama's pixels.
        direction: toward its middle, unit, light space, shape (3,).
        angular_radius: degrees of a disc with its solid angle.
        radiance: that it really has over its whole plateau, shape (3,).
        irradiance: of a surface that faces it, shape (3,).
        clipped_irradiance: the same as the panorama has it.
        uncertainty: relative standard error of ``irradiance``, shape (3,).
    """

    pixel: tuple[float, float]
    direction: FloatArray
    angular_radius: float
    radiance: FloatArray
    irradiance: FloatArray
    clipped_irradiance: FloatArray
    uncertainty: FloatArray

    @property
    def gain(self) -> FloatArray:
        """True over clipped irradiance."""
        return np.asarray(self.irradiance / np.maximum(self.clipped_irradiance, 1e-30))

    def disc_radiance(self, diameter: float) -> FloatArray:
        """The radiance that a disc of ``diameter`` degrees must have for the same irradiance."""
        return np.asarray(self.irradiance / (4.0 * np.pi * np.sin(np.radians(diameter) / 4.0) ** 2))


@dataclass(frozen=True)
class GreyBall:
    """What the grey ball says.

    Attributes:
        sources: those that were clipped, the strongest first.
        disagreement: median relative difference between the ball and what is found to light it.
    """

    sources: list[ClippedLight]
    disagreement: float


def recover_from_grey_ball(
    ball: Ball,
    grey: BallView,
    albedo: FloatArray,
    radiance: NDArray[np.float32],
    clipped: NDArray[np.bool_],
    tuned: MirrorBallParameters = DEFAULT,
) -> GreyBall:
    """Solve what clipped sources send.

    Args:
        ball: the photograph that shows the grey ball too, with rotation and gain.
        grey: where the grey ball is in it.
        albedo: of the grey ball, shape (3,).
        radiance: the panorama, without gaps, shape (height, 2 height, 3).
        clipped: its clipped texels, shape (height, 2 height).
        tuned: what is compared, and what counts.

    Raises:
        InputError: the grey ball is clipped itself, or is darker than the panorama's light makes it.
    """
    normals, seen = _shading(ball, grey, tuned)
    solid = np.repeat(pixel_solid_angles(*clipped.shape)[:, None], clipped.shape[1], axis=1)
    regions = _regions(clipped, solid, tuned)
    directions = pixel_directions(*clipped.shape)
    lit = np.array([_irradiance(normals, directions[each], solid[each]) for each in regions])
    lit = lit.reshape(len(regions), len(normals))
    other = np.where(np.any(regions, axis=0)[..., None] if regions else False, 0.0, radiance)
    explained = _coarse_irradiance(normals, other, tuned)
    now = np.array([(radiance[each] * solid[each][:, None]).sum(axis=0) / solid[each].sum() for each in regions])
    now = now.reshape(len(regions), 3).astype(np.float64)
    shown = np.pi * seen / albedo
    found, errors = np.zeros((len(regions), 3)), np.zeros((len(regions), 3))
    left = np.zeros_like(shown)
    for channel in range(3):
        level = float(np.median(shown[:, channel]))
        if not regions:
            left[:, channel] = (explained[:, channel] - shown[:, channel]) / level
            continue
        found[:, channel], errors[:, channel], left[:, channel] = _solved(
            lit, explained[:, channel], shown[:, channel], now[:, channel], level, tuned
        )
    if float(np.median(left)) > tuned.grey_darker:
        raise InputError(
            f"{ball.name}: with this albedo the grey ball is {100.0 * float(np.median(left)):.0f} % darker than the "
            "mirror ball's light makes it; state --grey-albedo and --reflectance as they are (a matte surface of albedo 1 "
            "would reflect all light), and check --grey-circle"
        )
    sources = [
        _source(each, directions, solid, radiance, found[index], now[index], errors[index])
        for index, each in enumerate(regions)
    ]
    sources.sort(key=lambda each: -float(each.irradiance.sum()))
    return GreyBall(
        [each for each in sources if each.gain.max() >= tuned.grey_least_gain], float(np.median(np.abs(left)))
    )


def _shading(ball: Ball, grey: BallView, tuned: MirrorBallParameters) -> tuple[FloatArray, FloatArray]:
    """Normals of points of the grey ball, light space, and their radiance."""
    index = np.arange(2 * tuned.grey_points) + 0.5
    cosine = 1.0 - index / tuned.grey_points
    turn = np.pi * (1.0 + np.sqrt(5.0)) * index
    sphere = np.stack([np.sqrt(1.0 - cosine**2) * np.cos(turn), cosine, np.sqrt(1.0 - cosine**2) * np.sin(turn)], -1)
    to_camera = -grey.distance * grey.axis - sphere
    to_camera /= np.linalg.norm(to_camera, axis=1, keepdims=True)
    normals = sphere[(sphere * to_camera).sum(axis=1) > tuned.grey_grazing]
    x, y = grey.seen_at(normals)
    sigma = max(tuned.grey_blur * grey.circle().radius, 0.5)
    soft = cv2.GaussianBlur(ball.radiance, (0, 0), sigma)
    maps = ((x - 0.5).astype(np.float32)[None], (y - 0.5).astype(np.float32)[None])
    seen = cv2.remap(soft, *maps, cv2.INTER_LINEAR)[0].astype(np.float64) * ball.gain
    lost = cv2.remap(ball.clipped.astype(np.float32), *maps, cv2.INTER_LINEAR)[0] > 0.0
    if np.mean(lost) > 0.5:
        raise InputError(f"{ball.name}: the grey ball is clipped itself; add shorter exposures")
    return normals[~lost] @ ball.rotation.T, seen[~lost]


def _regions(clipped: NDArray[np.bool_], solid: FloatArray, tuned: MirrorBallParameters) -> list[NDArray[np.bool_]]:
    """Connected clipped parts, the largest first; the panorama's left and right edge are one."""
    labels, count = ndimage.label(clipped, np.ones((3, 3)))
    for row in np.flatnonzero((labels[:, 0] > 0) & (labels[:, -1] > 0)):
        labels[labels == labels[row, -1]] = labels[row, 0]
    sizes = np.bincount(labels.ravel(), weights=solid.ravel(), minlength=count + 1)
    sizes[0] = 0.0
    largest = np.argsort(-sizes)[: tuned.grey_most_sources]
    order = [number for number in largest if sizes[number] > tuned.grey_least_source * sizes.max() > 0.0]
    return [labels == number for number in order]


def _irradiance(normals: FloatArray, directions: FloatArray, solid: FloatArray) -> FloatArray:
    """Of radiance 1 from directions, shape (n,)."""
    return np.asarray(np.maximum(normals @ directions.T, 0.0) @ solid)


def _coarse_irradiance(normals: FloatArray, radiance: NDArray[np.floating], tuned: MirrorBallParameters) -> FloatArray:
    """Of a panorama, shape (n, 3)."""
    width = min(tuned.grey_irradiance_width, radiance.shape[1])
    # Weighed by solid angle, so that the sum stays.
    solid = pixel_solid_angles(*radiance.shape[:2])[:, None, None]
    size = (width, width // 2)
    factor = radiance.shape[0] * radiance.shape[1] / (size[0] * size[1])
    light = factor * cv2.resize((radiance * solid).astype(np.float64), size, interpolation=cv2.INTER_AREA)
    directions = pixel_directions(width // 2, width).reshape(-1, 3)
    return np.asarray(np.maximum(normals @ directions.T, 0.0) @ light.reshape(-1, 3))


def _solved(
    lit: FloatArray,
    explained: FloatArray,
    shown: FloatArray,
    now: FloatArray,
    level: float,
    tuned: MirrorBallParameters,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Radiances of the sources in a channel, their standard errors, and the relative differences that are left."""

    def differences(radiance: FloatArray) -> FloatArray:
        return np.asarray((explained + radiance @ lit - shown) / level)

    start = 1.01 * now + 1e-12
    solved = least_squares(
        differences, start, bounds=(now, np.inf), loss="soft_l1", f_scale=tuned.grey_scale, x_scale=now + 1e-12
    )
    jacobian = lit.T / level
    left = differences(solved.x)
    spread = 1.4826 * float(np.median(np.abs(left - np.median(left))))
    # Neighbouring points err alike; there are fewer independent ones than points.
    covariance = np.linalg.pinv(jacobian.T @ jacobian) * spread**2 * tuned.grey_correlated
    return solved.x, np.sqrt(np.diag(covariance)), left


def _source(
    region: NDArray[np.bool_],
    directions: FloatArray,
    solid: FloatArray,
    radiance: NDArray[np.float32],
    found: FloatArray,
    now: FloatArray,
    error: FloatArray,
) -> ClippedLight:
    middle = (directions[region] * solid[region][:, None]).sum(axis=0)
    middle /= max(float(np.linalg.norm(middle)), 1e-12)
    y, x = np.nonzero(region)
    nearest = int(np.argmax(directions[region] @ middle))
    angle = float(solid[region].sum())
    return ClippedLight(
        (float(x[nearest]) + 0.5, float(y[nearest]) + 0.5),
        middle,
        float(np.degrees(2.0 * np.arcsin(np.sqrt(angle / (4.0 * np.pi))))),
        found,
        found * angle,
        now * angle,
        error / np.maximum(found, 1e-30),
    )


def pixel_of(direction: FloatArray, height: int) -> tuple[float, float]:
    """Pixel coordinates of a direction in a panorama of ``height`` rows."""
    u, v = direction_to_latlong(direction)
    return float(u) * 2 * height, min(float(v) * height, height - 1e-3)

"""A bracket of photographs to one image of linear radiance."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.capture import alignment
from lightdepth.capture.exposure import Exposure
from lightdepth.capture.fisheye import Circle, find_circle
from lightdepth.capture.photograph import (
    Codes,
    WhiteBalance,
    camera_colours,
    is_raw,
    read_photograph,
    shared_white_balance,
)
from lightdepth.capture.recovery import choose_samples, recover_response, sample_patches, trust
from lightdepth.capture.response import Response, linear_response, srgb_response
from lightdepth.errors import InputError, warn
from lightdepth.images.orientation import mirrored_back
from lightdepth.parameters.capture import DEFAULT, CaptureParameters

Progress = Callable[[str, int, int], None]
"""Called with what is being done, and how many of how many parts of it are done."""


@dataclass(frozen=True)
class Merged:
    """An HDR image from a bracket.

    Attributes:
        radiance: linear RGB, shape (height, width, 3), float32; reading over exposure, see :meth:`Response.linear`.
        seen: pixels that the lens reached, shape (height, width), bool.
        clipped: pixels clipped in every exposure in some channel, the same shape; their radiance is a lower bound.
        black: pixels black in every exposure in every channel, the same shape.
        ghosts: share of the seen pixels at which some exposure was left out because something moved.
        circle: the fisheye circle on the photographs, None for other lenses.
    """

    radiance: NDArray[np.float32]
    seen: NDArray[np.bool_]
    clipped: NDArray[np.bool_]
    black: NDArray[np.bool_]
    ghosts: float
    circle: Circle | None


def shared_response(
    brackets: Sequence[Sequence[tuple[Path, Exposure]]],
    progress: Progress = lambda *_: None,
    tuned: CaptureParameters = DEFAULT,
) -> tuple[Response, str]:
    """The response of the camera that took some brackets.

    Args:
        brackets: photographs with their exposures, a list for each orientation; three of them are looked at.
        progress: called after each photograph.
        tuned: how it is recovered, and from what.

    Returns:
        The response, and how it was found: "recovered from the bracket", "linear (RAW)", or "sRGB" with the reason.
    """
    if is_raw(brackets[0][0][0]):
        return linear_response(), "linear (RAW)"
    chosen = [brackets[index] for index in sorted({0, len(brackets) // 3, 2 * len(brackets) // 3})]
    total = sum(len(bracket) for bracket in chosen)
    parts, done = [], 0
    amounts = [exposure.amount for _, exposure in chosen[0]]
    for bracket in chosen:
        if not np.allclose([exposure.amount for _, exposure in bracket], amounts, rtol=0.01):
            continue  # A bracket with other exposures cannot share one system of samples.
        patches = []
        for path, _ in bracket:
            patches.append(sample_patches(read_photograph(path), tuned))
            done += 1
            progress("camera response", done, total)
        if len({mean.shape for mean, _ in patches}) > 1:
            raise InputError(f"{bracket[0][0]}: the photographs of its bracket have different sizes")
        parts.append(choose_samples(patches, count=tuned.response_samples // len(chosen)))
    response = recover_response(np.concatenate(parts), amounts, tuned)
    if response is None:
        return srgb_response(), "sRGB: the photographs do not determine the response"
    return response, "recovered from the bracket"


def merge(
    bracket: Sequence[tuple[Path, Exposure]],
    response: Response,
    circle: Circle | str | None = None,
    align: bool = False,
    deghost: bool = False,
    upright: bool = True,
    progress: Progress = lambda *_: None,
    white_balance: WhiteBalance | None = None,
    tuned: CaptureParameters = DEFAULT,
) -> Merged:
    """Merge a bracket.

    Each reading counts with its exposure (the light that made it, so the inverse variance of its photon noise) times
    the trust in it: none for black and clipped ones. A pixel clipped in every exposure has the shortest one's value.

    Args:
        bracket: photographs of the same view with their exposures, in any order.
        response: the camera's.
        circle: the fisheye circle, "auto" to find it, None for other lenses. The result is cropped to it.
        align: undo the movement of a hand-held camera.
        deghost: at each pixel leave out exposures that disagree with the best exposed one.
        upright: turn the result as the first photograph's EXIF orientation says; fisheye images are never turned, but
            mirrored ones always mirrored back.
        progress: called after each photograph.
        white_balance: of RAW files; ``None`` is that of the bracket.
        tuned: which readings count, and what is taken for a contradiction.

    Raises:
        InputError: a photograph cannot be read, sizes differ, exposures are said to be equal but are not, or no circle
            is found.
    """
    white_balance = white_balance or shared_white_balance([path for path, _ in bracket], tuned)
    colours = camera_colours(bracket[0][0])
    if is_raw(bracket[0][0]) and not np.array_equal(response.curves, linear_response().curves):
        raise InputError(f"{bracket[0][0]}: is RAW, whose values are linear; a response (--response) does not apply")
    bracket = sorted(bracket, key=lambda pair: pair[1].amount)
    amounts = [exposure.amount for _, exposure in bracket]
    # A fisheye that looks up or down has no upright; the camera's idea of one may change within the bracket.
    orientation = bracket[0][1].orientation
    if not upright or circle is not None:
        orientation = mirrored_back(orientation)[0]
    passes = 1 + align + deghost
    done = 0

    def tick(what: str) -> None:
        nonlocal done
        done += 1
        progress(what, done, passes * len(bracket))

    def load(index: int) -> Codes:
        codes = read_photograph(bracket[index][0], orientation, white_balance)
        if not shape:
            shape.extend(codes.shape)
        elif list(codes.shape) != shape:
            raise InputError(
                f"{bracket[index][0]}: is {codes.shape[1]} x {codes.shape[0]} pixels, others of its bracket are "
                f"{shape[1]} x {shape[0]}; all must be alike"
            )
        return codes

    shape: list[int] = []
    if circle == "auto":
        circle = find_circle((load(index) for index in reversed(range(len(bracket)))), tuned)
    matrices: list[NDArray[np.float64]] = []
    scale = 1.0
    if align:
        small = []
        for index in range(len(bracket)):
            small.append(alignment.comparison_image(load(index), tuned))
            tick("aligning")
        matrices = alignment.align(small, amounts, tuned)
        scale = max(small[0].shape) / max(shape[:2])

    def readings(index: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Radiance, and the trust in it, of a photograph."""
        codes = load(index)
        if align:
            codes = alignment.move(codes, matrices[index], scale)
        if isinstance(circle, Circle):
            codes = circle.crop(codes)
        return response.linear(codes) / np.float32(amounts[index]), _trust(codes, tuned)

    reference = _reference(len(bracket), readings, tick, tuned) if deghost else None
    total: NDArray[np.float32] | None = None
    brightness, views = [], []
    for index, amount in enumerate(amounts):
        radiance, weight = readings(index)
        brightness.append(float(radiance.mean()))
        views.append(_reduced(radiance, weight, tuned))
        if total is None:
            total, weights = np.zeros_like(radiance), np.zeros_like(radiance)
            black = np.ones(radiance.shape[:2], bool)
            rejected = np.zeros(radiance.shape[:2], bool)
            channel_clipped = np.ones(radiance.shape, bool)
            shortest = radiance
        level = response_bounds(response, amount, tuned)
        channel_clipped &= radiance > level[1]
        black &= (radiance < level[0]).all(axis=2)
        if index == len(amounts) - 1:
            # Nothing sees the dark better than the longest exposure: black there is black, whatever noise the shorter
            # ones read.
            weight = np.maximum(weight, tuned.merge_least_trust * (radiance < level[1]))
        if reference is not None:
            moved = _moved(response.readings(radiance * amount), response.readings(reference * amount), tuned)
            rejected |= moved
            weight = weight * ~moved[..., None]
        weight *= np.float32(amount)
        total += weight * radiance
        weights += weight
        tick("merging")
    _check_exposures(bracket, brightness, tuned)
    _check_views(bracket, views, tuned)
    assert total is not None
    clipped: NDArray[np.bool_] = np.asarray(channel_clipped.any(axis=2))
    known = weights > 0.0
    result = np.divide(total, weights, out=total, where=known)
    np.copyto(result, shortest, where=~known)
    if colours is not None:
        result = np.maximum(result @ colours.T.astype(np.float32), np.float32(0.0))
    seen = np.ones(clipped.shape, bool)
    if isinstance(circle, Circle):
        left, top, side = circle.box()
        seen = Circle(circle.x - left, circle.y - top, circle.radius).inside(side, side)
        seen &= circle.crop(np.ones(shape[:2], bool))
        result[~seen] = 0.0
    ghosts = float((rejected & seen).sum() / max(seen.sum(), 1))
    return Merged(result, seen, clipped & seen, black & seen, ghosts, circle if isinstance(circle, Circle) else None)


def _check_exposures(
    bracket: Sequence[tuple[Path, Exposure]], brightness: Sequence[float], tuned: CaptureParameters
) -> None:
    """Refuse photographs that are said to be exposed alike but are not.

    Args:
        bracket: from the least to the greatest exposure.
        brightness: mean radiance that each shows.
        tuned: what is not alike.
    """
    amounts = [exposure.amount for _, exposure in bracket]
    dark, bright = int(np.argmin(brightness)), int(np.argmax(brightness))
    if max(amounts) < tuned.merge_same * min(amounts) and brightness[bright] > tuned.merge_unlike * brightness[dark]:
        raise InputError(
            f"{bracket[bright][0]}: is exposed like {bracket[dark][0].name} by its EXIF data, but is "
            f"{brightness[bright] / max(brightness[dark], 1e-12):.3g} times as bright; state time, aperture and ISO in a "
            "table (--exposures)"
        )


def _reduced(
    radiance: NDArray[np.float32], weight: NDArray[np.float32], tuned: CaptureParameters
) -> NDArray[np.float32]:
    """Logarithm of the radiance of a photograph in a few hundred cells, NaN where it is not well exposed."""
    height, width = radiance.shape[:2]
    size = (tuned.merge_cells, max(1, round(tuned.merge_cells * height / width)))
    trusted = cv2.resize(np.asarray(weight.min(axis=2)), size, interpolation=cv2.INTER_AREA) > 0.5
    brightness = cv2.resize(np.asarray(radiance.mean(axis=2)), size, interpolation=cv2.INTER_AREA)
    return np.log(np.where(trusted & (brightness > 0.0), brightness, np.nan)).astype(np.float32)


def _check_views(
    bracket: Sequence[tuple[Path, Exposure]], views: Sequence[NDArray[np.float32]], tuned: CaptureParameters
) -> None:
    """Warn of photographs that show another view than the next longer exposure, or another brightness than it says."""
    for (path, _), (other, _), one, next_one in zip(bracket, bracket[1:], views, views[1:], strict=False):
        both = np.isfinite(one) & np.isfinite(next_one)
        if both.mean() < tuned.merge_least_cells:
            continue
        first, second = one[both], next_one[both]
        off = float(np.median(first - second))
        # What moves in a view leaves most of it as it is.
        alike = np.mean(abs(first - second - off) < tuned.merge_alike)
        if alike < tuned.merge_least_alike and np.corrcoef(first, second)[0, 1] < tuned.merge_likeness:
            warn(
                f"{path} and {other.name} hardly show the same view, but are merged as one bracket; if they are several "
                "orientations, `capture stitch --bracket` states how many photographs each has"
            )
        elif abs(off) > np.log(tuned.merge_unlike):
            warn(
                f"{path} and {other.name}: their brightness differs by {abs(off) / np.log(2.0):.1f} stops from what their "
                "exposures say; a filter, a flash or wrong EXIF data do this: state time, aperture and ISO in a table "
                "(--exposures)"
            )


def response_bounds(response: Response, amount: float, tuned: CaptureParameters = DEFAULT) -> NDArray[np.float32]:
    """Radiance at which an exposure is black and at which it is clipped; shape (2, 3): bound, channel."""
    levels = np.linspace(0.0, 1.0, response.curves.shape[1])
    bounds = (tuned.black, tuned.white)
    exposures = [[np.interp(reading, levels, curve) for curve in response.curves] for reading in bounds]
    return (np.array(exposures) / amount).astype(np.float32)


def _trust(codes: Codes, tuned: CaptureParameters) -> NDArray[np.float32]:
    white = np.iinfo(codes.dtype).max
    return trust(np.arange(white + 1) / white, tuned).astype(np.float32)[codes]


def _reference(
    count: int,
    readings: Callable[[int], tuple[NDArray, NDArray]],
    tick: Callable[[str], None],
    tuned: CaptureParameters,
) -> NDArray[np.float32]:
    """Radiance of each pixel from a single photograph: the middle exposure, or the nearest one that shows the pixel."""
    reference: NDArray[np.float32] | None = None
    for index in sorted(range(count), key=lambda index: abs(index - count // 2)):
        radiance, weight = readings(index)
        quality = weight.min(axis=2)
        if reference is None:
            reference, best = radiance.copy(), quality
        else:
            # A well exposed pixel stays; a poor one gives way to any better, for its noise would look like a ghost.
            better = (best < tuned.merge_well_exposed) & (quality > best)
            reference[better], best = radiance[better], np.where(better, quality, best)
        tick("looking for ghosts")
    assert reference is not None
    return reference


def _moved(readings: NDArray[np.float32], expected: NDArray[np.float32], tuned: CaptureParameters) -> NDArray[np.bool_]:
    """Where a photograph disagrees with the reference, shape (height, width); a little wider than seen."""
    differs = (
        (np.abs(cv2.blur(readings - expected, (tuned.merge_ghost_blur, tuned.merge_ghost_blur))) > tuned.merge_ghost)
        .any(axis=2)
        .astype(np.uint8)
    )
    # Edges of what moved are half transparent.
    return cv2.dilate(differs, np.ones((tuned.merge_ghost_rim, tuned.merge_ghost_rim), np.uint8)).astype(bool)

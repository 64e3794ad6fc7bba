"""Images in several orientations to one equirectangular panorama: the order of the steps."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from lightdepth.capture import hugin, seams
from lightdepth.capture.lens import Lens
from lightdepth.capture.panorama import Panorama, blend, natural_width
from lightdepth.capture.photometry import Photograph, Photometry, estimate_photometry
from lightdepth.capture.project import ControlPoint, read_project
from lightdepth.capture.rig import Rig
from lightdepth.errors import InputError, LightdepthError
from lightdepth.images.filling import fill, mark
from lightdepth.parameters.capture import DEFAULT, CaptureParameters

SMALLEST = 16
"""Pixels of an image's shorter side."""

STEPS = 8
"""How many steps ``progress`` counts."""


@dataclass(frozen=True)
class Orientation:
    """An image of linear radiance in one orientation.

    Attributes:
        name: what the user calls it.
        radiance: linear RGB, shape (height, width, 3), float32.
        seen: pixels that the lens reached, shape (height, width), bool.
        reliable: pixels that are neither clipped nor black in every exposure, the same shape.
        roll: degrees by which the camera was turned about its axis, as far as it knew.
    """

    name: str
    radiance: NDArray[np.float32]
    seen: NDArray[np.bool_]
    reliable: NDArray[np.bool_]
    roll: float = 0.0


@dataclass(frozen=True)
class Options:
    """How to stitch.

    Attributes:
        projection: a key of :data:`lightdepth.capture.lens.PROJECTIONS`.
        fov: degrees across an image's width, as far as known; it is optimised.
        circular: fisheye images, black outside the circle in their square.
        rig: orientations as far as known.
        width: of the panorama in pixels, even; None for as many as the images have.
        blender: "feather" or "enblend".
        uncovered: "fill", "mark" or "black".
        gains: make up for differences of exposure between the images.
    """

    projection: str
    fov: float
    circular: bool
    rig: Rig | None = None
    width: int | None = None
    blender: str = "feather"
    uncovered: str = "fill"
    gains: bool = True


@dataclass(frozen=True)
class Stitched:
    """A panorama and how it came about.

    Attributes:
        panorama: with uncovered directions treated as asked.
        lenses: lens and pose of each image.
        control_points: those that were kept, in pixels of the images.
        matched: how many were found before outliers were removed.
        photometry: vignetting and gains that were applied.
        unconnected: images that share no control point with the largest group of images.
    """

    panorama: Panorama
    lenses: list[Lens]
    control_points: list[ControlPoint]
    matched: int
    photometry: Photometry
    unconnected: list[int]


def stitch(
    orientations: Sequence[Orientation],
    options: Options,
    progress: Callable[[str, int, int], None] = lambda *_: None,
    tuned: CaptureParameters = DEFAULT,
) -> Stitched:
    """Find lens, poses and vignetting, remap and blend.

    Args:
        orientations: images of the same size from the same lens.
        options: how.
        progress: called with a step's name, its number and the number of steps; while control points are searched,
            with how many images and pairs have been looked at, and how many there are.
        tuned: what is searched, and what counts how much.

    Raises:
        InputError: the images are too few, too small, black, differ in size, or cannot be connected.
        SetupError: a tool is not installed.
        LightdepthError: a tool failed.
    """
    if len(orientations) < 2:
        raise InputError(f"stitching needs images in two orientations or more; there is {len(orientations)}")
    first = orientations[0]
    if min(first.radiance.shape[:2]) < SMALLEST:
        raise InputError(
            f"{first.name}: is {first.radiance.shape[1]} x {first.radiance.shape[0]} pixels; at least {SMALLEST} each way "
            "are needed"
        )
    if not any((each.reliable & each.seen).any() for each in orientations):
        raise InputError(f"{first.name} and all others: show no light; are they black, or not finite?")
    for other in orientations:
        if other.radiance.shape != first.radiance.shape:
            raise InputError(
                f"{other.name}: is {other.radiance.shape[1]} x {other.radiance.shape[0]} pixels, {first.name} is "
                f"{first.radiance.shape[1]} x {first.radiance.shape[0]}; all must come from one lens and have one size"
            )
    hugin.require(hugin.ALIGNMENT_TOOLS + (seams.TOOLS if options.blender == "enblend" else ()))
    step = 0

    def tick(what: str) -> None:
        nonlocal step
        progress(what, step, STEPS)
        step += 1

    with tempfile.TemporaryDirectory(prefix="lightdepth-stitch-") as temporary:
        folder = Path(temporary)
        tick("pictures for matching")
        names, scale = _write_matching_images(orientations, folder, tuned)
        rolls = [orientation.roll for orientation in orientations]
        matched_file, optimised_file = hugin.find_poses(
            names,
            folder,
            options.projection,
            options.fov,
            options.rig,
            rolls,
            options.circular,
            tick,
            lambda done, total: progress("control points", done, total),
            tuned,
        )
        matched = len(read_project(matched_file)[1])
        small_lenses, small_points = read_project(optimised_file)
        lenses = [_enlarged(lens, scale, first.radiance.shape) for lens in small_lenses]
        points = [_enlarged_point(point, scale) for point in small_points]
        groups = groups_of(len(orientations), points)
        unconnected = _outside_the_largest(groups) if points else list(range(len(orientations)))
        if unconnected and options.rig is None:
            raise InputError(
                f"{', '.join(orientations[index].name for index in unconnected)}: no control points with the other "
                "images; leave them out, photograph with more overlap, or state the orientations by --rig"
            )
        if options.rig is not None:
            lenses = turned_to_the_rig(lenses, groups, options.rig)
        tick("vignetting and exposures")
        photographs = [
            Photograph(
                orientation.radiance,
                np.where(orientation.reliable, 1.0, tuned.stitch_distrust).astype(np.float32) * orientation.seen,
                lens,
            )
            for orientation, lens in zip(orientations, lenses, strict=True)
        ]
        photometry = estimate_photometry(photographs, options.gains, tuned)
        width = options.width or natural_width(lenses)
        tick("blending")
        if options.blender == "enblend":
            panorama = seams.blend(photographs, photometry, width, folder)
        else:
            panorama = blend(photographs, photometry, width, tuned)
    tick("uncovered directions")
    radiance = panorama.radiance
    if options.uncovered == "fill":
        radiance = fill(radiance, panorama.covered)
    elif options.uncovered == "mark":
        radiance = mark(radiance, panorama.covered)
    return Stitched(replace(panorama, radiance=radiance), lenses, points, matched, photometry, unconnected)


def matching_image(
    orientation: Orientation, size: tuple[int, int], tuned: CaptureParameters = DEFAULT
) -> NDArray[np.uint8]:
    """What the matcher sees: the logarithm of radiance with its local contrast raised.

    Outside a fisheye's circle the rim's colours go on, for the rim itself would be matched: it looks alike everywhere.

    Args:
        orientation: the image.
        size: width and height of the result.
        tuned: how much its contrast is raised.

    Returns:
        Grey, shape (height, width), uint8.
    """
    method = cv2.INTER_AREA if size[0] <= orientation.seen.shape[1] else cv2.INTER_LINEAR
    small = cv2.resize(orientation.radiance, size, interpolation=method).mean(axis=2)
    seen = cv2.resize(orientation.seen.astype(np.float32), size, interpolation=method) > 0.999
    if not seen.all():
        seen = cv2.erode(seen.astype(np.uint8), np.ones((7, 7), np.uint8)) > 0
    if not (seen & (small > 0.0)).any():
        return np.full(small.shape, 128, dtype=np.uint8)  # Black all over: there is nothing to match.
    logarithm = np.log(np.maximum(small, small[seen & (small > 0.0)].min()))
    low, high = np.percentile(logarithm[seen], [0.5, 99.7])
    grey = np.clip(255.0 * (logarithm - low) / max(high - low, 1e-3), 0.0, 255.0).astype(np.uint8)
    if not seen.all():
        rows, columns = distance_transform_edt(~seen, return_distances=False, return_indices=True)
        grey = grey[rows, columns]
    return cv2.createCLAHE(clipLimit=tuned.matching_contrast, tileGridSize=(8, 8)).apply(grey)


def _write_matching_images(
    orientations: Sequence[Orientation], folder: Path, tuned: CaptureParameters
) -> tuple[list[str], float]:
    """Write what the matcher sees; the names, and the size relative to the images'."""
    height, width = orientations[0].radiance.shape[:2]
    sides = (tuned.matching_smallest, tuned.matching_largest)
    scale = float(np.clip(1.0, *(side / max(height, width) for side in sides)))
    size = (round(width * scale), round(height * scale))
    names = []
    for index, orientation in enumerate(orientations):
        names.append(f"view{index:03d}.png")
        if not cv2.imwrite(str(folder / names[-1]), matching_image(orientation, size, tuned)):
            raise LightdepthError(f"{folder}: the temporary folder cannot be written; is the disk full?")
    return names, size[0] / width


def _enlarged(lens: Lens, scale: float, shape: tuple[int, ...]) -> Lens:
    """A lens found in pictures of another size."""
    shift = (lens.shift[0] / scale, lens.shift[1] / scale)
    return replace(lens, width=shape[1], height=shape[0], shift=shift)


def _enlarged_point(point: ControlPoint, scale: float) -> ControlPoint:
    # Hugin counts from the centre of the first pixel; here pixels are counted from its corner.
    first, second = (tuple((value + 0.5) / scale for value in pixel) for pixel in (point.first, point.second))
    return ControlPoint(point.images, first, second)  # type: ignore[arg-type]


def groups_of(count: int, points: Sequence[ControlPoint]) -> list[int]:
    """For each of ``count`` images a number that it shares with all that control points connect it with."""
    group = list(range(count))
    for point in points:
        first, second = group[point.images[0]], group[point.images[1]]
        group = [first if label == second else label for label in group]
    return group


def _outside_the_largest(groups: Sequence[int]) -> list[int]:
    largest = max(set(groups), key=groups.count)
    return [index for index, label in enumerate(groups) if label != largest]


def turned_to_the_rig(lenses: Sequence[Lens], groups: Sequence[int], rig: Rig) -> list[Lens]:
    """Turn every group of images that nothing connects with the first one as a whole toward its orientations in the rig.

    The first image keeps the rig's pose while poses are optimised, and its group with it; another group may be turned
    by any angle then.

    Args:
        lenses: as they were optimised.
        groups: from :func:`groups_of`.
        rig: orientations of all images.
    """
    turned = list(lenses)
    for label in set(groups) - {groups[0]}:
        members = [index for index, own in enumerate(groups) if own == label]
        if len(members) == 1:
            continue  # Nothing has moved it.
        stated = [
            replace(lenses[index], yaw=rig[index][0], pitch=rig[index][1], roll=rig[index][2]).rotation
            for index in members
        ]
        # The rotation nearest to all differences (Kabsch).
        u, _, vt = np.linalg.svd(sum(to @ lenses[index].rotation.T for to, index in zip(stated, members, strict=True)))
        turn = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
        for index in members:
            turned[index] = lenses[index].with_rotation(turn @ lenses[index].rotation)
    return turned

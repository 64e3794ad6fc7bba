"""What the user hands over, photographs or HDR images, to one image of linear radiance for each orientation."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.capture.brackets import Bracket, brackets_in_folder, files_of, group_by_exposure
from lightdepth.capture.exposure import Exposure, read_exposures
from lightdepth.capture.fisheye import Circle, find_circle
from lightdepth.capture.merging import Merged, Progress, merge, shared_response
from lightdepth.capture.photograph import (
    PHOTOGRAPHS,
    Codes,
    WhiteBalance,
    read_photograph,
    shared_white_balance,
    unlike_srgb,
)
from lightdepth.capture.response import Response
from lightdepth.capture.stitching import Orientation
from lightdepth.errors import InputError
from lightdepth.images.beauty import Beauty, read_beauty
from lightdepth.images.orientation import mirrored_back
from lightdepth.images.radiance import READERS, read_radiance
from lightdepth.parameters.capture import DEFAULT, CaptureParameters
from lightdepth.quantities import BRIGHTEST

ROLLS = {3: 180.0, 6: 90.0, 8: -90.0}
"""How far the camera was turned about its axis, by EXIF orientation."""


@dataclass(frozen=True)
class MergeOptions:
    """How the brackets of a shoot are merged.

    Attributes:
        circle: fisheye circle, "auto", or None for other lenses.
        response: the camera's, None to recover it.
        exposures: table of exposures, None for EXIF.
        bracket: photographs in a bracket where the user states it.
        align: undo the movement of a hand-held camera within each bracket.
        deghost: leave out what moved within each bracket.
        several: more than one orientation is expected.
    """

    circle: Circle | str | None = None
    response: Response | None = None
    exposures: Path | None = None
    bracket: int | None = None
    align: bool = False
    deghost: bool = False
    several: bool = False


@dataclass(frozen=True)
class Shoot:
    """All orientations of a shoot, as linear radiance.

    Attributes:
        orientations: the images.
        response: of the camera; None where HDR images were given.
        response_source: how the response was found.
        photographs: for each orientation the names of its photographs.
        exposure: of the first photograph; None where HDR images were given.
        warnings: what the user should know.
    """

    orientations: list[Orientation]
    response: Response | None
    response_source: str
    photographs: list[list[str]]
    exposure: Exposure | None = None
    warnings: list[str] = field(default_factory=list)


def is_hdr(path: Path) -> bool:
    """Whether a file is an HDR image by its name."""
    return path.suffix.lower() in READERS


def read_shoot(
    inputs: Sequence[Path],
    options: MergeOptions,
    progress: Progress = lambda *_: None,
    tuned: CaptureParameters = DEFAULT,
) -> Shoot:
    """Read and, where they are photographs, merge what the user handed over.

    Args:
        inputs: one folder, or HDR images, or photographs (brackets of several orientations, or one for each).
        options: how to merge.
        progress: called after each photograph.
        tuned: how brackets are told apart, and merged.

    Raises:
        InputError: the inputs are missing or of mixed kinds, or cannot be merged.
    """
    for path in inputs:
        if not path.exists():
            raise InputError(f"{path}: no such file or folder")
    if len(inputs) == 1 and inputs[0].is_dir():
        files = files_of(inputs[0])
        hdr = [path for path in files if is_hdr(path)]
        if hdr:
            _check_one_kind(inputs[0], hdr, files)
            return _read_hdr(hdr, options, progress, tuned)
        brackets = brackets_in_folder(inputs[0], options.exposures, options.bracket, tuned)
        return _merge_all(brackets, options, progress, tuned)
    folders = [path for path in inputs if path.is_dir()]
    if folders:
        if len(folders) < len(inputs):
            raise InputError(
                f"{folders[0]}: is a folder; allowed are one folder, folders of one bracket each, or files"
            )
        brackets = [bracket for path in folders for bracket in brackets_in_folder(path, options.exposures, tuned=tuned)]
        return _merge_all(brackets, options, progress, tuned)
    if all(is_hdr(path) for path in inputs):
        return _read_hdr(inputs, options, progress, tuned)
    strange = [path for path in inputs if path.suffix.lower() not in PHOTOGRAPHS]
    if strange:
        raise InputError(
            f"{strange[0]}: allowed are photographs ({', '.join(PHOTOGRAPHS)}) or HDR images ({', '.join(READERS)}), "
            "not both"
        )
    pairs = list(zip(inputs, _exposures(inputs, options.exposures), strict=True))
    if options.bracket is not None:
        if len(pairs) % options.bracket:
            raise InputError(f"{len(pairs)} photographs are not a multiple of --bracket {options.bracket}")
        size = options.bracket
        brackets = [pairs[start : start + size] for start in range(0, len(pairs), size)]
        return _merge_all(brackets, options, progress, tuned)
    return _merge_all(group_by_exposure(pairs, tuned), options, progress, tuned)


def _check_one_kind(folder: Path, hdr: Sequence[Path], files: Sequence[Path]) -> None:
    """Refuse a folder of HDR images and photographs; the PNG that is written beside an HDR image is none."""
    pictures = {path.with_suffix(".png").name for path in hdr}
    photographs = [path for path in files if path.suffix.lower() in PHOTOGRAPHS and path.name not in pictures]
    if photographs:
        raise InputError(
            f"{folder}: holds HDR images, such as {hdr[0].name}, and photographs, such as {photographs[0].name}; "
            "allowed is one of the two: name the files, or move the others elsewhere"
        )


def _exposures(photographs: Sequence[Path], table: Path | None) -> list[Exposure]:
    """As :func:`read_exposures`; a single photograph needs none to be right but for one factor on all radiance."""
    try:
        return read_exposures(photographs, table)
    except InputError:
        if len(photographs) > 1 or table is not None:
            raise
        return [Exposure(1.0)]


def _merge_all(
    brackets: Sequence[Bracket], options: MergeOptions, progress: Progress, tuned: CaptureParameters
) -> Shoot:
    if options.several and len(brackets) == 1 and len(brackets[0]) > 1:
        raise InputError(
            f"{brackets[0][0][0].parent}: the {len(brackets[0])} photographs from {brackets[0][0][0].name} to "
            f"{brackets[0][-1][0].name} look like one bracket of one orientation, for neither their exposures nor the "
            "steps between them repeat; state how many photographs each orientation has as --bracket (1 where there "
            "are no brackets)"
        )
    warnings = []
    sizes = [len(bracket) for bracket in brackets]
    for bracket in brackets:
        if len(bracket) < max(sizes):
            warnings.append(f"{bracket[0][0].name}: its bracket has {len(bracket)} of {max(sizes)} exposures")
    white_balance = shared_white_balance([path for bracket in brackets for path, _ in bracket], tuned)
    colours = unlike_srgb([path for bracket in brackets for path, _ in bracket])
    if colours:
        warnings.append(colours)
    response, source = options.response, "given"
    if response is None:
        response, source = shared_response(brackets, progress, tuned)
    if source.startswith("sRGB"):
        warnings.append("the camera's response is taken to be sRGB, for the photographs do not determine it")
    circle = options.circle
    if circle == "auto":
        circle = _common_circle([partial(_from_bright_to_dark, bracket, white_balance) for bracket in brackets], tuned)
    orientations = []
    for index, bracket in enumerate(brackets):

        def tick(what: str, done: int, total: int, index: int = index) -> None:
            progress(what, index * total + done, len(brackets) * total)

        merged = merge(bracket, response, circle, options.align, options.deghost, False, tick, white_balance, tuned)
        orientations.append(_orientation(bracket, merged, options.circle is None))
    names = [[path.name for path, _ in bracket] for bracket in brackets]
    return Shoot(orientations, response, source, names, brackets[0][0][1], warnings)


def _common_circle(views: Sequence[Callable[[], Iterable[Codes]]], tuned: CaptureParameters) -> Circle:
    """One lens, one circle: the median of three views' is steadier than each one's own.

    Args:
        views: give the photographs of each view from bright to dark; those that show no circle, such as black ones, are
            passed over.
        tuned: what a circle is.

    Raises:
        InputError: no view shows a circle.
    """
    first = dict.fromkeys((0, len(views) // 2, len(views) - 1))
    circles: list[Circle] = []
    for index in [*first, *(other for other in range(len(views)) if other not in first)]:
        try:
            circles.append(find_circle(views[index](), tuned))
        except InputError:
            continue
        if len(circles) == 3:
            break
    if not circles:
        return find_circle([])  # Which says so.
    return Circle(*np.median([(each.x, each.y, each.radius) for each in circles], axis=0).tolist())


def _from_bright_to_dark(bracket: Bracket, white_balance: WhiteBalance | None) -> Iterator[Codes]:
    mirroring, _ = mirrored_back(bracket[0][1].orientation)
    for path, _ in sorted(bracket, key=lambda pair: -pair[1].amount):
        yield read_photograph(path, mirroring, white_balance)


def _orientation(bracket: Bracket, merged: Merged, with_roll: bool) -> Orientation:
    roll = ROLLS.get(mirrored_back(bracket[0][1].orientation)[1], 0.0) if with_roll else 0.0
    return Orientation(bracket[0][0].name, merged.radiance, merged.seen, ~(merged.clipped | merged.black), roll)


def _read_hdr(paths: Sequence[Path], options: MergeOptions, progress: Progress, tuned: CaptureParameters) -> Shoot:
    pictures, warnings = [], []
    for index, path in enumerate(paths):
        picture = read_beauty(path) if path.suffix.lower() == ".exr" else Beauty(read_radiance(path), None)
        radiance = picture.radiance
        finite: NDArray[np.bool_] = np.asarray(np.isfinite(radiance).all(axis=2))
        finite &= (np.abs(np.where(finite[..., None], radiance, 0.0)) <= BRIGHTEST).all(axis=2)
        if not finite.all():
            warnings.append(f"{path.name}: {(~finite).sum()} pixels are not finite; they count as not photographed")
            radiance = np.where(finite[..., None], radiance, np.float32(0.0))
        negative = (radiance < 0.0).any(axis=2)
        if negative.mean() > tuned.negative:
            warnings.append(
                f"{path.name}: {negative.sum()} pixels are negative, which light cannot be; they are black here"
            )
        radiance = np.maximum(radiance, np.float32(0.0))
        pictures.append(
            (radiance, finite if picture.alpha is None else finite & (picture.alpha > 0.5), picture.alpha is None)
        )
        progress("reading", index + 1, len(paths))
    circle = options.circle
    whole = [radiance for radiance, _, is_whole in pictures if is_whole]
    if circle == "auto":  # What has an alpha was cut out already.
        circle = _common_circle([partial(_as_photographs, each) for each in whole], tuned) if whole else None
    orientations = []
    for path, (radiance, seen, is_whole) in zip(paths, pictures, strict=True):
        if isinstance(circle, Circle) and (is_whole or options.circle != "auto"):
            left, top, side = circle.box()
            local = Circle(circle.x - left, circle.y - top, circle.radius)
            seen = circle.crop(seen) & local.inside(side, side)
            radiance = circle.crop(radiance)
        reliable = np.asarray((radiance > 0.0).any(axis=2))
        orientations.append(Orientation(path.name, radiance * seen[..., None], seen, reliable))
    return Shoot(orientations, None, "HDR images", [[path.name] for path in paths], None, warnings)


def _as_photographs(radiance: np.ndarray) -> list[Codes]:
    """An HDR image as one overexposed photograph, for finding the circle."""
    level = np.percentile(cv2.blur(radiance, (5, 5)), 60)
    return [np.clip(255.0 * np.sqrt(np.maximum(radiance, 0.0) / max(level, 1e-12)), 0, 255).astype(np.uint8)]

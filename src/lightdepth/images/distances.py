"""Equirectangular images of distances, as renderers, scanners and estimators write them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lightdepth.array_file import read_array
from lightdepth.directions import pixel_directions
from lightdepth.errors import InputError, warn
from lightdepth.images.exr import ExrHeader, ExrReader
from lightdepth.images.pixels import read_pixels
from lightdepth.parameters.distances import DEFAULT, DistancesParameters

FloatArray = NDArray[np.float64]
Kind = Literal["ray", "z", "disparity"]
"""Distances along the ray, along the viewing axis (the panorama's centre), or reciprocal ones."""

FARTHEST = 1e9
"""Renderers mark the sky by numbers from here on; Blender by 1e10."""
LARGEST_HALF = 65504.0
"""What becomes of such a number in half floats."""
UNMEASURED = 65535
"""A 16-bit image's way of saying so."""

_EXACT_WORDS = ("z", "distance")
_ANY_NAME = ("r", "v", "x", "y")


def read_distances(path: Path, channel: str | None = None) -> tuple[FloatArray, bool]:
    """Read an image of distances in the file's own unit.

    Of an OpenEXR file the channel ``Z`` counts, or the only one of a layer that is named so or has "depth" in its name
    (R, G and B may hold it alike), or the only one at all. Distances of :data:`FARTHEST` and more, and
    :data:`LARGEST_HALF`, are sky.

    Args:
        path: OpenEXR, a 16-bit PNG, or a NumPy array in a .npy file.
        channel: of an OpenEXR file, by its full name; ``None`` finds it.

    Returns:
        ``(distances, whole)``: shape (height, 2 height), inf for sky, NaN where a PNG says that nothing was measured; and
        whether the file holds whole numbers, whose unit it does not state.

    Raises:
        InputError: the file is missing, unreadable, of another format or shape, or it is not clear what is meant.
    """
    values = _read(path, channel)
    if values.dtype == np.uint8:
        raise InputError(
            f"{path}: has one channel of 8 bit, and distances in metres need one channel of 16 bit; if a network estimated "
            "them, 'reconstruct from-depth --estimated' takes them"
        )
    whole = bool(np.issubdtype(values.dtype, np.integer))
    with np.errstate(invalid="ignore"):  # Of signalling NaN, which stay NaN.
        distances = values.astype(np.float64)
    if path.suffix.lower() == ".png":
        distances[values == UNMEASURED] = np.nan
    elif not whole:
        distances[(distances >= FARTHEST) | (distances == LARGEST_HALF)] = np.inf
    return distances, whole


def read_estimate(path: Path, channel: str | None = None) -> FloatArray:
    """Read what a network estimated: distances or disparity in an unknown unit, in which any number may be meant.

    Args:
        path: OpenEXR, a PNG of 8 or 16 bit, or a NumPy array in a .npy file.
        channel: of an OpenEXR file, by its full name; ``None`` finds it.

    Returns:
        Shape (height, 2 height); NaN where the file says that nothing is known, inf for sky.

    Raises:
        InputError: see :func:`read_distances`; or all values are the same.
    """
    with np.errstate(invalid="ignore"):
        values = _read(path, channel).astype(np.float64)
    values[values >= FARTHEST] = np.inf
    values[values <= -FARTHEST] = np.nan
    known = values[np.isfinite(values)]
    if not known.size:
        raise InputError(f"{path}: no pixel holds a finite value")
    if known.min() == known.max():
        raise InputError(
            f"{path}: holds the same value, {known.min():g}, everywhere; that cannot be the depth of a place. Was the "
            "picture exported with the wrong range or channel?"
        )
    return values


def _read(path: Path, channel: str | None) -> np.ndarray:
    """The numbers of a file as they are, shape (height, 2 height)."""
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: '{path.suffix}' is not a format for depth; allowed are .exr, .png (16 bit), .npy")
    if channel is not None and reader is not _from_exr:
        raise InputError(f"{path}: has no channels with names, so --channel '{channel}' is none of its")
    values = reader(path) if channel is None else _from_exr(path, channel)
    shape = values.shape
    values = values.reshape([side for side in shape if side > 1])
    if values.ndim != 2 or values.shape[1] != 2 * values.shape[0]:
        raise InputError(
            f"{path}: depth has shape {shape}; rows and columns are needed, twice as many columns as rows, such as "
            "(512, 1024): it must be twice as wide as high"
        )
    return values


def along_rays(values: FloatArray, kind: Kind, scale: float = 1.0, tuned: DistancesParameters = DEFAULT) -> FloatArray:
    """Distances along the rays in metres, NaN where they are not known.

    Args:
        values: as they were read, shape (height, 2 height).
        kind: what they are.
        scale: metres of one; of disparity, the distance in metres of a disparity of one.
        tuned: where a distance along the viewing axis says something.
    """
    if kind == "disparity":
        nearness = np.where(values >= 0.0, values, np.nan)
        return np.divide(scale, nearness, out=np.full(values.shape, np.inf), where=nearness != 0.0)
    if kind == "ray":
        return values * scale
    forward = np.abs(pixel_directions(*values.shape)[..., 1])
    return np.where(forward > tuned.near_plane, np.abs(values) / np.maximum(forward, tuned.near_plane), np.nan) * scale


def likely_kind(values: FloatArray, tuned: DistancesParameters = DEFAULT) -> Kind:
    """What the values seem to be.

    They are z where they are negative behind, or vanish beside the viewing axis, and disparity where those of floor and
    ceiling grow toward the nadir and the zenith.

    Args:
        values: as they were read, shape (height, 2 height).
        tuned: what is recognised.
    """
    directions = pixel_directions(*values.shape)
    known = np.isfinite(values) & (values != 0.0)
    if known.sum() < tuned.fewest_known:
        return "ray"
    negative = values < 0.0
    behind = directions[..., 1] < 0.0
    if (negative & known).sum() > tuned.negative * known.sum() and (negative == behind)[
        known
    ].mean() > tuned.negative_behind:
        return "z"
    beside = known & (np.abs(directions[..., 1]) < tuned.beside)
    if beside.sum() > tuned.fewest_beside:
        typical = np.median(np.abs(values[known]))
        if np.median(np.abs(values[beside])) < tuned.vanishing * typical:
            return "z"
    found = (_slope(values, known, directions[:, 0, 2] * side, tuned) for side in (-1, 1))
    slopes = [slope for slope in found if slope]
    reciprocal = slopes and tuned.least_slope < min(slopes) <= max(slopes) < tuned.largest_slope
    return "disparity" if reciprocal else "ray"


def _slope(
    values: FloatArray, known: NDArray[np.bool_], steepness: FloatArray, tuned: DistancesParameters
) -> float | None:
    """Exponent by which the values of a floor or ceiling go with the sine of the angle to the horizon.

    It is -1 for distances, and 1 for their reciprocals.
    """
    rows = [row for row in np.flatnonzero(steepness > tuned.steep) if known[row].mean() > 0.5]
    if len(rows) < tuned.fewest_rows:
        return None
    medians = np.log(np.abs([np.median(values[row][known[row]]) for row in rows]))
    return float(np.polyfit(np.log(steepness[rows]), medians, 1)[0])


def _from_exr(path: Path, channel: str | None = None) -> np.ndarray:
    with ExrReader(path) as reader:
        if channel is None:
            part, names = _distance_channels(reader.headers, path)
        else:
            part, names = _named_channel(reader.headers, path, channel)
        planes = reader.read(part, names)
        if len(names) > 1 and (planes != planes[:, :, :1]).any():
            raise InputError(
                f"{path}: holds a colour picture ({', '.join(names)}), and no channel of distances; Z is needed"
            )
    return planes[:, :, 0]


def _distance_channels(headers: Sequence[ExrHeader], path: Path) -> tuple[ExrHeader, list[str]]:
    """The part and channel of distances, or R, G and B, which must then be equal."""
    found = [(part, channel) for part in headers for channel in part.channels if _is_distance(part, channel)]
    exact = [(part, channel) for part, channel in found if channel == "Z"]
    named = [(part, channel) for part, channel in found if "depth" in _words(part, channel)]
    for chosen in (exact, named, found):
        if len(chosen) == 1:
            return chosen[0][0], [chosen[0][1]]
    grey = [] if found else [(part, names) for part in headers for names in _grey_distances(part)]
    if len(grey) == 1:
        return grey[0]
    if found:
        names = ", ".join(f"'{part.name}: {channel}'" if part.name else f"'{channel}'" for part, channel in found)
        raise InputError(
            f"{path}: has several channels of distances, {names}; 'reconstruct from-depth --channel' states which"
        )
    others = [(part, channel) for part in headers for channel in part.channels if channel.lower() not in ("a", "alpha")]
    if len(others) == 1 and not _is_mist(*others[0]):
        return others[0][0], [others[0][1]]
    if len(headers) == 1 and [channel for _, channel in others] == ["R", "G", "B"]:
        return headers[0], ["R", "G", "B"]
    names = ", ".join(sorted(channel for part in headers for channel in part.channels))
    raise InputError(
        f"{path}: has no channel of distances (Z), but {names}; if one of them is, 'reconstruct from-depth --channel' "
        "states it"
    )


def _named_channel(headers: Sequence[ExrHeader], path: Path, channel: str) -> tuple[ExrHeader, list[str]]:
    """The channel of this name; a part's name may stand before it."""
    every = {f"{part.name}.{own}" if part.name else own: (part, own) for part in headers for own in part.channels}
    found = [entry for name, entry in every.items() if channel in (name, entry[1])]
    if channel in every:
        found = [every[channel]]
    if len(found) != 1:
        raise InputError(
            f"{path}: --channel '{channel}' is none of its channels, or several; allowed: {', '.join(every)}"
        )
    return found[0][0], [found[0][1]]


def _is_distance(part: ExrHeader, channel: str) -> bool:
    layer, _, own = channel.rpartition(".")
    if _is_mist(part, channel):
        return False
    dot = "." if layer else ""
    siblings = {name.lower() for name in part.channels if name.rpartition(".")[0] == layer}
    if _means_distance(own.lower()):
        vector = f"{layer}{dot}x".lower() in siblings and f"{layer}{dot}y".lower() in siblings
        return not vector  # A normal or a position has a Z as well.
    return own.lower() in _ANY_NAME and len(siblings) == 1 and any(map(_means_distance, _words(part, channel)[:-1]))


def _grey_distances(part: ExrHeader) -> list[list[str]]:
    """R, G and B of the layers that are named as distances."""
    layers = dict.fromkeys(channel.rpartition(".")[0] for channel in part.channels)
    found = [
        [f"{layer}.{own}" for own in "RGB"] for layer in layers if any(map(_means_distance, layer.lower().split(".")))
    ]
    if not found and any(map(_means_distance, part.name.lower().split("."))):
        found = [["R", "G", "B"]]
    return [names for names in found if all(name in part.channels for name in names)]


def _means_distance(word: str) -> bool:
    return word in _EXACT_WORDS or "depth" in word


def _is_mist(part: ExrHeader, channel: str) -> bool:
    """Blender's share of fog, whose channel is called Z as well."""
    return "mist" in _words(part, channel)


def _words(part: ExrHeader, channel: str) -> list[str]:
    return f"{part.name}.{channel}".lower().split(".")


def _from_npy(path: Path) -> np.ndarray:
    values = read_array(path)
    if values.dtype.kind not in "fiu":
        raise InputError(f"{path}: holds {values.dtype}; distances are numbers")
    return values


def _from_png(path: Path) -> np.ndarray:
    values = read_pixels(path, "PNG file")
    bits, channels = 8 * values.itemsize, values.shape[2]
    colours = values[:, :, : channels - 1 if channels in (2, 4) else channels]
    if values.dtype not in (np.uint8, np.uint16) or (colours != colours[:, :, :1]).any():
        raise InputError(
            f"{path}: has {channels} channels of {bits} bit that differ; depth has one value per pixel. A picture in false "
            "colours is for looking at only: export the depth in grey, 16 bit, or as a NumPy array"
        )
    return values[:, :, 0]


READERS: dict[str, Callable[[Path], np.ndarray]] = {".exr": _from_exr, ".png": _from_png, ".npy": _from_npy}
"""Readers by file name extension. A new format is one function and one line here."""


def check_kind(path: Path, values: FloatArray) -> None:
    """Refuse what cannot be distances along the rays, and warn of what probably is none.

    Raises:
        InputError: values are negative where distances along the viewing axis are.
    """
    kind = likely_kind(values)
    convert = f"'reconstruct from-depth --kind {kind}' converts them"
    if kind == "z" and (values < 0.0).any():
        raise InputError(
            f"{path}: is negative behind the viewing axis: distances along that axis (z), not along the rays; {convert}"
        )
    if kind == "z":
        warn(f"{path}: vanishes beside the viewing axis, as distances along that axis (z) do; if they are, {convert}")
    if kind == "disparity":
        warn(
            f"{path}: is largest straight up and down, as reciprocal distances (disparity) are; if they are, {convert}"
        )


def warn_of_sky(path: Path, distances: FloatArray, tuned: DistancesParameters = DEFAULT) -> None:
    """Warn of distances that seem to be a mark for the sky, or for the end of what was measured.

    Args:
        path: the file, for messages.
        distances: metres along the ray, shape (height, 2 height), NaN where not measured, inf for sky.
        tuned: what seems to be a mark.
    """
    known, nearer = _known_and_nearer(distances)
    if not known.size:
        return
    largest = float(known.max())
    count = known.size - nearer.size
    states = "if that means the sky, 'reconstruct from-depth --sky-beyond' states it"
    # By chance a level floor or ceiling meets a row of pixels at exactly the same distance, and both of them two.
    many = count > max(tuned.far_row * distances.shape[1], tuned.far_share * distances.size)
    some = count > max(tuned.far_fewest, tuned.far_fewest_share * distances.size)
    if nearer.size and (many or (some and largest > tuned.far_ratio * nearer.max())):
        warn(
            f"{path}: {count} pixels have the same distance, {largest:g}, and all others at most {nearer.max():g}; "
            f"{states}"
        )
    elif largest > tuned.farthest_surface:
        warn(f"{path}: its distances go up to {largest:.3g} m; {states}")


def _known_and_nearer(distances: FloatArray) -> tuple[FloatArray, FloatArray]:
    """All that is measured and no sky, and what of it is nearer than the farthest."""
    known = distances[np.isfinite(distances) & (distances > 0.0)]
    return known, known[known < known.max(initial=0.0) * (1.0 - 1e-6)]


def warn_of_unit(path: Path, distances: FloatArray, tuned: DistancesParameters = DEFAULT) -> None:
    """Warn of distances that are probably no metres; arguments as of :func:`warn_of_sky`."""
    known, nearer = _known_and_nearer(distances)
    if not known.size:
        return
    largest, middle = float(known.max()), float(np.median(known))
    convert = "'reconstruct from-depth --scale' converts them"
    most = tuned.largest_median
    if middle > most and (not nearer.size or np.median(nearer) > most):
        warn(f"{path}: half of its distances are above {middle:.3g} m; if they are not metres, {convert}")
    elif tuned.normalised < largest <= 1.0:
        warn(f"{path}: its distances end at {largest:g}; if they are normalised, {convert}")

"""A frame as a file: OpenEXR with its layers, and the picture for the screen beside it."""

from __future__ import annotations

import re
from collections.abc import Collection
from fractions import Fraction
from pathlib import Path
from typing import Any, Literal

import numpy as np
import OpenEXR

from lightdepth.cameras.topology import Flat, Rectangle, Spherical
from lightdepth.errors import InputError
from lightdepth.film.cryptomatte import matte_channels
from lightdepth.film.frame import EXPOSURE, NUMBER, Frame
from lightdepth.film.header import COLOUR, MATRICES, software, time_attributes
from lightdepth.images.exr import ExrPart, read_exr, write_exr
from lightdepth.images.look import Look
from lightdepth.images.png import write_png
from lightdepth.images.tonemapping import Curve, auto_exposure, tone_map

LAYERS: dict[str, tuple[str, type[np.generic]]] = {
    "plate": ("RGB", np.float32),
    "change": ("RGB", np.float32),
    "shadow": ("RGB", np.float16),
    "synthetic": ("RGB", np.float32),
    "coverage": ("Y", np.float32),
    "object_id": ("id", np.uint32),
    "depth": ("Z", np.float32),
    "normal": ("XYZ", np.float16),
    "albedo": ("RGB", np.float16),
    "photograph": ("share", np.float32),
    "variance": ("RGB", np.float32),
    "samples": ("count", np.uint32),
    "cryptomatte": ("", np.float32),
}
"""Channels and pixel type of each layer of a frame. Half floats only where the difference is invisible."""
AUXILIARY = frozenset({"object_id", "depth", "normal", "albedo", "photograph", "cryptomatte"})
"""Those rendered separately, see ``lightdepth.film.auxiliary``."""
FILE_NAMES = {"normal": "N"}
"""Names of layers in the file that differ from the layer's own: those that compositing programs know."""
FILE_LAYOUT = 3
"""Version of the file's contents; part of the fingerprint of frames."""
Structure = Literal["multipart", "single"]
ROWS_AT_ONCE = 128
REQUIRED = ("plate", "change", "synthetic", "coverage")
_OBJECT_NAMES = "lightdepth:objects"
_METADATA = "lightdepth:"
_NUMBERED = re.compile(r"(.*)([._-]\d+)")
_FORMER_NAMES = {"alpha.Y": "coverage.Y", "samples.samples": "samples.count"} | {f"normal.{c}": f"N.{c}" for c in "XYZ"}
_ENVIRONMENT_MAPS = {"latlong": OpenEXR.ENVMAP_LATLONG}


def write_frame(
    path: Path,
    frame: Frame,
    layers: Collection[str] | None = None,
    rate: Fraction | None = None,
    structure: Structure = "multipart",
) -> None:
    """Write a frame as OpenEXR: the finished image as ``R G B A``, and each layer with channels ``layer.X``.

    ``A`` is 1 inside the camera's image; ``coverage`` holds the new objects' coverage. A full panorama is marked
    ``envmap = latlong``. The first part says how the frame was made; ``docs/picture-file.md`` lists all layers and
    attributes. Views and faces that are to be files of their own are written first, see :func:`part_path`.

    Args:
        path: where to write; the file appears whole or not at all.
        frame: what to write.
        layers: names out of ``LAYERS`` to write beside the finished image; ``None`` means all that the frame has.
        rate: frames per second, for a frame of a sequence.
        structure: ``multipart`` writes the image first and each layer as a part with its name, ``single`` all as one
            part, for programs that read no other.

    Raises:
        InputError: a layer's name is unknown, or the file cannot be written.
    """
    unknown = sorted(set(layers or ()) - set(LAYERS))
    if unknown:
        raise InputError(f"layer '{unknown[0]}' is unknown; allowed are {', '.join(LAYERS)}")
    for name, part in frame.parts():
        write_frame(part_path(path, name), part, layers, rate, structure)
    layout = frame.topology.environment_map
    shared: dict[str, Any] = dict(COLOUR)  # Some of it must be the same in all parts.
    if layout is not None:
        shared["envmap"] = _ENVIRONMENT_MAPS[layout]
    facts = {**{_METADATA + name: value for name, value in frame.metadata.items()}, **frame.matrices}
    facts["software"] = software()
    if rate is not None:
        number = frame.metadata.get(NUMBER)
        timing = time_attributes(None if number is None else int(number), rate)
        facts["framesPerSecond"] = timing.pop("framesPerSecond")
        shared |= timing
    header = {**shared, **facts}
    planes: dict[str, Any] = {"RGB": frame.beauty, "A": frame.alpha}
    if frame.mattes is not None and (layers is None or "cryptomatte" in layers):
        # In the first part, which is the only one that many programs search for them.
        for name, of_shapes in (("CryptoObject", frame.mattes.objects), ("CryptoMaterial", frame.mattes.materials)):
            matte_planes, matte_facts = matte_channels(frame.mattes, name, of_shapes, frame.coverage.shape)
            planes |= matte_planes
            header |= matte_facts
    parts = [ExrPart(planes, "beauty", header)]
    for layer, (channels, dtype) in LAYERS.items():
        if layers is not None and layer not in layers:
            continue
        pixels = getattr(frame, layer, None)
        if pixels is None:
            continue
        extra = {_OBJECT_NAMES: list(frame.object_names)} if layer == "object_id" and frame.object_names else {}
        name = FILE_NAMES.get(layer, layer)
        parts.append(
            ExrPart(_channels(name, channels, pixels.astype(dtype, copy=False)), layer, {**shared, **extra}),
        )
    if structure == "single":
        together = {name: plane for part in parts for name, plane in part.channels.items()}
        parts = [ExrPart(together, "", {name: value for part in parts for name, value in part.header.items()})]
    write_exr(path, parts)


def part_path(path: Path, name: str) -> Path:
    """The file of a view or face beside that of the whole film: ``shot.left.exr``, ``shot.left.0001.exr``."""
    found = _NUMBERED.fullmatch(path.stem)
    stem, number = (path.stem, "") if found is None else found.groups()
    return path.with_name(f"{stem}.{name}{number}{path.suffix}")


def _channels(layer: str, names: str, pixels: np.ndarray) -> dict[str, np.ndarray]:
    """A layer's channels for the file; RGB stays interleaved, which saves a copy."""
    if names == "RGB":
        return {layer: pixels}
    if names == "XYZ":
        return {f"{layer}.{name}": pixels[:, :, i] for i, name in enumerate(names)}
    if names == "share":
        return {f"{layer}.share{number}": pixels[:, :, number - 1] for number in range(1, pixels.shape[2] + 1)}
    return {f"{layer}.{names}": pixels}


def read_frame(path: Path) -> Frame:
    """Read a frame that :func:`write_frame` wrote with at least the layers ``REQUIRED``, of this version or earlier ones.

    Raises:
        InputError: the file is missing, unreadable, or lacks a layer.
    """
    parts = read_exr(path)
    planes_of: dict[str, np.ndarray] = {}
    for part in parts:
        for name, plane in part.channels.items():
            bare = "." not in name and part.name not in ("", "beauty")  # Earlier, only parts had the layers' names.
            full = f"{part.name}.{name}" if bare else name
            planes_of[_FORMER_NAMES.get(full, full)] = plane
    first = parts[0]
    layers: dict[str, Any] = {}
    for layer, (channels, dtype) in LAYERS.items():
        letters = list(channels) if channels in ("RGB", "XYZ") else [channels]
        if channels == "share":
            count = sum(name.startswith(f"{layer}.share") for name in planes_of)
            letters = [f"share{number}" for number in range(1, max(count, 1) + 1)]
        names = [f"{FILE_NAMES.get(layer, layer)}.{letter}" for letter in letters]
        absent = [name for name in names if name not in planes_of]
        if len(absent) == len(names) or layer == "shadow":  # The frame computes that.
            continue
        if absent:
            raise InputError(f"{path}: lacks the channel '{absent[0]}'")
        planes = [planes_of[name] for name in names]
        kind = np.uint32 if dtype is np.uint32 else np.float32
        layers[layer] = (planes[0] if len(planes) == 1 else np.stack(planes, axis=-1)).astype(kind, copy=False)
    missing = [name for name in REQUIRED if name not in layers]
    if missing or "A" not in planes_of:
        lacking = ", ".join(missing) or "A"
        raise InputError(f"{path}: lacks the layers {lacking}; it has the channels {', '.join(planes_of)}")
    alpha = planes_of["A"]
    height, width = alpha.shape
    panorama = first.header.get("envmap") == "latlong"
    names_of_objects = [part.header[_OBJECT_NAMES] for part in parts if _OBJECT_NAMES in part.header]
    return Frame(
        **layers,
        alpha=alpha,
        metadata={
            name.removeprefix(_METADATA): value
            for name, value in first.header.items()
            if name.startswith(_METADATA) and name not in (_OBJECT_NAMES, *MATRICES)
        },
        matrices={name: first.header[name] for name in MATRICES if name in first.header},
        object_names=tuple(names_of_objects[0]) if names_of_objects else (),
        topology=Spherical((Rectangle(0, height, 0, width),)) if panorama else Flat(width, height),
    )


def picture_exposure(frame: Frame) -> float:
    """Exposure at which a frame is shown, stops: by the brightness of the whole panorama.

    So it is the same for all cameras and frames of a scene, and new objects do not change it. A frame that was not
    rendered from a scene is shown by the brightness of its plate.
    """
    known = frame.metadata.get(EXPOSURE)
    return auto_exposure(frame.plate, frame.alpha) if known is None else float(known)


def write_picture(
    path: Path,
    frame: Frame,
    exposure_stops: float | None = None,
    curve: Curve = "agx-like",
    look: Look | None = None,
) -> None:
    """Write a frame's finished image as PNG for the screen, transparent outside the camera's image, and so its parts.

    Args:
        path: where to write; the file appears whole or not at all.
        frame: what to show.
        exposure_stops: see :func:`~lightdepth.images.tonemapping.tone_map`; ``None`` takes :func:`picture_exposure`.
        curve: the tone curve.
        look: is used instead of it.

    Raises:
        InputError: the file cannot be written.
    """
    if exposure_stops is None:
        exposure_stops = picture_exposure(frame)
    for name, part in frame.parts():
        write_picture(part_path(path, name), part, exposure_stops, curve, look)
    pixels = np.empty(frame.plate.shape, np.uint8)
    for first in range(0, len(pixels), ROWS_AT_ONCE):
        here = slice(first, first + ROWS_AT_ONCE)
        rows = frame.beauty_rows(here.start, here.stop)
        if look is None:
            pixels[here] = tone_map(rows, exposure_stops, curve)
        else:
            pixels[here] = np.rint(look(rows, exposure_stops) * 255.0)
    if not (frame.alpha == 1.0).all():
        alpha = np.rint(np.clip(frame.alpha, 0.0, 1.0) * 255.0).astype(np.uint8)
        pixels = np.concatenate([pixels, alpha[:, :, None]], axis=2)
    write_png(path, pixels)

"""A frame as a file: one OpenEXR part a layer, and the picture for the screen beside it."""

from __future__ import annotations

from collections.abc import Collection
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR

from lightdepth.cameras.topology import Flat, Rectangle, Spherical
from lightdepth.errors import InputError
from lightdepth.film.cryptomatte import matte_channels
from lightdepth.film.frame import EXPOSURE, Frame
from lightdepth.images.exr import ExrPart, read_exr, write_exr
from lightdepth.images.png import write_png
from lightdepth.images.tonemapping import Curve, auto_exposure, tone_map

LAYERS: dict[str, tuple[str, type[np.generic]]] = {
    "plate": ("RGB", np.float32),
    "change": ("RGB", np.float32),
    "synthetic": ("RGB", np.float32),
    "coverage": ("Y", np.float32),
    "object_id": ("id", np.uint32),
    "depth": ("Z", np.float32),
    "normal": ("XYZ", np.float16),
    "albedo": ("RGB", np.float16),
    "photograph": ("share", np.float32),
    "variance": ("RGB", np.float32),
    "samples": ("samples", np.uint32),
    "cryptomatte": ("", np.float32),
}
"""Channels and pixel type of each layer of a frame. Half floats only where nobody could see the difference."""
AUXILIARY = frozenset({"object_id", "depth", "normal", "albedo", "photograph", "cryptomatte"})
"""Those that take time of their own, see ``lightdepth.film.auxiliary``."""
PART_NAMES = {"coverage": "alpha"}
"""Names of parts that are not the layer's own."""
ROWS_AT_ONCE = 128
REQUIRED = ("plate", "change", "synthetic", "coverage")
_OBJECT_NAMES = "lightdepth:objects"
_METADATA = "lightdepth:"
_ENVIRONMENT_MAPS = {"latlong": OpenEXR.ENVMAP_LATLONG}


def write_frame(path: Path, frame: Frame, layers: Collection[str] | None = None, rate: Fraction | None = None) -> None:
    """Write a frame as OpenEXR: the finished image as ``R G B A`` first, then each layer as a part with its name.

    ``A`` is 1 inside the camera's image; the part ``alpha`` holds the new objects' coverage. The parts of a full
    panorama are marked ``envmap = latlong``.

    Args:
        path: where to write; the file appears whole or not at all.
        frame: what to write.
        layers: names out of ``LAYERS`` to write beside the finished image; ``None`` means all that the frame has.
        rate: frames per second, for a frame of a sequence.

    Raises:
        InputError: a layer's name is unknown, or the file cannot be written.
    """
    unknown = sorted(set(layers or ()) - set(LAYERS))
    if unknown:
        raise InputError(f"layer '{unknown[0]}' is unknown; allowed are {', '.join(LAYERS)}")
    layout = frame.topology.environment_map
    marks: dict[str, Any] = {} if layout is None else {"envmap": _ENVIRONMENT_MAPS[layout]}
    header = {**marks, **{_METADATA + name: value for name, value in frame.metadata.items()}}
    if rate is not None:
        header["framesPerSecond"] = rate
    planes: dict[str, Any] = {"RGB": frame.beauty, "A": frame.alpha}
    if frame.mattes is not None and (layers is None or "cryptomatte" in layers):
        # In the first part, which is the only one that many programs search for them.
        for name, of_shapes in (("CryptoObject", frame.mattes.objects), ("CryptoMaterial", frame.mattes.materials)):
            matte_planes, facts = matte_channels(frame.mattes, name, of_shapes, frame.coverage.shape)
            planes |= matte_planes
            header |= facts
    parts = [ExrPart(planes, "beauty", header)]
    for layer, (channels, dtype) in LAYERS.items():
        pixels = getattr(frame, layer, None)
        if pixels is None or (layers is not None and layer not in layers):
            continue
        extra = {_OBJECT_NAMES: list(frame.object_names)} if layer == "object_id" and frame.object_names else {}
        parts.append(
            ExrPart(
                _channels(channels, pixels.astype(dtype, copy=False)), PART_NAMES.get(layer, layer), {**marks, **extra}
            )
        )
    write_exr(path, parts)


def _channels(names: str, pixels: np.ndarray) -> dict[str, np.ndarray]:
    """A layer's channels for the file; RGB stays interleaved, which saves a copy."""
    if names == "XYZ":
        return {name: pixels[:, :, i] for i, name in enumerate(names)}
    if names == "share":
        return {f"share{number}": pixels[:, :, number - 1] for number in range(1, pixels.shape[2] + 1)}
    return {names: pixels}


def read_frame(path: Path) -> Frame:
    """Read a frame that :func:`write_frame` wrote with at least the layers ``REQUIRED``.

    Raises:
        InputError: the file is missing, unreadable, or lacks a layer.
    """
    parts = {part.name: part for part in read_exr(path)}
    needed = ["beauty", *(PART_NAMES.get(name, name) for name in REQUIRED)]
    missing = [name for name in needed if name not in parts]
    if missing:
        raise InputError(f"{path}: lacks the parts {', '.join(missing)}; it has {', '.join(map(repr, parts))}")
    layers: dict[str, Any] = {}
    for layer, (channels, dtype) in LAYERS.items():
        part = parts.get(PART_NAMES.get(layer, layer))
        if part is None:
            continue
        names = list(channels) if channels in ("RGB", "XYZ") else [channels]
        if channels == "share":
            names = [f"share{number}" for number in range(1, max(len(part.channels), 1) + 1)]
        absent = [name for name in names if name not in part.channels]
        if absent:
            raise InputError(f"{path}: part '{part.name}' lacks the channel '{absent[0]}'")
        planes = [part.channels[name] for name in names]
        full = np.uint32 if dtype is np.uint32 else np.float32
        layers[layer] = (planes[0] if len(planes) == 1 else np.stack(planes, axis=-1)).astype(full, copy=False)
    beauty = parts["beauty"]
    height, width = beauty.channels["A"].shape
    panorama = beauty.header.get("envmap") == "latlong"
    ids = parts.get("object_id")
    return Frame(
        **layers,
        alpha=beauty.channels["A"],
        metadata={k.removeprefix(_METADATA): v for k, v in beauty.header.items() if k.startswith(_METADATA)},
        object_names=tuple(ids.header.get(_OBJECT_NAMES, ())) if ids else (),
        topology=Spherical((Rectangle(0, height, 0, width),)) if panorama else Flat(width, height),
    )


def picture_exposure(frame: Frame) -> float:
    """Stops at which a frame is shown: by the brightness of the whole panorama.

    So it is the same for all cameras and frames of a scene, and new objects do not change it. A frame that was not
    rendered from a scene, and does not know its panorama, goes by its plate.
    """
    known = frame.metadata.get(EXPOSURE)
    return auto_exposure(frame.plate, frame.alpha) if known is None else float(known)


def write_picture(path: Path, frame: Frame, exposure_stops: float | None = None, curve: Curve = "agx-like") -> None:
    """Write a frame's finished image as PNG for the screen, transparent outside the camera's image.

    Args:
        path: where to write; the file appears whole or not at all.
        frame: what to show.
        exposure_stops: see :func:`~lightdepth.images.tonemapping.tone_map`; ``None`` takes :func:`picture_exposure`.
        curve: the tone curve.

    Raises:
        InputError: the file cannot be written.
    """
    if exposure_stops is None:
        exposure_stops = picture_exposure(frame)
    pixels = np.empty(frame.plate.shape, np.uint8)
    for first in range(0, len(pixels), ROWS_AT_ONCE):
        here = slice(first, first + ROWS_AT_ONCE)
        pixels[here] = tone_map(frame.beauty_rows(here.start, here.stop), exposure_stops, curve)
    if not (frame.alpha == 1.0).all():
        alpha = np.rint(np.clip(frame.alpha, 0.0, 1.0) * 255.0).astype(np.uint8)
        pixels = np.concatenate([pixels, alpha[:, :, None]], axis=2)
    write_png(path, pixels)

"""A camera's response: what linear exposure a reading stands for."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lightdepth.capture.photograph import Codes
from lightdepth.errors import InputError
from lightdepth.images.writing import whole_file

FloatArray = NDArray[np.float64]
LEVELS = 256


@dataclass(frozen=True)
class Response:
    """Linear exposure by reading, for each colour channel.

    Attributes:
        curves: shape (3, 256), increasing; entry ``i`` is the exposure of the reading ``i / 255``, linear between. The
            reading of one half stands for the exposure of sRGB's one half, 0.214, in every channel: grey stays grey.
    """

    curves: FloatArray

    def linear(self, codes: Codes) -> NDArray[np.float32]:
        """Exposure of camera readings, shape (height, width, 3), float32."""
        white = np.iinfo(codes.dtype).max
        positions = np.linspace(0.0, LEVELS - 1.0, white + 1)
        levels = np.arange(LEVELS)
        tables = [np.interp(positions, levels, curve).astype(np.float32) for curve in self.curves]
        return np.stack([table[codes[..., channel]] for channel, table in enumerate(tables)], axis=-1)

    def readings(self, exposure: NDArray[np.float32]) -> NDArray[np.float32]:
        """Camera readings in [0, 1] of exposures, shape (height, width, 3), float32: the inverse of :meth:`linear`."""
        levels = np.linspace(0.0, 1.0, LEVELS)
        # Equal steps of the exposure's fourth root resolve dark readings well enough for a table.
        steps = np.linspace(0.0, 1.0, 4096)
        result = np.empty_like(exposure)
        for channel, curve in enumerate(self.curves):
            table = np.interp(curve[-1] * steps**4, curve, levels).astype(np.float32)
            relative = np.sqrt(np.sqrt(np.clip(exposure[..., channel] / np.float32(curve[-1]), 0.0, 1.0)))
            result[..., channel] = table[np.rint(relative * (steps.size - 1)).astype(np.intp)]
        return result


def normalised(curves: FloatArray) -> Response:
    """A response from curves of any scale, shape (3, 256): each scaled so that a reading of one half is 0.214."""
    levels = np.linspace(0.0, 1.0, LEVELS)
    middle = np.array([np.interp(0.5, levels, curve) for curve in curves])
    return Response(np.asarray(curves) * (srgb_to_linear(np.array(0.5)) / middle)[:, None])


def srgb_to_linear(encoded: FloatArray) -> FloatArray:
    """The transfer function of IEC 61966-2-1, from encoded to linear, both in [0, 1]."""
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def srgb_response() -> Response:
    """The response of a camera that follows sRGB to the letter."""
    return normalised(np.tile(srgb_to_linear(np.linspace(0.0, 1.0, LEVELS)), (3, 1)))


def linear_response() -> Response:
    """The response of RAW files: readings are exposures, 1 at white."""
    return Response(np.tile(np.linspace(0.0, 1.0, LEVELS), (3, 1)))


def save_response(path: Path, response: Response) -> None:
    """Write a response as JSON; the file appears whole or not at all.

    Raises:
        InputError: the file cannot be written.
    """
    names = zip(("red", "green", "blue"), response.curves.tolist(), strict=True)
    document = {"format": "lightdepth camera response", "version": 1, "exposure_by_reading": dict(names)}
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps(document, indent=1))


def load_response(path: Path) -> Response:
    """Read what :func:`save_response` wrote.

    Raises:
        InputError: the file is missing or is not a camera response.
    """
    try:
        document = json.loads(path.read_text())
        curves = np.array([document["exposure_by_reading"][name] for name in ("red", "green", "blue")], dtype=float)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputError(
            f"{path}: not a camera response as --save-response writes it: JSON with 'exposure_by_reading', which holds "
            f"{LEVELS} numbers for each of 'red', 'green' and 'blue'"
        ) from error
    if curves.shape != (3, LEVELS) or not np.isfinite(curves).all() or (np.diff(curves) < 0).any():
        raise InputError(f"{path}: each channel needs {LEVELS} finite, increasing values")
    return Response(curves)

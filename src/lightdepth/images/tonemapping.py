"""From scene-referred radiance to pixels for the screen: exposure and a curve."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, cast, get_args

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError, warn

Curve = Literal["agx-like", "filmic", "linear"]
Rgb = NDArray[np.float32]

LUMINANCE = np.array([0.2126, 0.7152, 0.0722], dtype=np.float32)
"""Weights of Rec.709's primaries."""
MIDDLE_GREY = 0.18
AVERAGE_LUMINANCE = 0.25
"""What automatic exposure aims at: half a stop above middle grey, for walls are lighter than a grey card."""

# The sigmoid of AgX (Troy Sobotka) in its published numbers: 16.5 stops around middle grey on a logarithmic scale, pivot at
# middle grey, slope 2.4, toe and shoulder of power 1.5. Primaries, inset and rotation are not those of AgX, so the
# colours are not either: hence "like".
_STOPS_BELOW, _STOPS_ABOVE = 10.0, 6.5
_PIVOT_X = _STOPS_BELOW / (_STOPS_BELOW + _STOPS_ABOVE)
_PIVOT_Y = MIDDLE_GREY ** (1.0 / 2.2)
_SLOPE, _POWER = 2.4, 1.5
# Colours move toward grey before the curve, so that bright ones fade to white instead of to a primary, and most of the
# way back after it.
_INSET, _OUTSET = 0.2, 0.12


def tone_map(
    radiance: NDArray[np.float32], exposure_stops: float = 0.0, curve: Curve = "agx-like"
) -> NDArray[np.uint8]:
    """Turn linear radiance into pixels for the screen.

    Args:
        radiance: linear Rec.709, shape (height, width, 3), float32; values that are not finite show as black or white.
        exposure_stops: the radiance is multiplied by two to this power first.
        curve: ``agx-like`` (highlights fade to white, 6.5 stops above middle grey), ``filmic`` (per channel, J. Hable's
            curve of 2010) or ``linear`` (cut at 1).

    Returns:
        sRGB, shape (height, width, 3), uint8.

    Raises:
        InputError: there is no such curve.
    """
    curve = known_curve(curve)
    pixels = np.empty(radiance.shape, dtype=np.uint8)
    rows = max(1, 2**20 // max(1, radiance.shape[1]))
    for top in range(0, radiance.shape[0], rows):  # In bands, so that a large image needs little memory.
        pixels[top : top + rows] = np.rint(display_values(radiance[top : top + rows], exposure_stops, curve) * 255.0)
    return pixels


def display_values(radiance: Rgb, exposure_stops: float = 0.0, curve: Curve = "agx-like") -> Rgb:
    """Turn linear radiance into values for the screen that are not yet quantised.

    Args:
        radiance: as for :func:`tone_map`.
        exposure_stops: likewise.
        curve: likewise.

    Returns:
        sRGB, shape (height, width, 3), float32, in [0, 1].
    """
    finite = np.nan_to_num(radiance, nan=0.0, posinf=3e38, neginf=0.0)
    exposed = np.clip(finite, 0.0, 1e30) * np.float32(2.0**exposure_stops)
    return _encode_srgb(np.clip(CURVES[known_curve(curve)](exposed), 0.0, 1.0))


def known_curve(curve: str) -> Curve:
    """The curve of this name, or of this former name.

    Raises:
        InputError: there is none.
    """
    if curve in FORMER_NAMES:
        warn(f"tone curve '{curve}' is now called '{FORMER_NAMES[curve]}'")
        return FORMER_NAMES[curve]
    if curve not in CURVES:
        raise InputError(f"tone curve '{curve}': allowed are {', '.join(get_args(Curve))}")
    return cast(Curve, curve)


def auto_exposure(radiance: NDArray[np.float32], alpha: NDArray[np.float32] | None = None) -> float:
    """Exposure that brings the image's log-average luminance to ``AVERAGE_LUMINANCE``.

    Luminances outside the 5th and 95th percentile count as these, so that lamps and black corners do not decide.

    Args:
        radiance: linear Rec.709, shape (height, width, 3), float32.
        alpha: shape (height, width); pixels of 0 do not count.

    Returns:
        Stops for :func:`tone_map`; 0 for a black image.
    """
    step = max(1, int(np.sqrt(radiance.shape[0] * radiance.shape[1] / 2**19)))  # Half a million pixels are enough.
    luminance = radiance[::step, ::step] @ LUMINANCE
    counts = np.isfinite(luminance) & (luminance > 0.0)
    if alpha is not None:
        counts &= alpha[::step, ::step] > 0.0
    if not counts.any():
        return 0.0
    stops = np.log2(luminance[counts].astype(np.float64))
    return float(np.log2(AVERAGE_LUMINANCE) - np.clip(stops, *np.percentile(stops, [5.0, 95.0])).mean())


def _agx_like(radiance: Rgb) -> Rgb:
    """Returns display-linear values, about [0, 1]."""
    inset = _toward_grey(_INSET)
    stops = np.log2(np.maximum(radiance @ inset.T, 1e-10) / np.float32(MIDDLE_GREY))
    position = np.clip((stops + _STOPS_BELOW) / (_STOPS_BELOW + _STOPS_ABOVE), 0.0, 1.0)
    outset = np.linalg.inv(_toward_grey(_OUTSET)).astype(np.float32)
    return np.maximum(_sigmoid(position) @ outset.T, 0.0) ** np.float32(2.2)


def _toward_grey(share: float) -> Rgb:
    """Matrix that mixes a colour with grey of about its own luminance."""
    return ((1.0 - share) * np.eye(3) + share * np.array([0.22, 0.39, 0.39])).astype(np.float32)


def _sigmoid(x: NDArray[np.float32]) -> NDArray[np.float32]:
    """Curve through (0, 0), the pivot and (1, 1), straight around the pivot.

    On either side ``y = scale h(slope x / scale)`` with ``h(t) = t / (1 + t^p)^(1/p)``, counted from the pivot; the
    scale follows from the end point.
    """

    def side(distance: NDArray[np.float32], width: float, height: float) -> NDArray[np.float32]:
        steepness = _SLOPE * width
        scale = steepness / ((steepness / height) ** _POWER - 1.0) ** (1.0 / _POWER)
        t = np.maximum(distance, 0.0) * np.float32(_SLOPE / scale)
        return np.float32(scale) * t / (1.0 + t ** np.float32(_POWER)) ** np.float32(1.0 / _POWER)

    above = side(x - np.float32(_PIVOT_X), 1.0 - _PIVOT_X, 1.0 - _PIVOT_Y)
    below = side(np.float32(_PIVOT_X) - x, _PIVOT_X, _PIVOT_Y)
    return np.float32(_PIVOT_Y) + above - below


def _filmic(radiance: Rgb) -> Rgb:
    """Hable's curve with his constants and white point 11.2."""

    def shape(x: Rgb) -> Rgb:
        y = (x * (0.15 * x + 0.05) + 0.004) / (x * (0.15 * x + 0.5) + 0.06) - 0.02 / 0.3
        return y.astype(np.float32, copy=False)

    return shape(np.minimum(2.0 * radiance, 1e6)) / shape(np.array(11.2, dtype=np.float32))


def _linear(radiance: Rgb) -> Rgb:
    return radiance


CURVES: dict[str, Callable[[Rgb], Rgb]] = {"agx-like": _agx_like, "filmic": _filmic, "linear": _linear}
"""The curves by name; each maps exposed radiance to linear light of the screen."""
FORMER_NAMES: dict[str, Curve] = {"agx": "agx-like"}
"""Names that are still understood."""


def _encode_srgb(linear: Rgb) -> Rgb:
    """The transfer function of IEC 61966-2-1, for values in [0, 1]."""
    curved = np.float32(1.055) * linear ** np.float32(1.0 / 2.4) - np.float32(0.055)
    return np.where(linear <= 0.0031308, np.float32(12.92) * linear, curved)

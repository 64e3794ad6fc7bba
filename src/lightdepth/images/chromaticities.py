"""Colours of other primaries as Rec.709."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lightdepth.errors import InputError, warn

FloatArray = NDArray[np.float64]

REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
"""Chromaticities x, y of red, green, blue and white (ITU-R BT.709)."""
CIE_XYZ = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0 / 3.0, 1.0 / 3.0)
"""Those of pixels that are tristimulus values X, Y, Z."""
COLOUR_SPACES = {
    "lin_rec709_scene": REC709,
    "lin_ap1_scene": (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767),
    "lin_ap0_scene": (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767),
    "lin_rec2020_scene": (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290),
    "lin_p3d65_scene": (0.680, 0.320, 0.265, 0.690, 0.150, 0.060, 0.3127, 0.3290),
    "lin_adobergb_scene": (0.64, 0.33, 0.21, 0.71, 0.15, 0.06, 0.3127, 0.3290),
    "lin_ciexyzd65_scene": CIE_XYZ,
}
"""Linear colour spaces by their names of the Color Interop Forum, which OpenEXR files may state."""
_SAME = 2e-3
_BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])


def to_rec709(chromaticities: ArrayLike, path: Path) -> NDArray[np.float32] | None:
    """Matrix from linear RGB of some primaries to linear Rec.709.

    Its white becomes Rec.709's by Bradford's transform (K. M. Lam, 1985), so that grey stays grey. Tristimulus values
    have no white of their own and are only converted.

    Args:
        chromaticities: x, y of red, green, blue and white, 8 numbers.
        path: the file that states them, for messages.

    Returns:
        Shape (3, 3), for column vectors; ``None`` where they are Rec.709's.

    Raises:
        InputError: they span no colour space.
    """
    xy = np.asarray(chromaticities, dtype=np.float64).ravel()
    if xy.size != 8 or not np.isfinite(xy).all():
        raise InputError(f"{path}: its chromaticities must be 8 finite numbers: x, y of red, green, blue and white")
    if np.allclose(xy, REC709, atol=_SAME):
        return None
    from_xyz = np.linalg.inv(_to_xyz(REC709))
    if np.allclose(xy, CIE_XYZ, atol=_SAME):
        return from_xyz.astype(np.float32)
    try:
        to_xyz = _to_xyz(xy)
    except (np.linalg.LinAlgError, FloatingPointError) as error:
        numbers = ", ".join(f"{value:g}" for value in xy)
        raise InputError(f"{path}: its chromaticities {numbers} span no colour space") from error
    cones = _BRADFORD @ _white(REC709) / (_BRADFORD @ _white(xy))
    adapted = np.linalg.inv(_BRADFORD) @ np.diag(cones) @ _BRADFORD @ to_xyz
    return np.asarray(from_xyz @ adapted, dtype=np.float32)


def primaries_of(attributes: Mapping[str, Any], path: Path) -> ArrayLike:
    """Chromaticities that an OpenEXR header states, by their numbers or by a colour space's name; else Rec.709's."""
    name = attributes.get("colorInteropID", "lin_ap0_scene" if attributes.get("acesImageContainerFlag") else None)
    if "chromaticities" in attributes:
        return attributes["chromaticities"]
    if name in (None, "", "unknown", "data"):
        return REC709
    if name not in COLOUR_SPACES:
        warn(f"{path}: its colour space '{name}' is not known and is taken for linear Rec.709")
    return COLOUR_SPACES.get(name, REC709)


def converted(radiance: NDArray[np.float32], matrix: NDArray[np.float32] | None) -> NDArray[np.float32]:
    """Radiance of shape (height, width, 3) multiplied by a matrix from :func:`to_rec709`, in place."""
    if matrix is not None:
        with np.errstate(over="ignore", invalid="ignore"):  # Reported where radiance is checked.
            for row in radiance:
                row[:] = row @ matrix.T
    return radiance


def luminance_weights(chromaticities: ArrayLike) -> NDArray[np.float32]:
    """Shares of red, green and blue in the luminance, shape (3,), for primaries that :func:`to_rec709` accepts."""
    return _to_xyz(np.asarray(chromaticities, dtype=np.float64).ravel())[1].astype(np.float32)


def _to_xyz(xy: Sequence[float] | FloatArray) -> FloatArray:
    """Matrix from RGB to XYZ with Y = 1 for white (SMPTE RP 177)."""
    columns = np.array([[x, y, 1.0 - x - y] for x, y in np.reshape(xy, (4, 2))[:3]]).T
    if abs(np.linalg.det(columns)) < 1e-6:
        raise np.linalg.LinAlgError
    shares = np.linalg.solve(columns, _white(xy))
    if not (shares > 0.0).all():
        raise np.linalg.LinAlgError
    return columns * shares


def _white(xy: Sequence[float] | FloatArray) -> FloatArray:
    x, y = np.reshape(xy, (4, 2))[3]
    if not y > 0.0:
        raise np.linalg.LinAlgError
    return np.array([x / y, 1.0, (1.0 - x - y) / y])

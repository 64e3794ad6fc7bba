"""How much a polished metal ball reflects at each angle."""

from __future__ import annotations

import numpy as np

from lightdepth.directions import FloatArray
from lightdepth.errors import InputError

CHROMIUM = 0.55
"""Reflectance of chromium at normal incidence."""
MODULUS = 4.6
"""Of its complex index of refraction."""
LEAST_METAL = ((MODULUS - 1.0) / (MODULUS + 1.0)) ** 2
"""Least reflectance at normal incidence with this modulus."""


def parse_reflectance(text: str, option: str) -> FloatArray:
    """One number or three, separated by commas, in (0, 1]; shape (3,).

    Args:
        text: what the user wrote.
        option: where, for messages.

    Raises:
        InputError: it is none of this.
    """
    try:
        values = np.array([float(part) for part in text.split(",")])
    except ValueError:
        values = np.zeros(0)
    if len(values) not in (1, 3) or not np.all((values > 0.0) & (values <= 1.0)):
        raise InputError(f"{option} is '{text}'; allowed are one number above 0 and up to 1, or three: red,green,blue")
    return np.array(np.broadcast_to(values, 3))


def metal_reflectance(normal: FloatArray, cosine: FloatArray) -> FloatArray:
    """Unpolarised reflectance of a metal by Fresnel's equations.

    A metal's complex index has two parts, of which the reflectance at normal incidence gives one. Its modulus is taken to
    be chromium's, 4.6; that of silver is 3.4 and of aluminium 6.8. What reflects less than 41 % is taken for glass.

    Args:
        normal: reflectance at normal incidence, per channel, in (0, 1], shape (3,).
        cosine: of the angle of incidence, shape (n,).

    Returns:
        Shape (n, 3).
    """
    f = np.minimum(np.asarray(normal, np.float64), 1.0 - 1e-6)
    root = np.sqrt(f)
    n = np.minimum((MODULUS**2 + 1.0) * (1.0 - f) / (2.0 * (1.0 + f)), (1.0 + root) / (1.0 - root))
    k = np.sqrt(np.maximum(MODULUS**2 - n**2, 0.0)) * (n < MODULUS) * (f > LEAST_METAL)
    c = np.clip(cosine, 0.0, 1.0)[:, None]
    sine = 1.0 - c**2
    real = n**2 - k**2 - sine
    both = np.sqrt(real**2 + 4.0 * n**2 * k**2)
    a = np.sqrt(np.maximum(0.5 * (both + real), 0.0))
    across = (both + c**2 - 2.0 * a * c) / (both + c**2 + 2.0 * a * c)
    numerator = both * c**2 + sine**2 - 2.0 * a * c * sine
    denominator = both * c**2 + sine**2 + 2.0 * a * c * sine
    along = across * numerator / np.maximum(denominator, 1e-12)
    return np.asarray(np.where(np.asarray(normal) >= 1.0, 1.0, 0.5 * (across + along)))

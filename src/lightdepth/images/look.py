"""Looks: what turns radiance into display values, a tone curve of ours or a view of OpenColorIO."""

from __future__ import annotations

import importlib.util
import os
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError, warn
from lightdepth.images.ocio import PACKAGE, VARIABLE, OcioView
from lightdepth.images.tonemapping import Curve, display_values, known_curve

DEFAULT: Curve = "agx-like"


class Look(Protocol):
    """Turns radiance into display values.

    Attributes:
        display: name of the display that the values are for.
    """

    display: str

    def __call__(self, radiance: NDArray[np.float32], exposure_stops: float = 0.0) -> NDArray[np.float32]:
        """Display values in [0, 1].

        Args:
            radiance: linear Rec.709, shape (height, width, 3), float32.
            exposure_stops: it is multiplied by two to this power first.
        """


class CurveLook:
    """One of our own tone curves, for sRGB displays.

    Raises:
        InputError: there is no curve of this name.
    """

    display = "sRGB"

    def __init__(self, curve: str = DEFAULT) -> None:
        self._curve = known_curve(curve)

    def __call__(self, radiance: NDArray[np.float32], exposure_stops: float = 0.0) -> NDArray[np.float32]:
        """As for every look."""
        return display_values(radiance, exposure_stops, self._curve)

    def __str__(self) -> str:
        return f"look {self._curve}"


def chosen_look(
    curve: str | None = None, ocio: str | None = None, display: str | None = None, view: str | None = None
) -> Look:
    """The look that the options of a command mean.

    Where none is given it is the view of the environment variable ``OCIO``, as in other programs, or else our own curve.

    Args:
        curve: ``--look``.
        ocio: ``--ocio``.
        display: ``--display``.
        view: ``--view``.

    Raises:
        InputError: they do not go together, or name what is not there.
        SetupError: OpenColorIO is asked for and not installed.
    """
    asked = ocio is not None or display is not None or view is not None
    if curve is not None and asked:
        raise InputError("--look is a tone curve of lightdepth; it does not go with --ocio, --display and --view")
    if curve is None and not asked and os.environ.get(VARIABLE):
        if importlib.util.find_spec(PACKAGE) is None:
            warn(
                f"${VARIABLE} is set, but OpenColorIO is not installed; the look {DEFAULT} is used: "
                "pip install 'lightdepth[colour]'"
            )
        else:
            asked = True
    return OcioView(ocio, display, view) if asked else CurveLook(curve or DEFAULT)

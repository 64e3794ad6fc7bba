"""Colour for the screen by OpenColorIO: a view of one of its built-in ACES configurations, or of the user's own."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError
from lightdepth.packages import optional_package

PACKAGE = "PyOpenColorIO"
VARIABLE = "OCIO"
"""The environment variable that names the configuration, as in all programs that use OpenColorIO."""
BUILT_IN = "ocio://"
_SCENE_SPACES = (
    "lin_rec709_scene",
    "lin_rec709",
    "Linear Rec.709 (sRGB)",
    "Linear Rec.709",
    "Utility - Linear - sRGB",
    "lin_srgb",
)
"""Names of linear Rec.709 in configurations."""


class OcioView:
    """Turns linear Rec.709 into a display's values by a view.

    Args:
        configuration: a file, or ``ocio://`` and the name of a built-in one, such as ``ocio://default``; ``None`` takes
            that of the environment variable ``OCIO``.
        display: the configuration's default where it is ``None``.
        view: likewise, the display's default.

    Raises:
        SetupError: OpenColorIO is not installed.
        InputError: there is no such configuration, display or view, or it lacks linear Rec.709.
    """

    def __init__(self, configuration: str | None = None, display: str | None = None, view: str | None = None) -> None:
        ocio = optional_package(PACKAGE, "colour")
        name = configuration or os.environ.get(VARIABLE)
        if not name:
            raise InputError(f"--ocio: name a configuration, or set ${VARIABLE}; built in is {BUILT_IN}default")
        config = _loaded(ocio, name)
        self.display = _chosen("display", display, config.getDefaultDisplay(), list(config.getDisplays()), name)
        views = list(config.getViews(self.display))
        self.view = _chosen("view", view, config.getDefaultView(self.display), views, name)
        self.configuration = name
        space = next((each for each in _SCENE_SPACES if config.getColorSpace(each) is not None), None)
        if space is None:
            raise InputError(f"{name}: has no colour space of linear Rec.709; one is needed, called {_SCENE_SPACES[0]}")
        transform = ocio.DisplayViewTransform(src=space, display=self.display, view=self.view)
        try:
            self._processor: Any = config.getProcessor(transform).getDefaultCPUProcessor()
        except ocio.Exception as error:
            raise InputError(f"{name}: display '{self.display}', view '{self.view}': {error}") from error

    def __call__(self, radiance: NDArray[np.float32], exposure_stops: float = 0.0) -> NDArray[np.float32]:
        """Values for the display, in [0, 1].

        Args:
            radiance: linear Rec.709, shape (height, width, 3), float32.
            exposure_stops: it is multiplied by two to this power first.
        """
        finite = np.nan_to_num(radiance, nan=0.0, posinf=3e38, neginf=0.0)
        pixels = np.ascontiguousarray(np.clip(finite, 0.0, 1e30) * np.float32(2.0**exposure_stops))
        self._processor.applyRGB(pixels)
        return np.clip(pixels, 0.0, 1.0)

    def __str__(self) -> str:
        return f"display '{self.display}', view '{self.view}'"


def _loaded(ocio: Any, name: str) -> Any:
    if not name.startswith(BUILT_IN) and not Path(name).is_file():
        raise InputError(f"{name}: no such OpenColorIO configuration; built in is {BUILT_IN}default")
    try:
        return ocio.Config.CreateFromFile(name)
    except ocio.Exception as error:
        if name.startswith(BUILT_IN):
            known = ", ".join(BUILT_IN + each for each, *_ in ocio.BuiltinConfigRegistry().getBuiltinConfigs())
            raise InputError(f"--ocio {name}: is not built in; allowed are {BUILT_IN}default, {known}") from error
        raise InputError(f"{name}: not a readable OpenColorIO configuration: {error}") from error


def _chosen(kind: str, wanted: str | None, default: str, allowed: list[str], configuration: str) -> str:
    if wanted is None:
        return default
    if wanted not in allowed:
        raise InputError(f"--{kind} '{wanted}': {configuration} has {', '.join(map(repr, allowed))}")
    return wanted

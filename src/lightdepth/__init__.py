"""Render synthetic objects into 360 degree HDR panoramas that carry depth.

The folders are the production pipeline in its order: ``capture``, ``calibration``, ``reconstruction``, ``lightmap``,
``scene``, ``cameras``, ``place`` (the photographed place and how its light is sampled), ``recovery`` (inverse rendering
of its albedo and irradiance), ``transport`` (the integrators), ``preparation``, ``film``, ``session``. Beneath them lie
``errors``, ``cancellation``, ``directions``, ``images`` and ``kernel``, which starts Mitsuba and gives it shapes and
materials; ``cli`` is on top.
"""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from lightdepth.api import begin_rendering, load_scene, render

__all__ = ["begin_rendering", "load_scene", "render"]

logging.getLogger(__name__).addHandler(logging.NullHandler())  # Quiet, until an application asks for more.


def __getattr__(name: str) -> object:
    """Load the public functions when they are first used: importing the package alone stays quick."""
    if name not in __all__:
        raise AttributeError(f"module 'lightdepth' has no attribute '{name}'")
    from lightdepth import api

    return getattr(api, name)

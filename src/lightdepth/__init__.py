"""Render synthetic objects into 360 degree HDR panoramas that carry depth.

The folders are the production pipeline in its order: ``capture``, ``calibration``, ``reconstruction``, ``lightmap``,
``scene``, ``cameras``, ``transport``, ``film``. Beneath them lie ``errors``, ``directions`` and ``images``; ``kernel``
is the only folder that starts and feeds Mitsuba; ``cli`` is on top.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from lightdepth.api import begin_rendering, load_scene, render

__all__ = ["begin_rendering", "load_scene", "render"]


def __getattr__(name: str) -> object:
    """Load the public functions when they are first used: importing the package alone stays quick."""
    if name not in __all__:
        raise AttributeError(f"module 'lightdepth' has no attribute '{name}'")
    from lightdepth import api

    return getattr(api, name)

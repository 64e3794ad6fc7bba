"""The kinds of declared lights: how the scene's plain data become lights of the place."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from lightdepth.parameters.place import PlaceParameters
from lightdepth.place.real_light import DeclaredLight
from lightdepth.place.sun import Sun
from lightdepth.place.traced_surfaces import TracedSurfaces
from lightdepth.scene.model import Light, SunLight

KINDS: dict[type[Light], Callable[[Any, TracedSurfaces, PlaceParameters], DeclaredLight]] = {SunLight: Sun}
"""What makes each kind of light. A new kind is a file in this folder and a line here."""


def declared_light(light: Light, surfaces: TracedSurfaces, parameters: PlaceParameters) -> DeclaredLight:
    """A light of the scene in the place.

    Args:
        light: as the scene declares it.
        surfaces: the real surfaces.
        parameters: of the place.
    """
    return KINDS[type(light)](light, surfaces, parameters)

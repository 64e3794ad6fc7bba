"""What every ``[[light]]`` table is."""

from __future__ import annotations

from typing import Any

from lightdepth.scene.model import Light, Panorama
from lightdepth.scene.values import Name, Table


class LightTable(Table):
    """Base of the lights, the settings of a ``[[light]]`` table: each kind shines by itself or corrects the panorama."""

    type: Any
    name: Name

    def light(self) -> Light | None:
        """What it adds to the light of the panoramas; ``None`` for nothing.

        Raises:
            InputError: it cannot be, or a file that it names cannot be read.
        """
        return None

    def corrected(self, panorama: Panorama) -> Panorama:
        """The first panorama with what it says of the light in it.

        Raises:
            InputError: it does not fit.
        """
        return panorama

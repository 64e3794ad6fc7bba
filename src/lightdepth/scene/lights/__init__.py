"""Lights of the real place that the photograph lacks.

A new kind is a file here and a line in ``LightSettings``; what shines by itself is a file in ``place`` as well.
"""

from typing import Annotated

from pydantic import Field

from lightdepth.scene.lights.clipped import ClippedTable
from lightdepth.scene.lights.light import LightTable
from lightdepth.scene.lights.sun import SunTable

LightSettings = Annotated[SunTable | ClippedTable, Field(discriminator="type")]

__all__ = ["ClippedTable", "LightSettings", "LightTable", "SunTable"]

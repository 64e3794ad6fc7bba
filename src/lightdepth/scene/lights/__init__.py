"""Lights of the real place that the photograph lacks. A new kind is a file here and a line in ``LightSettings``."""

from lightdepth.scene.lights.sun import SunTable

LightSettings = SunTable

__all__ = ["LightSettings", "SunTable"]

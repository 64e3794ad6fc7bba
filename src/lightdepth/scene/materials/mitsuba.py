"""Any BSDF of Mitsuba, for what the other kinds do not cover."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from pydantic import Field, ValidationInfo, field_validator

from lightdepth.files import is_file
from lightdepth.scene.materials.material import Material, Plugin

LARGEST = 1e15
"""Number that a plugin is given."""


class MitsubaBsdf(Material):
    """``material = { mitsuba = { type = ..., ... } }``: the plugin's parameters as its documentation names them.

    Lists of three numbers are RGB colours; a ``filename`` is relative to the scene file.
    """

    type: Literal["mitsuba"] = "mitsuba"
    mitsuba: dict[str, Any] = Field(min_length=1)

    @field_validator("mitsuba")
    @classmethod
    def _as_mitsuba_reads_it(cls, value: dict[str, Any], info: ValidationInfo) -> dict[str, Any]:
        folder = Path((info.context or {}).get("folder", ""))
        return _prepared(value, folder)

    def plugins(self) -> dict[str, Plugin]:  # noqa: D102
        return {"bsdf": self.mitsuba}


def _prepared(plugin: dict[str, Any], folder: Path) -> dict[str, Any]:
    """The plugin with colours and file names as Mitsuba wants them, nested ones included."""
    if not isinstance(plugin.get("type"), str):
        raise ValueError("every plugin needs a type, as in { type = 'roughplastic', alpha = 0.1 }")
    if plugin["type"] == "blendbsdf" and "weight" not in plugin:
        raise ValueError("blendbsdf needs a weight")  # Mitsuba 3.9 crashes without it.
    prepared: dict[str, Any] = {}
    for key, value in plugin.items():
        if isinstance(value, dict):
            prepared[key] = _prepared(value, folder)
        elif isinstance(value, list) and plugin["type"] not in ("rgb", "srgb", "spectrum"):
            prepared[key] = {"type": "rgb", "value": value}
        elif key == "filename":
            if not isinstance(value, str) or not is_file(folder / value):
                raise ValueError(f"{folder / value}: no such file")
            prepared[key] = str(folder / value)
        else:
            prepared[key] = value
        for number in value if isinstance(value, list) else [value]:
            if isinstance(number, int | float) and not abs(number) <= LARGEST:
                raise ValueError(f"{key}: must be at most {LARGEST:g} in size, found {number:g}")
    return prepared

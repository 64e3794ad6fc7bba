"""The kinds of values that the scene file's tables share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo

from lightdepth.files import is_file

Number = Annotated[float, Field(strict=True)]
Whole = Annotated[int, Field(strict=True)]
Vector3 = tuple[Number, Number, Number]
Pair = tuple[Number, Number]


def _existing_file(path: Path, info: ValidationInfo) -> Path:
    """The path, relative to the scene file's folder (``context["folder"]``)."""
    resolved: Path = (info.context or {}).get("folder", Path()) / path
    if not is_file(resolved):
        raise ValueError(f"{resolved}: no such file")
    return resolved


def _one_or_three(value: Any) -> Any:
    three = value if isinstance(value, list) else [value] * 3
    if len(three) != 3 or any(isinstance(n, bool) or not isinstance(n, int | float) or n == 0 for n in three):
        raise ValueError("must be one number or three, none of them 0")
    return three


InputFile = Annotated[Path, AfterValidator(_existing_file)]
Scale = Annotated[Vector3, BeforeValidator(_one_or_three)]
Name = Annotated[str, Field(min_length=1)]


class Table(BaseModel):
    """Base of the tables: no unknown keys, no NaN, no infinities."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

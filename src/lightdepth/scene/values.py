"""The kinds of values that the scene file's tables share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo

from lightdepth.files import is_file
from lightdepth.numbered_files import MARK, is_pattern, numbered, told_frames
from lightdepth.quantities import BRIGHTEST, Coordinate, Degrees
from lightdepth.scene.moment import Moment

Number = Annotated[float, Field(strict=True)]
Whole = Annotated[int, Field(strict=True)]
Metres = Annotated[Coordinate, Field(strict=True)]
Angle = Annotated[Degrees, Field(strict=True)]
Vector3 = tuple[Metres, Metres, Metres]
EulerAngles = tuple[Angle, Angle, Angle]
Pair = tuple[Number, Number]
SMALLEST_FACTOR, LARGEST_FACTOR = 1e-15, 1e15


def _in_range(value: float) -> float:
    if not SMALLEST_FACTOR <= value <= LARGEST_FACTOR:
        raise ValueError(f"must be from {SMALLEST_FACTOR:g} to {LARGEST_FACTOR:g}")
    return value


Factor = Annotated[float, Field(strict=True, gt=0.0), AfterValidator(_in_range)]
"""What multiplies lengths, or radiance."""
Radiance = Annotated[float, Field(strict=True, ge=0.0, le=BRIGHTEST)]
"""Of one channel, in the panorama's unit."""


def _existing_file(path: Path, info: ValidationInfo) -> Path:
    """The path, relative to the scene file's folder (``context["folder"]``)."""
    resolved: Path = (info.context or {}).get("folder", Path()) / path
    if not is_file(resolved):
        raise ValueError(f"{resolved}: no such file")
    return resolved


def _numbered_file(path: Path, info: ValidationInfo) -> Path:
    """The path, where ``#`` in its name stands for the digits of the frame that is nearest (``context["moment"]``).

    All frames of the sequence are looked for, so that one message names those that are missing.
    """
    context = info.context or {}
    resolved: Path = context.get("folder", Path()) / path
    if MARK not in path.name or is_file(resolved):
        return _existing_file(path, info)
    if not is_pattern(path.name):
        raise ValueError(f"{path.name}: the {MARK} that stand for the digits of a frame's number must be in one place")
    moment: Moment | None = context.get("moment")
    if moment is None:
        raise ValueError(
            f"{path.name}: numbered files belong to the frames of a [sequence], which the file does not have"
        )
    missing = moment.missing(resolved)
    if missing:
        count = moment.last - moment.first + 1
        frames = "frame" if len(missing) == 1 else "frames"
        raise ValueError(f"{resolved}: no such file for {frames} {told_frames(missing)}, {len(missing)} of {count}")
    return numbered(resolved, moment.nearest)


def _one_or_three(value: Any) -> Any:
    three = value if isinstance(value, list) else [value] * 3
    if len(three) != 3 or any(isinstance(n, bool) or not isinstance(n, int | float) or n == 0 for n in three):
        raise ValueError("must be one number or three, none of them 0")
    if any(not SMALLEST_FACTOR <= abs(n) <= LARGEST_FACTOR for n in three):
        raise ValueError(f"must be between {SMALLEST_FACTOR:g} and {LARGEST_FACTOR:g} in size")
    return three


InputFile = Annotated[Path, AfterValidator(_existing_file)]
NumberedFile = Annotated[Path, AfterValidator(_numbered_file)]
"""A file, or one for each frame of the sequence."""
Scale = Annotated[tuple[Number, Number, Number], BeforeValidator(_one_or_three)]
Name = Annotated[str, Field(min_length=1)]


class Table(BaseModel):
    """Base of the tables: no unknown keys, no NaN, no infinities."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

"""The scene file's tables: which keys there are, and what is allowed in them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    ValidationInfo,
    model_validator,
)

from lightdepth.cameras import CameraSettings
from lightdepth.scene.materials import MaterialSettings

FORMAT = 1
"""Version of the scene file's format; files without one have the first. It grows when a key changes its meaning."""
Number = Annotated[float, Field(strict=True)]
Whole = Annotated[int, Field(strict=True)]
Vector3 = tuple[Number, Number, Number]


def _existing_file(path: Path, info: ValidationInfo) -> Path:
    """The path, relative to the scene file's folder (``context["folder"]``)."""
    resolved: Path = (info.context or {}).get("folder", Path()) / path
    if not resolved.is_file():
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


class Placed(Table):
    """Where a mesh or a unit shape stands: scaled, then turned (XYZ Euler, degrees), then moved (metres)."""

    position: Vector3 = (0.0, 0.0, 0.0)
    rotation: Vector3 = (0.0, 0.0, 0.0)
    scale: Scale = (1.0, 1.0, 1.0)


class CapturePose(Table):
    """``[panorama]``: where the photograph was taken, which way it was turned, and whether in the open."""

    position: Vector3 = (0.0, 0.0, 0.0)
    rotation: Vector3 = (0.0, 0.0, 0.0)
    sky: Annotated[bool, Field(strict=True)] = False


class Picture(Table):
    """``[panorama]``: what the photograph shows."""

    image: InputFile
    depth: InputFile | None = None
    scale: Number = Field(default=1.0, gt=0.0)


class PanoramaTable(CapturePose, Picture):
    """``[panorama]``."""


class GlossTable(Table):
    """``gloss = { roughness, specular }`` of a support surface."""

    roughness: Number = Field(ge=0.0, le=1.0)
    specular: Number = Field(default=0.5, ge=0.0, le=1.0)


class RealTable(Placed):
    """``[[real]]``."""

    name: Name
    mesh: InputFile
    rest: InputFile | None = None
    role: Literal["support", "environment"]
    gloss: GlossTable | None = None

    @model_validator(mode="after")
    def _gloss_is_of_support(self) -> RealTable:
        if self.gloss is not None and self.role != "support":
            raise ValueError("gloss is for role = 'support' only")
        return self


class MeshObject(Placed):
    """``[[synthetic]]`` with a mesh file; without ``material`` it has the materials of the file."""

    name: Name
    mesh: InputFile
    material: MaterialSettings | None = None


class SphereObject(Table):
    """``[[synthetic]]`` with ``shape = "sphere"``."""

    name: Name
    shape: Literal["sphere"]
    center: Vector3
    radius: Number = Field(gt=0.0)
    material: MaterialSettings


class UnitShapeObject(Placed):
    """``[[synthetic]]`` with another shape of unit size: Mitsuba's, from -1 to 1; the cylinder from z = 0 to 1."""

    name: Name
    shape: Literal["sphere", "cube", "rectangle", "disk", "cylinder"]  # Spheres are told apart before; for messages.
    material: MaterialSettings


def _kind_of_object(table: Any) -> str | None:
    """Which of the three kinds of ``[[synthetic]]`` a table means; ``None`` if that cannot be told."""
    if not isinstance(table, dict) or ("mesh" in table) == ("shape" in table):
        return None
    if "mesh" in table:
        return "mesh object"
    return "sphere object" if table["shape"] == "sphere" else "shape object"


SyntheticTable = Annotated[
    Annotated[MeshObject, Tag("mesh object")]
    | Annotated[SphereObject, Tag("sphere object")]
    | Annotated[UnitShapeObject, Tag("shape object")],
    Discriminator(
        _kind_of_object,
        custom_error_type="kind_of_object",
        custom_error_message="either mesh = 'file' or shape = 'sphere' | 'cube' | 'rectangle' | 'disk' | 'cylinder' "
        "is needed",
    ),
]


class RenderTable(Table):
    """``[render]``."""

    samples: Whole = Field(default=64, ge=1, le=1_000_000)
    noise: Number | None = Field(default=None, gt=0.0, lt=1.0)
    max_bounces: Whole = Field(default=8, ge=0, le=1000)
    seed: Whole = Field(default=0, ge=0, lt=2**32)
    clamp_indirect: Number | None = Field(default=None, gt=0.0)
    irradiance_samples: Whole = Field(default=1024, ge=16, le=1 << 20, multiple_of=2)


def _known_format(version: int) -> int:
    if version > FORMAT:
        raise ValueError(f"must be at most {FORMAT}, the newest format that this version of lightdepth reads")
    return version


class SceneFile(Table):
    """The whole file."""

    panorama: PanoramaTable
    real: list[RealTable] = []
    synthetic: list[SyntheticTable] = []
    camera: dict[Name, CameraSettings] = {}
    render: RenderTable = RenderTable()
    format: Annotated[Whole, Field(ge=1), AfterValidator(_known_format)] = 1

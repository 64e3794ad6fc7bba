"""The scene file's tables: which keys there are, and what is allowed in them."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, Tag, model_validator

from lightdepth.cameras import CameraSettings
from lightdepth.numbered_files import MARK
from lightdepth.parameters import Parameters
from lightdepth.quantities import BRIGHTEST, Length
from lightdepth.scene.animation import SequenceTable, ShownAnimation
from lightdepth.scene.lights import LightSettings
from lightdepth.scene.materials import MaterialSettings
from lightdepth.scene.values import (
    EulerAngles,
    Factor,
    InputFile,
    Name,
    Number,
    NumberedFile,
    Pair,
    Scale,
    Table,
    Vector3,
    Whole,
)

FORMAT = 1
"""Version of the scene file's format; files without one have the first. It grows when a key changes its meaning."""


class Placed(Table):
    """Where a mesh or a unit shape stands: scaled, then turned (XYZ Euler, degrees), then moved (metres)."""

    position: Vector3 = (0.0, 0.0, 0.0)
    rotation: EulerAngles = (0.0, 0.0, 0.0)
    scale: Scale = (1.0, 1.0, 1.0)


class CapturePose(Table):
    """``[[panorama]]``: where the photograph was taken, which way it was turned, and whether in the open."""

    position: Vector3 = (0.0, 0.0, 0.0)
    rotation: EulerAngles = (0.0, 0.0, 0.0)
    sky: Annotated[bool, Field(strict=True)] = False


def _gain(value: Any) -> Any:
    three = value if isinstance(value, list) else [value] * 3
    if len(three) != 3 or any(isinstance(n, bool) or not isinstance(n, int | float) or not n > 0 for n in three):
        raise ValueError("must be one number or three, above 0")
    return three


class Picture(Table):
    """``[[panorama]]``: what the photograph shows."""

    image: NumberedFile
    depth: InputFile | None = None
    scale: Factor = 1.0
    gain: Annotated[tuple[Factor, Factor, Factor], BeforeValidator(_gain)] | None = None
    plate: NumberedFile | None = None
    mask: InputFile | None = None


class PanoramaTable(CapturePose, Picture):
    """``[[panorama]]``, or ``[panorama]`` where there is one."""


class PlateTable(Table):
    """``[plate]``: the picture of one camera, in place of what the panoramas show it."""

    image: NumberedFile
    camera: Name
    gain: Annotated[Vector3, BeforeValidator(_gain)] | None = None


def _as_list(tables: Any) -> Any:
    return tables if isinstance(tables, list) else [tables]


class GlossTable(Table):
    """``gloss = { roughness, specular }`` of a real surface."""

    roughness: Number = Field(ge=0.0, le=1.0)
    specular: Number = Field(default=0.5, ge=0.0, le=1.0)


class RealTable(Placed):
    """``[[real]]``."""

    name: Name
    mesh: InputFile
    rest: InputFile | None = None
    role: Literal["support", "environment"]
    gloss: GlossTable | None = None
    opening: Annotated[bool, Field(strict=True)] = False
    removed: Annotated[bool, Field(strict=True)] = False

    @model_validator(mode="after")
    def _fits_the_role(self) -> RealTable:
        if self.gloss is not None and self.opening:
            raise ValueError("gloss is not for an opening, which shows what stands behind it")
        if self.opening and self.role != "environment":
            raise ValueError("opening is for role = 'environment' only")
        if self.removed and (self.gloss is not None or self.opening or self.rest is not None):
            raise ValueError("gloss, opening and rest are not for a surface that is removed")
        return self


class OnSpot(Table):
    """Where an object stands by a pixel of the panorama, instead of a position in metres."""

    at: Pair | None = None
    at_angles: Pair | None = None
    stand: Annotated[bool, Field(strict=True)] = True
    align: Annotated[bool, Field(strict=True)] = False

    @property
    def on_spot(self) -> bool:
        """Whether a pixel places the object."""
        return self.at is not None or self.at_angles is not None

    @model_validator(mode="after")
    def _one_place(self) -> OnSpot:
        given = [key for key in ("at", "at_angles", "position", "center") if key in self.model_fields_set]
        if len(given) > 1:
            raise ValueError(f"{' and '.join(given)} exclude each other: each says where the object is")
        alone = self.model_fields_set & {"stand", "align"}
        if alone and not self.on_spot:
            raise ValueError(f"{' and '.join(sorted(alone))} belong to an object that is placed by at or at_angles")
        return self


class Seen(Table):
    """What sees an object."""

    visible_to_camera: Annotated[bool, Field(strict=True)] = True


class MeshObject(OnSpot, Placed, Seen):
    """``[[synthetic]]`` with a mesh file; without ``material`` it has the materials of the file."""

    name: Name
    mesh: NumberedFile
    animation: ShownAnimation | None = None
    material: MaterialSettings | None = None
    instances: NumberedFile | None = None

    @model_validator(mode="before")
    @classmethod
    def _numbered_stand_by_their_origin(cls, table: Any) -> Any:
        changing = isinstance(table, dict) and MARK in str(table.get("mesh"))
        if changing and table.get("stand") is not False and ("at" in table or "at_angles" in table):
            raise ValueError(
                "numbered meshes have another lowest point in each frame; with at or at_angles they need "
                "stand = false, which puts their origin there"
            )
        return table

    @model_validator(mode="after")
    def _instances_have_places(self) -> MeshObject:
        if self.instances is not None and self.on_spot:
            raise ValueError("instances stand where their file says; at and at_angles are for a single object")
        return self


class SphereObject(OnSpot, Seen):
    """``[[synthetic]]`` with ``shape = "sphere"``."""

    name: Name
    shape: Literal["sphere"]
    center: Vector3 | None = None
    radius: Annotated[Length, Field(strict=True)]
    material: MaterialSettings

    @model_validator(mode="after")
    def _placed(self) -> SphereObject:
        if self.center is None and not self.on_spot:
            raise ValueError("the key 'center' is missing (or 'at', a pixel of the panorama)")
        return self


class UnitShapeObject(OnSpot, Placed, Seen):
    """``[[synthetic]]`` with another shape of unit size: Mitsuba's, from -1 to 1; the cylinder from z = 0 to 1."""

    name: Name
    shape: Literal["sphere", "cube", "rectangle", "disk", "cylinder"]  # Spheres are recognised before; for messages.
    material: MaterialSettings


def _kind_of_object(table: Any) -> str | None:
    """Which of the three kinds of ``[[synthetic]]`` a table means; ``None`` if that is not clear."""
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
    clamp_indirect: Number | None = Field(default=None, gt=0.0, le=BRIGHTEST)
    irradiance_samples: Whole = Field(default=1024, ge=16, le=1 << 20, multiple_of=2)
    parameters: Parameters = Parameters()


def _known_format(version: int) -> int:
    if version > FORMAT:
        raise ValueError(f"must be at most {FORMAT}, the newest format that this version of lightdepth reads")
    return version


class SceneFile(Table):
    """The whole file."""

    panorama: Annotated[list[PanoramaTable], BeforeValidator(_as_list), Field(min_length=1)]
    real: list[RealTable] = Field(default_factory=list)
    light: list[LightSettings] = Field(default_factory=list)
    synthetic: list[SyntheticTable] = Field(default_factory=list)
    camera: dict[Name, CameraSettings] = Field(default_factory=dict)
    plate: PlateTable | None = None
    render: RenderTable = RenderTable()
    sequence: SequenceTable | None = None
    format: Annotated[Whole, Field(ge=1), AfterValidator(_known_format)] = 1

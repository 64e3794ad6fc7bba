"""The scene file's text to checked tables: all of them, or as many as are right."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from lightdepth.cameras import Camera, CameraSettings
from lightdepth.scene.lights import ClippedTable, LightSettings, SunTable
from lightdepth.scene.problems import Problems
from lightdepth.scene.schema import (
    CapturePose,
    MeshObject,
    Picture,
    RealTable,
    RenderTable,
    SceneFile,
    SphereObject,
    SyntheticTable,
    UnitShapeObject,
)
from lightdepth.toml_file import read_toml


@dataclass(frozen=True)
class Tables:
    """The tables of a scene file; ``None`` stands for one that is missing or wrong.

    Attributes:
        pose: of ``[panorama]``, where the capture point is.
        picture: of ``[panorama]``, what was photographed from there.
        real: the ``[[real]]`` tables in the order of the file.
        lights: the ``[[light]]`` tables in the order of the file.
        synthetic: the ``[[synthetic]]`` tables in the order of the file.
        cameras: the ``[camera.NAME]`` tables by name.
        render: ``[render]``.
    """

    pose: CapturePose | None
    picture: Picture | None
    real: list[RealTable | None]
    lights: list[SunTable | ClippedTable | None]
    synthetic: list[MeshObject | SphereObject | UnitShapeObject | None]
    cameras: dict[str, Camera | None]
    render: RenderTable | None


def read_tables(path: Path) -> tuple[Tables, Problems]:
    """Read a scene file, without the files that it names.

    Returns:
        Its tables, and everything that is wrong with them. A table with unknown keys is given without these.

    Raises:
        InputError: the file is missing, cannot be read, or is not TOML.
    """
    text, document = read_toml(path)
    problems = Problems(path, text, document)
    for array in ("real", "light", "synthetic"):
        _note_duplicates(array, document, problems)
    panorama = document.get("panorama")
    if not document.get("real") and isinstance(panorama, dict) and "depth" not in panorama:
        problems.add((), "no real geometry: give [[real]] meshes of the place, or the depth of the [panorama]")
    context = {"folder": path.parent}
    try:
        file = SceneFile.model_validate(document, context=context)
    except ValidationError as error:
        problems.add_all(error, SceneFile)
        return _right_tables(document, context), problems
    tables = Tables(
        file.panorama,
        file.panorama,
        list(file.real),
        list(file.light),
        list(file.synthetic),
        dict(file.camera),
        file.render,
    )
    return tables, problems


def _right_tables(document: Mapping[str, Any], context: Mapping[str, Any]) -> Tables:
    """The tables of a file of which some are wrong."""

    def right(kind: Any, table: Any) -> Any:
        try:
            return TypeAdapter(kind).validate_python(table, extra="ignore", context=context)
        except ValidationError:
            return None

    def synthetic(table: Any) -> Any:
        # With a wrong material, the object's shape is right all the same.
        grey = {"type": "diffuse"}
        return right(SyntheticTable, table) or right(SyntheticTable, {**_dict(table), "material": grey})

    panorama = document.get("panorama")
    return Tables(
        right(CapturePose, panorama),
        right(Picture, panorama),
        [right(RealTable, table) for table in _list(document.get("real"))],
        [right(LightSettings, table) for table in _list(document.get("light"))],
        [synthetic(table) for table in _list(document.get("synthetic"))],
        {name: right(CameraSettings, table) for name, table in _dict(document.get("camera")).items()},
        right(RenderTable, document.get("render", {})),
    )


def _list(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []


def _dict(value: Any) -> dict[str, Any]:
    return value if isinstance(value, dict) else {}


def _note_duplicates(array: str, document: Mapping[str, Any], problems: Problems) -> None:
    names = [table.get("name") for table in _list(document.get(array)) if isinstance(table, dict)]
    for name, count in Counter(name for name in names if isinstance(name, str)).items():
        if count > 1:
            last = len(names) - 1 - names[::-1].index(name)
            problems.add((array, last, "name"), f"'{name}' is the name of {count} [[{array}]] tables; names are unique")

"""The scene file's text to checked tables: all of them, or as many as are right."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from lightdepth.cameras import Camera, CameraSettings
from lightdepth.errors import InputError, warn
from lightdepth.scene.animation import Animation, SequenceTable
from lightdepth.scene.camera_file import with_cameras_of_files
from lightdepth.scene.lights import LightSettings, LightTable
from lightdepth.scene.moment import Moment
from lightdepth.scene.problems import KeyPath, Problems
from lightdepth.scene.schema import (
    CapturePose,
    MeshObject,
    Picture,
    PlateTable,
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
        poses: of each ``[[panorama]]``, where its capture point is; never empty.
        pictures: of each ``[[panorama]]``, what was photographed from there.
        real: the ``[[real]]`` tables in the order of the file.
        lights: the ``[[light]]`` tables in the order of the file.
        synthetic: the ``[[synthetic]]`` tables in the order of the file.
        cameras: the ``[camera.NAME]`` tables by name.
        render: ``[render]``.
        frame: the frame of ``[sequence]`` at which they are; ``None`` where there is no sequence.
        plate: ``[plate]``; ``None`` where there is none as well.
    """

    poses: list[CapturePose | None]
    pictures: list[Picture | None]
    real: list[RealTable | None]
    lights: list[LightTable | None]
    synthetic: list[MeshObject | SphereObject | UnitShapeObject | None]
    cameras: dict[str, Camera | None]
    render: RenderTable | None
    frame: float | None = None
    plate: PlateTable | None = None

    @property
    def pose(self) -> CapturePose | None:
        """Of the first ``[[panorama]]``, at whose capture point cameras stand that have no position of their own."""
        return self.poses[0]


class SceneText:
    """What a scene file says, at any of its frames.

    Attributes:
        path: the file.
        animation: its tables of keys.
    """

    def __init__(self, path: Path) -> None:
        """Read a scene file, without the files that it names.

        Raises:
            InputError: the file is missing, cannot be read, or is not TOML.
        """
        self.path = path
        self._text, self._document = read_toml(path)
        self.animation = Animation(self._document)
        for place, message in self.animation.cautions:
            warn(self._problems().located(place, message))

    @property
    def sequence(self) -> SequenceTable | None:
        """``[sequence]``; ``None`` where there is none, or a wrong one."""
        return self.animation.sequence

    def frame(self, frame: float | None) -> float | None:
        """The frame that is meant: the first of the sequence by default; ``None`` where there is no sequence.

        The shutter of the first frame opens before it, that of the last frame closes after it.

        Raises:
            InputError: there is no such frame.
        """
        if self.sequence is None:
            if frame is not None and "sequence" not in self._document:
                raise InputError(
                    f"{self.path}: has no frame {frame:g}: it lacks [sequence] with frames = [first, last]"
                )
            return None
        first, last = self.sequence.frames
        opened = 0.5 * self.sequence.shutter
        if frame is not None and not first - opened <= frame <= last + opened:
            raise InputError(f"{self.path}: has no frame {frame:g}; its [sequence] has frames {first} to {last}")
        return float(first) if frame is None else float(frame)

    def tables(self, frame: float | None = None) -> tuple[Tables, Problems]:
        """The tables at a frame, by default the first one.

        Returns:
            The tables, and everything that is wrong with them. A table with unknown keys is given without these.

        Raises:
            InputError: there is no such frame.
        """
        frame = self.frame(frame)
        problems = self._problems()
        for place, message in self.animation.mistakes:
            problems.add(place, message)
        document = self.animation.at(0.0 if frame is None else frame)
        known = [place for place, _ in self.animation.mistakes]
        notes = {} if frame is None else dict.fromkeys(self.animation.keys, f" (at frame {frame:g})")
        context = {"folder": self.path.parent, "moment": self._moment(frame)}
        tables = _checked(document, context, problems, known, notes)
        return replace(tables, frame=frame), problems

    def _moment(self, frame: float | None) -> Moment | None:
        if self.sequence is None or frame is None:
            return None
        first, last = self.sequence.frames
        return Moment(frame, first, last, (frame - first) / float(self.sequence.rate))

    def _problems(self) -> Problems:
        return Problems(self.path, self._text, self._document)


def _checked(
    document: Mapping[str, Any],
    context: Mapping[str, Any],
    problems: Problems,
    known: Collection[KeyPath],
    notes: Mapping[KeyPath, str],
) -> Tables:
    """The tables of a document without keys; what is wrong with it is noted."""
    for array in ("real", "light", "synthetic"):
        _note_duplicates(array, document, problems)
    panoramas = [table for table in _panoramas(document) if isinstance(table, dict)]
    if not document.get("real") and panoramas and not any("depth" in table for table in panoramas):
        problems.add((), "no real geometry: give [[real]] meshes of the place, or the depth of the [panorama]")
    document = with_cameras_of_files(document, context, problems)
    try:
        file = SceneFile.model_validate(document, context=dict(context))
    except ValidationError as error:
        problems.add_all(error, SceneFile, known, notes)
        return _right_tables(document, context)
    return Tables(
        list(file.panorama),
        list(file.panorama),
        list(file.real),
        list(file.light),
        list(file.synthetic),
        dict(file.camera),
        file.render,
        plate=file.plate,
    )


def _right_tables(document: Mapping[str, Any], context: Mapping[str, Any]) -> Tables:
    """The tables of a file of which some are wrong."""

    def right(kind: Any, table: Any) -> Any:
        try:
            return TypeAdapter(kind).validate_python(table, extra="ignore", context=dict(context))
        except ValidationError:
            return None

    def synthetic(table: Any) -> Any:
        # With a wrong material, the object's shape is right all the same.
        grey = {"type": "diffuse"}
        return right(SyntheticTable, table) or right(SyntheticTable, {**_dict(table), "material": grey})

    panoramas = _panoramas(document)
    return Tables(
        [right(CapturePose, panorama) for panorama in panoramas],
        [right(Picture, panorama) for panorama in panoramas],
        [right(RealTable, table) for table in _list(document.get("real"))],
        [right(LightSettings, table) for table in _list(document.get("light"))],
        [synthetic(table) for table in _list(document.get("synthetic"))],
        {name: right(CameraSettings, table) for name, table in _dict(document.get("camera")).items()},
        right(RenderTable, document.get("render", {})),
        plate=right(PlateTable, document.get("plate")),
    )


def _panoramas(document: Mapping[str, Any]) -> list[Any]:
    """The tables that are meant to be ``[[panorama]]``, one at least."""
    panoramas = document.get("panorama")
    return panoramas if isinstance(panoramas, list) and panoramas else [panoramas]


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

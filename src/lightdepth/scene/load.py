"""The scene file, read, checked and turned into plain data in world space."""

from __future__ import annotations

import tomllib
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from lightdepth.cameras import Camera, Equirectangular
from lightdepth.directions import euler_rotation, look_at_rotation
from lightdepth.errors import InputError
from lightdepth.images.radiance import read_radiance
from lightdepth.images.validation import find_defects, validate_panorama
from lightdepth.scene.depth import read_depth
from lightdepth.scene.materials import Material, Principled, Texture
from lightdepth.scene.meshes import MeshPart, read_mesh_file
from lightdepth.scene.meshes.emissive import split_emissive
from lightdepth.scene.meshes.geometry import merged, placement, transformed
from lightdepth.scene.meshes.mirrored import split_mirrored
from lightdepth.scene.model import (
    AnalyticShape,
    CameraView,
    Gloss,
    Mesh,
    Panorama,
    RealSurface,
    RenderSettings,
    Role,
    Scene,
    SyntheticObject,
    SyntheticPart,
)
from lightdepth.scene.problems import Place, Problems
from lightdepth.scene.schema import (
    MeshObject,
    PanoramaTable,
    RealTable,
    SceneFile,
    SphereObject,
    UnitShapeObject,
)

Result = TypeVar("Result")


def load_scene(path: Path | str, repair: bool = False) -> Scene:
    """Load a scene file and everything that it names.

    Args:
        path: the TOML file; paths in it are relative to its folder.
        repair: replace NaN, infinite and negative radiance of the panorama instead of refusing it.

    Returns:
        The scene, meshes in world space. A file without cameras has one, ``pano``: the panorama's own view.

    Raises:
        InputError: the file, or a file that it names, is missing, unreadable or wrong. The message has a line for
            each problem.
    """
    path = Path(path)
    text, document = _read_toml(path)
    problems = Problems(path, text, document)
    for array in ("real", "synthetic"):
        _note_duplicates(array, document, problems)
    try:
        tables = SceneFile.model_validate(document, context={"folder": path.parent})
    except ValidationError as error:
        problems.add_all(error, SceneFile)
    else:
        if not tables.real and tables.panorama.depth is None:
            problems.add((), "no real geometry: give [[real]] meshes of the place, or the depth of the [panorama]")
    if problems:
        raise InputError(str(problems))
    return _read_files(tables, path, repair, problems)


def _read_files(tables: SceneFile, path: Path, repair: bool, problems: Problems) -> Scene:
    """Everything that the scene file names, with all problems of all files noted before giving up."""
    panorama = _noted(problems, ("panorama",), lambda: _panorama(tables.panorama, repair))
    real = [_noted(problems, ("real", i), partial(_real_surface, table)) for i, table in enumerate(tables.real)]
    synthetic = [
        _noted(problems, ("synthetic", i), partial(_synthetic_object, table))
        for i, table in enumerate(tables.synthetic)
    ]
    cameras = {
        name: _noted(problems, ("camera", name), partial(_camera_view, camera, tables.panorama))
        for name, camera in tables.camera.items()
    }
    if problems or panorama is None:
        raise InputError(str(problems))
    if not cameras:
        pano = Equirectangular(type="equirectangular", width=panorama.radiance.shape[1])
        cameras["pano"] = _camera_view(pano, tables.panorama)
    return Scene(
        panorama=panorama,
        real=tuple(surface for surface in real if surface is not None),
        synthetic=tuple(thing for thing in synthetic if thing is not None),
        cameras={name: view for name, view in cameras.items() if view is not None},
        render=RenderSettings(**tables.render.model_dump()),
        path=path,
    )


def _read_toml(path: Path) -> tuple[str, dict[str, Any]]:
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file") from error
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read as a text file ({error})") from error
    try:
        return text, tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: not valid TOML: {error}") from error


def _note_duplicates(array: str, document: Mapping[str, Any], problems: Problems) -> None:
    tables = document.get(array)
    names = [table.get("name") for table in tables if isinstance(table, dict)] if isinstance(tables, list) else []
    for name, count in Counter(name for name in names if isinstance(name, str)).items():
        if count > 1:
            last = len(names) - 1 - names[::-1].index(name)
            problems.add((array, last, "name"), f"'{name}' is the name of {count} [[{array}]] tables; names are unique")


def _noted(problems: Problems, place: Place, work: Callable[[], Result]) -> Result | None:
    """The result of reading something, or ``None`` with the problem noted at a place of the scene file."""
    try:
        return work()
    except InputError as error:
        problems.add(place, str(error))
        return None


def _panorama(table: PanoramaTable, repair: bool) -> Panorama:
    found = read_radiance(table.image)
    radiance = validate_panorama(found, table.image, repair=repair)
    repairs = [f"{table.image}: {defect}; replaced" for defect in find_defects(found)] if repair else []
    if table.scale != 1.0:
        radiance = radiance * np.float32(table.scale)
    return Panorama(
        radiance=radiance,
        position=np.array(table.position),
        rotation=euler_rotation(table.rotation),
        depth=None if table.depth is None else read_depth(table.depth),
        path=table.image,
        repairs=tuple(repairs),
    )


def _real_surface(table: RealTable) -> RealSurface:
    mesh = merged([part.mesh for part in read_mesh_file(table.mesh, with_materials=False)])
    if table.rest is not None:
        mesh = replace(mesh, rest=_rest_positions(table.rest, mesh, table.mesh))
    return RealSurface(
        name=table.name,
        mesh=transformed(mesh, placement(table.position, table.rotation, table.scale)),
        role=Role(table.role),
        gloss=None if table.gloss is None else Gloss(table.gloss.roughness, table.gloss.specular),
    )


def _rest_positions(path: Path, mesh: Mesh, mesh_path: Path) -> NDArray[np.float32]:
    """Vertices of the ``rest`` mesh, which must have the vertices and faces of ``mesh`` in the same order."""
    rest = merged([part.mesh for part in read_mesh_file(path, with_materials=False, keep_flat=True)])
    if len(rest.vertices) != len(mesh.vertices):
        raise InputError(
            f"{path}: the rest mesh has {len(rest.vertices)} vertices, but {mesh_path.name} has {len(mesh.vertices)}; "
            "the two must have the same topology"
        )
    return rest.vertices


def _synthetic_object(table: MeshObject | SphereObject | UnitShapeObject) -> SyntheticObject:
    if isinstance(table, MeshObject):
        to_world = placement(table.position, table.rotation, table.scale)
        parts = read_mesh_file(table.mesh, with_materials=table.material is None)
        placed = [_part(part, to_world, table.material) for part in parts]
        pieces = [piece for part in placed for half in split_mirrored(part) for piece in split_emissive(half)]
        return SyntheticObject(table.name, tuple(pieces))
    if isinstance(table, SphereObject):
        to_world = placement(table.center, (0.0, 0.0, 0.0), (table.radius,) * 3)
    else:
        to_world = placement(table.position, table.rotation, table.scale)
    return SyntheticObject(table.name, (SyntheticPart(AnalyticShape(table.shape, to_world), table.material),))


def _part(part: MeshPart, to_world: NDArray[np.float64], material: Material | None) -> SyntheticPart:
    if part.mesh.texture_coordinates is None and any(isinstance(value, Texture) for _, value in material or ()):
        raise InputError("the material has an image, but the mesh has no texture coordinates to lay it by")
    return SyntheticPart(transformed(part.mesh, to_world), material or part.material or Principled())


def _camera_view(camera: Camera, panorama: PanoramaTable) -> CameraView:
    """The camera at its own pose, or at the capture pose where it has none."""
    position = np.array(panorama.position if camera.position is None else camera.position)
    look_at = getattr(camera, "look_at", None)
    if look_at is not None:
        rotation = look_at_rotation(position, look_at)
    else:
        rotation = euler_rotation(panorama.rotation if camera.rotation is None else camera.rotation)
    return CameraView(camera.model_copy(update={"position": tuple(position.tolist())}), position, rotation)

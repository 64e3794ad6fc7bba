"""The files that a scene names, read and turned into plain data in world space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lightdepth.cameras import Camera, Equirectangular
from lightdepth.directions import euler_rotation, look_at_rotation
from lightdepth.errors import InputError
from lightdepth.images.panorama_file import read_panorama
from lightdepth.images.validation import find_defects, validate_panorama
from lightdepth.quantities import BRIGHTEST
from lightdepth.scene.depth import read_depth
from lightdepth.scene.instances import check_precision, read_instances
from lightdepth.scene.mask import read_mask
from lightdepth.scene.materials import Principled, Texture
from lightdepth.scene.meshes import AnimatedMesh, MeshPart, read_mesh_file
from lightdepth.scene.meshes.emissive import split_emissive
from lightdepth.scene.meshes.geometry import merged, placed, placement
from lightdepth.scene.meshes.mirrored import split_mirrored
from lightdepth.scene.model import (
    AnalyticShape,
    CameraView,
    Gloss,
    Light,
    Mesh,
    Panorama,
    Plate,
    RealSurface,
    RenderSettings,
    Role,
    Scene,
    SyntheticObject,
    SyntheticPart,
)
from lightdepth.scene.plate import read_camera_plate
from lightdepth.scene.problems import Problems
from lightdepth.scene.scene_file import SceneText, Tables
from lightdepth.scene.schema import CapturePose, MeshObject, OnSpot, Picture, RealTable, SphereObject, UnitShapeObject
from lightdepth.scene.spot import angles_direction, find_spot, pixel_direction, standing_placement

MeshKey = tuple[Path, bool]
NO_PICTURE = np.zeros((0, 0, 3), np.float32)
"""Radiance of a panorama whose image cannot be read."""


@dataclass(frozen=True)
class Contents:
    """What a scene file and the files that it names hold, as far as they can be read.

    Attributes:
        scene: ``None`` where the capture pose is not known. Surfaces, objects and cameras that cannot be read are left
            out; impossible radiance is replaced; ``NO_PICTURE`` stands for an image that cannot be read.
        unread: how many of the real surfaces are left out.
        problems: a line each, in the order of the file; empty where all is well.
        tables: what the scene file says.
        meshes: what the mesh files of the objects hold, by path and whether their materials were read.
        moving: opened files of the objects that are animated, likewise.
    """

    scene: Scene | None
    unread: int
    problems: tuple[str, ...]
    tables: Tables
    meshes: dict[MeshKey, list[MeshPart]]
    moving: dict[MeshKey, AnimatedMesh]


def load_scene(path: Path | str, repair: bool = False, frame: float | None = None) -> Scene:
    """Load a scene file and everything that it names.

    Args:
        path: the TOML file; paths in it are relative to its folder.
        repair: replace NaN, infinite and negative radiance of the panorama instead of refusing it.
        frame: of the file's ``[sequence]``, whole or in between; the first one by default.

    Returns:
        The scene, meshes in world space. A file without cameras has one, ``pano``: the panorama's own view.

    Raises:
        InputError: the file, or a file that it names, is missing, unreadable or wrong. The message has a line for
            each problem. Or the sequence has no such frame.
    """
    contents = read_scene(Path(path), repair, frame)
    if contents.problems or contents.scene is None:
        raise InputError("\n".join(contents.problems))
    return contents.scene


def read_scene(
    file: Path | SceneText, repair: bool = False, frame: float | None = None, earlier: Contents | None = None
) -> Contents:
    """Read what can be read of a scene, and note everything that is wrong with its files.

    Args:
        file: the scene file, or what it says.
        repair: as for :func:`load_scene`.
        frame: as for :func:`load_scene`.
        earlier: the same file at another frame; what is the same there is taken from it.

    Raises:
        InputError: the scene file itself is missing, cannot be read, or is not TOML, or there is no such frame.
    """
    text = SceneText(file) if isinstance(file, Path) else file
    path = text.path
    tables, problems = text.tables(frame)
    pose = tables.pose or CapturePose()
    known = earlier if earlier is not None and _same_place(tables, earlier) else None
    if known is not None and known.scene is not None:
        panoramas, real, lights = list(known.scene.panoramas), list(known.scene.real), list(known.scene.lights)
    else:
        panoramas, real, lights = _read_place(tables, repair, problems, earlier)
    panorama, *further = panoramas
    # Of numbered meshes, only those of this frame are kept.
    used = {_mesh_key(table) for table in tables.synthetic if isinstance(table, MeshObject)}
    meshes = {} if earlier is None else {key: parts for key, parts in earlier.meshes.items() if key in used}
    moving = {} if earlier is None else dict(earlier.moving)
    standing = {} if known is None or known.scene is None else {thing.name: thing for thing in known.scene.synthetic}
    same = [] if known is None else [table for table in known.tables.synthetic if table is not None]
    synthetic: list[SyntheticObject] = []
    for number, thing in enumerate(tables.synthetic):
        with problems.noting(("synthetic", number)):
            if thing is not None and thing in same and thing.name in standing:
                synthetic.append(standing[thing.name])
            elif thing is not None:
                synthetic.append(_synthetic_object(thing, panorama, real, meshes, moving))
    cameras: dict[str, CameraView] = {}
    for name, camera in tables.cameras.items():
        with problems.noting(("camera", name)):
            cameras |= {} if camera is None else {name: _camera_view(camera, pose)}
    if not tables.cameras and panorama.radiance.size:
        pano = Equirectangular(type="equirectangular", width=panorama.radiance.shape[1])
        cameras["pano"] = _camera_view(pano, pose)
    plate = _plate(tables, problems, earlier)
    render = RenderSettings() if tables.render is None else RenderSettings(**dict(tables.render))
    scene = Scene(
        panorama,
        tuple(real),
        tuple(synthetic),
        cameras,
        render,
        path,
        lights=tuple(lights),
        further=tuple(further),
        plate=plate,
    )
    unread = len(tables.real) - len(real)
    return Contents(None if tables.pose is None else scene, unread, problems.messages, tables, meshes, moving)


def _plate(tables: Tables, problems: Problems, earlier: Contents | None) -> Plate | None:
    if tables.plate is None:
        return None
    if (
        earlier is not None
        and earlier.scene is not None
        and not earlier.problems
        and tables.plate == earlier.tables.plate
    ):
        return earlier.scene.plate
    with problems.noting(("plate",)):
        return read_camera_plate(tables.plate, tables.cameras)
    return None


def _same_place(tables: Tables, earlier: Contents) -> bool:
    """Whether what belongs to the place is the same, and was read without a problem."""
    other = earlier.tables
    same = (tables.poses, tables.pictures, tables.real, tables.lights) == (
        other.poses,
        other.pictures,
        other.real,
        other.lights,
    )
    return same and not earlier.problems


def _read_place(
    tables: Tables, repair: bool, problems: Problems, earlier: Contents | None
) -> tuple[list[Panorama], list[RealSurface], list[Light]]:
    """What was photographed: panoramas, real surfaces and suns, as far as they can be read."""
    real: list[RealSurface] = []
    if (
        earlier is not None
        and earlier.scene is not None
        and not earlier.problems
        and earlier.tables.real == tables.real
    ):
        real += earlier.scene.real  # A filmed panorama has new light in the same room.
    else:
        for number, surface in enumerate(tables.real):
            with problems.noting(("real", number)):
                real += [] if surface is None else [_real_surface(surface)]
    panoramas = []
    for number, (pose, picture) in enumerate(zip(tables.poses, tables.pictures, strict=True)):
        panoramas.append(_panorama(number, pose or CapturePose(), picture, repair, problems))
    panorama = replace(panoramas[0], sky=any(each.sky for each in panoramas))
    lights: list[Light] = []
    for number, light in enumerate(tables.lights):
        with problems.noting(("light", number)):
            if light is not None:
                panorama, found = light.corrected(panorama), light.light()
                lights += [] if found is None else [found]
    # A photograph of which nothing can be seen would be seen through.
    further = [each for each in panoramas[1:] if each.radiance.size]
    return [panorama, *further], real, lights


def _panorama(number: int, pose: CapturePose, picture: Picture | None, repair: bool, problems: Problems) -> Panorama:
    panorama = Panorama(NO_PICTURE, np.array(pose.position), euler_rotation(pose.rotation), sky=pose.sky)
    if picture is None:
        return panorama
    if picture.depth is not None:
        with problems.noting(("panorama", number)):
            panorama = replace(panorama, depth=read_depth(picture.depth))
    factor = picture.scale * np.array(picture.gain or (1.0, 1.0, 1.0))
    with problems.noting(("panorama", number)):
        image = read_panorama(picture.image)
        found = image.radiance
        radiance = validate_panorama(found, picture.image, repair=True)
        defects = [] if radiance is found else find_defects(found)
        panorama = replace(
            panorama,
            radiance=_scaled(radiance, factor, picture, picture.image),
            balanced=number == 0 or picture.gain is not None,
            path=picture.image,
            repairs=tuple(f"{picture.image}: {defect}; replaced" for defect in defects) if repair else (),
            notes=image.notes,
        )
        if defects and not repair:
            validate_panorama(found, picture.image)
    if picture.plate is not None:
        with problems.noting(("panorama", number, "plate")):
            plate = validate_panorama(read_panorama(picture.plate).radiance, picture.plate)
            _check_size(picture.plate, "plate", plate, panorama.radiance)
            panorama = replace(panorama, plate=_scaled(plate, factor, picture, picture.plate))
    if picture.mask is not None:
        with problems.noting(("panorama", number, "mask")):
            mask = read_mask(picture.mask)
            _check_size(picture.mask, "mask", mask, panorama.radiance)
            panorama = replace(panorama, mask=mask)
    return panorama


def _scaled(
    radiance: NDArray[np.float32], factor: NDArray[np.float64], picture: Picture, path: Path
) -> NDArray[np.float32]:
    """The radiance of an image times scale and gain.

    Raises:
        InputError: it becomes larger than the renderer can compute with.
    """
    brightest = float((radiance.max(axis=(0, 1)).astype(np.float64) * factor).max())
    if brightest > BRIGHTEST:
        keys = [f"scale = {picture.scale:g}", *([] if picture.gain is None else [f"gain = {list(picture.gain)}"])]
        raise InputError(
            f"{' and '.join(keys)}: the radiance of {path.name} becomes {brightest:.3g}; allowed are up to {BRIGHTEST:g}"
        )
    return radiance if (factor == 1.0).all() else np.asarray(radiance * factor.astype(np.float32))


def _check_size(path: Path, key: str, image: NDArray[np.float32], panorama: NDArray[np.float32]) -> None:
    if panorama.size and image.shape[:2] != panorama.shape[:2]:
        (height, width), (rows, columns) = image.shape[:2], panorama.shape[:2]
        raise InputError(
            f"{path}: is {width} x {height} pixels, but the panorama {columns} x {rows}; its {key} must have its size"
        )


def _real_surface(table: RealTable) -> RealSurface:
    mesh = merged([part.mesh for part in read_mesh_file(table.mesh, with_materials=False)])
    if table.rest is not None:
        mesh = replace(mesh, rest=_rest_positions(table.rest, mesh, table.mesh))
    return RealSurface(
        name=table.name,
        mesh=_placed(mesh, placement(table.position, table.rotation, table.scale), table.mesh),
        role=Role(table.role),
        gloss=None if table.gloss is None else Gloss(table.gloss.roughness, table.gloss.specular),
        opening=table.opening,
        removed=table.removed,
    )


def _rest_positions(path: Path, mesh: Mesh, mesh_path: Path) -> NDArray[np.floating]:
    """Vertices of the ``rest`` mesh, which must have the vertices and faces of ``mesh`` in the same order."""
    rest = merged([part.mesh for part in read_mesh_file(path, with_materials=False, keep_flat=True)])
    if len(rest.vertices) != len(mesh.vertices):
        raise InputError(
            f"{path}: the rest mesh has {len(rest.vertices)} vertices, but {mesh_path.name} has {len(mesh.vertices)}; "
            "the two must have the same topology"
        )
    return rest.vertices


def _synthetic_object(
    table: MeshObject | SphereObject | UnitShapeObject,
    panorama: Panorama,
    real: Sequence[RealSurface],
    meshes: dict[MeshKey, list[MeshPart]],
    moving: dict[MeshKey, AnimatedMesh],
) -> SyntheticObject:
    if isinstance(table, MeshObject):
        key = _mesh_key(table)
        if table.animation is not None:
            if key not in moving:
                moving[key] = AnimatedMesh(*key)
            parts = moving[key].parts(table.animation.name, table.animation.offset, table.animation.loop)
            # It stands by the pose with which the animation begins, or it would slide along with its lowest point.
            resting = moving[key].parts(table.animation.name, 0.0, loop=False) if table.on_spot else parts
        else:
            if key not in meshes:
                meshes[key] = read_mesh_file(*key)
            parts = resting = meshes[key]
        to_world = _to_world(table, [part.mesh for part in resting], panorama, real)
        if table.instances is not None:
            pieces = _instanced(table, table.instances, parts, to_world)
        else:
            pieces = _pieces(table, parts, to_world)
        return SyntheticObject(table.name, tuple(pieces), table.visible_to_camera)
    to_world = _to_world(table, [AnalyticShape(table.shape, np.eye(4))], panorama, real)
    part = SyntheticPart(AnalyticShape(table.shape, to_world), table.material)
    return SyntheticObject(table.name, (part,), table.visible_to_camera)


def _pieces(table: MeshObject, parts: Sequence[MeshPart], matrix: NDArray[np.float64]) -> list[SyntheticPart]:
    standing = [_part(part, matrix, table) for part in parts]
    return [piece for part in standing for half in split_mirrored(part) for piece in split_emissive(half)]


def _instanced(
    table: MeshObject, path: Path, parts: Sequence[MeshPart], to_world: NDArray[np.float64]
) -> list[SyntheticPart]:
    """The parts of an object and where they stand; those of mirrored instances are mirrored meshes."""
    places = to_world @ read_instances(path)
    mirrored = np.linalg.det(places[:, :3, :3]) < 0.0
    pieces = []
    for some, matrix in ((places[~mirrored], np.eye(4)), (places[mirrored], np.diag([-1.0, 1.0, 1.0, 1.0]))):
        if not len(some):
            continue
        standing, at = _pieces(table, parts, matrix), some @ matrix
        vertices = [each.geometry.vertices for each in standing if isinstance(each.geometry, Mesh)]
        low, high = np.min([v.min(axis=0) for v in vertices], axis=0), np.max([v.max(axis=0) for v in vertices], axis=0)
        check_precision(path, at, low.astype(np.float64), high.astype(np.float64))
        pieces += [replace(each, places=at) for each in standing]
    return pieces


def _mesh_key(table: MeshObject) -> MeshKey:
    """The file of an object, and whether its materials are wanted."""
    return table.mesh, table.material is None


def _to_world(
    table: MeshObject | SphereObject | UnitShapeObject,
    bodies: Sequence[Mesh | AnalyticShape],
    panorama: Panorama,
    real: Sequence[RealSurface],
) -> NDArray[np.float64]:
    """Matrix from an object's own coordinates to the world, shape (4, 4)."""
    if isinstance(table, SphereObject):
        to_world = placement(table.center or (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (table.radius,) * 3)
    else:
        to_world = placement(table.position, table.rotation, table.scale)
    if not table.on_spot:
        return to_world
    spot = find_spot(panorama, [each for each in real if not each.removed], _spot_direction(table, panorama))
    if spot is None:
        key = "at" if table.at is not None else "at_angles"
        raise InputError(
            f"{key}: shows no real surface but {'sky' if panorama.sky or panorama.depth is not None else 'a hole'}; "
            "take a pixel of the floor or of a table (`lightdepth where` reports what a pixel shows)"
        )
    return standing_placement(spot, bodies, to_world[:3, :3], table.stand, table.align)


def _spot_direction(table: OnSpot, panorama: Panorama) -> NDArray[np.float64]:
    if table.at_angles is not None:
        return angles_direction(*table.at_angles)
    assert table.at is not None
    if not panorama.radiance.size:
        raise InputError("at: is a pixel of the panorama, whose image cannot be read")
    height, width = panorama.radiance.shape[:2]
    return pixel_direction(*table.at, (height, width))


def _placed(mesh: Mesh, to_world: NDArray[np.float64], path: Path) -> Mesh:
    try:
        return placed(mesh, to_world)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error


def _part(part: MeshPart, to_world: NDArray[np.float64], table: MeshObject) -> SyntheticPart:
    material = table.material
    if part.mesh.texture_coordinates is None and any(isinstance(value, Texture) for _, value in material or ()):
        raise InputError("the material has an image, but the mesh has no texture coordinates to map it by")
    name = part.material_name if material is None else None
    body = _placed(part.mesh, to_world, table.mesh)
    return SyntheticPart(body, material or part.material or Principled(), material_name=name)


def _camera_view(camera: Camera, pose: CapturePose) -> CameraView:
    """The camera at its own pose, or at the capture pose where it has none."""
    position = np.array(pose.position if camera.position is None else camera.position)
    look_at = getattr(camera, "look_at", None)
    if look_at is not None:
        rotation = look_at_rotation(position, look_at)
    else:
        rotation = euler_rotation(pose.rotation if camera.rotation is None else camera.rotation)
    return CameraView(camera.model_copy(update={"position": tuple(position.tolist())}), position, rotation)

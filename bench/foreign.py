"""Any Mitsuba scene as a place: photographed from its own panorama and geometry, then path-traced with objects in it.

Glossy floors, and windows onto a sky, break the method's one assumption; this shows by how much.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

import lightdepth
from bench.measures import display, find_regions, measure
from bench.methods.job import MAX_BOUNCES
from bench.places.objects import object_set
from bench.places.place import mitsuba_objects
from bench.run import RESULTS
from bench.truth import Estimate, cached, content_hash, on_plate, path_trace
from lightdepth.cameras import Equirectangular
from lightdepth.checks import Severity
from lightdepth.checks.support import support_problems
from lightdepth.checks.view import look_around
from lightdepth.errors import InputError
from lightdepth.images.png import write_png
from lightdepth.kernel.start import start
from lightdepth.scene.model import (
    AnalyticShape,
    CameraView,
    Mesh,
    Panorama,
    RealSurface,
    RenderSettings,
    Role,
    Scene,
    SyntheticObject,
    SyntheticPart,
)

Y_UP_TO_Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Turns +y into +z and +z into -y."""
METHODS = ("difference", "directional", "envpath")
FOREIGN = RESULTS / "foreign.json"
SPHERE_RINGS = 24


def compare(
    path: Path,
    capture: tuple[float, float, float],
    stand: tuple[float, float, float] | None,
    up: str,
    width: int,
    samples: int,
    console: Console,
) -> dict[str, Any]:
    """Compare the methods with the truth in the scene of a file.

    Args:
        path: Mitsuba scene file.
        capture: capture point, the scene's axes and units.
        stand: where the objects stand; by default on the floor below a point 1.2 units beside the capture point.
        up: ``y`` or ``z``.
        width: of the panoramas.
        samples: camera rays a pixel of the truth; the methods get a sixteenth.
        console: for progress.

    Returns:
        The figures as a table of text, and ``picture``: truth and methods below each other, a file in ``bench/results``.

    Raises:
        InputError: the file is missing, ``up`` is no axis, or nothing lies below the place for the objects.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    if up not in ("y", "z"):
        raise InputError(f"--up {up}: must be y or z")
    start()
    import mitsuba as mi

    turn = Y_UP_TO_Z_UP if up == "y" else np.eye(3)
    empty_scene = mi.load_file(str(path), optimize=False)
    position = turn @ np.asarray(capture)
    view = CameraView(Equirectangular(type="equirectangular", width=width), position, np.eye(3))
    original = replace(view, position=np.asarray(capture, dtype=np.float64), rotation=turn.T)
    foot = _floor_below(empty_scene, np.asarray(capture), stand, turn)
    objects = _lifted(object_set("mixed", (float(foot[0]), float(foot[1]))), float(foot[2]))

    def traced(scene: Any, name: str, rays: int, seed: int) -> Estimate:
        key = content_hash(2, path.read_bytes(), capture, objects, name, width, rays, seed, up)
        console.print(f"path tracing {name}", highlight=False)
        return cached(key, lambda: path_trace(scene, original, rays, seed))

    full_scene = _with_objects(path, objects, turn)
    photograph = traced(empty_scene, "the empty place: photograph", samples, 2)
    empty = traced(empty_scene, "the empty place", samples, 3)
    full = traced(full_scene, "the place with the objects", samples, 1)
    full = on_plate(full, empty)
    scene = _without_hidden_support(
        Scene(
            panorama=Panorama(photograph.mean.astype(np.float32), position, np.eye(3), sky=True),
            real=tuple(_real_surfaces(empty_scene, turn)),
            synthetic=objects,
            cameras={"panorama": view},
            render=RenderSettings(max_bounces=MAX_BOUNCES),
        )
    )
    regions = find_regions(full, empty.mean)
    pictures, rows = [full.mean], []
    for method in METHODS:
        console.print(method, highlight=False)
        frame = lightdepth.render(scene, camera="panorama", samples=max(16, samples // 16), method=method)
        image = empty.mean * (1.0 - frame.coverage[..., None]) + frame.change + frame.synthetic
        pictures.append(image)
        for region, values in measure(image, full, regions).items():
            signed, *others = (100.0 * values[name] for name in ("signed", "rmse", "block_rmse"))
            errors = [f"{signed:+.2f} %", *(f"{error:.2f} %" for error in others)]
            rows.append([method, region, str(values["pixels"]), *errors])
    title = (
        f"{path.resolve().parent.name}, capture point {capture}, {width} pixels wide, {samples} samples for the truth"
    )
    head = ["method", "region", "pixels", "signed", "RMSE", "RMSE of 8x8"]
    return {"title": title, "head": head, "rows": rows, "picture": _save(pictures, path).name}


def keep(table: dict[str, Any]) -> None:
    """Put a table into ``bench/results/foreign.json`` in place of that of the same scene, for the page."""
    tables = {one["picture"]: one for one in kept()} | {table["picture"]: table}
    FOREIGN.write_text(json.dumps(list(tables.values()), indent=1) + "\n")


def kept() -> list[dict[str, Any]]:
    """All tables that were kept."""
    return json.loads(FOREIGN.read_text()) if FOREIGN.is_file() else []


def _save(pictures: list[NDArray[np.float64]], path: Path) -> Path:
    """The pictures below each other as a PNG in the results' folder."""
    exposure = 0.4 / float(np.median(pictures[0]))
    shown = np.concatenate([display(exposure * picture) for picture in pictures])
    RESULTS.mkdir(parents=True, exist_ok=True)
    target = RESULTS / f"scene_{path.resolve().parent.name}.png"
    write_png(target, (255.0 * shown + 0.5).astype(np.uint8))
    return target


def _floor_below(
    scene: Any, capture: NDArray[np.float64], stand: tuple[float, float, float] | None, turn: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Where the objects stand, z up: the first surface below the wanted place."""
    import mitsuba as mi

    if stand is not None:
        return turn @ np.asarray(stand)
    above = turn @ capture + np.array([0.0, 1.2, 0.0])
    down = turn.T @ np.array([0.0, 0.0, -1.0])
    found = scene.ray_intersect(mi.Ray3f(mi.Point3f((turn.T @ above).tolist()), mi.Vector3f(down.tolist())))
    if not found.is_valid()[0]:
        raise InputError(f"nothing lies below {(turn.T @ above).tolist()}; say with --objects where the objects stand")
    return turn @ np.array(found.p).ravel()


def _lifted(objects: tuple[SyntheticObject, ...], height: float) -> tuple[SyntheticObject, ...]:
    """Objects that stand at z = 0 moved up, metres."""
    return tuple(_moved(thing, np.eye(3), np.array([0.0, 0.0, height])) for thing in objects)


def _moved(thing: SyntheticObject, turn: NDArray[np.float64], shift: NDArray[np.float64]) -> SyntheticObject:
    """An object turned about the origin, then shifted."""
    parts = []
    for part in thing.parts:
        if isinstance(part.geometry, AnalyticShape):
            pose = np.eye(4)
            pose[:3, :3], pose[:3, 3] = turn, shift
            geometry: AnalyticShape | Mesh = replace(part.geometry, to_world=pose @ part.geometry.to_world)
        else:
            geometry = replace(part.geometry, vertices=(part.geometry.vertices @ turn.T + shift).astype(np.float32))
        parts.append(SyntheticPart(geometry, part.material))
    return SyntheticObject(thing.name, tuple(parts))


def _with_objects(path: Path, objects: tuple[SyntheticObject, ...], turn: NDArray[np.float64]) -> Any:
    """The file's scene with the objects in it, in the file's own axes."""
    import mitsuba as mi

    loaded_scene = mi.load_file(str(path), optimize=False)
    entries: dict[str, Any] = {"type": "scene"}
    for index, shape in enumerate(loaded_scene.shapes()):
        entries[f"real_{index}"] = shape
    environment = loaded_scene.environment()
    if environment is not None:
        entries["environment"] = environment
    entries |= mitsuba_objects(tuple(_moved(thing, turn.T, np.zeros(3)) for thing in objects))
    return mi.load_dict(entries, optimize=False)


def _real_surfaces(scene: Any, turn: NDArray[np.float64]) -> Iterator[RealSurface]:
    """The geometry of a Mitsuba scene, z up; what emits is environment, everything else support."""
    for index, shape in enumerate(scene.shapes()):
        vertices, faces = _triangles(shape)
        if not len(faces):
            continue
        role = Role.ENVIRONMENT if shape.is_emitter() else Role.SUPPORT
        yield RealSurface(f"{index} {shape.id()}", Mesh((vertices @ turn.T).astype(np.float32), faces), role)


def _without_hidden_support(scene: Scene) -> Scene:
    """The scene with support that the capture point hardly sees declared environment, as the checks ask for."""
    view = look_around(scene)

    def declared(surface: RealSurface) -> RealSurface:
        too_hidden = any(problem.severity is Severity.ERROR for problem in support_problems(surface, [view]))
        return replace(surface, role=Role.ENVIRONMENT) if too_hidden else surface

    return replace(scene, real=tuple(map(declared, scene.real)))


def _triangles(shape: Any) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Vertices and faces of a mesh, or of an analytic rectangle, cube, disk or sphere by its parametrisation."""
    import mitsuba as mi

    parameters = mi.traverse(shape)
    if "vertex_positions" in parameters:
        vertices = np.asarray(parameters["vertex_positions"], dtype=np.float32).reshape(-1, 3)
        return vertices, np.asarray(parameters["faces"], dtype=np.int32).reshape(-1, 3)
    steps = 2 if "rectangle" in str(shape).lower() else SPHERE_RINGS
    grid = (np.arange(steps) + (0.0 if steps == 2 else 0.5)) / (steps - 1 if steps == 2 else steps)
    v, u = np.meshgrid(np.clip(grid, 1e-5, 1.0 - 1e-5), np.clip(grid, 1e-5, 1.0 - 1e-5), indexing="ij")
    uv = mi.Point2f(u.ravel().astype(np.float32), v.ravel().astype(np.float32))
    points = np.array(shape.eval_parameterization(uv).p).T.astype(np.float32)
    row, column = (index.ravel() for index in np.meshgrid(np.arange(steps - 1), np.arange(steps - 1), indexing="ij"))
    a = row * steps + column
    faces = np.concatenate([np.stack([a, a + 1, a + steps + 1], 1), np.stack([a, a + steps + 1, a + steps], 1)])
    return points, faces.astype(np.int32)

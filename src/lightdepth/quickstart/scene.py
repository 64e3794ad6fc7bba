"""The first scene as files: meshes, and a scene file in which every guess is a key with a comment."""

from __future__ import annotations

import os
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
from numpy.typing import NDArray

from lightdepth.directions import FloatArray, direction_to_latlong
from lightdepth.images.writing import whole_file
from lightdepth.parameters.quickstart import DEFAULT, QuickstartParameters
from lightdepth.quickstart.objects import NewObject, offsets
from lightdepth.quickstart.place import GuessedPlace
from lightdepth.quickstart.pose import GuessedPose
from lightdepth.quickstart.spot import FloorSpot
from lightdepth.reconstruction.scene_file import mesh_path, write_meshes


@dataclass(frozen=True)
class View:
    """The ``[camera.view]`` table: width, height, fov in degrees, and the world point that it looks at, metres."""

    width: int
    height: int
    fov: float
    look_at: tuple[float, float, float]


def group_width(objects: Sequence[NewObject], tuned: QuickstartParameters = DEFAULT) -> float:
    """From the left side of the first object to the right side of the last, metres."""
    places = offsets(objects, tuned)
    first, last = (float(max(thing.size[:2])) for thing in (objects[0], objects[-1]))
    return places[-1] - places[0] + 0.5 * (first + last)


def view_of(
    spot: FloorSpot,
    objects: Sequence[NewObject],
    camera_height: float,
    panorama_width: int,
    tuned: QuickstartParameters = DEFAULT,
) -> View:
    """A perspective camera at the capture point that shows the objects and the place around them."""
    tallest = max(float(thing.size[2]) for thing in objects)
    middle = spot.point + [0.0, 0.0, 0.5 * tallest]
    eye = np.array([0.0, 0.0, camera_height])
    distance = float(np.linalg.norm(middle - eye))
    far, deepest = float(np.linalg.norm(middle[:2])), 0.5 * max(float(thing.size[:2].max()) for thing in objects)
    bottom = np.arctan2(-camera_height, max(far - deepest, 0.1 * far))
    top = max(
        np.arctan2(tallest - camera_height, far + sign * deepest) for sign in (-0.9, 1.0) if far > deepest or sign > 0
    )
    across = 2.0 * np.arctan(0.5 * group_width(objects, tuned) / distance / tuned.group_share)
    high = (top - bottom) / (2.0 * tuned.group_share)
    fov = float(
        np.clip(
            np.degrees(max(across, 2.0 * np.arctan(np.tan(0.5 * high) / tuned.aspect))),
            tuned.smallest_fov,
            tuned.largest_fov,
        )
    )
    upright = 2.0 * np.arctan(tuned.aspect * np.tan(np.radians(0.5 * fov)))
    elevation = bottom + (0.5 - tuned.below) * upright
    target = eye + distance * (np.cos(elevation) * spot.away + np.sin(elevation) * np.array([0.0, 0.0, 1.0]))
    width = (
        int(np.clip(tuned.finer * panorama_width * fov / 360.0, tuned.smallest_width, tuned.largest_width)) // 16 * 16
    )
    x, y, z = (round(float(value), 3) + 0.0 for value in target)
    return View(width, round(width * tuned.aspect), round(fov, 1), (x, y, z))


def object_pixels(
    spot: FloorSpot,
    objects: Sequence[NewObject],
    pose: GuessedPose,
    size: tuple[int, int],
    tuned: QuickstartParameters = DEFAULT,
) -> list[tuple[float, float]]:
    """Where in the panorama the floor is seen on which each object stands, pixels."""
    right = np.array([spot.away[1], -spot.away[0], 0.0])
    points: FloatArray = spot.point + np.array(offsets(objects, tuned))[:, None] * right
    u, v = direction_to_latlong((points - [0.0, 0.0, pose.height]) @ pose.rotation)
    height, width = size
    return [(round(float(x) * width, 1), round(float(y) * height, 1)) for x, y in zip(u, v, strict=True)]


def write_first_scene(
    scene: Path,
    image: Path,
    pose: GuessedPose,
    place: GuessedPlace,
    objects: Sequence[NewObject],
    spot: FloorSpot,
    radiance: NDArray[np.float32],
    tuned: QuickstartParameters = DEFAULT,
) -> None:
    """Write the meshes beside a scene file, and the scene file.

    Args:
        scene: the file to write.
        image: the panorama's file.
        pose: of the panorama.
        place: its surfaces.
        objects: what is new.
        spot: where it stands.
        radiance: the panorama, for its size.
        tuned: how the camera is guessed.

    Raises:
        InputError: a file cannot be written.
    """
    folder = scene.with_suffix("")
    write_meshes(place.surfaces, folder)
    size = (radiance.shape[0], radiance.shape[1])
    view = view_of(spot, objects, pose.height, size[1], tuned)
    pixels = object_pixels(spot, objects, pose, size, tuned)
    text = _text(scene, image, pose, place, objects, spot, pixels, view, folder, size[1])
    with whole_file(scene) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _text(
    scene: Path,
    image: Path,
    pose: GuessedPose,
    place: GuessedPlace,
    objects: Sequence[NewObject],
    spot: FloorSpot,
    pixels: Sequence[tuple[float, float]],
    view: View,
    folder: Path,
    panorama_width: int,
) -> str:
    lines = [
        "# Begun by `lightdepth new`. What is marked as a guess was neither measured nor given: correct what you know, and",
        f"# render again with `lightdepth render {shlex.quote(scene.name)} --camera view`.",
        "",
        "[panorama]",
        f"image = {_toml(_relative(image, scene))}",
        f"position = {_toml([0.0, 0.0, round(pose.height, 4)])}  # {pose.height_words}",
        f"rotation = {_toml(list(pose.rotation_degrees))}  # {pose.rotation_words}",
    ]
    if place.sky:
        lines.append("sky = true  # guess: what the ground leaves open is sky, infinitely far away")
    better = {
        "box": "lightdepth reconstruct layout {} --floor ... --ceiling ... -o {} --write {}",
        "dome": "lightdepth reconstruct layout {} --floor ... --ceiling ... -o {} --write {}",
        "ground": "lightdepth reconstruct layout {} --outdoor --box ... -o {} --write {}",
    }[place.kind].format(*map(shlex.quote, (scene.name, folder.name, scene.name)))
    lines += ["", f"# {_sentence(place.words)}.", f"# Better: {better}"]
    for surface in place.surfaces:
        lines += [
            "[[real]]",
            f"name = {_toml(surface.name)}",
            f"mesh = {_toml(_relative(mesh_path(surface, folder), scene))}",
            f"role = {_toml(surface.role.value)}",
            "",
        ]
    where = (
        "guess: free floor in front of the camera" if spot.is_free else "guess: in front of the camera, not free floor"
    )
    for thing, pixel in zip(objects, pixels, strict=True):
        lines += ["[[synthetic]]", f"name = {_toml(thing.name)}"]
        for key, value in thing.keys.items():
            shown = _relative(value, scene) if isinstance(value, Path) else value
            lines.append(f"{key} = {_toml(shown)}")
        lines.append(f"at = {_toml(list(pixel))}  # {where}; a pixel of the panorama, on which it stands")
        if "mesh" in thing.keys:
            across, deep, high = (f"{side:.3g}" for side in thing.size)
            what = f"{across} x {deep} x {high} m"
            lines.append(f"scale = {_toml(thing.scale)}  # {thing.words + '; it is now ' if thing.words else ''}{what}")
        lines.append("")
    lines += [
        "[camera.view]  # guess: looks from the capture point at the new objects",
        'type = "perspective"',
        f"width = {view.width}",
        f"height = {view.height}",
        f"fov = {_toml(view.fov)}",
        f"look_at = {_toml(list(view.look_at))}",
        "",
        "[camera.pano]  # the whole panorama",
        'type = "equirectangular"',
        f"width = {panorama_width}",
        "",
    ]
    return "\n".join(lines)


def _sentence(words: str) -> str:
    return words[:1].upper() + words[1:]


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_toml(item)}" for key, item in value.items()) + " }"
    return tomlkit.item(value).as_string()


def _relative(path: Path, scene: Path) -> str:
    return Path(os.path.relpath(path.resolve(), scene.resolve().parent)).as_posix()

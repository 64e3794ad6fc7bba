"""How far the box that `lightdepth new` fits is off: in virtual rooms, in furnished ones, and in photographs of rooms."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mitsuba_oidn
import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from bench.places.barred_windows import barred_windows
from bench.places.furnished import furnished_room
from bench.places.lamp_and_window import lamp_and_window
from bench.places.place import Place
from bench.places.polished_room import polished_room
from bench.places.sunlit_room import sunlit_room
from bench.truth import photograph
from lightdepth.directions import FloatArray, euler_rotation, latlong_to_direction
from lightdepth.images.panorama_image import PanoramaImage
from lightdepth.images.radiance import read_radiance
from lightdepth.quickstart.pose import guess_pose
from lightdepth.reconstruction.room_box import fit_room_box

LAYOUTS = Path(__file__).parent / "places" / "photographed_rooms.toml"
PHOTOGRAPHS = Path(__file__).parents[1] / ".." / "shared" / "data" / "hdr"
WIDTH, SAMPLES = 1024, 64
"""Of the virtual rooms' panoramas, which are denoised: a photograph has a tenth of the noise of so few samples."""
FURNISHED, FURNISHED_HEIGHT = 30, 320
ALLOWED = 5.0
"""Per cent of the room's size along a wall's normal that the wall may be off."""


@dataclass(frozen=True)
class KnownRoom:
    """A panorama of a room whose walls are known.

    Attributes:
        name: of the row.
        radiance: the panorama.
        camera_height: metres.
        rotation: light space to the axes of ``walls``, shape (3, 3); ``None`` for the room's frame that is found.
        walls: distances of the walls at -x, +x, -y, +y, and of the ceiling, camera heights; NaN where there is no wall.
    """

    name: str
    radiance: NDArray[np.float32]
    camera_height: float
    rotation: FloatArray | None
    walls: FloatArray


def boxes(quick: bool, console: Console) -> dict[str, Any]:
    """Fit boxes to all rooms.

    Args:
        quick: only photographs and six furnished rooms.
        console: for progress.
    """
    rows, furnished, right = [], [], 0
    for room in _rooms(quick):
        errors, evidence = _errors(room)
        if room.name.startswith("furnished"):
            furnished.append(errors)
            right += int(_is_right(errors))
        verdict = "all walls" if _is_right(errors) else "no"
        shown = ["-" if np.isnan(error) else f"{error:+.1f}" for error in errors]
        rows.append([room.name, *shown, f"{100 * evidence:.0f} %", verdict])
        console.print("   ".join(rows[-1]), highlight=False, markup=False)
    if furnished:
        walls = np.abs(np.array(furnished)[:, :4]) <= ALLOWED
        share = f"{walls.sum()} of {walls.size} walls, {right} of {len(furnished)} rooms"
        rows.append(["furnished, together", "", "", "", "", "", "", share])
    title = f"The guessed box: errors of its walls in % of the room's size along them (right: at most {ALLOWED:g})"
    return {"title": title, "head": ["room", "-x", "+x", "-y", "+y", "height", "edges seen", "within"], "rows": rows}


def _is_right(errors: FloatArray) -> bool:
    return bool(np.all((np.abs(errors[:4]) <= ALLOWED) | np.isnan(errors[:4])))


def _errors(room: KnownRoom) -> tuple[FloatArray, float]:
    """Per cent, positive outward; all infinite where no frame is found."""
    frame = guess_pose(PanoramaImage(room.radiance), room.camera_height).frame
    if frame is None:
        return np.full(5, np.inf), 0.0
    walls = room.walls
    if room.rotation is not None:
        turn = frame.rotation @ room.rotation.T
        # The room's directions are found but for quarter turns.
        for _ in range(int(np.rint(np.degrees(np.arctan2(turn[1, 0], turn[0, 0])) / 90.0)) % 4):
            walls = walls[[3, 2, 0, 1, 4]]
    box = fit_room_box(room.radiance, frame, room.camera_height)
    found = np.array([-box.low[0], box.high[0], -box.low[1], box.high[1], box.high[2]])
    # Where a side is open, the room is taken for twice as long as the other one is far.
    along = [2.0 * np.nanmean(walls[first : first + 2]) for first in (0, 2)]
    return 100.0 * (found - walls) / np.array([along[0], along[0], along[1], along[1], 1.0 + walls[4]]), box.evidence


def _rooms(quick: bool) -> Iterator[KnownRoom]:
    if PHOTOGRAPHS.is_dir():
        for entry in tomllib.loads(LAYOUTS.read_text(encoding="utf-8"))["room"]:
            yield _photographed(entry)
    if not quick:
        yield from map(_virtual, (lamp_and_window(), barred_windows(), sunlit_room(), polished_room()))
    for seed in range(6 if quick else FURNISHED):
        room = furnished_room(seed)
        walls = _walls(room.low - room.position, room.high - room.position, room.position[2])
        rotation = euler_rotation(room.rotation)
        yield KnownRoom(
            f"furnished {seed}", room.photograph(FURNISHED_HEIGHT), float(room.position[2]), rotation, walls
        )


def _virtual(place: Place) -> KnownRoom:
    vertices = np.concatenate([part.mesh.vertices for part in place.parts]) - np.asarray(place.position)
    seen = photograph(place, WIDTH, SAMPLES).mean.astype(np.float32)
    around = np.ascontiguousarray(np.pad(seen, ((0, 0), (64, 64), (0, 0)), mode="wrap"))
    return KnownRoom(
        place.name,
        np.ascontiguousarray(mitsuba_oidn.denoise(around, hdr=True)[:, 64:-64]),
        place.position[2],
        euler_rotation(place.rotation),
        _walls(vertices.min(axis=0), vertices.max(axis=0), place.position[2]),
    )


def _walls(low: FloatArray, high: FloatArray, camera_height: float) -> FloatArray:
    return np.array([-low[0], high[0], -low[1], high[1], high[2]]) / camera_height


def _photographed(entry: dict[str, Any]) -> KnownRoom:
    radiance = np.maximum(np.nan_to_num(read_radiance(PHOTOGRAPHS / entry["image"])), 0.0)
    height, width = radiance.shape[:2]
    frame = guess_pose(PanoramaImage(radiance), entry["camera_height"]).frame
    assert frame is not None, f"{entry['name']}: no directions found"
    below, above = (
        latlong_to_direction(*(np.array(entry[key]) / (width, height)).T) @ frame.rotation.T
        for key in ("floor", "ceiling")
    )
    plan = below[:, :2] / -below[:, 2:]
    ceiling = np.mean(above[:, 2] / np.linalg.norm(above[:, :2], axis=1) * np.linalg.norm(plan, axis=1))
    left, right = -plan[[0, 3], 0].mean(), plan[[1, 2], 0].mean()
    back, front = -plan[[0, 1], 1].mean(), plan[[2, 3], 1].mean()
    walls = np.array([left, right, back, front, ceiling])
    for side in entry["open"]:
        walls[["left", "right", "back", "front"].index(side)] = np.nan
    return KnownRoom(entry["name"], radiance, entry["camera_height"], None, walls)

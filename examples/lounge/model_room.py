"""Model the hotel room of the example: every measure in one place, one PLY file for each kind of thing.

The measures were fitted by hand on the panorama (`overlay.py` shows how well). World: metres, z up, the origin on the
floor below the capture point, the window wall toward +y, the bed toward +x. Only the ratio of lengths can be read from
one panorama; the capture height of 1.3 m makes the door 2.1 m and the desk 0.71 m high.

Usage: `python examples/lounge/model_room.py` writes the meshes again, into `room/` beside this file.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import ArrayLike

FOLDER = Path(__file__).parent / "room"

CAPTURE_HEIGHT = 1.30
CEILING = 2.70
TV_WALL = -1.384  # x
CABINETS = 1.848  # x of their fronts
MIRROR = 2.43  # x
CURTAIN_FOOT, CURTAIN_TOP = 1.453, 1.508  # y: the curtain hangs a little inward
DOOR_WALL = -1.38  # y of the wall with the glass door
CORRIDOR = -0.203  # x of its inner wall
CORRIDOR_END = -2.771  # y of the entrance door
CORRIDOR_CEILING = 2.37
ALCOVE = (-0.63, 1.07)  # y, between the cabinets
CABINET_FOOT = 1.07  # height of the upper cabinets' bottom


def quad(*corners: ArrayLike) -> trimesh.Trimesh:
    """Flat four-sided face, counter-clockwise seen from its front."""
    return trimesh.Trimesh(np.asarray(corners, dtype=float), [[0, 1, 2], [0, 2, 3]], process=False)


def box(low: ArrayLike, high: ArrayLike) -> trimesh.Trimesh:
    """Box with its faces along the axes."""
    return trimesh.creation.box(bounds=np.array([low, high], dtype=float))


def hull(points: ArrayLike) -> trimesh.Trimesh:
    """Convex hull of points of shape (n, 3)."""
    return trimesh.convex.convex_hull(np.asarray(points, dtype=float))


def cushion(low: Sequence[float], high: Sequence[float], radius: float, inset: float = 0.0) -> trimesh.Trimesh:
    """Box whose upper edges are rounded, and whose foot is smaller by `inset` metres on each side."""
    ball = trimesh.creation.icosphere(subdivisions=2, radius=radius).vertices
    corners = [
        ball + np.array([x, y, high[2] - radius])
        for x in (low[0] + radius, high[0] - radius)
        for y in (low[1] + radius, high[1] - radius)
    ]
    foot = [[x, y, low[2]] for x in (low[0] + inset, high[0] - inset) for y in (low[1] + inset, high[1] - inset)]
    return hull(np.concatenate([*corners, foot]))


def placed(mesh: trimesh.Trimesh, position: ArrayLike, degrees: float) -> trimesh.Trimesh:
    """The mesh turned about z, then moved."""
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.radians(degrees), [0, 0, 1]))
    mesh.apply_translation(np.asarray(position, dtype=float))
    return mesh


def floor() -> list[trimesh.Trimesh]:
    """The floor of room and corridor with the rug on it, but not what lies under bed and cabinets."""

    def patch(low: Sequence[float], high: Sequence[float]) -> trimesh.Trimesh:
        return quad([low[0], low[1], 0], [high[0], low[1], 0], [high[0], high[1], 0], [low[0], high[1], 0])

    bed_foot, bed_sides = 0.36, (-0.58, 0.86)
    return [
        patch([TV_WALL, DOOR_WALL], [bed_foot, CURTAIN_FOOT]),
        patch([bed_foot, DOOR_WALL], [CABINETS, bed_sides[0]]),
        patch([bed_foot, bed_sides[1]], [CABINETS + 0.1, CURTAIN_FOOT]),
        patch([TV_WALL, CORRIDOR_END], [CORRIDOR, DOOR_WALL]),
    ]


def walls() -> list[trimesh.Trimesh]:
    """Walls, ceiling and the corridor, facing inward."""

    def wall(start: Sequence[float], end: Sequence[float], low: float = 0.0, high: float = CEILING) -> trimesh.Trimesh:
        """Upright wall with the room to its left, seen from `start` toward `end`."""
        return quad([*start, low], [*end, low], [*end, high], [*start, high])

    return [
        wall((TV_WALL, CURTAIN_TOP), (TV_WALL, CORRIDOR_END)),
        wall((TV_WALL, CORRIDOR_END), (CORRIDOR, CORRIDOR_END)),
        wall((CORRIDOR, CORRIDOR_END), (CORRIDOR, DOOR_WALL)),
        wall((CORRIDOR, DOOR_WALL), (MIRROR, DOOR_WALL)),
        wall((MIRROR, DOOR_WALL), (MIRROR, CURTAIN_TOP)),
        wall((TV_WALL, DOOR_WALL), (CORRIDOR, DOOR_WALL), low=CORRIDOR_CEILING),
        quad(
            [TV_WALL, CURTAIN_TOP, CEILING],
            [MIRROR, CURTAIN_TOP, CEILING],
            [MIRROR, DOOR_WALL, CEILING],
            [TV_WALL, DOOR_WALL, CEILING],
        ),
        quad(
            [TV_WALL, DOOR_WALL, CORRIDOR_CEILING],
            [CORRIDOR, DOOR_WALL, CORRIDOR_CEILING],
            [CORRIDOR, CORRIDOR_END, CORRIDOR_CEILING],
            [TV_WALL, CORRIDOR_END, CORRIDOR_CEILING],
        ),
    ]


def window() -> list[trimesh.Trimesh]:
    """The curtains, through which the daylight comes."""
    return [
        quad(
            [MIRROR, CURTAIN_FOOT, 0],
            [TV_WALL, CURTAIN_FOOT, 0],
            [TV_WALL, CURTAIN_TOP, CEILING],
            [MIRROR, CURTAIN_TOP, CEILING],
        )
    ]


def cabinets() -> list[trimesh.Trimesh]:
    """The cabinets on both sides of the bed, the bedside tables below them, and the headboard."""
    left, right = ALCOVE[1], ALCOVE[0]
    tall = right - 0.28
    return [
        box([CABINETS, left, CABINET_FOOT], [MIRROR, CURTAIN_TOP, CEILING]),
        box([CABINETS, right - 0.28, CABINET_FOOT], [MIRROR, right, CEILING]),
        box([CABINETS, DOOR_WALL, 0], [MIRROR, tall, CEILING]),
        box([CABINETS + 0.1, left - 0.1, 0], [MIRROR, CURTAIN_FOOT, 0.5]),
        box([CABINETS + 0.1, tall, 0], [MIRROR, right + 0.1, 0.5]),
        box([MIRROR - 0.06, right, 0], [MIRROR, left, CABINET_FOOT]),
    ]


def bed() -> list[trimesh.Trimesh]:
    """Mattress with the blanket that hangs to the floor, and the pillows."""
    return [
        cushion([0.28, -0.66, 0.0], [MIRROR, 0.94, 0.63], radius=0.07, inset=0.06),
        cushion([1.85, 0.25, 0.6], [2.3, 0.95, 0.85], radius=0.08),
        cushion([1.95, -0.55, 0.6], [2.3, 0.15, 0.95], radius=0.08),
    ]


def desk() -> list[trimesh.Trimesh]:
    """Desk top, drawers and the two front legs."""
    front, back, left, right, top = -0.82, TV_WALL, -0.985, 0.46, 0.714
    return [
        box([back, left, top - 0.045], [front, right, top]),
        box([back, -0.06, 0.02], [front - 0.015, right - 0.02, top]),
        *(box([front - 0.035, y, 0], [front, y + 0.035, top]) for y in (left, right - 0.035)),
    ]


def armchair() -> list[trimesh.Trimesh]:
    """The green armchair, facing +x of its own before it is placed: seat, curved back, arms that slope down, legs."""
    seat = cushion([-0.5, -0.27, 0.2], [0.03, 0.27, 0.43], radius=0.05)
    angles = np.radians(np.linspace(90, 270, 9))
    inner = np.stack([0.30 * np.cos(angles) - 0.20, 0.24 * np.sin(angles)], axis=1)
    outer = np.stack([0.38 * np.cos(angles) - 0.20, 0.32 * np.sin(angles)], axis=1)
    back = [
        hull([[*point, z] for point in (inner[i], inner[i + 1], outer[i], outer[i + 1]) for z in (0.25, 0.77)])
        for i in range(len(angles) - 1)
    ]
    arms = [
        hull([[x, side * y, z] for x, top in ((-0.20, 0.72), (0.0, 0.45)) for y in (0.23, 0.29) for z in (0.25, top)])
        for side in (-1, 1)
    ]
    legs = [box([x - 0.02, y - 0.02, 0], [x + 0.02, y + 0.02, 0.2]) for x in (-0.5, 0) for y in (-0.26, 0.26)]
    return [placed(part, [-0.565, 0.772, 0], -25.0) for part in [seat, *back, *arms, *legs]]


def office_chair() -> list[trimesh.Trimesh]:
    """The chair at the desk: back, seat, column and star."""
    spoke = [[0, -0.03, 0.12], [0, 0.03, 0.12], [0.28, -0.02, 0], [0.28, 0.02, 0], [0.28, 0, 0.06]]
    back = ((-0.54, 0.88), (-0.51, 0.88), (-0.60, 0.58), (-0.57, 0.58))  # x, z
    return [
        hull([[x, y, z] for x, z in back for y in (-0.50, -0.08)]),
        box([-1.0, -0.50, 0.43], [-0.60, -0.12, 0.50]),
        box([-0.895, -0.44, 0.08], [-0.845, -0.39, 0.45]),
        *(placed(hull(spoke), [-0.87, -0.415, 0], angle) for angle in range(-3, 357, 72)),
    ]


def fixtures() -> list[trimesh.Trimesh]:
    """Television, lamp on the wall, and the two lamps that hang from the ceiling."""
    lamps = []
    for x, y, low, high in ((-1.215, 0.984, 1.69, 2.02), (-1.058, 1.135, 1.45, 1.785)):
        lamps.append(trimesh.creation.cylinder(radius=0.045, height=0.6 * (high - low), sections=16))
        lamps[-1].apply_translation([x, y, low + 0.3 * (high - low)])
        lamps.append(trimesh.creation.cylinder(radius=0.02, height=0.4 * (high - low), sections=12))
        lamps[-1].apply_translation([x, y, low + 0.8 * (high - low)])
    return [
        box([TV_WALL, -0.59, 1.07], [TV_WALL + 0.06, 0.335, 1.60]),
        box([0.27, DOOR_WALL, 1.99], [0.44, DOOR_WALL + 0.07, 2.09]),
        *lamps,
    ]


THINGS = {
    "floor": floor,
    "walls": walls,
    "window": window,
    "cabinets": cabinets,
    "bed": bed,
    "desk": desk,
    "armchair": armchair,
    "office_chair": office_chair,
    "fixtures": fixtures,
}


def main() -> None:
    """Write every mesh."""
    FOLDER.mkdir(exist_ok=True)
    for name, build in THINGS.items():
        mesh = trimesh.util.concatenate(build())
        (FOLDER / f"{name}.ply").write_bytes(trimesh.exchange.ply.export_ply(mesh, vertex_normal=False))
        print(f"{name}: {len(mesh.faces)} triangles")


if __name__ == "__main__":
    main()

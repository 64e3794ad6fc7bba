"""A furnished flat of one room that a bookcase divides: furniture hides much of it, wherever the camera stands.

What the first capture point sees next to nothing of is environment: no photograph tells the colour that support must have.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bench.places.meshes import Hole, box, join, rectangle
from bench.places.objects import object_set
from bench.places.place import Finish, Part, Place
from bench.places.polished_room import planks
from lightdepth.cameras import Perspective
from lightdepth.scene.model import Mesh, Role

X0, X1, Y0, Y1, HEIGHT = -3.2, 3.2, -2.4, 2.4, 2.6
WINDOW = (-2.2, -0.8, 0.9, 2.1)
"""In the back wall: along x and z."""
LAMPS = [(-1.4, 0.1), (1.8, 0.1)]
LAMP_SIZE = 0.3
SHELVES, BOOKS, BOOK_PIXELS = 5, 36, 4
GAP = 0.002
"""Metres between furniture and what it stands on or at, so that no two surfaces coincide."""


def studio_flat(objects: str = "mixed") -> Place:
    """The flat, with an object set of :func:`bench.places.objects.object_set` behind the bookcase."""
    dx, dy, up = (X1 - X0, 0.0, 0.0), (0.0, Y1 - Y0, 0.0), (0.0, 0.0, HEIGHT)
    half = 0.5 * LAMP_SIZE
    lamp_holes: list[Hole] = [(y - Y0 - half, y - Y0 + half, x - X0 - half, x - X0 + half) for x, y in LAMPS]
    left, right, low, high = WINDOW
    wall, wood = (0.64, 0.62, 0.57), (0.42, 0.3, 0.19)
    parts = [
        Part("floor", rectangle((X0, Y0, 0.0), dx, dy), finish=Finish(planks())),
        Part("ceiling", rectangle((X0, Y0, HEIGHT), dy, dx, lamp_holes), (0.75, 0.75, 0.75)),
        Part("front wall", rectangle((X0, Y0, 0.0), up, dx), wall),
        Part("back wall", rectangle((X0, Y1, 0.0), dx, up, [(left - X0, right - X0, low, high)]), wall),
        Part("left wall", rectangle((X0, Y0, 0.0), dy, up), (0.27, 0.38, 0.43)),
        Part("right wall", rectangle((X1, Y0, 0.0), up, dy), wall, role=Role.ENVIRONMENT),
        Part("bookcase", _stands((0.2, -0.9), (0.55, 1.3), 1.9), finish=Finish(_books())),
        Part("sofa", _sofa((-2.6, -0.6), Y0 + GAP), (0.35, 0.12, 0.1)),
        Part("armchair", _stands((-2.9, 1.2), (-2.1, 2.0), 0.45), (0.2, 0.28, 0.16)),
        Part("low table", _table((-2.0, -0.4), (-0.9, 0.3), 0.43), wood),
        Part("bed", _stands((1.3, -2.3), (3.1, -0.8), 0.5), (0.55, 0.55, 0.6), role=Role.ENVIRONMENT),
        Part("desk", _table((0.8, 1.75), (2.2, Y1 - GAP), 0.76), wood),
        Part("wardrobe", _stands((2.6, 0.4), (X1 - GAP, 2.3), 2.1), (0.6, 0.55, 0.45), role=Role.ENVIRONMENT),
        Part(
            "window",
            rectangle((left, Y1, low), (right - left, 0.0, 0.0), (0.0, 0.0, high - low)),
            radiance=(7.0, 8.0, 9.5),
            role=Role.ENVIRONMENT,
        ),
    ]
    for index, (x, y) in enumerate(LAMPS):
        mesh = rectangle((x - half, y - half, HEIGHT), (0.0, LAMP_SIZE, 0.0), (LAMP_SIZE, 0.0, 0.0))
        parts.append(Part(f"lamp {index}", mesh, radiance=(75.0, 62.0, 45.0), role=Role.ENVIRONMENT))
    view = Perspective(
        type="perspective", width=320, height=240, fov=65.0, position=(-0.6, 0.2, 1.5), look_at=(0.2, -1.2, 0.6)
    )
    return Place(
        name="studio_flat",
        parts=tuple(parts),
        objects=object_set(objects, (1.4, 0.35)),
        position=(-1.3, 0.9, 1.5),
        rotation=(0.0, 0.0, 25.0),
        view=view,
    )


def _stands(low: tuple[float, float], high: tuple[float, float], height: float) -> Mesh:
    """A box on the floor."""
    return box((*low, GAP), (*high, height), "-x+x-y+y+z")


def _table(low: tuple[float, float], high: tuple[float, float], height: float, leg: float = 0.05) -> Mesh:
    """A top of 4 cm on four legs."""
    corners = [(x, y) for x in (low[0], high[0] - leg) for y in (low[1], high[1] - leg)]
    under = height - 0.04
    legs = [box((x, y, GAP), (x + leg, y + leg, under), "-x+x-y+y") for x, y in corners]
    return join([box((*low, under), (*high, height)), *legs])


def _sofa(across: tuple[float, float], back: float) -> Mesh:
    """A seat and a back rest along the front wall."""
    seat = box((across[0], back, GAP), (across[1], back + 0.85, 0.42), "-x+x-y+y+z")
    return join([seat, box((across[0], back, 0.42), (across[1], back + 0.25, 0.85), "-x+x-y+y+z")])


def _books() -> NDArray[np.float32]:
    """Albedos of rows of books, shape (rows, columns, 3)."""
    generator = np.random.default_rng(7)
    colours = generator.uniform(0.08, 0.6, (SHELVES, BOOKS, 3)) * generator.uniform(0.5, 1.0, (SHELVES, BOOKS, 1))
    fine = np.repeat(np.repeat(colours, 3 * BOOK_PIXELS, axis=0), BOOK_PIXELS, axis=1)
    fine.reshape(SHELVES, 3 * BOOK_PIXELS, -1, 3)[:, 0] = (0.3, 0.2, 0.13)
    return np.asarray(fine, dtype=np.float32)

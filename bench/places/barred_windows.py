"""A room with two windows, each of four panes between bars, whose patches of sun lie over floor, rug and a wall."""

from __future__ import annotations

from bench.places.meshes import Hole, join, rectangle
from bench.places.objects import Matte, Polished, ball, block
from bench.places.place import Part, Place
from bench.places.sun import Sun
from lightdepth.cameras import Perspective
from lightdepth.scene.model import Role

X0, X1, Y0, Y1, HEIGHT = -2.6, 2.2, -2.2, 2.8, 2.8
LEFT_EDGES = (-1.95, 0.35)
"""Where the windows begin, along x in the back wall."""
PANE_WIDTH, PANE_HEIGHT, BAR, SILL = 0.56, 0.7, 0.08, 0.8
RUG = (-1.75, -0.35, 0.1, 1.5)
"""Along x and y; it lies in the floor, flush with it."""


def barred_windows(objects: str = "mixed") -> Place:
    """The room; objects stand in the patches, at an edge and outside.

    Args:
        objects: ``matte`` or ``mixed``, which makes the ball in the patch of rough metal.
    """
    dx, dy, up = (X1 - X0, 0.0, 0.0), (0.0, Y1 - Y0, 0.0), (0.0, 0.0, HEIGHT)
    panes = [
        (x + column * (PANE_WIDTH + BAR), SILL + row * (PANE_HEIGHT + BAR))
        for x in LEFT_EDGES
        for row in range(2)
        for column in range(2)
    ]
    holes: list[Hole] = [(x - X0, x - X0 + PANE_WIDTH, z, z + PANE_HEIGHT) for x, z in panes]
    rug = (RUG[0] - X0, RUG[1] - X0, RUG[2] - Y0, RUG[3] - Y0)
    wall = (0.66, 0.62, 0.54)
    parts = (
        Part("floor", rectangle((X0, Y0, 0.0), dx, dy, [rug]), (0.42, 0.32, 0.23)),
        Part(
            "rug",
            rectangle((RUG[0], RUG[2], 0.0), (RUG[1] - RUG[0], 0.0, 0.0), (0.0, RUG[3] - RUG[2], 0.0)),
            (0.28, 0.36, 0.42),
        ),
        Part("ceiling", rectangle((X0, Y0, HEIGHT), dy, dx), (0.75, 0.75, 0.75)),
        Part("front wall", rectangle((X0, Y0, 0.0), up, dx), wall),
        Part("window wall", rectangle((X0, Y1, 0.0), dx, up, holes), wall),
        Part("left wall", rectangle((X0, Y0, 0.0), dy, up), wall),
        Part("green wall", rectangle((X1, Y0, 0.0), up, dy), (0.28, 0.45, 0.25)),
        Part(
            "panes",
            join([rectangle((x, Y1, z), (PANE_WIDTH, 0.0, 0.0), (0.0, 0.0, PANE_HEIGHT)) for x, z in panes]),
            radiance=(6.0, 7.0, 8.5),
            role=Role.ENVIRONMENT,
            opening=True,
        ),
    )
    first = Polished(color=(0.9, 0.75, 0.45), roughness=0.5) if objects == "mixed" else Matte(color=(0.7, 0.15, 0.1))
    white, blue = Matte(color=(0.75, 0.75, 0.72)), Matte(color=(0.15, 0.25, 0.6))
    view = Perspective(
        type="perspective", width=320, height=240, fov=65.0, position=(0.4, -1.7, 1.4), look_at=(-0.9, 0.6, 0.3)
    )
    return Place(
        name="barred_windows",
        parts=parts,
        objects=(
            ball("ball", (-0.9, 0.75), 0.2, first),
            block("block", (-1.75, 0.55), (0.32, 0.3, 0.6), white, 20.0),
            ball("small ball", (0.35, 0.3), 0.18, blue),
        ),
        position=(0.6, -0.9, 1.5),
        rotation=(0.0, 0.0, -15.0),
        view=view,
        outside_sun=Sun(direction=(0.497, 0.709, 0.5), irradiance=(150.0, 128.0, 92.0)),
    )

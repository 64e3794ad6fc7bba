"""A room with one window and one patch of sun on its floor; the capture point does not see the sun."""

from __future__ import annotations

from bench.places.meshes import rectangle
from bench.places.objects import Matte, Polished, ball, block
from bench.places.place import Part, Place
from bench.places.sun import Sun
from lightdepth.cameras import Perspective
from lightdepth.scene.model import Role

X0, X1, Y0, Y1, HEIGHT = -2.4, 2.6, -2.6, 3.0, 2.7
WINDOW = (0.3, 1.7, 0.9, 2.2)
"""Along y and z, in the left wall."""


def sunlit_room(objects: str = "mixed") -> Place:
    """The room; one object stands in the patch of sun, one at its edge, one outside.

    Args:
        objects: ``matte`` or ``mixed``, which makes the ball in the patch of rough metal.
    """
    dx, dy, up = (X1 - X0, 0.0, 0.0), (0.0, Y1 - Y0, 0.0), (0.0, 0.0, HEIGHT)
    hole = (WINDOW[0] - Y0, WINDOW[1] - Y0, WINDOW[2], WINDOW[3])
    parts = (
        Part("floor", rectangle((X0, Y0, 0.0), dx, dy), (0.45, 0.36, 0.28)),
        Part("ceiling", rectangle((X0, Y0, HEIGHT), dy, dx), (0.75, 0.75, 0.75)),
        Part("front wall", rectangle((X0, Y0, 0.0), up, dx), (0.62, 0.6, 0.56)),
        Part("back wall", rectangle((X0, Y1, 0.0), dx, up), (0.62, 0.6, 0.56)),
        Part("window wall", rectangle((X0, Y0, 0.0), dy, up, [hole]), (0.62, 0.6, 0.56)),
        Part("blue wall", rectangle((X1, Y0, 0.0), up, dy), (0.2, 0.28, 0.5)),
        Part(
            "window",
            rectangle((X0, WINDOW[0], WINDOW[2]), (0.0, WINDOW[1] - WINDOW[0], 0.0), (0.0, 0.0, WINDOW[3] - WINDOW[2])),
            radiance=(7.0, 8.5, 11.0),
            role=Role.ENVIRONMENT,
            opening=True,
        ),
    )
    first = Polished(color=(0.9, 0.75, 0.45), roughness=0.5) if objects == "mixed" else Matte(color=(0.7, 0.15, 0.1))
    white, blue = Matte(color=(0.75, 0.75, 0.72)), Matte(color=(0.15, 0.25, 0.6))
    view = Perspective(
        type="perspective", width=320, height=240, fov=65.0, position=(0.9, -1.2, 1.45), look_at=(-0.4, 0.9, 0.2)
    )
    return Place(
        name="sunlit_room",
        parts=parts,
        objects=(
            ball("ball", (-0.55, 0.75), 0.22, first),
            block("block", (0.3, 1.25), (0.36, 0.3, 0.55), white, 25.0),
            ball("small ball", (0.75, 0.1), 0.18, blue),
        ),
        position=(0.3, -0.5, 1.5),
        rotation=(0.0, 0.0, 20.0),
        view=view,
        outside_sun=Sun(direction=(-0.78, 0.15, 0.58), irradiance=(190.0, 172.0, 142.0)),
    )

"""A room with a polished floor of planks, in which two windows and a lamp are mirrored."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bench.places.meshes import rectangle
from bench.places.objects import Matte, Polished, ball, block
from bench.places.place import Finish, Part, Place
from lightdepth.cameras import Perspective
from lightdepth.scene.model import Gloss, Role

X0, X1, Y0, Y1, HEIGHT = -2.4, 2.6, -2.6, 3.4, 2.7
LEFT_WINDOW, BACK_WINDOW = (0.2, 1.6, 0.7, 2.1), (-1.5, 0.1, 0.9, 2.2)
"""Along the wall and z."""
LAMP = (1.0, 1.5, 0.6, 1.1)
PLANKS, PIECES, PLANK_PIXELS = 40, 6, 8
GLOSS = Gloss(roughness=0.25, specular=0.5)


def planks(color: tuple[float, float, float] = (0.36, 0.25, 0.17), contrast: float = 0.3) -> NDArray[np.float32]:
    """Albedos of planks of one wood, each of its own shade, shape (rows, columns, 3)."""
    generator = np.random.default_rng(5)
    shade = np.exp(contrast * generator.uniform(-1.0, 1.0, (PLANKS, PIECES)))
    fine = np.repeat(np.repeat(shade, PLANK_PIXELS, axis=0), PLANK_PIXELS * PLANKS // PIECES, axis=1)
    fine *= np.exp(0.3 * contrast * generator.uniform(-1.0, 1.0, fine.shape))
    return np.asarray(np.array(color) * fine[..., None], dtype=np.float32)


def polished_room(objects: str = "mixed", gloss: Gloss | None = GLOSS) -> Place:
    """The room, with objects where the floor mirrors them.

    Args:
        objects: ``matte`` or ``mixed``, which makes one ball of rough metal.
        gloss: of the floor; ``None`` for a matte one.
    """
    dx, dy, up = (X1 - X0, 0.0, 0.0), (0.0, Y1 - Y0, 0.0), (0.0, 0.0, HEIGHT)
    left_hole = (LEFT_WINDOW[0] - Y0, LEFT_WINDOW[1] - Y0, *LEFT_WINDOW[2:])
    back_hole = (BACK_WINDOW[0] - X0, BACK_WINDOW[1] - X0, *BACK_WINDOW[2:])
    lamp_hole = (LAMP[2] - Y0, LAMP[3] - Y0, LAMP[0] - X0, LAMP[1] - X0)
    wall = (0.62, 0.6, 0.56)
    parts = (
        Part("floor", rectangle((X0, Y0, 0.0), dx, dy), finish=Finish(planks(), gloss)),
        Part("ceiling", rectangle((X0, Y0, HEIGHT), dy, dx, [lamp_hole]), (0.75, 0.75, 0.75)),
        Part("front wall", rectangle((X0, Y0, 0.0), up, dx), wall),
        Part("back wall", rectangle((X0, Y1, 0.0), dx, up, [back_hole]), wall),
        Part("left wall", rectangle((X0, Y0, 0.0), dy, up, [left_hole]), wall),
        Part("green wall", rectangle((X1, Y0, 0.0), up, dy), (0.3, 0.42, 0.28)),
        Part(
            "lamp",
            rectangle((LAMP[0], LAMP[2], HEIGHT), (0.0, LAMP[3] - LAMP[2], 0.0), (LAMP[1] - LAMP[0], 0.0, 0.0)),
            radiance=(45.0, 36.0, 25.0),
            role=Role.ENVIRONMENT,
        ),
        Part(
            "left window",
            rectangle((X0, LEFT_WINDOW[0], LEFT_WINDOW[2]), _along_y(LEFT_WINDOW), _upward(LEFT_WINDOW)),
            radiance=(9.0, 10.5, 13.0),
            role=Role.ENVIRONMENT,
        ),
        Part(
            "back window",
            rectangle((BACK_WINDOW[0], Y1, BACK_WINDOW[2]), _along_x(BACK_WINDOW), _upward(BACK_WINDOW)),
            radiance=(13.0, 13.5, 13.0),
            role=Role.ENVIRONMENT,
        ),
    )
    second = Polished(color=(0.9, 0.9, 0.9), roughness=0.3) if objects == "mixed" else Matte(color=(0.15, 0.25, 0.6))
    view = Perspective(
        type="perspective", width=320, height=240, fov=70.0, position=(0.95, -0.6, 1.3), look_at=(-0.4, 1.5, 0.3)
    )
    return Place(
        name="polished_room",
        parts=parts,
        objects=(
            block("block", (-0.65, 1.75), (0.36, 0.3, 0.6), Matte(color=(0.7, 0.15, 0.1)), 25.0),
            ball("ball", (0.25, 1.3), 0.22, second),
            ball("small ball", (-0.3, 0.75), 0.15, Matte(color=(0.75, 0.75, 0.72))),
        ),
        position=(0.0, -0.4, 1.5),
        rotation=(0.0, 0.0, 15.0),
        view=view,
    )


def _along_x(window: tuple[float, float, float, float]) -> tuple[float, float, float]:
    return (window[1] - window[0], 0.0, 0.0)


def _along_y(window: tuple[float, float, float, float]) -> tuple[float, float, float]:
    return (0.0, window[1] - window[0], 0.0)


def _upward(window: tuple[float, float, float, float]) -> tuple[float, float, float]:
    return (0.0, 0.0, window[3] - window[2])

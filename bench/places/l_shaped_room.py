"""An L-shaped room with five small bright lamps; parts of its far leg are hidden from the capture point.

Walls of which the capture point sees nothing are environment: no photograph tells the colour that support must have.
"""

from __future__ import annotations

from bench.places.meshes import Hole, join, rectangle
from bench.places.objects import object_set
from bench.places.place import Part, Place
from lightdepth.cameras import Perspective
from lightdepth.scene.model import Role

LEFT, CORNER_X, RIGHT = -3.0, 0.8, 3.0
FRONT, CORNER_Y, BACK = -2.0, 1.5, 4.5
HEIGHT = 2.6
LAMP_SIZE = 0.12
LAMPS = [(-2.0, -1.0), (-0.4, 0.6), (1.0, -0.8), (2.2, 0.6), (2.4, 2.4)]
WALL = (0.66, 0.64, 0.58)


def l_shaped_room(objects: str = "mixed") -> Place:
    """The room, with an object set of :func:`bench.places.objects.object_set` near the inner corner."""
    up = (0.0, 0.0, HEIGHT)
    width, near, far = RIGHT - LEFT, CORNER_Y - FRONT, BACK - CORNER_Y

    def lamp_hole(lamp: tuple[float, float], x: float, y: float) -> Hole:
        half = 0.5 * LAMP_SIZE
        return lamp[1] - y - half, lamp[1] - y + half, lamp[0] - x - half, lamp[0] - x + half

    near_lamps = [lamp_hole(lamp, LEFT, FRONT) for lamp in LAMPS if lamp[1] < CORNER_Y]
    far_lamps = [lamp_hole(lamp, CORNER_X, CORNER_Y) for lamp in LAMPS if lamp[1] > CORNER_Y]
    parts = [
        Part(
            "floor",
            join(
                [
                    rectangle((LEFT, FRONT, 0.0), (width, 0.0, 0.0), (0.0, near, 0.0)),
                    rectangle((CORNER_X, CORNER_Y, 0.0), (RIGHT - CORNER_X, 0.0, 0.0), (0.0, far, 0.0)),
                ]
            ),
            (0.35, 0.33, 0.3),
        ),
        Part(
            "ceiling",
            join(
                [
                    rectangle((LEFT, FRONT, HEIGHT), (0.0, near, 0.0), (width, 0.0, 0.0), near_lamps),
                    rectangle((CORNER_X, CORNER_Y, HEIGHT), (0.0, far, 0.0), (RIGHT - CORNER_X, 0.0, 0.0), far_lamps),
                ]
            ),
            (0.75, 0.75, 0.75),
        ),
        Part("front wall", rectangle((LEFT, FRONT, 0.0), up, (width, 0.0, 0.0)), WALL),
        Part("green wall", rectangle((LEFT, FRONT, 0.0), (0.0, near, 0.0), up), (0.25, 0.45, 0.22)),
        Part("inner wall", rectangle((LEFT, CORNER_Y, 0.0), (CORNER_X - LEFT, 0.0, 0.0), up), WALL),
        Part("corner wall", rectangle((CORNER_X, CORNER_Y, 0.0), (0.0, far, 0.0), up), WALL, role=Role.ENVIRONMENT),
        Part(
            "far wall", rectangle((CORNER_X, BACK, 0.0), (RIGHT - CORNER_X, 0.0, 0.0), up), WALL, role=Role.ENVIRONMENT
        ),
        Part("right wall", rectangle((RIGHT, FRONT, 0.0), up, (0.0, BACK - FRONT, 0.0)), WALL),
    ]
    half = 0.5 * LAMP_SIZE
    for index, (x, y) in enumerate(LAMPS):
        mesh = rectangle((x - half, y - half, HEIGHT), (0.0, LAMP_SIZE, 0.0), (LAMP_SIZE, 0.0, 0.0))
        parts.append(Part(f"lamp {index}", mesh, radiance=(420.0, 340.0, 240.0), role=Role.ENVIRONMENT))
    view = Perspective(
        type="perspective", width=320, height=240, fov=65.0, position=(-1.0, -1.4, 1.45), look_at=(0.75, 0.45, 0.35)
    )
    return Place(
        name="l_shaped_room",
        parts=tuple(parts),
        objects=object_set(objects, (0.75, 0.5)),
        position=(-1.2, -0.4, 1.5),
        rotation=(0.0, 0.0, -35.0),
        view=view,
    )

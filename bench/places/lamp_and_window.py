"""A closed room with a lamp in the ceiling, a window and a sofa, all of it visible from the capture point."""

from __future__ import annotations

from bench.places.meshes import box, join, rectangle
from bench.places.objects import object_set
from bench.places.place import Part, Place
from lightdepth.cameras import Perspective
from lightdepth.scene.model import Role

X0, X1, Y0, Y1, HEIGHT = -2.4, 2.6, -2.6, 3.4, 2.7
LAMP = (0.8, 1.4, 0.9, 1.5)
WINDOW = (0.2, 1.8, 0.9, 2.2)
SOFA_LEFT, SEAT_FRONT, BACK_FRONT, SEAT_HEIGHT, BACK_HEIGHT = 1.0, 2.5, 3.15, 0.42, 0.85


def sofa_as_it_is() -> Part:
    """An L-shaped profile in the corner: seat and back."""
    seat = box((SOFA_LEFT, SEAT_FRONT, 0.0), (X1, BACK_FRONT, SEAT_HEIGHT), "-x-y+z")
    back = box((SOFA_LEFT, BACK_FRONT, SEAT_HEIGHT), (X1, Y1, BACK_HEIGHT), "-x-y+z")
    foot = box((SOFA_LEFT, BACK_FRONT, 0.0), (X1, Y1, SEAT_HEIGHT), "-x")
    return Part("sofa", join([seat, back, foot]), (0.25, 0.3, 0.42))


def sofa_as_a_box() -> Part:
    """What somebody in a hurry models instead: the sofa's bounding box."""
    return Part("sofa", box((SOFA_LEFT, SEAT_FRONT, 0.0), (X1, Y1, BACK_HEIGHT), "-x-y+z"), (0.25, 0.3, 0.42))


def lamp_and_window(objects: str = "mixed") -> Place:
    """The room, with an object set of :func:`bench.places.objects.object_set` in its middle."""
    dx, dy, up = (X1 - X0, 0.0, 0.0), (0.0, Y1 - Y0, 0.0), (0.0, 0.0, HEIGHT)
    lamp_hole = (LAMP[2] - Y0, LAMP[3] - Y0, LAMP[0] - X0, LAMP[1] - X0)
    window_hole = (WINDOW[0] - Y0, WINDOW[1] - Y0, WINDOW[2], WINDOW[3])
    sofa_on_floor = (SOFA_LEFT - X0, X1 - X0, SEAT_FRONT - Y0, Y1 - Y0)
    sofa_on_back_wall = (SOFA_LEFT - X0, X1 - X0, 0.0, BACK_HEIGHT)
    sofa_on_right_wall = [
        (0.0, SEAT_HEIGHT, SEAT_FRONT - Y0, Y1 - Y0),
        (SEAT_HEIGHT, BACK_HEIGHT, BACK_FRONT - Y0, Y1 - Y0),
    ]
    parts = (
        Part("floor", rectangle((X0, Y0, 0.0), dx, dy, [sofa_on_floor]), (0.45, 0.36, 0.28)),
        Part("ceiling", rectangle((X0, Y0, HEIGHT), dy, dx, [lamp_hole]), (0.75, 0.75, 0.75)),
        Part("front wall", rectangle((X0, Y0, 0.0), up, dx), (0.62, 0.6, 0.56)),
        Part("back wall", rectangle((X0, Y1, 0.0), dx, up, [sofa_on_back_wall]), (0.62, 0.6, 0.56)),
        Part("window wall", rectangle((X0, Y0, 0.0), dy, up, [window_hole]), (0.62, 0.6, 0.56)),
        Part("red wall", rectangle((X1, Y0, 0.0), up, dy, sofa_on_right_wall), (0.55, 0.22, 0.18)),
        sofa_as_it_is(),
        Part(
            "lamp",
            rectangle((LAMP[0], LAMP[2], HEIGHT), (0.0, LAMP[3] - LAMP[2], 0.0), (LAMP[1] - LAMP[0], 0.0, 0.0)),
            radiance=(45.0, 36.0, 25.0),
            role=Role.ENVIRONMENT,
        ),
        Part(
            "window",
            rectangle((X0, WINDOW[0], WINDOW[2]), (0.0, WINDOW[1] - WINDOW[0], 0.0), (0.0, 0.0, WINDOW[3] - WINDOW[2])),
            radiance=(7.0, 8.5, 11.0),
            role=Role.ENVIRONMENT,
        ),
    )
    view = Perspective(
        type="perspective", width=320, height=240, fov=65.0, position=(-0.6, -0.95, 1.35), look_at=(0.1, 1.0, 0.35)
    )
    return Place(
        name="lamp_and_window",
        parts=parts,
        objects=object_set(objects, (0.1, 1.1)),
        position=(0.1, -0.2, 1.5),
        rotation=(0.0, 0.0, 20.0),
        view=view,
    )

"""An outdoor court under sun and sky: a house wall on one side, low walls on the others.

The low walls end below the capture point and the objects, so that whatever looks past them sees sky that the panorama
shows too.
"""

from __future__ import annotations

from bench.places.meshes import rectangle
from bench.places.objects import object_set
from bench.places.place import Part, Place, Sky
from lightdepth.cameras import Perspective

X0, X1, Y0, Y1 = -5.0, 5.0, -5.0, 4.0
WALL_HEIGHT, HOUSE_HEIGHT = 1.1, 3.2


def court(objects: str = "mixed") -> Place:
    """The court, with an object set of :func:`bench.places.objects.object_set` in front of the house."""
    dx, dy = (X1 - X0, 0.0, 0.0), (0.0, Y1 - Y0, 0.0)
    wall, house = (0.0, 0.0, WALL_HEIGHT), (0.0, 0.0, HOUSE_HEIGHT)
    parts = (
        Part("ground", rectangle((X0, Y0, 0.0), dx, dy), (0.38, 0.36, 0.32)),
        Part("house", rectangle((X0, Y1, 0.0), dx, house), (0.6, 0.5, 0.38)),
        Part("front wall", rectangle((X0, Y0, 0.0), wall, dx), (0.5, 0.48, 0.45)),
        Part("left wall", rectangle((X0, Y0, 0.0), dy, wall), (0.5, 0.48, 0.45)),
        Part("right wall", rectangle((X1, Y0, 0.0), wall, dy), (0.42, 0.25, 0.2)),
    )
    view = Perspective(
        type="perspective", width=320, height=240, fov=65.0, position=(-0.75, -0.6, 1.4), look_at=(0.1, 1.9, 0.35)
    )
    return Place(
        name="court",
        parts=parts,
        objects=object_set(objects, (0.1, 1.8)),
        position=(0.0, 0.0, 1.6),
        rotation=(0.0, 0.0, 10.0),
        view=view,
        sky=Sky(
            zenith=(0.35, 0.6, 1.2),
            horizon=(0.9, 1.0, 1.2),
            ground=(0.25, 0.24, 0.2),
            sun_direction=(-0.55, -0.45, 0.75),
            sun_radiance=(5200.0, 4700.0, 3900.0),
            sun_diameter=2.5,
        ),
    )

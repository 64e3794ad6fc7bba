"""Places whose model is wrong on purpose, as hand-made models are; the places themselves stay as they are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from bench.places.lamp_and_window import sofa_as_a_box
from bench.places.place import Part, Place


def walls_off(place: Place, share: float) -> Place:
    """Everything but the ground's height modelled too far away by a share of its distance from the capture point."""
    center = np.array([place.position[0], place.position[1], 0.0])

    def scaled(part: Part) -> Part:
        vertices = (center + (part.mesh.vertices - center) * (1.0 + share)).astype(np.float32)
        return replace(part, mesh=replace(part.mesh, vertices=vertices))

    return replace(place, name=f"{place.name}, walls {100 * share:.0f} % off", modelled=tuple(map(scaled, place.parts)))


def box_for_furniture(place: Place) -> Place:
    """The sofa modelled as its bounding box."""
    modelled = tuple(sofa_as_a_box() if part.name == "sofa" else part for part in place.parts)
    return replace(place, name=f"{place.name}, box for furniture", modelled=modelled)


def capture_off(place: Place, distance: float = 0.05) -> Place:
    """The capture point measured wrongly by a distance in metres, to the side, forward and up."""
    direction = np.array([0.6, -0.64, 0.48])
    return replace(
        place,
        name=f"{place.name}, capture {100 * distance:.0f} cm off",
        capture_error=tuple(distance * direction),
    )


WRONG: dict[str, Callable[[Place], Place]] = {
    "walls 5 % off": lambda place: walls_off(place, 0.05),
    "walls 10 % off": lambda place: walls_off(place, 0.10),
    "box for furniture": box_for_furniture,
    "capture 5 cm off": capture_off,
}
"""The wrong models by name; ``box for furniture`` is meant for the room with the sofa."""

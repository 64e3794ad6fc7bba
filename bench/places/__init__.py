"""Virtual places whose truth is known: exact geometry, Lambertian surfaces, and objects to put into them."""

from collections.abc import Callable

from bench.places.court import court
from bench.places.l_shaped_room import l_shaped_room
from bench.places.lamp_and_window import lamp_and_window
from bench.places.place import Part, Place

PLACES: dict[str, Callable[..., Place]] = {
    "lamp_and_window": lamp_and_window,
    "l_shaped_room": l_shaped_room,
    "court": court,
}
"""The procedural places by name. A new one is a file in this folder and a line here."""

__all__ = ["PLACES", "Part", "Place", "court", "l_shaped_room", "lamp_and_window"]

"""Virtual places whose truth is known: exact geometry, Lambertian surfaces, and objects to put into them."""

from collections.abc import Callable

from bench.places.barred_windows import barred_windows
from bench.places.court import court
from bench.places.l_shaped_room import l_shaped_room
from bench.places.lamp_and_window import lamp_and_window
from bench.places.place import Finish, Part, Place
from bench.places.polished_room import polished_room
from bench.places.studio_flat import studio_flat
from bench.places.sun import Sun
from bench.places.sunlit_room import sunlit_room

PLACES: dict[str, Callable[..., Place]] = {
    "lamp_and_window": lamp_and_window,
    "l_shaped_room": l_shaped_room,
    "court": court,
    "sunlit_room": sunlit_room,
    "barred_windows": barred_windows,
}
"""The procedural places by name. A new one is a file in this folder and a line here."""

__all__ = [
    "PLACES",
    "Finish",
    "Part",
    "Place",
    "Sun",
    "barred_windows",
    "court",
    "l_shaped_room",
    "lamp_and_window",
    "polished_room",
    "studio_flat",
    "sunlit_room",
]

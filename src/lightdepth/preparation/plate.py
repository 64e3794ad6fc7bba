"""The plate of an ordinary camera made ready: its gain, and what it shows of the place."""

from __future__ import annotations

import numpy as np

from lightdepth.errors import InputError
from lightdepth.place.place import Place
from lightdepth.place.seen_plate import SeenPlate
from lightdepth.preparation.place import PreparedPlace
from lightdepth.recovery.plate_gain import solve_plate_gain
from lightdepth.recovery.specular import plate_mirrored
from lightdepth.scene.identity import digest, view_digest
from lightdepth.scene.model import Scene

KEPT = 2
"""Plates that a prepared place keeps."""


def with_plate(place: Place, scene: Scene, prepared: PreparedPlace) -> Place:
    """A place with the plate of the scene, where it has one.

    Args:
        place: of ``prepared``, with the objects.
        scene: its plate and its cameras.
        prepared: keeps the plates that were used last.

    Raises:
        InputError: the plate has no gain, and none can be solved.
    """
    plate = scene.plate
    if plate is None:
        return place
    view, kept = scene.cameras[plate.camera], prepared.seen_plates
    tuned = scene.render.parameters
    key = digest(plate.radiance, plate.gain, view_digest(view), tuned.recovery, tuned.balance)
    if key not in kept:
        if plate.gain is None:
            balance = solve_plate_gain(plate.radiance, view, prepared.place, tuned=tuned.balance)
            if balance.problem is not None:
                raise InputError(f"{scene.path or 'scene'}: {plate_name(scene)}: {balance.problem}")
            gain = balance.gain
        else:
            gain = np.asarray(plate.gain, np.float32)
        mirrored = plate_mirrored(prepared.place, view, parameters=tuned.recovery)
        kept[key] = SeenPlate(plate.radiance, view, gain, prepared.place.surfaces, mirrored, prepared.place.parameters)
        while len(kept) > KEPT:
            kept.pop(next(iter(kept)))
    return place.with_plate(kept[key])


def plate_name(scene: Scene) -> str:
    """What messages call the plate."""
    path = None if scene.plate is None else scene.plate.path
    return f"[plate] ({path.name})" if path else "[plate]"

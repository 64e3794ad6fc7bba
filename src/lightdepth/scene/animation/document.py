"""A scene file's document at one frame: every table of keys becomes the value that it has there."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any, get_args

import numpy as np
from pydantic import ValidationError

from lightdepth.scene.animation.keys import Interpolation, Keys
from lightdepth.scene.animation.sequence import SequenceTable

ANIMATED: dict[str, tuple[str, ...]] = {
    "panorama": ("scale",),
    "synthetic": ("position", "rotation", "scale", "center", "radius"),
    "camera": (
        "position",
        "rotation",
        "look_at",
        "fov",
        "aperture",
        "focus_distance",
        "shift",
        "tilt",
        "interocular_distance",
        "convergence_distance",
    ),
    "material": (
        "radiance",
        "emission",
        "emission_strength",
        "base_color",
        "color",
        "metallic",
        "roughness",
        "clearcoat",
        "opacity",
        "transmission",
    ),
}
"""Keys of each kind of table that may be tables of keys."""
STILL = {
    "real": "real surfaces stand where they were photographed",
    "light": "the lights of the place shine as they were photographed",
}
"""Kinds of table of which nothing can be animated, and why."""
ALLOWED = ("frame", "value", "interpolation")
NEEDED = ("frame", "value")
INTERPOLATIONS: tuple[str, ...] = get_args(Interpolation)
TURN = 180.0
SHORT_WAY = (
    f"two keys are more than {TURN:.0f} degrees apart, and rotations turn the short way; for a longer turn, put keys in "
    "between"
)
KeyPath = tuple[str | int, ...]


class Animation:
    """The keys of a scene file.

    Args:
        document: the file's tables, unchecked; it stays as it is.

    Attributes:
        sequence: ``[sequence]``; ``None`` where there is none, or a wrong one.
        keys: by the place of the key in the document.
        mistakes: what is wrong with tables of keys: place and message. Such a table is its own first value, or absent.
        cautions: likewise, what may be meant otherwise.
    """

    def __init__(self, document: Mapping[str, Any]) -> None:
        self._document = document
        self.sequence = _sequence(document)
        self.keys: dict[KeyPath, Keys] = {}
        self.mistakes: list[tuple[KeyPath, str]] = []
        self.cautions: list[tuple[KeyPath, str]] = []
        self._values: dict[KeyPath, Any] = {}
        for place, kind, table in _tables_of_keys(document):
            self._values[place] = _first_value(table)
            message = self._mistake(place, kind, table)
            if message is not None:
                self.mistakes.append((place, message))
            else:
                keys = self.keys[place] = _keys(place, kind, table)
                if _turns_back(keys):
                    self.cautions.append((place, SHORT_WAY))

    @property
    def key_frames(self) -> list[float]:
        """All frames that have a key, in order."""
        return sorted({float(frame) for keys in self.keys.values() for frame in keys.frames})

    def at(self, frame: float) -> dict[str, Any]:
        """The document at a frame, without tables of keys."""
        values = self._values | {place: _plain(keys.at(frame)) for place, keys in self.keys.items()}
        return dict(_expanded(self._document, (), values))

    def _mistake(self, place: KeyPath, kind: str, table: Mapping[str, Any]) -> str | None:
        """What is wrong with a table of keys."""
        key = str(place[-1])
        if kind in STILL or key not in ANIMATED[kind]:
            reason = STILL.get(kind) or f"of this table, only {', '.join(ANIMATED[kind])} can"
            return f"cannot have keys: {reason}"
        if "sequence" not in self._document:
            return "has keys, but the file has no [sequence] with frames = [first, last]"
        unknown = [name for name in table if name not in ALLOWED]
        if unknown:
            return f"unknown key '{str(unknown[0])[:100]}'; a table of keys has {', '.join(ALLOWED)}"
        missing = [name for name in NEEDED if name not in table]
        if missing:
            return f"the key '{missing[0]}' is missing; a table of keys has {', '.join(ALLOWED)}"
        chosen = table.get("interpolation", "linear")
        if chosen not in INTERPOLATIONS:
            return f"interpolation: {str(chosen)[:100]!r} is not known; allowed: {', '.join(INTERPOLATIONS)}"
        return self._wrong_frames(table["frame"]) or _wrong_values(table["value"], len(table["frame"]), kind, key)

    def _wrong_frames(self, frames: Any) -> str | None:
        if not isinstance(frames, list) or not frames or not all(_is_number(frame) for frame in frames):
            return "frame: must be a list of frame numbers, one for each value"
        for before, after in pairwise(frames):
            if not before < after:
                return f"frame: keys must be in order, each after the one before, found {before} and then {after}"
        if self.sequence is None:  # Its own mistake is reported.
            return None
        first, last = self.sequence.frames
        outside = [frame for frame in frames if not first <= frame <= last]
        if outside:
            return f"frame: {outside[0]} is outside the [sequence], which has frames {first} to {last}"
        return None


def _sequence(document: Mapping[str, Any]) -> SequenceTable | None:
    try:
        return SequenceTable.model_validate(document.get("sequence"))
    except ValidationError:
        return None


def _tables_of_keys(document: Mapping[str, Any]) -> Iterator[tuple[KeyPath, str, Mapping[str, Any]]]:
    """Key path, kind of the table that it is in, and contents of everything that is meant to be a table of keys."""
    for kind in (*ANIMATED, *STILL):
        tables = document.get(kind)
        entries: list[tuple[KeyPath, Any]] = [((kind,), tables)]
        if kind == "camera":
            entries = [((kind, name), table) for name, table in tables.items()] if isinstance(tables, dict) else []
        elif kind != "panorama" or isinstance(tables, list):
            entries = [((kind, i), table) for i, table in enumerate(tables)] if isinstance(tables, list) else []
        for place, table in entries:
            if not isinstance(table, dict):
                continue
            yield from _in_table(place, kind, table)
            if kind == "synthetic" and isinstance(table.get("material"), dict):
                yield from _in_table((*place, "material"), "material", table["material"])


def _in_table(place: KeyPath, kind: str, table: Mapping[str, Any]) -> Iterator[tuple[KeyPath, str, Mapping[str, Any]]]:
    for key, value in table.items():
        if isinstance(value, dict) and any(name in value for name in NEEDED):
            yield (*place, key), kind, value


def _wrong_values(values: Any, count: int, kind: str, key: str) -> str | None:
    if not isinstance(values, list) or not values:
        return "value: must be a list, one value for each frame"
    if len(values) != count:
        return f"frame and value: must be equally long, found {count} frames and {len(values)} values"
    lengths = set()
    for value in values:
        numbers = value if isinstance(value, list) else [value]
        if not numbers or not all(_is_number(number) for number in numbers):
            return f"value: must be numbers, or lists of numbers, found {str(value)[:100]!r}"
        single = not isinstance(value, list)
        lengths.add(3 if single and (kind, key) == ("synthetic", "scale") else 0 if single else len(numbers))
    if len(lengths) > 1:
        return "value: must be all numbers, or all lists of as many numbers"
    if key == "rotation" and lengths != {3}:
        return "value: must be lists of 3 angles"
    return None


def _keys(place: KeyPath, kind: str, table: Mapping[str, Any]) -> Keys:
    key, values = place[-1], table["value"]
    if (kind, key) == ("synthetic", "scale"):
        values = [value if isinstance(value, list) else [value] * 3 for value in values]
    numbers = np.array([value if isinstance(value, list) else [value] for value in values], np.float64)
    single = not isinstance(values[0], list)
    return Keys(
        np.array(table["frame"], np.float64),
        numbers[:, 0] if single else numbers,
        table.get("interpolation", "linear"),
        turns=key == "rotation",
    )


def _turns_back(keys: Keys) -> bool:
    """Whether the angles of two keys say a longer way than the short one that is taken."""
    far = np.abs(np.diff(keys.values, axis=0)) > TURN
    return keys.turns and keys.interpolation != "step" and bool(far.any())


def _first_value(table: Mapping[str, Any]) -> Any:
    """What stands for a wrong table of keys while everything else is checked; ``None`` takes the key away."""
    values = table.get("value")
    return values[0] if isinstance(values, list) and values else None


def _plain(value: Any) -> Any:
    return np.asarray(value).tolist()


def _expanded(table: Mapping[str, Any], place: KeyPath, values: Mapping[KeyPath, Any]) -> Iterator[tuple[str, Any]]:
    for key, value in table.items():
        here = (*place, key)
        if here in values:
            if values[here] is not None:
                yield key, values[here]
        elif isinstance(value, dict):
            yield key, dict(_expanded(value, here, values))
        elif isinstance(value, list) and key in ("panorama", "synthetic", "real", "light") and not place:
            yield (
                key,
                [
                    dict(_expanded(entry, (*here, i), values)) if isinstance(entry, dict) else entry
                    for i, entry in enumerate(value)
                ],
            )
        else:
            yield key, value


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)

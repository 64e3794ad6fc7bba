"""Digests of plain data: whether two scenes show the same place, whatever files they came from."""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from enum import Enum
from typing import Any, Generic, TypeVar

import numpy as np

from lightdepth.scene.model import Scene

T = TypeVar("T")


def content_digest(*values: object) -> str:
    """SHA-256 of values, as hexadecimal digits: the same for the same content.

    Args:
        values: dataclasses, arrays, tuples, lists, strings, numbers and ``None``, nested as they may be.

    Raises:
        TypeError: a value is of another kind.
    """
    digest = hashlib.sha256()
    for value in values:
        _add(digest, value)
    return digest.hexdigest()


def _add(digest: Any, value: object) -> None:
    if isinstance(value, np.ndarray):
        digest.update(f"array {value.dtype.str} {value.shape};".encode())
        digest.update(np.ascontiguousarray(value).view(np.uint8).data if value.size else b"")
    elif is_dataclass(value) and not isinstance(value, type):
        digest.update(f"{type(value).__name__};".encode())
        for each in fields(value):
            digest.update(f"{each.name}=".encode())
            _add(digest, getattr(value, each.name))
    elif isinstance(value, (tuple, list)):
        digest.update(f"{len(value)} values;".encode())
        for each in value:
            _add(digest, each)
    elif value is None or isinstance(value, (str, bytes, int, float, Enum)):
        digest.update(f"{type(value).__name__} {value!r};".encode())
    else:
        raise TypeError(f"{type(value).__name__} has no content digest")


class KeptByIdentity(Generic[T]):
    """What was made of the last few objects, for objects that are too large to compare; those are kept alive.

    Args:
        make: makes it of the objects.
        most: how many results are kept.
    """

    def __init__(self, make: Callable[..., T], most: int = 2) -> None:
        self._make, self._most = make, most
        self._kept: list[tuple[tuple[object, ...], T]] = []
        self._lock = threading.Lock()

    def __call__(self, *objects: object) -> T:
        """The result for these very objects, made where it is not kept."""
        with self._lock:
            for index, (known, result) in enumerate(self._kept):
                if len(known) == len(objects) and all(a is b for a, b in zip(known, objects, strict=True)):
                    self._kept.insert(0, self._kept.pop(index))
                    return result
        result = self._make(*objects)
        with self._lock:
            self._kept.insert(0, (objects, result))
            del self._kept[self._most :]
        return result

    def forget(self) -> None:
        """Free all of it."""
        with self._lock:
            self._kept.clear()


def _digest_of_place(panorama: Any, real: Any, lights: Any) -> str:
    return content_digest(replace(panorama, path=None, repairs=()), real, lights)


place_digests = KeptByIdentity(_digest_of_place)
"""Digests of the places seen last."""


def place_digest(scene: Scene) -> str:
    """Digest of all that belongs to the photographed place: panorama, real surfaces and their names, lights."""
    return place_digests(scene.panorama, scene.real, scene.lights)

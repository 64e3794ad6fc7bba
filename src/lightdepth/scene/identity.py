"""Which scene it is: a digest of everything in it that decides a picture."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from enum import Enum
from functools import lru_cache
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary, finalize

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from lightdepth.scene.model import CameraView, Panorama, RenderSettings, Scene

LARGE = 1 << 16
"""Bytes from which on the digest of an array is kept."""
_known: WeakKeyDictionary[Scene, str] = WeakKeyDictionary()
_arrays: dict[int, bytes] = {}


def scene_digest(scene: Scene) -> str:
    """Digest of what a scene shows, in hexadecimal; computed once for each scene in memory.

    Left out is what changes no picture: where the files lie, the cameras, and how many samples are wanted.
    """
    known = _known.get(scene)
    if known is None:
        known = _known[scene] = _scene_digest(scene)
    return known


def _scene_digest(scene: Scene) -> str:
    settings = replace(scene.render, samples=RenderSettings.samples, noise=None, seed=0)
    seed = scene.render.seed  # The preparation's; a rendering may have a seed of its own.
    values = [_photographs(scene), scene.real, scene.lights, scene.synthetic, settings, seed]
    if scene.plate is not None:
        values += [replace(scene.plate, path=None), scene.cameras[scene.plate.camera]]
    return digest(*values)


def place_digest(scene: Scene) -> str:
    """Digest of what belongs to the photographed place: panoramas, real surfaces and lights, but no object or setting."""
    return digest(_photographs(scene), scene.real, scene.lights)


def _photographs(scene: Scene) -> list[Panorama]:
    """The panoramas without what names their files, which may lie elsewhere on another machine."""
    return [replace(panorama, path=None, repairs=(), notes=()) for panorama in scene.panoramas]


def view_digest(view: CameraView) -> str:
    """Digest of a camera and its pose, in hexadecimal."""
    return digest(view)


def digest(*values: Any) -> str:
    """Digest of plain values, arrays, dataclasses and Pydantic models, in hexadecimal.

    Raises:
        TypeError: a value is of another kind.
    """
    state = hashlib.sha256()
    for chunk in _chunks(values):
        state.update(chunk)
    return state.hexdigest()[:32]


def _bytes(array: NDArray) -> memoryview:
    return np.ascontiguousarray(array).reshape(-1).view(np.uint8).data


def _array_digest(array: NDArray) -> bytes:
    """Digest of an array's numbers, computed once for each array in memory: scenes that differ in little share many."""
    key = id(array)
    if key not in _arrays:
        _arrays[key] = hashlib.sha256(_bytes(array)).digest()
        finalize(array, _arrays.pop, key, None)
    return _arrays[key]


@lru_cache(maxsize=256)
def _file_digest(path: str, size: int, changed: int) -> bytes:
    """Digest of a file's bytes, computed once for each ``size`` and time at which it was ``changed``.

    Neither the path nor that time is part of it: the machines of a farm may have copies.
    """
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").digest()


def _chunks(value: Any) -> Iterator[bytes | memoryview]:
    """The value as bytes that distinguish it from every other one."""
    yield f"<{type(value).__name__}".encode()
    if isinstance(value, np.ndarray):
        yield f"{value.dtype.str}{value.shape}".encode()
        yield _array_digest(value) if value.nbytes > LARGE else _bytes(value)
    elif is_dataclass(value) and not isinstance(value, type):
        for field in fields(value):
            yield field.name.encode()
            yield from _chunks(getattr(value, field.name))
    elif isinstance(value, BaseModel):
        for name in type(value).model_fields:
            yield name.encode()
            yield from _chunks(getattr(value, name))
    elif isinstance(value, Mapping):
        for key, item in value.items():
            yield from _chunks(key)
            if key == "filename" and isinstance(item, str) and Path(item).is_file():  # A file of a Mitsuba plugin.
                status = Path(item).stat()
                yield _file_digest(item, status.st_size, status.st_mtime_ns)
            else:
                yield from _chunks(item)
    elif isinstance(value, Enum):
        yield value.name.encode()
    elif value is None or isinstance(value, str | int | float | bool | Path | np.generic):
        yield repr(value).encode()
    elif isinstance(value, Sequence):
        for item in value:
            yield from _chunks(item)
    else:
        raise TypeError(f"{type(value).__name__} has no digest")
    yield b">"

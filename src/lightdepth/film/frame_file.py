"""A frame as it is in memory, in a file: between the sampling of a sequence and what is made of several frames."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightdepth.cameras.topology import Topology
from lightdepth.errors import InputError
from lightdepth.film.arrays_file import read_arrays, write_arrays
from lightdepth.film.cryptomatte import Mattes
from lightdepth.film.frame import Frame

KIND = "a lightdepth frame's samples"
_MATTES, _MATRICES = "mattes.", "matrices."


def save_frame(path: Path, frame: Frame) -> None:
    """Write a frame; the file appears whole or not at all.

    Raises:
        InputError: it cannot be written.
    """
    arrays: dict[str, NDArray] = {
        each.name: value for each in fields(frame) if isinstance(value := getattr(frame, each.name), np.ndarray)
    }
    arrays |= {_MATRICES + name: matrix for name, matrix in frame.matrices.items()}
    header: dict[str, Any] = {"metadata": frame.metadata, "object_names": frame.object_names}
    if frame.mattes is not None:
        arrays |= {_MATTES + name: getattr(frame.mattes, name) for name in ("pixels", "shapes", "shares")}
        header |= {"objects": frame.mattes.objects, "materials": frame.mattes.materials}
    write_arrays(path, KIND, header, arrays)


def saved_facts(path: Path) -> dict[str, str]:
    """The ``metadata`` of a frame that :func:`save_frame` wrote.

    Raises:
        InputError: the file is missing, damaged, or something else.
    """
    header, _ = read_arrays(path, KIND, ())
    facts = header.get("metadata")
    if not isinstance(facts, dict):
        raise InputError(f"{path}: its contents are damaged")
    return facts


def load_frame(path: Path, topology: Topology, layers: Collection[str] | None = None) -> Frame:
    """Read a frame that :func:`save_frame` wrote.

    Args:
        path: the file.
        topology: of its camera.
        layers: that are needed besides those that every frame has; ``None`` for all that there is.

    Raises:
        InputError: the file is missing, damaged, or something else.
    """
    required = ("plate", "change", "synthetic", "coverage", "alpha")
    header, arrays = read_arrays(path, KIND, None if layers is None else (*required, *layers))
    known = {each.name for each in fields(Frame)}
    try:
        mattes = None
        if layers is None and "objects" in header:
            pixels, shapes, shares = (arrays[_MATTES + name] for name in ("pixels", "shapes", "shares"))
            mattes = Mattes(pixels, shapes, shares, tuple(header["objects"]), tuple(header["materials"]))
        return Frame(
            **{name: value for name, value in arrays.items() if name in known},
            metadata=header["metadata"],
            matrices={
                name.removeprefix(_MATRICES): value for name, value in arrays.items() if name.startswith(_MATRICES)
            },
            object_names=tuple(header["object_names"]),
            mattes=mattes,
            topology=topology,
        )
    except (KeyError, TypeError) as error:
        raise InputError(f"{path}: its contents are damaged ({error})") from error

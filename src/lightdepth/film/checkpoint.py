"""Checkpoints: a rendering's state in a file, from which another process can continue."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from lightdepth.errors import InputError
from lightdepth.film.arrays_file import read_arrays, remove_arrays, write_arrays

if TYPE_CHECKING:
    from lightdepth.film.rendering import Rendering

KIND = "lightdepth checkpoint"


def checkpoint_beside(output: Path) -> Path:
    """The checkpoint file that belongs to an output file."""
    return output.with_suffix(".checkpoint")


def write_checkpoint(path: Path, rendering: Rendering) -> None:
    """Write a rendering's state; a process that is killed meanwhile leaves the old file.

    Raises:
        InputError: the file cannot be written.
    """
    write_arrays(path, KIND, *rendering.state())


def resume(path: Path, rendering: Rendering) -> None:
    """Let a rendering that has just begun continue from a checkpoint.

    Raises:
        InputError: the file is missing, damaged, or of another picture.
    """
    header, arrays = read_arrays(path, KIND)
    try:
        rendering.restore(header, arrays)
    except InputError as error:
        raise InputError(f"{path}: {error}; remove the file, or render without --resume") from error
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"{path}: its contents are damaged; remove the file, or render without --resume") from error


def remove_checkpoint(path: Path) -> None:
    """Remove a checkpoint that is no longer needed, if there is one."""
    remove_arrays(path)

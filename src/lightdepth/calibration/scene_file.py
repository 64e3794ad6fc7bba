"""The pose in a scene file, which otherwise stays as the person wrote it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import tomlkit
from tomlkit.exceptions import TOMLKitError

from lightdepth.errors import InputError
from lightdepth.images.writing import whole_file


def write_pose(scene: Path, rotation: Sequence[float], position: Sequence[float] | None) -> Path:
    """Put a pose into the ``[panorama]`` table of a scene file; comments, order and all else are kept.

    Args:
        scene: the scene file; it is replaced whole or not at all.
        rotation: light space to world, XYZ Euler, degrees, three numbers.
        position: capture point, world, metres, three numbers; ``None`` leaves the file's as it is.

    Returns:
        The panorama image that the scene names.

    Raises:
        InputError: the file is missing, is not TOML, has no panorama with an image, or cannot be written.
    """
    if not scene.is_file():
        raise InputError(f"{scene}: no such file")
    try:
        with scene.open(encoding="utf-8", newline="") as file:
            document = tomlkit.parse(file.read())
    except (TOMLKitError, UnicodeDecodeError) as error:
        raise InputError(f"{scene}: not a readable TOML file ({error})") from error
    except OSError as error:
        raise InputError(f"{scene}: cannot be read ({error.strerror})") from error
    panorama = document.get("panorama")
    if not isinstance(panorama, dict) or not isinstance(panorama.get("image"), str):
        raise InputError(f"{scene}: has no [panorama] table with an image; write one, then calibrate")
    if position is not None:
        panorama["position"] = _numbers(position)
    panorama["rotation"] = _numbers(rotation)
    with whole_file(scene) as temporary:
        text = tomlkit.dumps(document).rstrip("\r\n") + "\n"
        if "\r\n" in text:  # New lines end as the file's own do.
            text = text.replace("\r\n", "\n").replace("\n", "\r\n")
        temporary.write_bytes(text.encode("utf-8"))
    return scene.parent / panorama["image"]


def _numbers(values: Sequence[float]) -> list[float]:
    """Five decimals, which is finer than any calibration, and no negative zero."""
    return [round(float(value), 5) + 0.0 for value in values]

"""OpenUSD, .usd, .usda, .usdc and .usdz: meshes with their materials, posed and moved, turned to z up and metres.

What is here loads without the package; the rest of the reader is in the modules ``usd_*``.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from lightdepth.packages import optional_package
from lightdepth.scene.meshes.file_camera import FileCamera
from lightdepth.scene.meshes.part import MeshPart, Note

if TYPE_CHECKING:
    from lightdepth.scene.meshes.usd_reader import UsdReader

FORMATS = (".usd", ".usda", ".usdc", ".usdz")


def read_usd(path: Path, with_materials: bool, note: Note) -> list[MeshPart]:
    """Read a USD file at its first time code: one part for each material of each mesh that is shown.

    Raises:
        SetupError: the package ``usd-core`` is missing.
        InputError: the file is broken, incomplete, or has surfaces other than meshes.
    """
    return open_usd(path, with_materials, note).parts()


def open_usd(path: Path, with_materials: bool, note: Note) -> UsdReader:
    """Open a USD file, to read it at one time after the other.

    Raises:
        SetupError, InputError: as for :func:`read_usd`.
    """
    optional_package("pxr", "usd")
    from lightdepth.scene.meshes.usd_reader import UsdReader

    return UsdReader(path, with_materials, note)


def read_usd_camera(path: Path, name: str | None, animation: str | None, time: float, loop: bool) -> FileCamera:
    """A camera out of a USD file; see :func:`~lightdepth.scene.camera_file.read_camera`."""
    optional_package("pxr", "usd")
    from lightdepth.scene.meshes.usd_camera import read_camera

    return read_camera(path, name, animation, time, loop)

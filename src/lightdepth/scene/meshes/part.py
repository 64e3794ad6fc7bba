"""What the mesh readers return."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from lightdepth.scene.materials import Material
from lightdepth.scene.model import Mesh

Note = Callable[[str], None]
"""Called with what the file says that is left out or taken otherwise, one line without the file's name."""


@dataclass(frozen=True)
class MeshPart:
    """A mesh in the coordinates of its file, z up, metres, and the material that the file gives it with its name, if any.

    Its vertices and rest positions are float64 where the file's numbers are, until the mesh is placed.
    """

    mesh: Mesh
    material: Material | None = None
    material_name: str | None = None

"""What the mesh readers return."""

from __future__ import annotations

from dataclasses import dataclass

from lightdepth.scene.materials import Material
from lightdepth.scene.model import Mesh


@dataclass(frozen=True)
class MeshPart:
    """A mesh in the coordinates of its file, z up, metres, and the material that the file gives it, if any."""

    mesh: Mesh
    material: Material | None = None

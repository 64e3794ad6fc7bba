"""The scene file, meshes and materials: one validated Scene of plain data."""

from lightdepth.scene.load import load_scene
from lightdepth.scene.model import Scene

__all__ = ["Scene", "load_scene"]

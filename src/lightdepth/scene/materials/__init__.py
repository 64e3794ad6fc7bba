"""Materials of synthetic objects."""

from lightdepth.scene.materials.material import Material

__all__ = ["Material"]

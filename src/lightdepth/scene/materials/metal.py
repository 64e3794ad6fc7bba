"""Bare metals, by their measured index of refraction."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from lightdepth.scene.materials.material import Material, Plugin, two_sided

MetalName = Literal[
    "Ag", "Al", "Au", "Be", "Cr", "Cu", "Hg", "Ir", "K", "Li", "Mo", "Na_palik", "Nb", "Ni_palik", "Rh", "Ta",
    "V_palik", "VN", "TiN", "W", "none",
]  # fmt: skip


class Metal(Material):
    """A metal of Mitsuba's tables; ``none`` is a perfect mirror. GGX width is the square of ``roughness``."""

    type: Literal["metal"]
    name: MetalName = "Ag"
    roughness: float = Field(default=0.0, ge=0.0, le=1.0)

    def plugins(self) -> dict[str, Plugin]:  # noqa: D102
        if self.roughness == 0.0:
            return {"bsdf": two_sided({"type": "conductor", "material": self.name})}
        alpha = max(self.roughness**2, 1e-3)
        metal = {"type": "roughconductor", "material": self.name, "distribution": "ggx", "alpha": alpha}
        return {"bsdf": two_sided(metal)}

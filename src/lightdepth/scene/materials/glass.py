"""Clear glass and other transparent solids."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from lightdepth.scene.materials.material import Material, Plugin


class Glass(Material):
    """A dielectric in air with index of refraction ``ior``.

    A closed surface encloses a solid that bends light. With ``thin`` the surface is a pane by itself. GGX width is
    the square of ``roughness``.
    """

    type: Literal["glass"]
    ior: float = Field(default=1.5, gt=1.0, le=4.0)
    roughness: float = Field(default=0.0, ge=0.0, le=1.0)
    thin: bool = False

    @model_validator(mode="after")
    def _thin_is_smooth(self) -> Glass:
        if self.thin and self.roughness > 0.0:
            raise ValueError("thin glass is smooth: leave out roughness, or thin")
        return self

    def plugins(self) -> dict[str, Plugin]:  # noqa: D102
        if self.thin:
            return {"bsdf": {"type": "thindielectric", "int_ior": self.ior}}
        if self.roughness == 0.0:
            return {"bsdf": {"type": "dielectric", "int_ior": self.ior}}
        alpha = max(self.roughness**2, 1e-3)
        return {"bsdf": {"type": "roughdielectric", "distribution": "ggx", "int_ior": self.ior, "alpha": alpha}}

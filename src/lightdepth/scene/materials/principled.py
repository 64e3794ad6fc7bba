"""The all-round material: metallic-roughness, as in glTF, with transmission, clearcoat, emission and opacity."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from lightdepth.quantities import BRIGHTEST
from lightdepth.scene.materials.material import Material, Plugin, area_light, rgb, two_sided
from lightdepth.scene.materials.texture import Texture, VertexColors
from lightdepth.scene.materials.values import Colour, NormalMap, Radiance, Share


class Principled(Material):
    """A dielectric or a metal with a rough surface, as in glTF, below an optional lacquer.

    What transmits is Disney's principled BSDF (Burley 2015) as Mitsuba has it.

    Attributes:
        base_color: diffuse colour of a dielectric, reflection colour of a metal, tint of a transmitting body (where
            vertex colours go without their texture).
        metallic: 0 dielectric, 1 metal.
        roughness: GGX width is its square.
        specular: reflection of a dielectric at normal incidence, as a share of 8 %; 0.5 is F0 = 4 %.
        ior: index of refraction, which replaces ``specular``.
        transmission: share of the dielectric that lets light through instead of scattering it.
        thin: the surface is a pane by itself and does not bend light; else it encloses a solid.
        clearcoat: strength of a lacquer layer on top.
        clearcoat_roughness: roughness of that layer.
        emission: emitted radiance, multiplied by ``emission_strength``.
        opacity: 0 is a hole, 1 is there.
        normal_map: normals in tangent space.
    """

    type: Literal["principled"] = "principled"
    base_color: Colour = (0.8, 0.8, 0.8)
    metallic: Share = 0.0
    roughness: Share = 0.5
    specular: float = Field(default=0.5, ge=0.0, le=1.0)
    ior: float | None = Field(default=None, ge=1.0, le=4.0)
    transmission: Share = 0.0
    thin: bool = False
    clearcoat: Share = 0.0
    clearcoat_roughness: Share = 0.0
    emission: Radiance = (0.0, 0.0, 0.0)
    emission_strength: float = Field(default=1.0, ge=0.0)
    opacity: Share = 1.0
    normal_map: NormalMap | None = None

    @model_validator(mode="after")
    def _one_reflectivity(self) -> Principled:
        if self.ior is not None and "specular" in self.model_fields_set:
            raise ValueError("give specular or ior, not both")
        return self

    @model_validator(mode="after")
    def _possible_radiance(self) -> Principled:
        emission = self.emission
        brightest = float(emission.pixels.max(initial=0.0)) if isinstance(emission, Texture) else max(emission)
        if brightest * self.emission_strength > BRIGHTEST:
            raise ValueError(
                f"emission_strength {self.emission_strength:g} times emission, up to {brightest:g}, is too bright; "
                f"allowed is a product of up to {BRIGHTEST:g}"
            )
        return self

    @property
    def transmits(self) -> bool:
        """Whether light passes through."""
        return isinstance(self.transmission, Texture) or self.transmission > 0.0

    def plugins(self) -> dict[str, Plugin]:  # noqa: D102
        bsdf = self._body()
        if self.normal_map is not None:
            bsdf = {"type": "normalmap", "normalmap": self.normal_map, "bsdf": bsdf}
        if not self.transmits:
            bsdf = two_sided(bsdf)
        if isinstance(self.opacity, Texture) or self.opacity < 1.0:
            bsdf = {"type": "mask", "opacity": self.opacity, "bsdf": bsdf}
        if (radiance := self._emitted()) is None:
            return {"bsdf": bsdf}
        return {"bsdf": bsdf, "emitter": area_light(radiance)}

    def _body(self) -> Plugin:
        if not self.transmits:
            return self._opaque_body()
        if self.transmission == 1.0:
            return self._transmitting_body()
        return {
            "type": "blendbsdf",
            "weight": self.transmission,
            "opaque": self._opaque_body(),
            "transmitting": self._transmitting_body(),
        }

    def _opaque_body(self) -> Plugin:
        """The project's own BSDF, registered by ``kernel``."""
        bsdf: Plugin = {
            "type": "metallicroughness",
            "base_color": rgb(self.base_color),
            "metallic": self.metallic,
            "roughness": self.roughness,
            "f0": 0.08 * self.specular if self.ior is None else ((self.ior - 1.0) / (self.ior + 1.0)) ** 2,
        }
        if isinstance(self.base_color, VertexColors) and self.base_color.texture is not None:
            bsdf |= {"base_color": self.base_color.texture, "tint": VertexColors()}
        if isinstance(self.clearcoat, Texture) or self.clearcoat > 0.0:
            bsdf |= {"clearcoat": self.clearcoat, "clearcoat_roughness": self.clearcoat_roughness}
        return bsdf

    def _transmitting_body(self) -> Plugin:
        bsdf: Plugin = {"base_color": rgb(self.base_color), "roughness": self.roughness, "spec_trans": 1.0}
        if self.thin:
            return {**bsdf, "type": "principledthin", "eta": 1.5 if self.ior is None else self.ior}
        bsdf |= {"type": "principled", "metallic": self.metallic}
        return bsdf | ({"specular": self.specular} if self.ior is None else {"eta": self.ior})

    def _emitted(self) -> Any | None:
        """Radiance with its strength, or ``None`` where nothing shines."""
        if isinstance(self.emission, Texture):
            if self.emission_strength == 0.0 or not self.emission.pixels.any():
                return None
            pixels = self.emission.pixels.astype(np.float32) * np.float32(self.emission_strength)
            return Texture(pixels, self.emission.wrap, self.emission.nearest, self.emission.to_uv)
        radiance = tuple(self.emission_strength * channel for channel in self.emission)
        return radiance if any(radiance) else None

"""Materials of glTF 2.0 with its extensions.

Carried: base colour, metallic-roughness, normal (with scale) and emissive textures and factors, vertex colours, alpha
mask and blend, ``KHR_texture_transform``, ``KHR_materials_emissive_strength``, ``_transmission``, ``_ior``, ``_volume``
(whether a body is solid), ``_clearcoat`` (without normals of its own) and ``_specular`` (its strength). Occlusion is
left out, since light transport finds it by itself. ``doubleSided`` makes no difference: culled back faces would be
holes in shadows and mirrors, so reflecting surfaces are seen from both sides.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightdepth.scene.materials import Principled, Texture, VertexColors
from lightdepth.scene.meshes.gltf_file import GltfFile
from lightdepth.scene.meshes.gltf_texture import ALPHA, BLUE, GREEN, RED, GltfTextures, Info, texture_coordinate_set


class GltfMaterials:
    """The materials of one file, each made once."""

    def __init__(self, file: GltfFile) -> None:
        self._descriptions = file.header.get("materials", [])
        self._textures = GltfTextures(file)
        self._made: dict[tuple[int | None, bool, bool, bool], Principled] = {}

    def texture_coordinate_set(self, index: int | None) -> int:
        """Which ``TEXCOORD`` a material uses; where its textures differ, that of the base colour, else the first."""
        description = self._description(index)
        tables = [description.get("pbrMetallicRoughness", {}), description, *description.get("extensions", {}).values()]
        infos = [t[key] for t in tables for key in t if key.endswith("Texture") and key != "occlusionTexture"]
        return texture_coordinate_set(infos[0]) if infos else 0

    def base_color_factor(self, index: int | None) -> NDArray[np.float64]:
        """Linear red, green, blue and alpha that textures and vertex colours are multiplied by, shape (4,)."""
        surface = self._description(index).get("pbrMetallicRoughness", {})
        return np.clip(surface.get("baseColorFactor", [1.0, 1.0, 1.0, 1.0]), 0.0, 1.0)

    def transmits(self, index: int | None) -> bool:
        """Whether a material lets light through other than by its alpha."""
        return _transmits(self._description(index).get("extensions", {}))

    def principled(self, index: int | None, has_uv: bool, has_colors: bool, closed: bool) -> Principled:
        """A material for a mesh.

        Args:
            index: the material's number in the file; ``None`` is the default material.
            has_uv: whether the mesh has texture coordinates; without, textures are left out.
            has_colors: whether the mesh has vertex colours, which then carry the base colour's factor.
            closed: whether the mesh encloses a volume. A transmitting body whose file does not say by
                ``KHR_materials_volume`` whether it is solid is taken as solid if it does, else as a thin pane.
        """
        key = (index, has_uv, has_colors, closed)
        if key not in self._made:
            self._made[key] = self._principled(*key)
        return self._made[key]

    def _principled(self, index: int | None, has_uv: bool, has_colors: bool, closed: bool) -> Principled:
        description = self._description(index)
        surface = description.get("pbrMetallicRoughness", {})
        extensions = description.get("extensions", {})
        coat = extensions.get("KHR_materials_clearcoat", {})
        strength = extensions.get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0)

        def info(table: dict[str, Any], key: str) -> Info | None:
            return table.get(key) if has_uv else None

        def share(table: dict[str, Any], texture: str, channel: int, factor: str, default: float) -> Texture | float:
            number = float(np.clip(table.get(factor, default), 0.0, 1.0))
            image = info(table, texture)
            return number if image is None else self._textures.share(image, channel, number)

        settings: dict[str, Any] = {
            "base_color": self._base_color(info(surface, "baseColorTexture"), index, has_colors),
            "metallic": share(surface, "metallicRoughnessTexture", BLUE, "metallicFactor", 1.0),
            "roughness": share(surface, "metallicRoughnessTexture", GREEN, "roughnessFactor", 1.0),
            "opacity": self._opacity(info(surface, "baseColorTexture"), index),
            "clearcoat": share(coat, "clearcoatTexture", RED, "clearcoatFactor", 0.0),
            "clearcoat_roughness": share(coat, "clearcoatRoughnessTexture", GREEN, "clearcoatRoughnessFactor", 0.0),
            "emission": self._emission(info(description, "emissiveTexture"), description),
            "emission_strength": max(float(strength), 0.0),
            **_transmission(extensions, closed),
        }
        if _transmits(extensions):
            transmission = extensions["KHR_materials_transmission"]
            settings["transmission"] = share(transmission, "transmissionTexture", RED, "transmissionFactor", 0.0)
        if (normals := info(description, "normalTexture")) is not None:
            settings["normal_map"] = self._textures.normals(normals)
        return Principled(**settings)

    def _description(self, index: int | None) -> dict[str, Any]:
        description: dict[str, Any] = {} if index is None else self._descriptions[index]
        return description

    def _base_color(self, info: Info | None, index: int | None, has_colors: bool) -> Any:
        factor = self.base_color_factor(index)[:3].tolist()
        if has_colors:
            return VertexColors(None if info is None else self._textures.colour(info, (1.0, 1.0, 1.0)))
        return tuple(factor) if info is None else self._textures.colour(info, factor)

    def _opacity(self, info: Info | None, index: int | None) -> Texture | float:
        description, factor = self._description(index), float(self.base_color_factor(index)[ALPHA])
        match description.get("alphaMode", "OPAQUE"):
            case "BLEND":
                return factor if info is None else self._textures.share(info, ALPHA, factor)
            case "MASK":
                cutoff = float(description.get("alphaCutoff", 0.5))
                return float(factor >= cutoff) if info is None else self._textures.mask(info, factor, cutoff)
            case _:
                return 1.0

    def _emission(self, info: Info | None, description: dict[str, Any]) -> Any:
        factor = [max(float(channel), 0.0) for channel in description.get("emissiveFactor", (0.0, 0.0, 0.0))]
        if info is None or not any(factor):
            return tuple(factor)
        return self._textures.colour(info, factor)


def _transmits(extensions: dict[str, Any]) -> bool:
    return bool(extensions.get("KHR_materials_transmission", {}).get("transmissionFactor", 0.0) > 0.0)


def _transmission(extensions: dict[str, Any], closed: bool) -> dict[str, Any]:
    """Index of refraction, and for what transmits whether it is ``thin``."""
    ior = float(extensions.get("KHR_materials_ior", {}).get("ior", 1.5))
    ior = min(ior, 4.0) if ior >= 1.0 else 4.0  # 0 stands for an endless one in glTF.
    if _transmits(extensions):
        volume = extensions.get("KHR_materials_volume")
        thin = not closed if volume is None else volume.get("thicknessFactor", 0.0) == 0.0
        return {"ior": ior, "thin": thin}
    # KHR_materials_specular scales the reflection at normal incidence, F0, which the principled BSDF has as eta.
    strength = min(max(float(extensions.get("KHR_materials_specular", {}).get("specularFactor", 1.0)), 0.0), 1.0)
    root = math.sqrt(strength) * (ior - 1.0) / (ior + 1.0)
    return {"ior": (1.0 + root) / (1.0 - root)}

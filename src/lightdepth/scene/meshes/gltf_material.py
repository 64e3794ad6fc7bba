"""Materials of glTF 2.0 with its extensions.

Carried: base colour, metallic-roughness, normal (with scale) and emissive textures and factors, vertex colours, alpha
mask and blend, ``KHR_texture_transform``, ``KHR_materials_emissive_strength``, ``_transmission``, ``_ior``, ``_volume``
(whether a body is solid), ``_clearcoat`` (without normals of its own), ``_specular`` (its strength), ``_unlit`` (as
what it looks like in light) and ``_pbrSpecularGlossiness``. What else a material says is noted. Occlusion is left out,
since light transport finds it by itself. ``doubleSided`` makes no difference: culled back faces would be holes in
shadows and mirrors, so reflecting surfaces are seen from both sides.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError
from lightdepth.quantities import BRIGHTEST
from lightdepth.scene.materials import Principled, Texture, VertexColors
from lightdepth.scene.meshes.gltf_file import GltfFile
from lightdepth.scene.meshes.gltf_schema import (
    MaterialEntry,
    MaterialExtensions,
    MetallicRoughness,
    Quadruple,
    SpecularGlossiness,
    TextureInfo,
)
from lightdepth.scene.meshes.gltf_texture import ALPHA, BLUE, GREEN, RED, GltfTextures
from lightdepth.scene.meshes.part import Note

_METAL = 0.2
"""Reflection at normal incidence from which on a specular-glossiness material without diffuse colour is a metal."""
_LARGEST_IOR = 4.0


class GltfMaterials:
    """The materials of one file, each made once."""

    def __init__(self, file: GltfFile, note: Note) -> None:
        self._file = file
        self._note = note
        self._textures = GltfTextures(file, note)
        self._made: dict[tuple[int | None, bool, bool, bool], Principled] = {}

    def texture_coordinate_set(self, index: int | None) -> int:
        """Which ``TEXCOORD`` a material uses; where its textures differ, that of the base colour, else the first."""
        infos = [info for info in _infos(self._entry(index)) if info is not None]
        if len({info.coordinate_set for info in infos}) > 1:
            self._note(
                f"{self._name(index)} uses several sets of texture coordinates; all its textures are laid by TEXCOORD_"
                f"{infos[0].coordinate_set}"
            )
        return infos[0].coordinate_set if infos else 0

    def base_color_factor(self, index: int | None) -> NDArray[np.float64]:
        """Linear red, green, blue and alpha that textures and vertex colours are multiplied by, shape (4,)."""
        if index is None:
            return np.ones(4)
        return np.clip(_diffuse(self._entry(index))[0], 0.0, 1.0)

    def transmits(self, index: int | None) -> bool:
        """Whether a material lets light through other than by its alpha."""
        return _transmits(self._entry(index).extensions)

    def shows_alpha(self, index: int | None) -> bool:
        """Whether alpha has a meaning in a material."""
        return self._entry(index).alpha_mode in ("BLEND", "MASK")

    def principled(self, index: int | None, has_uv: bool, has_colors: bool, closed: bool) -> Principled:
        """A material for a mesh.

        Args:
            index: the material's number in the file; without one it is ``Principled()``, as for all mesh files.
            has_uv: whether the mesh has texture coordinates; without, textures are left out.
            has_colors: whether the mesh has vertex colours, which then carry the base colour's factor.
            closed: whether the mesh encloses a volume. A transmitting body whose file does not say by
                ``KHR_materials_volume`` whether it is solid is taken as solid if it does, else as a thin pane.
        """
        key = (index, has_uv, has_colors, closed)
        if key not in self._made:
            if index is None:
                self._made[key] = Principled(base_color=VertexColors()) if has_colors else Principled()
            else:
                self._made[key] = self._principled(index, has_uv, has_colors, closed)
        return self._made[key]

    def name(self, index: int | None) -> str | None:
        """What the file calls a material, else its number; ``None`` without a material."""
        return None if index is None else self._entry(index).name or f"material_{index}"

    def _principled(self, index: int, has_uv: bool, has_colors: bool, closed: bool) -> Principled:
        entry = self._entry(index)
        extensions, coat = entry.extensions, entry.extensions.KHR_materials_clearcoat
        self._note_what_is_left_out(index, entry, has_uv)

        def info(texture: TextureInfo | None) -> TextureInfo | None:
            return texture if has_uv else None

        factor, diffuse = _diffuse(entry)
        settings: dict[str, Any] = {
            "base_color": self._base_color(info(diffuse), factor, has_colors),
            "opacity": self._opacity(info(diffuse), entry, factor),
            "clearcoat": self._share(info(coat.clearcoat_texture), RED, coat.clearcoat_factor),
            "clearcoat_roughness": self._share(
                info(coat.clearcoat_roughness_texture), GREEN, coat.clearcoat_roughness_factor
            ),
            "emission": self._emission(info(entry.emissive_texture), entry.emissive_factor),
            "emission_strength": max(extensions.KHR_materials_emissive_strength.emissive_strength, 0.0),
            **_transmission(extensions, closed),
            **self._reflection(index, entry, has_uv),
        }
        if _transmits(extensions):
            transmission = extensions.KHR_materials_transmission
            settings["transmission"] = self._share(
                info(transmission.transmission_texture), RED, transmission.transmission_factor
            )
        if (normals := info(entry.normal_texture)) is not None:
            settings["normal_map"] = self._textures.normals(normals)
        brightest = max(entry.emissive_factor) * settings["emission_strength"]
        if brightest > BRIGHTEST:
            raise InputError(
                f"{self._file.path}: {self._name(index)}: emissiveFactor times emissiveStrength is {brightest:.3g}; "
                f"allowed are up to {BRIGHTEST:g}"
            )
        return Principled(**settings)

    def _entry(self, index: int | None) -> MaterialEntry:
        if index is None:
            return MaterialEntry()
        return self._file.entry(self._file.header.materials, index, "material")

    def _name(self, index: int | None) -> str:
        name = self._entry(index).name
        return f"material {index}" + (f" ('{name[:40]}')" if name else "")

    def _share(self, info: TextureInfo | None, channel: int, factor: float) -> Texture | float:
        number = min(max(factor, 0.0), 1.0)
        return number if info is None else self._textures.share(info, channel, number)

    def _reflection(self, index: int, entry: MaterialEntry, has_uv: bool) -> dict[str, Any]:
        """Metalness and roughness, and the index of refraction where a specular-glossiness material says it."""
        gloss, pbr = entry.extensions.KHR_materials_pbrSpecularGlossiness, _metallic_roughness(entry)
        if gloss is not None:
            return self._specular_glossiness(index, gloss, has_uv)
        info = pbr.metallic_roughness_texture if has_uv else None
        if entry.extensions.KHR_materials_unlit is not None:
            self._note(f"{self._name(index)} is unlit; it is lit here like all else, as a dielectric of its colour")
            roughness = pbr.roughness_factor if "roughness_factor" in pbr.model_fields_set else 0.5
            return {"metallic": 0.0, "roughness": min(max(roughness, 0.0), 1.0)}
        return {
            "metallic": self._share(info, BLUE, pbr.metallic_factor),
            "roughness": self._share(info, GREEN, pbr.roughness_factor),
        }

    def _specular_glossiness(self, index: int, gloss: SpecularGlossiness, has_uv: bool) -> dict[str, Any]:
        """A dielectric of the diffuse colour, or a metal of the specular colour where there is no diffuse one."""
        info = gloss.specular_glossiness_texture if has_uv else None
        factor = np.clip(gloss.specular_factor, 0.0, 1.0)
        glossiness = min(max(gloss.glossiness_factor, 0.0), 1.0)
        roughness: Any = 1.0 - glossiness
        if info is not None:
            roughness = self._textures.complement(info, ALPHA, glossiness)
            specular = self._textures.mean_colour(info) * factor
        elif "specular_factor" in gloss.model_fields_set:
            specular = factor
        else:
            self._note(f"{self._name(index)} does not say its specular colour; it is a dielectric here, not a mirror")
            specular = np.full(3, 0.04)
        reflection = float(specular.mean())
        black = not any(channel > 0.02 for channel in gloss.diffuse_factor[:3])
        if reflection > _METAL and black and gloss.diffuse_texture is None:
            return {"base_color": tuple(specular.tolist()), "metallic": 1.0, "roughness": roughness, "ior": 1.5}
        if reflection > _METAL:
            self._note(
                f"{self._name(index)} reflects {100 * reflection:.0f} % at normal incidence by its specular colour, as "
                "metals do; its diffuse colour is used, with the reflection of a dielectric"
            )
        root = math.sqrt(min(reflection, 0.36))
        return {"metallic": 0.0, "roughness": roughness, "ior": min((1.0 + root) / (1.0 - root), _LARGEST_IOR)}

    def _base_color(self, info: TextureInfo | None, factor: Quadruple, has_colors: bool) -> Any:
        red, green, blue = np.clip(factor[:3], 0.0, 1.0).tolist()
        if has_colors:
            return VertexColors(None if info is None else self._textures.colour(info, (1.0, 1.0, 1.0)))
        return (red, green, blue) if info is None else self._textures.colour(info, (red, green, blue))

    def _opacity(self, info: TextureInfo | None, entry: MaterialEntry, colour: Quadruple) -> Texture | float:
        factor = min(max(colour[ALPHA], 0.0), 1.0)
        match entry.alpha_mode:
            case "BLEND":
                return factor if info is None else self._textures.share(info, ALPHA, factor)
            case "MASK":
                cutoff = entry.alpha_cutoff
                return float(factor >= cutoff) if info is None else self._textures.mask(info, factor, cutoff)
            case _:
                return 1.0

    def _emission(self, info: TextureInfo | None, colour: tuple[float, float, float]) -> Any:
        factor = tuple(max(channel, 0.0) for channel in colour)
        if info is None or not any(factor):
            return factor
        return self._textures.colour(info, factor)

    def _note_what_is_left_out(self, index: int, entry: MaterialEntry, has_uv: bool) -> None:
        """Name what a material says and what is not carried."""
        name, extensions = self._name(index), entry.extensions
        if not has_uv and any(info is not None for info in _infos(entry)):
            self._note(f"textures of {name} are left out where a mesh has no texture coordinates to lay them by")
        specular, volume = extensions.KHR_materials_specular, extensions.KHR_materials_volume
        if specular.specular_texture or specular.specular_color_texture or set(specular.specular_color_factor) != {1.0}:
            self._note(f"{name}: of KHR_materials_specular only the strength is used")
        if extensions.KHR_materials_clearcoat.clearcoat_normal_texture is not None:
            self._note(f"{name}: the normals of its clearcoat are left out")
        distance = None if volume is None else volume.attenuation_distance
        if volume is not None and distance and math.isfinite(distance) and set(volume.attenuation_color) != {1.0}:
            self._note(f"{name}: the attenuation within its volume is left out")


def _infos(entry: MaterialEntry) -> list[TextureInfo | None]:
    """The textures of a material that are used, that of the base colour first."""
    extensions, pbr = entry.extensions, _metallic_roughness(entry)
    coat, gloss = extensions.KHR_materials_clearcoat, extensions.KHR_materials_pbrSpecularGlossiness
    surface = (
        [pbr.base_color_texture, pbr.metallic_roughness_texture]
        if gloss is None
        else [gloss.diffuse_texture, gloss.specular_glossiness_texture]
    )
    return [
        info
        for info in (
            *surface,
            entry.normal_texture,
            entry.emissive_texture,
            coat.clearcoat_texture,
            coat.clearcoat_roughness_texture,
            extensions.KHR_materials_transmission.transmission_texture,
        )
        if info is not None
    ]


def _metallic_roughness(entry: MaterialEntry) -> MetallicRoughness:
    return entry.pbr_metallic_roughness or MetallicRoughness()


def _diffuse(entry: MaterialEntry) -> tuple[Quadruple, TextureInfo | None]:
    """Factor and texture of the base colour."""
    gloss, pbr = entry.extensions.KHR_materials_pbrSpecularGlossiness, _metallic_roughness(entry)
    if gloss is not None:
        return gloss.diffuse_factor, gloss.diffuse_texture
    return pbr.base_color_factor, pbr.base_color_texture


def _transmits(extensions: MaterialExtensions) -> bool:
    return extensions.KHR_materials_transmission.transmission_factor > 0.0


def _transmission(extensions: MaterialExtensions, closed: bool) -> dict[str, Any]:
    """Index of refraction, and for what transmits whether it is ``thin``."""
    ior = extensions.KHR_materials_ior.ior
    ior = min(ior, _LARGEST_IOR) if ior >= 1.0 else _LARGEST_IOR  # 0 stands for an endless one in glTF.
    if _transmits(extensions):
        volume = extensions.KHR_materials_volume
        thin = not closed if volume is None else volume.thickness_factor == 0.0
        return {"ior": ior, "thin": thin}
    # KHR_materials_specular scales the reflection at normal incidence, F0, which the principled BSDF has as eta.
    strength = min(max(extensions.KHR_materials_specular.specular_factor, 0.0), 1.0)
    root = math.sqrt(strength) * (ior - 1.0) / (ior + 1.0)
    return {"ior": (1.0 + root) / (1.0 - root)}

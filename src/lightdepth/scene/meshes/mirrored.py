"""Normal maps on faces whose texture is mirrored."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lightdepth.scene.materials import Principled, Texture
from lightdepth.scene.model import Mesh, SyntheticPart


def split_mirrored(part: SyntheticPart) -> list[SyntheticPart]:
    """The part with its mirrored faces set apart, where it has a normal map.

    Mitsuba takes the tangent along u and the bitangent as normal x tangent, so that y of the normal map would point
    the wrong way where the texture is mirrored on the surface: there the map is used with y negated.
    """
    mesh, material = part.geometry, part.material
    if not isinstance(mesh, Mesh) or mesh.texture_coordinates is None:
        return [part]
    if not isinstance(material, Principled) or material.normal_map is None:
        return [part]
    mirrored = _signed_texture_areas(mesh) < 0.0
    if not mirrored.any():
        return [part]
    turned = material.model_copy(update={"normal_map": _with_y_turned(material.normal_map)})
    pieces = [(~mirrored, material), (mirrored, turned)]
    return [
        replace(part, geometry=replace(mesh, faces=mesh.faces[which]), material=m) for which, m in pieces if which.any()
    ]


def _signed_texture_areas(mesh: Mesh) -> np.ndarray:
    """Twice the area of each face in the texture, shape (m,), negative where it lies there the other way round."""
    assert mesh.texture_coordinates is not None
    a, b, c = (mesh.texture_coordinates[mesh.faces[:, corner]].astype(np.float64) for corner in range(3))
    (bu, bv), (cu, cv) = (b - a).T, (c - a).T
    areas: np.ndarray = bu * cv - bv * cu
    return areas


def _with_y_turned(normal_map: Texture) -> Texture:
    pixels = normal_map.pixels.copy()
    pixels[:, :, 1] = 1.0 - pixels[:, :, 1]
    return replace(normal_map, pixels=pixels)

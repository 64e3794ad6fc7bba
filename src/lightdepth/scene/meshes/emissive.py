"""Emission textures on meshes of which only a part shines."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lightdepth.scene.materials import Principled, Texture
from lightdepth.scene.model import Mesh, SyntheticPart


def split_emissive(part: SyntheticPart) -> list[SyntheticPart]:
    """The part with the faces that shine set apart, where its emission is a texture.

    An area light is sampled all over its surface; so a bottle with a small glowing sign would be a poor lamp.
    """
    mesh, material = part.geometry, part.material
    if not isinstance(mesh, Mesh) or mesh.texture_coordinates is None:
        return [part]
    if not isinstance(material, Principled) or not isinstance(material.emission, Texture):
        return [part]
    shines = _touches_light(mesh.texture_coordinates, mesh.faces, material.emission)
    dark = material.model_copy(update={"emission": (0.0, 0.0, 0.0)})
    pieces = [(shines, material), (~shines, dark)]
    return [
        replace(part, geometry=replace(mesh, faces=mesh.faces[which]), material=m) for which, m in pieces if which.any()
    ]


def _touches_light(
    texture_coordinates: NDArray[np.float32], faces: NDArray[np.int32], emission: Texture
) -> NDArray[np.bool_]:
    """Faces whose box in the texture has a texel that is not black, shape (m,).

    Boxes are a texel wider on each side, for interpolation. Along an axis on which one spans more than the whole
    texture, or leaves a texture that is not repeated, it is taken to be as long as the texture.
    """
    bright = emission.pixels.any(axis=2)
    block = 8 if not any(n % 8 for n in bright.shape) else 1  # Blocks of texels make a small table.
    bright = bright.reshape(bright.shape[0] // block, block, bright.shape[1] // block, block).any(axis=(1, 3))
    size = np.array(bright.shape[::-1])
    u, v = texture_coordinates.T.astype(np.float64)
    texels = (np.stack([u, 1.0 - v, np.ones_like(u)], axis=1) @ emission.to_uv.T)[:, :2] * (size * block)
    corners = texels[faces]
    low = np.floor((corners.min(axis=1) - 1.0) / block).astype(np.int64)
    high = np.ceil((corners.max(axis=1) + 1.0) / block).astype(np.int64)
    whole = high - low > size
    if emission.wrap != "repeat":
        whole |= (low < -1) | (high > size + 1)
    first_tile = low - low % size
    low, high = np.where(whole, 0, low - first_tile), np.where(whole, size, high - first_tile)
    # A table of sums over two by two repetitions gives the number of bright blocks in any box.
    sums = np.pad(np.tile(bright, (2, 2)).cumsum(axis=0, dtype=np.int64).cumsum(axis=1), ((1, 0), (1, 0)))
    (x0, y0), (x1, y1) = low.T, high.T
    shines: NDArray[np.bool_] = sums[y1, x1] - sums[y0, x1] - sums[y1, x0] + sums[y0, x0] > 0
    return shines

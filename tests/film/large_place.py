"""A large procedural place on disk, for measurements of memory and time through the real command."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

from lightdepth.directions import latlong_to_direction
from lightdepth.images.radiance import write_radiance

SCENE = """
[panorama]
image = "large.exr"
position = [0.0, 0.0, 1.5]

[[real]]
name = "room"
mesh = "room.ply"
role = "support"

[[real]]
name = "ceiling"
mesh = "ceiling.ply"
role = "{ceiling}"

[[synthetic]]
name = "ball"
shape = "sphere"
center = [0.5, 1.5, 0.4]
radius = 0.4
material = {{ type = "metal", name = "Ag", roughness = 0.2 }}

[[synthetic]]
name = "block"
shape = "cube"
position = [-1.0, 1.0, 0.25]
rotation = [0.0, 0.0, 30.0]
scale = 0.25
material = {{ type = "diffuse", color = [0.7, 0.3, 0.2] }}
"""


def write_large_place(folder: Path, width: int, ceiling: str = "support") -> Path:
    """Write a box room that is support, with a panorama of the given width; the scene file is returned.

    Args:
        folder: where to write.
        width: of the panorama.
        ceiling: the ceiling's role; as environment, its pixels are not sampled.
    """
    radiance = np.empty((width // 2, width, 3), np.float32)
    for top in range(0, width // 2, 64):
        v = (np.arange(top, min(top + 64, width // 2))[:, None] + 0.5) / (width // 2)
        rows = latlong_to_direction(*np.broadcast_arrays((np.arange(width) + 0.5) / width, v))
        stripes = 0.4 + 0.1 * np.sin(40.0 * rows[..., :1]) * np.sin(40.0 * rows[..., 1:2])
        radiance[top : top + 64] = stripes * [1.0, 0.9, 0.8]
        radiance[top : top + 64][rows @ [0.3, 0.4, 0.866] > 0.99] = [300.0, 280.0, 250.0]
    write_radiance(folder / "large.exr", radiance)
    box = trimesh.creation.box(bounds=[[-3.0, -3.0, 0.0], [3.0, 3.0, 2.8]])
    box.invert()
    above = np.all(box.triangles_center[:, 2:] > 2.7, axis=1)
    for name, faces in (("room", ~above), ("ceiling", above)):
        trimesh.Trimesh(box.vertices, box.faces[faces]).export(folder / f"{name}.ply")
    (folder / "scene.toml").write_text(SCENE.format(ceiling=ceiling))
    return folder / "scene.toml"

"""Draw the edges of the modelled room over the panorama, to see how well they fit.

Usage: `python examples/lounge/overlay.py [OUT.png]`; the picture goes to `out/demo/overlay.png` by default.
"""

from __future__ import annotations

import itertools
import sys
import tomllib
from pathlib import Path

import cv2
import numpy as np
import trimesh

from lightdepth.directions import direction_to_latlong, euler_rotation
from lightdepth.images.radiance import read_radiance

HERE = Path(__file__).parent
WIDTH = 4096
COLORS = ((80, 220, 255), (90, 255, 90), (255, 160, 60), (255, 90, 255), (60, 60, 255), (255, 255, 80))


def crease_edges(mesh: trimesh.Trimesh) -> np.ndarray:
    """Edges where a mesh ends or bends by more than 20 degrees, shape (n, 2, 3)."""
    mesh.merge_vertices()
    bent = mesh.face_adjacency_edges[mesh.face_adjacency_angles > np.radians(20)]
    border = mesh.edges_sorted[trimesh.grouping.group_rows(mesh.edges_sorted, require_count=1)]
    return mesh.vertices[np.concatenate([bent, border])]


def main() -> None:
    """Write the picture."""
    output = Path(sys.argv[1]) if len(sys.argv) > 1 else HERE.parents[1] / "out/demo/overlay.png"
    scene = tomllib.loads((HERE / "scene.toml").read_text())
    to_light = euler_rotation(scene["panorama"]["rotation"]).T
    radiance = read_radiance(HERE / scene["panorama"]["image"])
    exposed = np.clip(radiance * (0.4 / np.median(radiance)), 0, 4)
    picture = (255 * np.clip(exposed / (1 + 0.3 * exposed), 0, 1) ** (1 / 2.2)).astype(np.uint8)[:, :, ::-1]
    picture = cv2.resize(picture, (WIDTH, WIDTH // 2), interpolation=cv2.INTER_CUBIC)
    for index, real in enumerate(scene["real"]):
        for start, end in crease_edges(trimesh.load(HERE / real["mesh"], force="mesh")):
            points = np.linspace(start, end, 200) - scene["panorama"]["position"]
            u, v = direction_to_latlong(points @ to_light.T)
            pixels = np.stack([u * WIDTH, v * WIDTH / 2], axis=1)
            for a, b in itertools.pairwise(pixels):
                if abs(a[0] - b[0]) < WIDTH / 2:
                    cv2.line(
                        picture, tuple(a.astype(int)), tuple(b.astype(int)), COLORS[index % len(COLORS)], 1, cv2.LINE_AA
                    )
    output.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(output), picture)
    print(output)


if __name__ == "__main__":
    main()

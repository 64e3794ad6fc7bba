"""Make the vase of the example: a turned walnut vase with a brass ring and bare branches, as textured glTF.

The wood is a solid texture (growth rings around an axis a little beside the vase's own) evaluated where the surface
is, so that the grain runs through the shape as it does on a lathe; tool marks and pores make the normal map.

Usage: `python examples/lounge/model_vase.py` writes `vase.glb` beside this file.
"""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray
from PIL import Image
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.ndimage import gaussian_filter, map_coordinates
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

OUTPUT = Path(__file__).with_name("vase.glb")
TEXTURE = (512, 1024)  # rows along the profile, columns around it
Array = NDArray[np.float64]

# The profile from the middle of the foot, up the outside, over the lip and down inside: radius and height in metres.
PROFILE = np.array(
    [
        (0.000, 0.000), (0.058, 0.000), (0.064, 0.004), (0.066, 0.012), (0.060, 0.022), (0.064, 0.040),
        (0.092, 0.095), (0.112, 0.160), (0.115, 0.205), (0.104, 0.260), (0.078, 0.318), (0.052, 0.362),
        (0.042, 0.395), (0.044, 0.415), (0.056, 0.440), (0.0585, 0.445), (0.056, 0.447), (0.050, 0.440),
        (0.037, 0.412), (0.035, 0.390), (0.042, 0.360), (0.066, 0.312), (0.080, 0.260),
    ]
)  # fmt: skip
RING = (0.384, 0.402)  # heights between which the brass ring sits, metres


def profile(count: int) -> tuple[Array, Array]:
    """Radius and height at `count` points, evenly spaced along the profile."""
    lengths = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(PROFILE, axis=0), axis=1))])
    along = np.linspace(0, lengths[-1], count)
    return PchipInterpolator(lengths, PROFILE[:, 0])(along), PchipInterpolator(lengths, PROFILE[:, 1])(along)


def noise(points: Array, frequency: float, generator: np.random.Generator) -> Array:
    """Smooth solid noise of about unit variance at points of shape (..., 3); `frequency` in cells per metre."""
    lattice = generator.standard_normal((48, 48, 48))
    return map_coordinates(lattice, np.moveaxis(points * frequency, -1, 0), order=3, mode="grid-wrap")


def wood(generator: np.random.Generator) -> tuple[Image.Image, Image.Image, Image.Image]:
    """Base colour, normal map and (roughness in green, metallic in blue) of the wood, over `TEXTURE`."""
    rows, columns = TEXTURE
    radius, height = profile(rows)
    angle = 2 * np.pi * (np.arange(columns) + 0.5) / columns
    x, y = radius[:, None] * np.cos(angle), radius[:, None] * np.sin(angle)
    z = np.broadcast_to(height[:, None], x.shape)
    points = np.stack([x, y, z], axis=-1)

    along_grain = points * [1, 1, 0.12]
    wander = 0.006 * noise(along_grain, 14, generator) + 0.0015 * noise(along_grain, 60, generator)
    trunk = np.hypot(x - 0.05 + 0.08 * z, y + 0.07 - 0.05 * z) + wander
    ring = trunk / 0.0075 % 1.0
    late_wood = np.clip((ring - 0.45) / 0.5, 0, 1) ** 2 * (ring < 0.97)
    fibre = noise(points * [1, 1, 0.03], 900, generator)
    pores = np.clip(noise(points * [1, 1, 0.05], 700, generator) - 1.3, 0, 1)
    tone = np.clip(0.30 + 0.6 * late_wood + 0.08 * fibre + 0.15 * noise(along_grain, 25, generator), 0, 1)[..., None]
    light, dark = np.array([0.36, 0.19, 0.10]), np.array([0.09, 0.045, 0.025])
    color = (light + (dark - light) * tone) * (1 - 0.6 * pores[..., None])

    grooves = 0.5 * gaussian_filter(generator.standard_normal(rows), 1.2)[:, None]
    relief = grooves - 0.8 * late_wood * 0.3 - 1.2 * pores
    slope_v, slope_u = np.gradient(relief)
    normal = np.stack([-0.35 * slope_u, 0.35 * slope_v, np.ones_like(relief)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)

    roughness = np.clip(0.32 + 0.10 * tone[..., 0] + 0.3 * pores, 0, 1)
    surface = np.stack([np.ones_like(roughness), roughness, np.zeros_like(roughness)], axis=-1)
    return _image(color ** (1 / 2.2)), _image(0.5 * normal + 0.5), _image(surface)


def _image(values: Array) -> Image.Image:
    """The values in [0, 1] as a JPEG image, which keeps the file small."""
    data = io.BytesIO()
    Image.fromarray((255 * np.clip(values, 0, 1) + 0.5).astype(np.uint8)).save(data, "JPEG", quality=92, subsampling=0)
    return Image.open(data)


def lathe(radius: Array, height: Array, around: int, material: PBRMaterial) -> trimesh.Trimesh:
    """Surface of revolution about z; texture u runs around, v down the profile (the image's first row comes first)."""
    angle = np.linspace(0, 2 * np.pi, around + 1)
    rings = len(radius)
    vertices = np.stack(
        [radius[:, None] * np.cos(angle), radius[:, None] * np.sin(angle), height[:, None] + 0 * angle], axis=-1
    )
    u, v = np.meshgrid(angle / (2 * np.pi), 1 - np.linspace(0, 1, rings))
    corner = (np.arange(rings - 1)[:, None] * (around + 1) + np.arange(around)).ravel()
    below, above = np.stack([corner, corner + 1], 1), np.stack([corner, corner + 1], 1) + around + 1
    faces = np.concatenate([np.c_[below, above[:, 1]], np.c_[below[:, :1], above[:, ::-1]]])
    tangent = np.stack([np.gradient(radius), np.gradient(height)], axis=1)
    outward = np.stack([tangent[:, 1], -tangent[:, 0]], axis=1) / np.linalg.norm(tangent, axis=1, keepdims=True)
    normals = np.stack(
        [outward[:, :1] * np.cos(angle), outward[:, :1] * np.sin(angle), outward[:, 1:] + 0 * angle], axis=-1
    )
    return trimesh.Trimesh(
        vertices.reshape(-1, 3),
        faces,
        vertex_normals=normals.reshape(-1, 3),
        visual=TextureVisuals(uv=np.stack([u, v], axis=-1).reshape(-1, 2), material=material),
        process=False,
    )


def ring(material: PBRMaterial) -> trimesh.Trimesh:
    """The brass ring around the neck."""
    radius, height = profile(2000)
    outside = slice(0, int(np.argmax(height)))
    low, high = RING
    z = np.linspace(low, high, 13)
    bulge = 0.0035 * np.sqrt(np.clip(1 - ((z - 0.5 * (low + high)) / (0.5 * (high - low))) ** 2, 0, 1))
    return lathe(np.interp(z, height[outside], radius[outside]) + bulge, z, 72, material)


def branch(generator: np.random.Generator, lean: float, length: float, material: PBRMaterial) -> list[trimesh.Trimesh]:
    """A bare branch that stands in the vase, leaning toward the angle `lean`, with twigs."""
    knots = np.linspace(0, 1, 6)
    outward = 0.02 + (0.05 + 0.16 * generator.random()) * knots**1.7
    path = np.stack([outward * np.cos(lean), outward * np.sin(lean), 0.02 + length * knots], axis=1)
    path[2:] += 0.012 * generator.standard_normal((4, 3))
    path[0] = [0.02 * np.cos(lean + np.pi), 0.02 * np.sin(lean + np.pi), 0.03]
    curve = CubicSpline(knots, path)
    parts = [tube(curve(np.linspace(0, 1, 30)), 0.0042, 0.0012, material)]
    for start in (0.55, 0.68, 0.8, 0.9):
        side = generator.standard_normal(3) * [0.6, 0.6, 0.1] + [0, 0, 0.9]
        reach = (0.05 + 0.10 * generator.random()) * side / np.linalg.norm(side)
        t = np.linspace(0, 1, 8)[:, None]
        parts.append(tube(curve(start) + t * reach + 0.012 * t * (1 - t) * [0, 0, -1], 0.0018, 0.0007, material))
    return parts


def tube(path: Array, thick: float, thin: float, material: PBRMaterial, around: int = 7) -> trimesh.Trimesh:
    """Tapered round tube along a path of shape (n, 3); radii in metres, with a closed tip."""
    forward = np.gradient(path, axis=0)
    forward /= np.linalg.norm(forward, axis=1, keepdims=True)
    side = np.cross(forward, [0.31, 0.95, 0.02])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    other = np.cross(forward, side)
    angle = 2 * np.pi * np.arange(around) / around
    outward = side[:, None] * np.cos(angle)[:, None] + other[:, None] * np.sin(angle)[:, None]
    radius = np.linspace(thick, thin, len(path))[:, None, None]
    vertices = np.concatenate([(path[:, None] + radius * outward).reshape(-1, 3), path[-1:] + 0.002 * forward[-1:]])
    normals = np.concatenate([outward.reshape(-1, 3), forward[-1:]])
    start = np.arange(len(path) - 1)[:, None] * around
    here, after = start + np.arange(around), start + (np.arange(around) + 1) % around
    faces = [np.stack([here, after, after + around], -1), np.stack([here, after + around, here + around], -1)]
    last = (len(path) - 1) * around
    tip = np.stack(
        [last + np.arange(around), last + (np.arange(around) + 1) % around, np.full(around, len(vertices) - 1)], -1
    )
    return trimesh.Trimesh(
        vertices,
        np.concatenate([*(f.reshape(-1, 3) for f in faces), tip]),
        vertex_normals=normals,
        visual=TextureVisuals(material=material),
        process=False,
    )


def main() -> None:
    """Write the vase; glTF is y-up, so the whole stands on a node that turns it."""
    generator = np.random.default_rng(7)
    color, normal, surface = wood(generator)
    walnut = PBRMaterial(
        name="walnut",
        baseColorTexture=color,
        normalTexture=normal,
        metallicRoughnessTexture=surface,
        metallicFactor=1.0,
        roughnessFactor=1.0,
    )
    brass = PBRMaterial(name="brass", baseColorFactor=[0.80, 0.58, 0.28, 1.0], metallicFactor=1.0, roughnessFactor=0.22)
    bark = PBRMaterial(name="bark", baseColorFactor=[0.16, 0.11, 0.08, 1.0], metallicFactor=0.0, roughnessFactor=0.8)
    branches = [
        part
        for lean, length in ((0.3, 0.90), (1.7, 0.78), (2.9, 0.86), (4.1, 0.72), (5.3, 0.82))
        for part in branch(generator, lean, length, bark)
    ]
    upright = trimesh.transformations.rotation_matrix(-np.pi / 2, [1, 0, 0])
    scene = trimesh.Scene()
    radius, height = profile(120)
    for name, mesh in (
        ("vase", lathe(radius, height, 72, walnut)),
        ("ring", ring(brass)),
        ("branches", trimesh.util.concatenate(branches)),
    ):
        scene.add_geometry(mesh, node_name=name, geom_name=name, transform=upright)
    OUTPUT.write_bytes(scene.export(file_type="glb"))
    print(
        f"{OUTPUT.name}: {sum(len(m.faces) for m in scene.geometry.values())} triangles, {OUTPUT.stat().st_size} bytes"
    )


if __name__ == "__main__":
    main()

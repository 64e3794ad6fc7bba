"""A camera for tests: photographs of a known HDR panorama, with what real photographs suffer from."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from lightdepth.directions import direction_to_latlong, euler_rotation, pixel_directions

PAPER_RIG = [(0, 0), (72, 0), (144, 0), (216, 0), (288, 0), (0, 90), (0, -90)]
"""Yaw (to the right) and pitch (up) in degrees: five around, zenith, nadir."""


def rig_rotation(yaw: float, pitch: float, roll: float = 0.0) -> np.ndarray:
    """Camera space (x right, y forward, z up) to light space; yaw to the right, pitch up, roll about the axis."""
    return euler_rotation([0, 0, -yaw]) @ euler_rotation([pitch, 0, 0]) @ euler_rotation([0, roll, 0])


def film_curve(linear: np.ndarray) -> np.ndarray:
    """A response that is neither a power nor sRGB: a gamma of 2.2 under an S-shaped contrast curve."""
    encoded = np.clip(linear, 0, 1) ** (1 / 2.2)
    return encoded + 0.35 * encoded * (1 - encoded) * (encoded - 0.35)


@dataclass(frozen=True)
class TestCamera:
    """A circular fisheye or rectilinear camera.

    Attributes:
        size: width and height of the image in pixels.
        fov: field of view across the image's width in degrees.
        mapping: "equidistant", "equisolid" or "rectilinear".
        distortion: relative radial displacement at the image's edge, quadratic in the radius.
        vignetting: share of the light lost at the image's edge, as r^2 and r^4.
        response: encoded value in [0, 1] of a linear exposure in [0, 1].
        full_well: electrons of a saturated pixel.
        read_noise: standard deviation in electrons.
        quality: JPEG quality.
    """

    __test__ = False
    size: tuple[int, int] = (512, 512)
    fov: float = 185.0
    mapping: str = "equidistant"
    distortion: float = 0.0
    vignetting: tuple[float, float] = (0.25, 0.15)
    response: Callable[[np.ndarray], np.ndarray] = field(default=film_curve)
    full_well: float = 30000.0
    read_noise: float = 6.0
    quality: int = 97

    def rays(self, supersampling: int = 2) -> tuple[np.ndarray, np.ndarray]:
        """Unit vectors in camera space through a grid finer than the pixels, and radii (1 at half the width)."""
        width, height = self.size
        columns = (np.arange(width * supersampling) + 0.5) / supersampling
        rows = (np.arange(height * supersampling) + 0.5) / supersampling
        x, y = np.meshgrid(columns - width / 2, rows - height / 2)
        radius = np.hypot(x, y) / (width / 2)
        ideal = radius * (1 - self.distortion * radius**2)
        half = np.radians(self.fov / 2)
        theta = {
            "equidistant": lambda r: r * half,
            "equisolid": lambda r: 2 * np.arcsin(np.clip(r * np.sin(half / 2), -1, 1)),
            "rectilinear": lambda r: np.arctan(r * np.tan(half)),
        }[self.mapping](ideal)
        scale = np.sin(theta) / np.maximum(np.hypot(x, y), 1e-12)
        return np.stack([x * scale, np.cos(theta), -y * scale], axis=-1), radius

    @property
    def circular(self) -> bool:
        """Whether the image is black outside a circle."""
        return self.mapping != "rectilinear"


def look_up(panorama: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Radiance of an equirectangular panorama in directions of light space, bilinear, wrapping round."""
    height, width = panorama.shape[:2]
    padded = cv2.copyMakeBorder(panorama.astype(np.float32), 1, 1, 1, 1, cv2.BORDER_REPLICATE)
    padded[:, 0], padded[:, -1] = padded[:, -2], padded[:, 1]
    u, v = direction_to_latlong(directions)
    return cv2.remap(
        padded, (u * width + 0.5).astype(np.float32), (v * height + 0.5).astype(np.float32), cv2.INTER_LINEAR
    )


def sensor_radiance(panorama: np.ndarray, rotation: np.ndarray, camera: TestCamera) -> np.ndarray:
    """Radiance that reaches the pixels through the lens, vignetting included, shape (height, width, 3)."""
    rays, radius = camera.rays()
    light = look_up(panorama, rays @ rotation.T)
    light *= (1 - camera.vignetting[0] * radius**2 - camera.vignetting[1] * radius**4).clip(0)[..., None]
    if camera.circular:
        light[radius > 1] = 0
    return cv2.resize(light, camera.size, interpolation=cv2.INTER_AREA)


def photograph(light: np.ndarray, exposure: float, camera: TestCamera, rng: np.random.Generator) -> np.ndarray:
    """One exposure of :func:`sensor_radiance`: saturation, shot and read noise, response, 8 bits; RGB."""
    electrons = np.clip(light * exposure, 0, 1.5) * camera.full_well
    # Shot noise by its normal approximation: the two differ only below some ten electrons, where read noise rules.
    noise = rng.standard_normal(light.shape, dtype=np.float32)
    electrons = electrons + noise * np.sqrt(electrons + camera.read_noise**2)
    levels = camera.response(np.linspace(0, 1, 4097))
    encoded = np.interp(np.clip(electrons / camera.full_well, 0, 1), np.linspace(0, 1, 4097), levels)
    return np.rint(255 * np.clip(encoded, 0, 1)).astype(np.uint8)


def write_photograph(
    path: Path, pixels: np.ndarray, time: float, when: float, aperture: float = 8.0, iso: int = 100, quality: int = 97
) -> None:
    """Save RGB pixels of 8 bits as JPEG with the EXIF of a camera.

    Args:
        path: the file.
        pixels: shape (height, width, 3), uint8.
        time: exposure time in seconds.
        when: seconds since the first photograph.
        aperture: f-number.
        iso: sensitivity.
        quality: JPEG quality.
    """
    exif = Image.Exif()
    minutes, seconds = divmod(when, 60)
    exif[0x0110] = "Test camera"
    tags = exif.get_ifd(0x8769)
    tags[0x829A] = IFDRational(Fraction(time).limit_denominator(100_000))
    tags[0x829D] = IFDRational(Fraction(aperture).limit_denominator(10))
    tags[0x8827] = iso
    tags[0x9003] = f"2024:05:01 12:{int(minutes):02d}:{int(seconds):02d}"
    tags[0x9291] = f"{int(seconds % 1 * 100):02d}"
    Image.fromarray(pixels).save(path, quality=quality, subsampling=0, exif=exif)


def shoot(
    panorama: np.ndarray,
    rotations: Sequence[np.ndarray],
    times: Sequence[float],
    folder: Path,
    camera: TestCamera,
    aperture: float = 8.0,
    seed: int = 0,
) -> list[list[Path]]:
    """Photograph a panorama in several orientations with several exposure times each.

    The camera is such that radiance 1 saturates it at 1 second, ISO 100 and f/1.

    Returns:
        The files, a list for each orientation.
    """
    rng = np.random.default_rng(seed)
    files, number, when = [], 0, 0.0
    for rotation in rotations:
        light = sensor_radiance(panorama, rotation, camera)
        files.append([])
        for time in times:
            path = folder / f"IMG_{number:04d}.JPG"
            pixels = photograph(light, time / aperture**2, camera, rng)
            write_photograph(path, pixels, time, when, aperture, 100, camera.quality)
            files[-1].append(path)
            number, when = number + 1, when + 0.5
        when += 20
    return files


def room_panorama(height: int = 512, seed: int = 3) -> np.ndarray:
    """A made-up HDR place with texture everywhere, dark corners, a window and lamps: five orders of magnitude."""
    rng = np.random.default_rng(seed)
    directions = pixel_directions(height, 2 * height)
    # Band-limited noise of the direction has no seam and no poles.
    albedo = np.zeros((height, 2 * height))
    for octave in range(5):
        waves = rng.normal(size=(24, 3)) * 4 * 1.9**octave
        phases = rng.uniform(0, 2 * np.pi, 24)
        for wave, phase in zip(waves, phases, strict=True):
            albedo += np.sin(directions @ wave + phase) / 1.25**octave
    albedo = 0.35 * np.exp(0.09 * albedo)
    # Tiles give corners that a feature detector finds.
    cells = np.floor(directions * 9).astype(int) % 97
    tiles = rng.uniform(0.4, 1.0, (97, 97, 97))[cells[..., 0], cells[..., 1], cells[..., 2]]
    light = np.exp(2.2 * directions @ np.array([0.6, 0.3, 0.74]) - 2.0)
    radiance = (albedo * tiles * light)[..., None] * np.array([1.0, 0.9, 0.75])
    for axis, degrees, value in [
        ((0.3, 0.8, 0.5), 9, 40.0),
        ((-0.7, 0.2, 0.6), 2.5, 900.0),
        ((0.2, -0.9, 0.3), 2.5, 300.0),
    ]:
        inside = directions @ (np.array(axis) / np.linalg.norm(axis)) > np.cos(np.radians(degrees))
        radiance[inside] = value * np.array([1.0, 0.95, 0.85])
    corner = directions @ (np.array([-0.5, -0.6, -0.5]) / np.linalg.norm([0.5, 0.6, 0.5])) > np.cos(np.radians(25))
    radiance[corner] *= 0.05
    return radiance.astype(np.float32)

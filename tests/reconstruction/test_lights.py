"""The strongest sources are where the lamps are."""

import numpy as np
import pytest

from lightdepth.directions import latlong_to_direction, pixel_directions
from lightdepth.lightmap.file import LightDepthMap
from lightdepth.reconstruction.coverage import view
from lightdepth.reconstruction.depth_image import DepthImage
from lightdepth.reconstruction.from_depth import surfaces_from_depth
from lightdepth.reconstruction.lights import strongest_sources
from lightdepth.reconstruction.lights_picture import draw_sources
from tests.reconstruction.virtual_room import CAPTURE, LAMPS, radiance, trace


def room_map(pose, height=256, depth=None):
    directions = pose.to_world(pixel_directions(height, 2 * height))
    exact = trace(CAPTURE, directions)
    pixels = radiance(CAPTURE + directions * exact[..., None])
    return LightDepthMap(pixels, (exact if depth is None else depth).astype(np.float32), pose.position, pose.rotation)


def check(sources, tolerance):
    for centre, half, _ in LAMPS.values():
        nearest = min(sources, key=lambda source: np.linalg.norm(source.position - centre))
        assert np.linalg.norm(nearest.position - centre) < tolerance
        assert sorted(nearest.size) == pytest.approx(sorted(2 * half[half > 0]), abs=0.05)


def test_lamps_and_window_are_found_in_metres(pose):
    sources = strongest_sources(room_map(pose))
    assert len(sources) == 3
    check(sources, 0.02)
    # The share is the light's part of what arrives: lamp radiance times solid angle, over the whole map.
    shares = [source.share for source in sources]
    assert shares == sorted(shares, reverse=True)
    assert 0.1 < sum(shares) < 1.0


def test_lamps_are_within_five_centimetres_on_a_reconstruction_from_noisy_depth(pose, depth):
    random = np.random.default_rng(3)
    noisy = depth + random.normal(0, 0.01, depth.shape)
    noisy[random.random(depth.shape) < 0.2] = np.nan
    surfaces = surfaces_from_depth(DepthImage(noisy), pose).surfaces
    seen = view(surfaces, pose, 256).distance.reshape(256, 512)
    check(strongest_sources(room_map(pose, depth=seen)), 0.05)


def sky_map(lamps, height=128):
    """A dim map without surfaces, with bright disks: (u, v, radius in degrees, radiance)."""
    directions = pixel_directions(height, 2 * height)
    pixels = np.full((height, 2 * height, 3), 0.1, np.float32)
    for u, v, radius, light in lamps:
        pixels[directions @ latlong_to_direction(u, v) > np.cos(np.radians(radius))] = light
    return LightDepthMap(pixels, np.full((height, 2 * height), np.inf, np.float32), np.zeros(3), np.eye(3))


def test_a_source_across_the_panoramas_edge_is_one():
    (source,) = strongest_sources(sky_map([(0.0, 0.4, 8.0, 50.0)]))
    assert source.position is None
    np.testing.assert_allclose(source.direction, latlong_to_direction(0.0, 0.4), atol=6e-3)  # A quarter of a pixel.
    # It is behind, 18 degrees above the horizon.
    assert abs(source.azimuth) == pytest.approx(180.0, abs=0.4)
    assert source.elevation == pytest.approx(18.0, abs=0.4)
    assert source.as_dict()["elevation"] == pytest.approx(18.0, abs=0.4)
    # A disk has the variance r^2 / 4, its rectangle of equal variance the side sqrt(3) r.
    assert source.size == pytest.approx([8.0 * np.sqrt(3.0)] * 2, rel=0.05)
    solid_angle = 2 * np.pi * (1 - np.cos(np.radians(8.0)))
    assert source.share == pytest.approx(50 * solid_angle / (50 * solid_angle + 0.1 * (4 * np.pi - solid_angle)), 0.02)


def test_a_glow_belongs_to_its_lamp():
    layers = [(0.5, 0.5, radius, light) for radius, light in ((14, 4.0), (10, 10.0), (7, 30.0), (4, 1000.0))]
    sources = strongest_sources(sky_map([*layers, (0.8, 0.5, 5.0, 60.0)]))
    assert len(sources) == 2
    assert sources[0].size == pytest.approx([4.0 * np.sqrt(3.0)] * 2, rel=0.1)


def test_equally_bright_things_at_different_distances_are_two():
    flat = sky_map([(0.5, 0.5, 8.0, 50.0)])
    depth = np.where(pixel_directions(128, 256)[..., 0] < 0, 2.0, 4.0).astype(np.float32)
    sources = strongest_sources(LightDepthMap(flat.radiance, depth, np.zeros(3), np.eye(3)))
    assert sorted(round(source.distance) for source in sources) == [2, 4]


def test_the_picture_marks_the_sources(pose):
    light_depth_map = room_map(pose)
    sources = strongest_sources(light_depth_map)
    marked, plain = (draw_sources(light_depth_map.radiance, chosen).astype(int) for chosen in (sources, []))
    changed = np.abs(marked - plain).sum(axis=2) > 0
    for source in sources:
        x, y = int(source.u * 1024), int(source.v * 512)
        assert changed[y - 12 : y + 12, x - 12 : x + 12].any()
    assert changed.mean() < 0.05

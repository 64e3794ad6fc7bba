"""The photograph that the benchmark gives to every method."""

import numpy as np
import pytest
from bench.places import court
from bench.truth import photograph


def test_a_sun_of_few_pixels_has_its_power() -> None:
    """With 16 rays a pixel, those at its rim would make its power a matter of luck."""
    place = court()
    image = photograph(place, 256, 16).mean
    height, width, _ = image.shape
    rows = np.cos(np.arange(height + 1) / height * np.pi)
    solid_angle = ((rows[:-1] - rows[1:]) * 2.0 * np.pi / width)[:, None, None]
    shows_sun = (image.mean(axis=-1) > 10.0)[..., None]
    sky = (image * ~shows_sun).max(axis=(0, 1))
    power = (np.maximum(image - sky, 0.0) * solid_angle * shows_sun).sum(axis=(0, 1))
    radius = np.radians(0.5 * place.sky.sun_diameter)
    expected = np.asarray(place.sky.sun_radiance) * 2.0 * np.pi * (1.0 - np.cos(radius))
    assert power == pytest.approx(expected, rel=0.002)

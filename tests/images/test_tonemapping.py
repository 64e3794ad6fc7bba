"""Tone curves: monotonic, neutral, fixed at black, and without surprises at the extremes."""

import numpy as np
import pytest

from lightdepth.errors import InputError, InputWarning
from lightdepth.images.tonemapping import AVERAGE_LUMINANCE, CURVES, auto_exposure, tone_map


def grey(values):
    return np.repeat(np.asarray(values, np.float32)[None, :, None], 3, axis=2)


@pytest.mark.parametrize("curve", CURVES)
def test_curves_rise_from_black_to_white_and_keep_grey_grey(curve):
    pixels = tone_map(grey([0.0, *np.geomspace(1e-5, 1e5, 2000)]), 0.0, curve)[0].astype(int)
    assert (np.ptp(pixels, axis=1) <= 1).all()
    assert (np.diff(pixels[:, 0]) >= 0).all()
    assert pixels[0, 0] == 0
    assert pixels[-1, 0] == 255


@pytest.mark.parametrize("curve", CURVES)
def test_values_that_are_no_radiance_do_no_harm(curve):
    pixels = tone_map(grey([np.nan, -1.0, -np.inf, np.inf, 3e38]), 3.0, curve)[0, :, 0]
    assert pixels.tolist() == [0, 0, 0, 255, 255]


def test_linear_is_the_srgb_encoding():
    expected = [0, 13, 118, 188, 255, 255]  # IEC 61966-2-1.
    assert tone_map(grey([0, 0.004, 0.18, 0.5, 1, 7]), 0, "linear")[0, :, 0].tolist() == expected
    assert tone_map(grey([0.25]), 1, "linear")[0, 0, 0] == 188


def test_agx_like_keeps_middle_grey_and_reaches_white_after_its_stops():
    assert tone_map(grey([0.18]))[0, 0, 0] == pytest.approx(118, abs=1)
    assert tone_map(grey([0.18 * 2**6.5]))[0, 0, 0] == 255
    assert tone_map(grey([0.18 * 2**6]))[0, 0, 0] < 255


def test_agx_like_fades_bright_colours_to_white_and_keeps_their_hue_below():
    blue = np.float32([[[0.02, 0.02, 0.4], [2.0, 2.0, 400.0]]])
    normal, bright = tone_map(blue)[0].astype(int)
    assert normal[2] > 2 * normal[0]
    assert bright.min() > 0.75 * bright.max()


def test_exposure_counts_in_stops_and_large_images_are_mapped_alike():
    random = np.random.default_rng(6)
    radiance = random.uniform(0, 2, (600, 2000, 3)).astype(np.float32)
    pixels = tone_map(radiance, -1.0)
    np.testing.assert_array_equal(pixels[590:], tone_map(radiance[590:] * np.float32(0.5)))


def test_automatic_exposure_aims_at_the_average_and_ignores_lamps_and_corners():
    radiance = np.full((100, 200, 3), 3.0, np.float32)
    assert 2 ** auto_exposure(radiance) * 3.0 == pytest.approx(AVERAGE_LUMINANCE)
    radiance[:2, :100], radiance[2:8, :20] = 1e5, 0.0
    assert 2 ** auto_exposure(radiance) * 3.0 == pytest.approx(AVERAGE_LUMINANCE, rel=0.01)
    alpha = np.ones((100, 200), np.float32)
    radiance[50:], alpha[50:] = 0.001, 0.0
    assert 2 ** auto_exposure(radiance, alpha) * 3.0 == pytest.approx(AVERAGE_LUMINANCE, rel=0.01)
    assert auto_exposure(np.zeros((8, 16, 3), np.float32)) == 0.0


def test_an_unknown_curve_is_refused():
    with pytest.raises(InputError, match="'aces': allowed are agx-like, filmic, linear"):
        tone_map(grey([1.0]), 0.0, "aces")


def test_the_former_name_of_a_curve_is_understood():
    with pytest.warns(InputWarning, match="'agx' is now called 'agx-like'"):
        former = tone_map(grey([0.1, 1.0, 10.0]), 0.0, "agx")
    np.testing.assert_array_equal(former, tone_map(grey([0.1, 1.0, 10.0]), 0.0, "agx-like"))

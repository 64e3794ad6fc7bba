"""Fireflies are spread, glints stay where they are, and no light is lost."""

import numpy as np
import pytest

from lightdepth.film.outliers import Settled, settle
from lightdepth.parameters.denoising import DEFAULT, DenoisingParameters

SHAPE, SAMPLES = (96, 128), 32
HERE = np.ones(SHAPE, bool)


def sampled(mean, seed=3):
    """Means of samples around ``mean``, and their standard errors."""
    noise = np.random.default_rng(seed).gamma(4.0, 0.25, (SAMPLES, *mean.shape)) * mean
    return noise.mean(axis=0), noise.std(axis=0, ddof=1) / np.sqrt(SAMPLES)


def settled(grey, error, here=HERE, tuned=DEFAULT) -> Settled:
    colour = np.float32([1.0, 0.8, 0.6]) / np.float32(0.8)
    layer = grey[:, :, None].astype(np.float32) * colour
    result = settle(layer, error.astype(np.float32), here.astype(np.float32), 0.18 / 0.5, tuned)
    assert result.plain.min() >= 0.0
    return result


@pytest.mark.parametrize("strength", [60.0, 3000.0])
def test_one_samples_firefly_is_spread_without_a_spot(strength):
    grey, error = sampled(np.full(SHAPE, 0.5))
    grey[40, 60] += strength / SAMPLES
    error[40, 60] = np.hypot(error[40, 60], strength / SAMPLES)
    result = settled(grey, error)
    assert not result.glints.any()
    assert result.plain[40, 60].mean() < 0.5 * 1.25
    assert result.plain.max() < 1.15 * settled(*sampled(np.full(SHAPE, 0.5))).plain.max()
    np.testing.assert_allclose(result.plain.mean(axis=2).sum(), grey.sum(), rtol=1e-3)


def test_light_is_spread_as_far_as_the_parameters_say():
    """Around a pixel with a firefly, beyond four standard deviations nothing changes."""
    grey, error = sampled(np.full(SHAPE, 0.5))
    before = settled(grey, error).plain
    grey[40, 60], error[40, 60] = grey[40, 60] + 2.0, error[40, 60] + 2.0
    for tuned, reach in ((DEFAULT, 16), (DenoisingParameters(spread=2.0, spreads=1), 8)):
        changed = np.abs(settled(grey, error, tuned=tuned).plain - before).max(axis=2) > 1e-5
        assert reach / 2 < np.ptp(np.flatnonzero(changed.any(axis=0))) / 2 <= reach


def test_what_many_samples_agree_on_stays_with_its_rim():
    """The sun in a metal ball: one pixel full of it, and one that it fills by a twentieth, which few samples find."""
    grey, error = sampled(np.full(SHAPE, 0.5))
    grey[40, 60], error[40, 60] = 1500.0, 30.0
    grey[40, 61], error[40, 61] = 75.0, 1500.0 * np.sqrt(0.05 * 0.95 / SAMPLES)
    result = settled(grey, error)
    together = result.plain + result.glints
    np.testing.assert_allclose(together.mean(axis=2), grey, rtol=1e-5)
    assert result.plain[40, 60].mean() < 20.0


def test_noise_alone_is_left_to_the_denoiser():
    grey, error = sampled(np.linspace(0.01, 2.0, SHAPE[1])[None] * np.ones((SHAPE[0], 1)))
    result = settled(grey, error)
    assert not result.glints.any()
    np.testing.assert_allclose(result.plain.mean(axis=2), grey, rtol=1e-5)


def test_a_thin_line_is_no_row_of_fireflies():
    """A wire that fills a tenth of each pixel on its way: few samples find it, but in pixel after pixel."""
    grey, error = sampled(np.full(SHAPE, 0.5))
    grey[10:80, 60] += 4.0
    error[10:80, 60] = 40.0 * np.sqrt(0.1 * 0.9 / SAMPLES)
    np.testing.assert_allclose(settled(grey, error).plain.mean(axis=2), grey, rtol=1e-5)


def test_a_firefly_on_a_rim_is_worth_its_share():
    """A pixel that the layer fills by a tenth holds a tenth of the light that the whole pixel would."""
    share = np.where(np.arange(SHAPE[1]) < 68, 1.0, np.where(np.arange(SHAPE[1]) == 68, 0.1, 0.0)) * np.ones(SHAPE)
    grey, error = sampled(np.where(share > 0.0, 0.5, 0.0))
    grey[40, 68], error[40, 68] = 30.0, 29.0
    result = settled(grey, error, share)
    np.testing.assert_allclose((share * result.plain.mean(axis=2)).sum(), (share * grey).sum(), rtol=1e-3)


def test_light_is_spread_only_where_the_layer_is():
    here = HERE.copy()
    here[:, 70:] = False
    grey, error = sampled(np.where(here, 0.5, 0.0))
    grey[40, 68], error[40, 68] = 3.0, 2.6
    result = settled(grey, error, here)
    assert not result.plain[~here].any()
    np.testing.assert_allclose(result.plain.mean(axis=2).sum(), grey.sum(), rtol=5e-3)

"""Sums of samples against the plain means and variances of the same samples."""

from itertools import pairwise

import numpy as np
import pytest

from lightdepth.kernel.start import start

start("cpu")

import drjit as dr  # noqa: E402
import mitsuba as mi  # noqa: E402

from lightdepth.film import accumulation  # noqa: E402
from lightdepth.film.accumulation import Accumulator  # noqa: E402
from lightdepth.transport.integrator import CameraSums  # noqa: E402


def camera_sums(change, synthetic, covered):
    """From arrays of shapes (k, per_pixel, 3) and (k, per_pixel)."""

    def color(values):
        return mi.Color3f(values.sum(axis=1).T.astype(np.float32).copy())

    covered = mi.Float(covered.sum(axis=1).astype(np.float32))
    result = CameraSums(color(change), color(synthetic), color(np.square(change + synthetic)), covered)
    dr.eval(result)
    return result


@pytest.fixture
def drawn():
    """Samples of 50 out of 200 pixels: bare ones, wholly covered ones and in between, before dim and glaring plates."""
    generator = np.random.default_rng(1)
    plate = (10.0 ** generator.uniform(-2, 4, (200, 3))).astype(np.float32)
    pixels = np.sort(generator.choice(200, 50, replace=False)).astype(np.uint32)
    covered = generator.random((50, 20)) < generator.choice([0.0, 0.5, 1.0], 50)[:, None]
    value = generator.exponential(1.0, (50, 20, 3)).astype(np.float32)
    return plate, pixels, covered, np.where(covered[..., None], 0, value - 1.2), np.where(covered[..., None], value, 0)


def fill(accumulator, covered, change, synthetic, slots, cuts=(0, 4, 16, 20)):
    for first, last in pairwise(cuts):
        part = (change[slots, first:last], synthetic[slots, first:last], covered[slots, first:last])
        accumulator.add(slots.astype(np.uint32), camera_sums(*part), np.full(len(slots), last - first))


@pytest.mark.parametrize("finish", [False, True])
def test_means_and_variances(drawn, finish, monkeypatch):
    plate, pixels, covered, change, synthetic = drawn
    monkeypatch.setattr(accumulation, "PIXELS_AT_ONCE", 16)
    accumulator = Accumulator(plate, pixels)
    order = np.random.default_rng(2).permutation(50)
    fill(accumulator, covered, change, synthetic, order[:30])
    fill(accumulator, covered, change, synthetic, order[30:])
    errors = accumulator.relative_errors(0.1)
    estimates = accumulator.estimates(finish)
    assert (accumulator.taken == 20).all()
    np.testing.assert_allclose(estimates.change, change.mean(axis=1), rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(estimates.synthetic, synthetic.mean(axis=1), rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(estimates.coverage, covered.mean(axis=1), rtol=1e-6)
    here = plate[pixels][:, None].astype(np.float64)
    finished = here * ~covered[..., None] + change + synthetic
    np.testing.assert_allclose(estimates.variance, finished.var(axis=1, ddof=1) / 20, rtol=2e-4, atol=1e-6)
    brightness = np.maximum(finished.mean(axis=(1, 2)), 0) + 0.1
    deviation = np.sqrt(finished.var(axis=1, ddof=1).mean(axis=1) / 20)
    np.testing.assert_allclose(errors, deviation / brightness, rtol=1e-3)


def test_pixels_without_samples_are_nothing_new():
    accumulator = Accumulator(np.ones((8, 3), np.float32), np.arange(8, dtype=np.uint32))
    estimates = accumulator.estimates()
    for values in (estimates.change, estimates.synthetic, estimates.coverage, estimates.variance):
        assert not values.any()
    empty = Accumulator(np.ones((8, 3), np.float32), np.zeros(0, np.uint32)).estimates(finish=True)
    assert empty.change.shape == (0, 3)
    assert empty.coverage.shape == (0,)

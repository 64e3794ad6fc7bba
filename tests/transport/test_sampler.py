"""The random numbers of paths: spread evenly over a pixel's samples, and as if independent from pixel to pixel."""

import numpy as np
import pytest
from scipy import stats
from scipy.stats import qmc

from lightdepth.kernel.start import start
from tests.chance import FALSE_ALARM, Seen, check_seen
from tests.machine import SEED

start("cpu")

import drjit as dr  # noqa: E402
import mitsuba as mi  # noqa: E402

from lightdepth.transport.sampler import DIMENSIONS, _reversed_sobol, begin_path  # noqa: E402

NAMES = list(DIMENSIONS)
COUNT = sum(len(each) for each in DIMENSIONS.values())


def spread(pixels, first, samples, seed=3):
    """All dimensions for pixels of shape (n,) and ``samples`` samples from ``first`` on: shape (n, samples, dimensions)."""
    lane = dr.arange(mi.UInt32, len(pixels) * samples)
    pixel = dr.gather(mi.UInt32, mi.UInt32(np.uint32(pixels)), lane // samples)
    sampler = begin_path(pixel, lane % samples + first, mi.UInt32(seed + 1000 * SEED))
    columns = [number.numpy() for name in NAMES for number in sampler.stratified(name)]
    return np.stack(columns, axis=-1).reshape(len(pixels), samples, COUNT).astype(np.float64)


def test_it_is_the_sequence_of_sobol():
    index = dr.arange(mi.UInt32, 256)
    found = np.stack([dr.brev(_reversed_sobol(index, each)).numpy() for each in range(COUNT)], axis=1) / 2.0**32
    expected = qmc.Sobol(COUNT, scramble=False, bits=32).random(256)
    # The other's points come in the order of Gray's code.
    number = np.arange(256)
    np.testing.assert_array_equal(found[number ^ number >> 1], expected)


@pytest.mark.parametrize("first", [0, 16, 96, 65536 + 32])
@pytest.mark.parametrize("samples", [4, 16])
def test_each_dimension_has_one_sample_in_every_interval(first, samples):
    numbers = spread(np.arange(200), first, samples)
    intervals = np.sort((numbers * samples).astype(int), axis=1)
    assert (intervals == np.arange(samples)[None, :, None]).all()


def test_film_has_one_sample_in_every_cell_of_any_shape():
    x, y = np.moveaxis(spread(np.arange(200), 16, 16)[..., :2], -1, 0)
    for columns in (1, 2, 4, 8, 16):
        cell = (x * columns).astype(int) * (16 // columns) + (y * (16 // columns)).astype(int)
        assert (np.sort(cell, axis=1) == np.arange(16)).all()


@pytest.mark.parametrize("index", [0, 5, 70000])
def test_any_one_sample_is_uniform_over_pixels(index):
    """Sixty-four intervals that hold 5 % too much or too little in the root mean square are caught."""
    numbers = spread(np.arange(1 << 16), index, 1)[:, 0]
    for dimension in range(COUNT):
        counts = np.bincount((numbers[:, dimension] * 64).astype(int), minlength=64)
        assert stats.chisquare(counts).pvalue > FALSE_ALARM / (2 * COUNT)
    # The low digits too.
    fine = numbers * 2.0**16 % 1.0
    for dimension in range(COUNT):
        counts = np.bincount((fine[:, dimension] * 16).astype(int), minlength=16)
        assert stats.chisquare(counts).pvalue > FALSE_ALARM / (2 * COUNT)


def test_two_samples_of_different_pixels_seeds_and_sequences_are_independent():
    """A joint density that is 7 % off in the root mean square is caught."""
    pixels = np.arange(1 << 15)
    here = spread(pixels, 7, 1)[:, 0]
    others = {
        "the next pixel": spread(pixels + 1, 7, 1)[:, 0],
        "another seed": spread(pixels, 7, 1, seed=4)[:, 0],
        "the next sequence": spread(pixels, 65536 + 7, 1)[:, 0],
    }
    for other in others.values():
        for one in range(COUNT):
            for two in range(COUNT):
                cell = (here[:, one] * 8).astype(int) * 8 + (other[:, two] * 8).astype(int)
                assert stats.chisquare(np.bincount(cell, minlength=64)).pvalue > FALSE_ALARM / (3 * COUNT**2)


def test_two_dimensions_of_a_sample_are_independent():
    """A joint density that is 5 % off in the root mean square is caught."""
    numbers = spread(np.arange(1 << 16), 11, 1)[:, 0]
    for one in range(COUNT):
        for two in range(one):
            cell = (numbers[:, one] * 8).astype(int) * 8 + (numbers[:, two] * 8).astype(int)
            assert stats.chisquare(np.bincount(cell, minlength=64)).pvalue > FALSE_ALARM / (COUNT * (COUNT - 1) / 2)


def test_a_smooth_integrand_is_found_better_than_by_independent_numbers():
    numbers, ratios = spread(np.arange(500), 0, 64), []
    for pair in ((0, 1), (2, 3), (0, 2), (5, 6), (7, 8)):
        value = np.prod(1.0 + np.sin(3.0 * numbers[..., pair]), axis=-1)
        spread_means, single = value.mean(axis=1).std(), value.std() / 8.0
        ratios.append(spread_means / single)
    check_seen(ratios, Seen(12, 0.0469, 0.0792, 0.00298), high=0.25)

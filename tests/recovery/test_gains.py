"""Gains between photographs of one place: found in spite of what disagrees, and reported where they explain nothing."""

from dataclasses import replace

import numpy as np
import pytest

from lightdepth.directions import latlong_to_direction
from lightdepth.kernel.start import start

start("cpu")

from lightdepth.parameters import BalanceParameters  # noqa: E402
from lightdepth.place.real_surfaces import merge_real_surfaces  # noqa: E402
from lightdepth.place.traced_surfaces import TracedSurfaces  # noqa: E402
from lightdepth.recovery.gains import solve_gains  # noqa: E402
from tests.place.virtual_room import CAPTURES, REAL, photograph  # noqa: E402

GAIN = np.float32([1.3, 0.9, 0.6])


@pytest.fixture(scope="module")
def surfaces():
    return TracedSurfaces(merge_real_surfaces(REAL))


@pytest.fixture(scope="module")
def first():
    return photograph(CAPTURES[0])


@pytest.fixture(scope="module")
def second():
    """From elsewhere, exposed otherwise, with someone in the way."""
    seen = photograph(CAPTURES[1], turn=(0, 0, 70), balanced=False)
    spoilt = seen.radiance / GAIN
    spoilt[40:100, 30:60] *= 0.3
    return replace(seen, radiance=spoilt)


def test_the_gain_is_found_in_spite_of_people(surfaces, first, second):
    balance = solve_gains([first, second], surfaces)
    assert balance.problem is None
    np.testing.assert_allclose(balance.gains, [[1.0, 1.0, 1.0], GAIN], rtol=0.01)
    off = balance.disagreements[1]
    assert off is not None
    assert 0.05 < off.share < 0.3
    assert 40 <= off.row < 100
    assert 30 <= off.column < 60
    direction = second.rotation @ latlong_to_direction((off.column + 0.5) / 256, (off.row + 0.5) / 128)
    offset = off.point - second.position
    assert direction @ offset / np.linalg.norm(offset) > 0.999


def test_three_photographs_of_which_two_share_nothing(surfaces, first, second):
    """The third is masked where the first sees it: it takes its gain by way of the second."""
    third = photograph([1.0, 1.2, 1.2], balanced=False)
    third = replace(third, radiance=third.radiance * 2.0)
    balance = solve_gains([first, second, third], surfaces)
    np.testing.assert_allclose(balance.gains[1:], [GAIN, [0.5] * 3], rtol=0.01)


def test_a_given_gain_stays(surfaces, first, second):
    balance = solve_gains([first, replace(second, balanced=True)], surfaces)
    np.testing.assert_array_equal(balance.gains, np.ones((2, 3)))


def test_what_shares_nothing_or_contradicts_is_named(surfaces, first, second):
    outside = replace(second, position=np.array([40.0, 0.0, 1.0]))
    assert "[[panorama]] 2: sees next to nothing that another" in str(solve_gains([first, outside], surfaces).problem)
    other = replace(first, radiance=np.exp(6.0 * np.minimum(first.radiance, 1.0)))
    turned = replace(other, radiance=np.roll(other.radiance, 90, axis=1), balanced=False)
    message = str(solve_gains([other, turned], surfaces).problem)
    assert "which no gain explains; is its pose right" in message
    assert solve_gains([other, turned], surfaces, BalanceParameters(too_far=1e9)).problem is None

"""Clicks as a person writes them."""

import numpy as np
import pytest

from lightdepth.calibration.clicks import read_clicks
from lightdepth.errors import InputError

SIZE = (500, 1000)


def test_clicks_are_read_in_several_styles():
    expected = read_clicks("1,2 3.5,4", SIZE, "--vertical", 2)
    for style in ("1, 2;3.5,4", " 1 ,2  3.5 , 4\n"):
        np.testing.assert_array_equal(read_clicks(style, SIZE, "--vertical"), expected)
    assert read_clicks("", SIZE, "--floor").shape == (0, 3)


def test_pixels_and_angles_say_the_same():
    pixels = read_clicks("500,250 750,250 500,0 0,125", SIZE, "--floor")
    np.testing.assert_allclose(pixels, read_clicks("0,0 90,0 0,90 -180,45", None, "--floor"), atol=1e-12)
    expected = [[0, 1, 0], [1, 0, 0], [0, 0, 1], [0, -np.sqrt(0.5), np.sqrt(0.5)]]
    np.testing.assert_allclose(pixels, expected, atol=1e-12)
    # Beyond its edge the panorama goes on.
    np.testing.assert_allclose(read_clicks("-250,250 1250,250", SIZE, "--floor"), [[1, 0, 0], [-1, 0, 0]], atol=1e-12)


@pytest.mark.parametrize(
    ("text", "size", "words"),
    [
        ("1,1 2,2 3,3", SIZE, "--rectangle: 3 points, 4 are needed"),
        ("1,1 2,2 3;3 4,4", SIZE, "'3' is not a point; write each one as x,y"),
        ("1,1 2,2 3,nan 4,4", SIZE, "point 3 is 3,nan; allowed are x from -1000 to 2000 and y from 0 to 500 pixels"),
        ("1,1 2,2 3,3 4,501", SIZE, "point 4 is 4,501; .* in this panorama of 1000 x 500"),
        ("1,1 2,2 3,91 4,4", None, "point 3 is 3,91; allowed are x from -360 to 360 and y from -90 to 90 degrees"),
    ],
)
def test_wrong_clicks_are_explained(text, size, words):
    with pytest.raises(InputError, match=words):
        read_clicks(text, size, "--rectangle", 4)

"""Motion blur against the path-traced mean over 64 instants."""

import pytest
from bench.motion_blur import QUICK, errors, mean_truth, rendered
from bench.places.l_shaped_room import l_shaped_room

from lightdepth.kernel.start import start


@pytest.mark.truth
def test_motion_blur_is_the_mean_over_the_shutter() -> None:
    start("cpu")
    place = l_shaped_room("mixed")
    scene = place.scene(QUICK.photograph, QUICK.photograph_samples, QUICK.width)
    full, empty = (mean_truth(place, "objects", QUICK, objects) for objects in (True, False))
    (sharp, _), (blurred, signed) = (
        errors(rendered(scene, place, "objects", count, QUICK), full, empty, "objects") for count in (1, 8)
    )
    assert blurred < 0.25 * sharp
    assert abs(signed) < 0.005

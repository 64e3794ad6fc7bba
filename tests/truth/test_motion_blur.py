"""Motion blur against the path-traced mean over 64 instants."""

from dataclasses import replace

import pytest
from bench.motion_blur import QUICK, errors, mean_truth, rendered, shared
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


@pytest.mark.truth
@pytest.mark.parametrize("moving", ["camera", "objects"])
def test_blurred_frames_share_their_samples(moving: str) -> None:
    """Where the camera moves, the error falls; where objects do, with their shadows, it is not above that of the frame."""
    start("cpu")
    place, spent = l_shaped_room("mixed"), replace(QUICK, samples=16)
    scene = place.scene(spent.photograph, spent.photograph_samples, spent.width)
    full, empty = (mean_truth(place, moving, QUICK, objects) for objects in (True, False))
    (alone, _), (together, signed) = (
        errors(frame, full, empty, moving, change=True) for frame in shared(scene, place, moving, 8, spent, 3)
    )
    print(f"{moving}: {100 * alone:.2f} % alone, {100 * together:.2f} % with six others, signed {100 * signed:+.2f} %")
    assert together < (0.8 if moving == "camera" else 1.02) * alone
    assert abs(signed) < 0.01

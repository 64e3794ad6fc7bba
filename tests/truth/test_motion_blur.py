"""Motion blur against the path-traced mean over 64 instants."""

from dataclasses import replace

import numpy as np
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
    """Against the same frame with many samples, whose motion blur is that of path tracing.

    Where the camera moves, the error of support falls; where objects do, with their shadows, no error is above that of the
    frame alone.
    """
    start("cpu")
    place, spent = l_shaped_room("mixed"), replace(QUICK, width=96, samples=16)
    scene = place.scene(spent.photograph, spent.photograph_samples, spent.width)
    converged = rendered(scene, place, moving, 8, replace(spent, samples=1024))
    alone, together = shared(scene, place, moving, 8, spent, 3)
    changed = (np.abs(converged.change) > 0.02 * converged.plate).any(axis=2) | (converged.coverage > 0.0)
    if moving == "camera":  # Nothing else is sure to be shared.
        assert alone.support is not None
        changed &= alone.support & (converged.coverage == 0.0)
    off = [(frame.beauty - converged.beauty)[changed] for frame in (alone, together)]
    level = converged.beauty[changed].mean()
    before, after = (float(np.sqrt(np.square(each).mean()) / level) for each in off)
    signed = float(off[1].mean() / level)
    print(f"{moving}: {100 * before:.2f} % alone, {100 * after:.2f} % with six others, signed {100 * signed:+.2f} %")
    assert after < (0.75 if moving == "camera" else 1.02) * before
    assert abs(signed) < 0.005

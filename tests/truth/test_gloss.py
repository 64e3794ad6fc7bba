"""A room with a polished floor, from a camera one metre beside the capture point."""

import pytest
from bench.gloss import FULL, ROUGHNESSES, compare
from bench.places import polished_room

from lightdepth.scene.model import Gloss


@pytest.mark.truth
@pytest.mark.parametrize("roughness", ROUGHNESSES)
def test_recovered_gloss_at_least_halves_the_error_of_a_camera_elsewhere(roughness):
    compared = compare(polished_room(gloss=Gloss(roughness, 0.5)), FULL)
    assert compared.found.gloss is not None
    assert compared.recovered is not None
    assert compared.found.gloss.roughness == pytest.approx(roughness, abs=0.05)
    for error, without in zip(compared.errors(compared.recovered), compared.errors(compared.matte), strict=True):
        assert error <= 0.5 * without

"""The paper's method: where nothing new is near, a support point converges to the photograph (paper, eq. 6)."""

import numpy as np

import lightdepth
from tests.transport.places import GREY, ball, lamp_image, room


def test_support_converges_to_the_photograph_far_from_the_objects():
    scene = room(lamp_image(128), [ball(GREY, (0.3, 1.2, 0.02), 0.02)])
    frame = lightdepth.render(scene, "view", samples=64, method="envpath", seed=1)
    free = frame.coverage == 0.0
    change, plate = frame.change[free], frame.plate[free]
    noise = np.sqrt(frame.variance[free].sum(axis=0)) / plate.sum(axis=0)
    # 256 lights stand for the map, and their sum is interpolated over a quarter of a metre.
    assert (np.abs(change.sum(axis=0) / plate.sum(axis=0)) < 0.02 + 3.0 * noise).all()


def test_an_object_darkens_the_floor_below_it_and_is_lit():
    frame = lightdepth.render(room(lamp_image(64), [ball(GREY)]), "view", samples=32, method="envpath")
    covered = frame.coverage == 1.0
    assert covered.any()
    assert frame.synthetic[covered].mean() > 0.0
    assert frame.change[frame.coverage == 0.0].mean() < 0.0

"""Untouched pixels are the photograph: exactly, after any number of samples, and without variance."""

from dataclasses import replace

import numpy as np
import pytest

import lightdepth
from lightdepth.directions import pixel_directions
from lightdepth.film.layers import read_frame, write_frame
from tests.transport.places import GREY, ball, box_depth, lamp_image, room, with_floor_alone_as_support


@pytest.fixture(scope="module")
def photograph():
    generator = np.random.default_rng(1)
    image = np.exp(generator.normal(0.0, 3.0, (32, 64, 3))).astype(np.float32)
    image[3, 5], image[7, 9] = 1e5, 0.0
    return image


@pytest.mark.parametrize("samples", [1, 64])
def test_without_objects_the_picture_is_the_photograph_bit_for_bit(photograph, samples, tmp_path):
    frame = lightdepth.render(room(photograph), "pano", samples=samples)
    assert frame.beauty.tobytes() == photograph.tobytes()
    write_frame(tmp_path / "picture.exr", frame)
    assert read_frame(tmp_path / "picture.exr").beauty.tobytes() == photograph.tobytes()


def test_pixels_that_no_object_influences_have_no_variance():
    """Only the floor is support; the walls are environment and must stay the photograph."""
    image = lamp_image(128)
    scene = with_floor_alone_as_support(room(image, [ball(GREY)]))
    frame = lightdepth.render(scene, "pano", samples=32)
    looks_up = np.zeros(frame.coverage.shape, bool)
    looks_up[: frame.coverage.shape[0] * 2 // 5] = True
    assert (frame.coverage[looks_up] == 0).all()
    assert (frame.variance[looks_up] == 0).all()
    assert frame.beauty[looks_up].tobytes() == image[looks_up].tobytes()
    assert (frame.variance[~looks_up] > 0).any()


def test_a_seed_gives_the_same_picture_twice_and_another_seed_another():
    scene = room(lamp_image(64), [ball(GREY)])
    first = lightdepth.render(scene, "view", samples=8, seed=3)
    again = lightdepth.render(replace(scene), "view", samples=8, seed=3)
    other = lightdepth.render(scene, "view", samples=8, seed=4)
    assert first.beauty.tobytes() == again.beauty.tobytes()
    assert first.beauty.tobytes() != other.beauty.tobytes()


def test_the_mesh_may_be_made_from_depth_instead():
    image = lamp_image(128)
    scene = room(image, [ball(GREY)])
    meshed = lightdepth.render(scene, "view", samples=64)

    directions = pixel_directions(128, 256) @ scene.panorama.rotation.T
    depth = box_depth(directions).astype(np.float32)
    from_depth = replace(scene, real=(), panorama=replace(scene.panorama, depth=depth))
    frame = lightdepth.render(from_depth, "view", samples=64)
    assert np.abs(frame.plate - meshed.plate).mean() < 0.02 * meshed.plate.mean()
    # Without the upper quarter, where the lamp's rim is: hundreds of times as bright as its neighbour, all noise.
    assert frame.change[8:].sum() == pytest.approx(meshed.change[8:].sum(), rel=0.1)

"""A moved object: what stays is neither made nor compiled again."""

from dataclasses import replace

import pytest

from lightdepth.kernel.start import start

start("cpu")

import drjit as dr  # noqa: E402

import lightdepth  # noqa: E402
from lightdepth.kernel.shapes import forget_shapes, synthetic_shapes  # noqa: E402
from lightdepth.scene.materials import Metal  # noqa: E402
from tests.transport.places import GREY, ball, lamp_image, room  # noqa: E402

METAL = Metal(type="metal", name="Ag", roughness=0.3)


def scene(x=0.3):
    return room(lamp_image(64), [ball(METAL, (-0.5, 1.0, 0.3), 0.3), ball(GREY, (x, 1.2, 0.4))], irradiance_samples=16)


def test_only_the_moved_object_has_a_new_shape():
    forget_shapes()
    before = [shape for _, shape in synthetic_shapes(scene()).numbered]
    after = [shape for _, shape in synthetic_shapes(scene(0.31)).numbered]
    assert after[0] is before[0]
    assert after[1] is not before[1]
    assert after[1].bsdf() is before[1].bsdf()
    assert after[1].bbox().min.x == pytest.approx(before[1].bbox().min.x + 0.01)


def test_what_stands_twice_at_one_place_is_two_shapes():
    twice = scene()
    twice = replace(twice, synthetic=twice.synthetic[:1] * 2)
    (_, first), (_, second) = synthetic_shapes(twice).numbered
    assert first is not second


def kernels(scene):
    """Hashes of the kernels that a picture takes."""
    dr.kernel_history_clear()
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        lightdepth.render(scene, "view", samples=1, draft=True)
        return {kernel["hash"] for kernel in dr.kernel_history((dr.KernelType.JIT,))}


def test_a_moved_object_compiles_nothing():
    lightdepth.api.forget_prepared()
    first = kernels(scene())
    assert first
    for x in (0.31, 0.32, 0.33):
        assert kernels(scene(x)) <= first

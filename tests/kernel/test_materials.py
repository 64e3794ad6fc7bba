"""BSDFs by the shapes that wear them, against Mitsuba's own calls by pointer."""

import numpy as np
import pytest

from lightdepth.kernel.start import start


@pytest.fixture(scope="module")
def worn():
    """Spheres in a row along x, whose materials hold others; two share one. Hits, with a ray that misses."""
    start("cpu")
    import drjit as dr
    import mitsuba as mi

    from lightdepth.kernel.materials import Materials

    def diffuse(reflectance):
        return {"type": "diffuse", "reflectance": reflectance}

    shared = mi.load_dict({"type": "twosided", "bsdf": diffuse(0.7)})
    materials = [
        {"type": "mask", "opacity": 0.4, "bsdf": {"type": "twosided", "bsdf": diffuse(0.3)}},
        shared,
        {"type": "twosided", "bsdf": {"type": "roughconductor", "alpha": 0.4}},
        {"type": "blendbsdf", "weight": 0.25, "a": diffuse(0.9), "b": {"type": "roughplastic"}},
        shared,
        {"type": "dielectric"},
    ]
    shapes = [
        mi.load_dict({"type": "sphere", "center": [4.0 * place, 0.0, 0.0], "bsdf": material})
        for place, material in enumerate(materials)
    ]
    scene = mi.load_dict({"type": "scene", **{f"s{place}": shape for place, shape in enumerate(shapes)}})
    x = mi.Float(np.array([20.3, 0.2, 12.1, 4.4, 8.3, 16.2, 0.5, 2.0], np.float32))
    ray = mi.Ray3f(mi.Point3f(x, 0.1, 5.0), mi.Vector3f(0.0, 0.0, -1.0))
    dr.make_opaque(ray)
    yield mi, Materials(shapes), scene.ray_intersect(ray)
    del scene  # Hits only point to its shapes.


def test_what_shapes_wear_is_what_is_evaluated(worn):
    mi, materials, si = worn
    index, met = materials.index(si, si.is_valid()), si.is_valid()
    outgoing = mi.warp.square_to_cosine_hemisphere(mi.Point2f(0.3, 0.6))
    assert (materials.flags(index, met).numpy()[:-1] == si.bsdf().flags().numpy()[:-1]).all()

    value, density = materials.eval_pdf(index, mi.BSDFContext(), si, outgoing, met)
    expected_value, expected_density = si.bsdf().eval_pdf(mi.BSDFContext(), si, outgoing, met)
    np.testing.assert_array_equal(value.numpy(), expected_value.numpy())
    np.testing.assert_array_equal(density.numpy(), expected_density.numpy())
    assert len(np.unique(value.numpy()[0])) > 4  # The spheres differ, and what is missed has none.

    drawn, weight = materials.sample(index, mi.BSDFContext(), si, mi.Float(0.35), mi.Point2f(0.2, 0.7), met)
    expected, expected_weight = si.bsdf().sample(mi.BSDFContext(), si, mi.Float(0.35), mi.Point2f(0.2, 0.7), met)
    np.testing.assert_array_equal(drawn.wo.numpy(), expected.wo.numpy())
    np.testing.assert_array_equal(weight.numpy(), expected_weight.numpy())

    passed = materials.null_transmission(index, si, met).numpy()
    np.testing.assert_array_equal(passed, si.bsdf().eval_null_transmission(si, met).numpy())
    assert materials.have_holes
    assert passed.max() == pytest.approx(0.6)


def test_without_shapes_nothing_is_reflected(worn):
    mi, _, si = worn
    from lightdepth.kernel.materials import Materials

    empty = Materials([])
    nowhere = mi.Bool(False) & si.is_valid()
    value, _ = empty.eval_pdf(empty.index(si, nowhere), mi.BSDFContext(), si, mi.Vector3f(0.0, 0.0, 1.0), nowhere)
    assert not value.numpy().any()
    assert not empty.have_holes


def test_only_worn_materials_are_compiled(worn):
    """A material below another one takes no part by itself: half as many operations as by pointer."""
    import drjit as dr

    mi, materials, si = worn

    def operations(call):
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            dr.eval(call())
            return max(kernel.get("operation_count", 0) for kernel in dr.kernel_history())

    arguments = mi.BSDFContext(), si, mi.Float(0.35), mi.Point2f(0.2, 0.7), si.is_valid()
    index = materials.index(si, si.is_valid())
    assert operations(lambda: materials.sample(index, *arguments)) < 0.7 * operations(
        lambda: si.bsdf().sample(*arguments)
    )

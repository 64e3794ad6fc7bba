"""The metallic-roughness BSDF: its sampling, its density and its energy."""

import numpy as np
import pytest

from lightdepth.kernel.start import start

SURFACES = [
    {"metallic": 0.0, "roughness": 0.3},
    {"metallic": 1.0, "roughness": 0.5},
    {"metallic": 0.3, "roughness": 0.8, "clearcoat": 0.7, "clearcoat_roughness": 0.4},
]


@pytest.fixture(scope="module")
def mi():
    start("cpu")
    import mitsuba

    import lightdepth.kernel.metallic_roughness  # noqa: F401

    return mitsuba


def make(mi, **settings):
    return mi.load_dict({"type": "metallicroughness", "base_color": 0.7, **settings})


def interaction(mi, cosine, count):
    import drjit as dr

    si = dr.zeros(mi.SurfaceInteraction3f, count)
    si.wi = mi.Vector3f((1 - cosine**2) ** 0.5, 0.0, cosine)
    return si


@pytest.mark.parametrize("settings", SURFACES)
@pytest.mark.parametrize("cosine", [0.95, 0.3])
def test_samples_follow_the_density(mi, settings, cosine):
    import drjit as dr

    bsdf = make(mi, **settings)

    def sample(points, choices):
        found, weight = bsdf.sample(mi.BSDFContext(), interaction(mi, cosine, dr.width(points)), choices, points)
        return found.wo, dr.select(weight.x > 0.0, 1.0, 0.0)

    def density(directions):
        return bsdf.pdf(mi.BSDFContext(), interaction(mi, cosine, dr.width(directions)), directions)

    test = mi.chi2.ChiSquareTest(
        domain=mi.chi2.SphericalDomain(),
        sample_func=lambda points: sample(mi.Point2f(points.x, points.y), points.z),
        pdf_func=density,
        sample_dim=3,
        sample_count=200_000,
        res=51,
        ires=16,
    )
    assert test.run(0.01)


@pytest.mark.parametrize("settings", SURFACES)
def test_value_is_eval_over_density(mi, settings):
    bsdf = make(mi, **settings)
    count = 1000
    si = interaction(mi, 0.5, count)
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(3, count)
    found, weight = bsdf.sample(mi.BSDFContext(), si, sampler.next_1d(), sampler.next_2d())
    good = np.array(found.pdf) > 0
    value, density = bsdf.eval_pdf(mi.BSDFContext(), si, found.wo)
    np.testing.assert_allclose(np.array(density)[good], np.array(found.pdf)[good], rtol=1e-4)
    ratio = np.array(value)[0][good] / np.array(density)[good]
    np.testing.assert_allclose(np.array(weight)[0][good], ratio, rtol=1e-3)


@pytest.mark.parametrize("metallic", [0.0, 1.0])
@pytest.mark.parametrize("roughness", [0.0, 0.1, 0.4, 1.0])
def test_white_reflects_what_arrives(mi, metallic, roughness):
    bsdf = make(mi, base_color=1.0, metallic=metallic, roughness=roughness)
    count = 100_000
    sampler = mi.load_dict({"type": "independent"})
    for cosine in (1.0, 0.5, 0.2, 0.05):
        sampler.seed(5, count)
        weight = bsdf.sample(mi.BSDFContext(), interaction(mi, cosine, count), sampler.next_1d(), sampler.next_2d())[1]
        assert np.array(weight)[0].mean() == pytest.approx(1.0, abs=0.006)


def test_nothing_comes_from_below(mi):
    bsdf = make(mi)
    si = interaction(mi, 0.5, 1)
    assert np.array(bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(0, 0, -1))).max() == 0.0
    si.wi = mi.Vector3f(0, 0, -1)
    assert np.array(bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(0, 0, 1))).max() == 0.0

"""What the benchmark measures, on images whose errors are known."""

import numpy as np
import pytest
from bench.analysis import convergence
from bench.measures import find_regions, measure, structural_similarity
from bench.places import lamp_and_window
from bench.truth import Estimate, content_hash

GENERATOR = np.random.default_rng(4)


def estimate(mean: np.ndarray, sigma: float) -> Estimate:
    height, width = mean.shape[:2]
    coverage = np.zeros((height, width))
    coverage[:, : width // 2] = 1.0
    return Estimate(mean, np.full(mean.shape, sigma**2), coverage, 1, 1.0)


def test_noise_of_the_truth_is_taken_out_and_bias_is_found() -> None:
    exact = np.full((64, 64, 3), 2.0)
    sigma = 0.1
    truth = estimate(exact + GENERATOR.normal(0.0, sigma, exact.shape), sigma)
    regions = find_regions(truth, exact)
    found = measure(1.05 * exact, truth, regions)["objects"]
    assert found["signed"] == pytest.approx(0.05, abs=0.003)
    assert found["rmse"] == pytest.approx(0.05, rel=0.1)
    assert found["block_rmse"] == pytest.approx(0.05, rel=0.1)
    assert not regions["changed"].any()


def test_regions_follow_coverage_and_change() -> None:
    empty = np.ones((32, 32, 3))
    full = empty.copy()
    full[:10, 20:] = 0.8
    regions = find_regions(estimate(full, 1e-4), empty)
    assert regions["objects"][:, :16].all()
    assert regions["changed"][2:8, 22:30].all()
    assert regions["untouched"][20:, 20:].all()
    assert sum(regions[name].sum() for name in ("objects", "changed", "untouched")) == 32 * 32


def test_similarity_is_one_for_equal_images_only() -> None:
    image = GENERATOR.uniform(size=(32, 32, 3))
    assert structural_similarity(image, image) == pytest.approx(1.0)
    assert structural_similarity(image, image[::-1]).mean() < 0.5


def test_convergence_tells_bias_from_noise_and_time_to_an_error() -> None:
    bias, noise = 0.02, 0.4
    records = [
        {
            "samples": samples,
            "seconds": [0.5 + 0.1 * samples],
            "measures": {"objects": {"rmse": np.sqrt(bias**2 + noise**2 / samples)}},
        }
        for samples in (4, 16, 64)
    ]
    fitted = convergence(records, "objects")
    assert fitted is not None
    assert (fitted.bias, fitted.noise) == (pytest.approx(bias), pytest.approx(noise))
    assert fitted.seconds_to(np.sqrt(bias**2 + noise**2 / 100)) == pytest.approx(10.5)
    assert fitted.seconds_to(0.01) == np.inf


def test_cache_keys_follow_content() -> None:
    place = lamp_and_window()
    assert content_hash(place.parts) == content_hash(lamp_and_window().parts)
    assert content_hash(place.objects) != content_hash(lamp_and_window("matte").objects)

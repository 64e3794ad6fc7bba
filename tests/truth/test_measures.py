"""What the benchmark measures, on images whose errors are known."""

import numpy as np
import pytest
from bench.analysis import convergence
from bench.goals import goals
from bench.measures import block_products, converged, find_regions, interval, measure, structural_similarity
from bench.places import lamp_and_window
from bench.run import FULL, QUICK, SEEDS, plan_of
from bench.truth import Estimate, content_hash, on_plate

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


def biased(size: float) -> np.ndarray:
    """A bias of the given root mean square over blocks, of both signs."""
    pattern = np.repeat(np.repeat(np.sin(1.0 + np.arange(64.0)).reshape(8, 8), 8, axis=0), 8, axis=1)
    return np.broadcast_to(size * (pattern / np.sqrt(np.mean(pattern**2)))[..., None], (64, 64, 3))


def two_noisy_images(exact: np.ndarray, bias: np.ndarray) -> tuple[np.ndarray, np.ndarray, Estimate]:
    """Two images with noise 50 times the smallest bias below, and a noisy truth."""
    first, second = (exact + bias + GENERATOR.normal(0.0, 0.5, exact.shape) for _ in range(2))
    return first, second, estimate(exact + GENERATOR.normal(0.0, 0.2, exact.shape), 0.2)


@pytest.mark.parametrize("size", [0.0, 0.01, 0.05])
def test_the_error_at_convergence_is_that_without_noise(size: float) -> None:
    exact, bias = np.full((64, 64, 3), 2.0), biased(size)
    mask = np.ones((64, 64), dtype=bool)
    squares, covered, plain = [], [], []
    for _ in range(200):
        first, second, truth = two_noisy_images(exact, bias)
        one, other = first - truth.mean, second - truth.mean
        products = block_products(one, other, truth.variance, mask)
        low, high = interval(products)
        squares.append(products.mean())
        covered.append(low <= size**2 <= high)
        plain.append(block_products(one, one, truth.variance, mask).mean())
    error = np.std(squares) / np.sqrt(len(squares))
    assert abs(np.mean(squares) - size**2) < 3.0 * error
    assert error < 5e-5
    assert np.mean(covered) > 0.6
    # The noise of one image is in its plain error.
    assert min(plain) > 0.05**2


def test_an_error_that_may_be_none_is_reported_with_its_bound() -> None:
    exact = np.full((64, 64, 3), 2.0)
    for _ in range(20):
        first, second, truth = two_noisy_images(exact, biased(0.0))
        found = converged(first, second, truth, find_regions(truth, exact))["objects"]
        assert found["low"] <= found["error"] <= found["high"]
        assert 0.0 < found["high"] < 0.02
        assert found["truth_noise"] == pytest.approx(0.2 / 8.0 / 2.0, rel=0.01)
        assert found["signed"] == pytest.approx(0.0, abs=0.01)


def test_regions_without_enough_blocks_have_no_error_at_convergence() -> None:
    truth = estimate(np.ones((64, 64, 3)), 0.1)
    mask = np.zeros((64, 64), dtype=bool)
    mask[:8, :16] = True
    assert converged(truth.mean, truth.mean, truth, {"small": mask}) == {}


def test_noise_of_the_plate_counts_where_it_is_seen() -> None:
    full, empty = estimate(np.ones((8, 8, 3)), 0.1), estimate(np.ones((8, 8, 3)), 0.2)
    variance = on_plate(full, empty).variance
    assert variance[:, :4] == pytest.approx(0.1**2)
    assert variance[:, 4:] == pytest.approx(0.1**2 + 0.2**2)


@pytest.mark.parametrize("effort", [QUICK, FULL])
def test_every_method_renders_the_largest_budget_with_two_seeds(effort) -> None:
    for method in ("difference", "debevec", "cycles_proxy", "luxcore_catcher"):
        plan = plan_of(method, "view", "exact", False, effort)
        assert [seed for budgets, seed in plan if effort.budgets[-1] in budgets] == list(SEEDS)
        assert len([budgets for budgets, _ in plan if effort.budgets[0] in budgets]) == effort.repeats
    assert not set(SEEDS) & {1, 2, 3}


def test_methods_that_are_mostly_noise_are_followed_further() -> None:
    assert min(FULL.longer.values()) > FULL.budgets[-1]
    for method in ("difference", "debevec", "cycles_proxy", "luxcore_catcher"):
        plan = plan_of(method, "view", "exact", False, FULL)
        longest = max(max(budgets) for budgets, _ in plan)
        assert longest == FULL.longer.get(method, FULL.budgets[-1])
        assert [seed for budgets, seed in plan if longest in budgets] == list(SEEDS)


def row_of(errors: dict[str, tuple[float, float, float]], longer: dict[str, int] | None = None) -> list[str]:
    """The summary's row of methods' errors at convergence, each with its interval; ``difference`` comes first.

    With 16 samples, those that are followed for ``longer`` have twice the error.
    """
    longer = longer or {}
    records = []
    for method, (error, low, high) in errors.items():
        found = {"signed": 0.001, "error": error, "low": low, "high": high, "truth_noise": 0.002}
        record = {"method": method, "place": "room", "model": "exact", "camera": "view", "denoised": False}
        if method in longer:
            records.append(record | {"samples": longer[method], "measures": {}, "converged": {"objects": found}})
            found = found | {"error": 2.0 * error}
        records.append(record | {"samples": 16, "measures": {}, "converged": {"objects": found}})
    effort = {"places": ["room"], "budgets": [4, 8, 16], "converged": 64, "longer": longer}
    results = {"records": records, "effort": effort, "labels": {method: method for method in errors}}
    table = next(rows for title, _, rows in goals(results) if title.startswith("Error at convergence"))
    assert len(table) == 1
    return table[0]


def test_the_summary_tells_how_many_times_ours_the_others_errors_are() -> None:
    row = row_of({"difference": (0.0012, 0.001, 0.0014), "a": (0.012, 0.01, 0.02), "b": (0.001, 0.0, 0.003)})
    assert row == ["room", "objects", "0.20 %", "0.12 % ± 0.02", "1.20 % (10.0x)", "0.10 % (0 to 0.30)"]


def test_the_summary_takes_the_error_of_what_was_followed_further() -> None:
    row = row_of({"difference": (0.0012, 0.001, 0.0014), "a": (0.012, 0.01, 0.02)}, {"a": 64})
    assert row[3:] == ["0.12 % ± 0.02", "1.20 % (10.0x)"]


def test_the_summary_gives_a_bound_where_our_error_may_be_none() -> None:
    row = row_of({"difference": (0.0, 0.0, 0.0005), "a": (0.01, 0.009, 0.011)})
    assert row[3:] == ["0.00 % (0 to 0.05)", "1.00 % (> 20.0x)"]


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

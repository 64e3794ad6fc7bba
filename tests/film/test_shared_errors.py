"""What all pixels have in common is estimated, reported, and counts for a wanted noise."""

import math
from dataclasses import replace

import numpy as np
import pytest

from lightdepth.kernel.start import start

start("cpu")

from lightdepth.api import begin_rendering  # noqa: E402
from lightdepth.cameras import Perspective  # noqa: E402
from lightdepth.film.shared_errors import CacheUse, ListUse, difference_error  # noqa: E402
from lightdepth.parameters import FilmParameters, Parameters  # noqa: E402
from tests.chance import Seen, check_seen  # noqa: E402
from tests.transport.places import GREY, ball, lamp_image, room  # noqa: E402

SEEDS, SAMPLES = 16, 1024
TILE = 4


@pytest.fixture(scope="module")
def scene():
    """Seen by so few pixels that their own noise is soon small."""
    scene = room(lamp_image(128), [ball(GREY)])
    camera = Perspective(type="perspective", width=24, height=16, fov=80)
    return replace(scene, cameras={"view": replace(scene.cameras["view"], camera=camera)})


def test_the_estimate_is_what_is_seen_over_seeds(scene):
    """One short light list for all paths; as many training paths at first as a large picture has.

    Means of tiles have a quarter of the pixels' own errors and all of the common one, which varies slowly over the
    picture.
    """
    few = FilmParameters(light_list_length=512, light_list_paths=1 << 40, first_training_share=4.0)
    scene = replace(scene, render=replace(scene.render, parameters=Parameters(film=few)))
    pictures, own, common, lists = [], [], [], []
    for seed in range(SEEDS):
        rendering = begin_rendering(scene, "view", seed=seed)
        list(rendering.run(SAMPLES))
        frame = rendering.frame(auxiliary=False)
        pictures.append(frame.beauty)
        light_list, cache = (float(frame.metadata[name]) for name in ("light_list_error", "radiance_cache_error"))
        lists.append(light_list)
        common.append(light_list**2 + cache**2)
        own.append(np.mean(np.square(rendering.errors.own())))
        irradiance = rendering.errors.shared_variance()[0]
        expected = math.sqrt(own[-1] + common[-1] + float(np.mean(irradiance)))
        assert float(frame.metadata["error"]) == pytest.approx(expected, rel=0.02)
    # That of a single picture is 0 where its estimate's own noise is larger, in one of some two hundred.
    assert np.median(lists) > 0.0
    tiles = (
        np.stack(pictures).astype(np.float64).reshape(SEEDS, 16 // TILE, TILE, 24 // TILE, TILE, 3).mean(axis=(2, 4))
    )
    relative = tiles.var(axis=0, ddof=1).mean(axis=2) / np.square(tiles.mean(axis=(0, 3)))
    observed = relative.mean() - np.mean(own) / TILE**2
    check_seen(0.5 * math.log(np.mean(common) / observed), Seen(11, 0.312, 0.312, 0.0987), -1.0, 1.5)


def test_what_is_in_common_counts_for_a_wanted_noise(scene):
    spent = []
    for irradiance in (0.0, 0.02):
        rendering = begin_rendering(scene, "view", seed=1)
        report = replace(rendering.errors._prepared.irradiance, mean_error=irradiance)
        rendering.errors._prepared = replace(rendering.errors._prepared, irradiance=report)
        list(rendering.run(4096, 0.02))
        spent.append(rendering.frame(auxiliary=False).samples)
    changed = np.abs(rendering.frame(auxiliary=False).change).mean(axis=2) > 0.02
    check_seen(math.log(spent[1].mean() / spent[0].mean()), Seen(11, 0.633, 0.633, 0.0491), low=0.0)
    check_seen(math.log(spent[1][changed].mean() / spent[0][changed].mean()), Seen(11, 1.34, 1.34, 0.088), low=0.0)


def test_lists_and_caches_count_by_how_they_were_used():
    lists = ListUse()
    assert lists.share(10) == 1.0
    for _ in range(4):
        lists.next_list()
        lists.add(100, 10)
    assert lists.share(10) == pytest.approx(1 / 4)
    # Four lists, but each pixel has been in one pass only.
    rows = ListUse()
    for _ in range(4):
        rows.next_list()
        rows.add(100, 10)
    assert rows.share(40) == 1.0
    cache = CacheUse()
    cache.add(100, 50)
    assert cache.share(50) == pytest.approx(1.0)
    # Of means x of 1 and y of 1 + 3 records, y = (x + 3 z) / 4, half of the paths each: var (x + y) / 2 by hand.
    cache = CacheUse()
    cache.add(1, 1)
    cache.add(1, 4)
    assert cache.share(4) == pytest.approx(4 * np.square([5 / 8, 3 / 8 / math.sqrt(3)]).sum())


def test_the_difference_is_found_beneath_noise():
    generator = np.random.Generator(np.random.PCG64(1))  # The same input with every seed of `tests.machine`.
    common = generator.normal(0.0, 0.1, (200_000, 3))
    noisy = [common + generator.normal(0.0, 0.5, common.shape) for _ in range(2)]
    assert difference_error(*noisy, np.full(len(common), 2.0)) == pytest.approx(0.05, rel=0.05)

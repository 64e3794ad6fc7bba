"""Where samples go, when they stop, and whether the estimated error is the real one."""

import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from lightdepth.kernel.start import start

start("cpu")

import lightdepth  # noqa: E402
from lightdepth.api import begin_rendering  # noqa: E402
from lightdepth.film import picture_error  # noqa: E402
from lightdepth.film.pixel_list import PixelList  # noqa: E402
from lightdepth.film.schedule import passes  # noqa: E402
from lightdepth.parameters import FilmParameters, Parameters  # noqa: E402
from lightdepth.scene.model import Role  # noqa: E402
from tests.chance import Seen, check_mean, check_seen  # noqa: E402
from tests.transport.places import GREY, ball, lamp_image, one_pass, picture, room  # noqa: E402

PILOT_SAMPLES = FilmParameters().pilot_samples


@pytest.fixture(scope="module")
def scene():
    return room(lamp_image(128), [ball(GREY)])


@pytest.fixture(scope="module")
def seeds(scene):
    """The same picture 24 times, with the same number of samples everywhere."""
    return [picture(scene, "view", PILOT_SAMPLES, seed) for seed in range(24)]


def test_estimated_variance_is_the_spread_over_seeds(seeds):
    """The estimate is made for independent samples; well spread ones deviate less, so that it is on the safe side."""
    pictures = np.stack([frame.beauty for frame in seeds]).astype(np.float64)
    spread = pictures.var(axis=0, ddof=1).mean(axis=2)
    estimated = np.mean([frame.variance for frame in seeds], axis=(0, 3))
    changed = spread > 0
    covered = seeds[0].coverage == 1
    ratios = []
    for where in (changed & covered, changed & ~covered):
        # Trimmed, because a few fireflies hold most of the plain sum.
        few = np.quantile(spread[where], 0.98)
        where = where & (spread < few)
        ratios.append(spread[where].sum() / estimated[where].sum())
    check_seen(ratios[0], Seen(11, 0.227, 0.227, 0.00818), 0.1, 1.25)
    check_seen(ratios[1], Seen(11, 0.765, 0.765, 0.0159), 0.4, 1.25)


def test_a_draft_shows_its_true_error(scene, seeds):
    """One sample a pixel: the error against the mean of many pictures is the one that is reported."""
    truth = np.mean([frame.beauty for frame in seeds], axis=0, dtype=np.float64)
    reported, true = [], []
    for seed in range(77, 85):
        rendering = begin_rendering(scene, "view", seed=seed)
        *_, last = rendering.run(1)
        draft = rendering.frame(auxiliary=False)
        brightness = truth.mean(axis=2) + 0.1 * np.median(draft.plate.mean(axis=2))
        error = ((draft.beauty - truth).mean(axis=2) / brightness)[draft.samples > 0]
        reported.append(last.error**2)
        true.append(np.mean(error**2))
    check_seen(np.log(np.mean(reported) / np.mean(true)), Seen(11, -0.169, -0.169, 0.0462), -0.8, 0.8)
    check_seen(np.sqrt(np.mean(reported)), Seen(11, 0.0935, 0.0935, 0.00529), low=0.02)


def test_samples_go_where_the_error_is(scene):
    frame = lightdepth.render(scene, "view", samples=64)
    check_seen(frame.samples.mean() / 64, Seen(11, 1.0, 1.0, 0.000274), 0.95, 1.05)
    assert frame.samples.min() >= PILOT_SAMPLES
    per_sample = np.sqrt(frame.variance.mean(axis=2) * frame.samples)
    noisy = per_sample > np.quantile(per_sample, 0.9)
    quiet = per_sample < np.quantile(per_sample, 0.5)
    check_seen(frame.samples[noisy].mean() / frame.samples[quiet].mean(), Seen(11, 4.13, 4.13, 0.195), low=1.5)


def test_no_pixel_is_given_up(scene):
    """Most of the room is even, and a pilot of 16 samples finds no error there."""
    frame = lightdepth.render(scene, "view", samples=512)
    assert frame.samples.min() >= 512 / 8
    assert frame.samples.mean() == pytest.approx(512, rel=0.02)


def test_a_pixels_own_luck_does_not_decide_how_many_samples_it_gets(scene):
    rendering = begin_rendering(scene, "view")
    lucky = len(rendering.pixels) // 2
    error = np.zeros(len(rendering.pixels), np.float32)
    error[lucky] = 1.0
    around = PixelList(scene.cameras["view"], rendering.pixels).around(error, 2)
    assert around[lucky] == 0.0
    assert np.count_nonzero(around) >= 8


def test_noise_stops_near_its_target_and_counts_samples_truly(scene):
    target = 0.03
    rendering = begin_rendering(scene, "view", seed=5)
    steps = list(rendering.run(4096, target))
    assert steps[-1].fraction == 1.0
    assert steps[-1].samples >= PILOT_SAMPLES
    check_seen(steps[-1].samples, Seen(11, 43.3, 43.3, 1.08), high=2048)
    frame = rendering.frame(auxiliary=False)
    assert frame.samples.max() <= 4096 + 4
    # Pixel by pixel: in the root mean square a few outliers that reached the largest number of samples weigh most.
    relative = np.sqrt(frame.variance.mean(axis=2)) / (frame.beauty.mean(axis=2) + 0.1 * np.median(frame.plate))
    sampled = relative[frame.samples > 0]
    check_seen(np.quantile(sampled, 0.9) / target, Seen(11, 0.642, 0.642, 0.0286), 0.3, 1.3)
    assert frame.samples.mean() == pytest.approx(steps[-1].samples, rel=1e-3)
    looser = begin_rendering(scene, "view", seed=5)
    check_seen(list(looser.run(4096, 0.1))[-1].samples / steps[-1].samples, Seen(11, 0.374, 0.374, 0.00991), high=0.8)


def test_progress_costs_little(scene, monkeypatch):
    """By a clock on which a pass takes a tenth of a second, and estimating the error half of that."""
    now = 0.0
    monkeypatch.setattr(picture_error, "time", SimpleNamespace(monotonic=lambda: now))
    small = Parameters(film=FilmParameters(paths_at_once=1 << 12))
    rendering = begin_rendering(replace(scene, render=replace(scene.render, parameters=small)), "view", seed=1)
    in_error = 0.0
    overall = rendering.errors.overall

    def timed():
        nonlocal in_error, now
        in_error, now = in_error + 0.05, now + 0.05
        return overall()

    monkeypatch.setattr(rendering.errors, "overall", timed)
    fractions = []
    for step in rendering.run(128):
        fractions.append(step.fraction)
        now += 0.1
    assert len(fractions) > 25
    assert fractions == sorted(fractions)
    assert 0.1 < in_error < 0.08 * now  # More than once, and little.


def test_a_frame_in_between_does_not_disturb_the_rest(scene):
    watched, plain = (begin_rendering(scene, "view", seed=9) for _ in range(2))
    for _ in watched.run(32):
        watched.frame(auxiliary=False)
    list(plain.run(32))
    assert watched.frame().beauty.tobytes() == plain.frame(finish=True).beauty.tobytes()


def test_indirect_light_is_held_to_the_clamp():
    """A tiny lamp before a mirror ball makes fireflies on a rough floor; the clamp holds them, and is in the header."""
    scene = room(lamp_image(128), [ball(GREY)], role=Role.SUPPORT)
    clamped = replace(scene, render=replace(scene.render, clamp_indirect=1e-6))
    direct = replace(scene, render=replace(scene.render, max_bounces=1))

    def on_ball(scene, seed):
        frame = one_pass(scene, "view", seed)
        return frame.beauty[frame.coverage == 1].mean()

    # Nothing but direct light is left.
    mean = np.mean([on_ball(direct, seed) for seed in range(1000, 1004)])
    check_mean(lambda seed: (on_ball(clamped, seed) - on_ball(direct, seed + 500)) / mean, 0.0, caught=0.04)
    rendering = begin_rendering(clamped, "view")
    list(rendering.run(1))
    assert float(rendering.frame(auxiliary=False).metadata["clamp_indirect"]) == 1e-6


MEMORY = """
import lightdepth
from bench.memory import peak_memory
from tests.transport.places import GREY, ball, lamp_image, room
scene = room(lamp_image(128), [ball(GREY)])
lightdepth.render(scene, "pano", samples=2)
peaks = []
for samples in (16, 256):
    lightdepth.render(scene, "pano", samples=samples)
    peaks.append(peak_memory() / 2**20)
print(*peaks)
"""


def test_memory_does_not_grow_with_the_samples():
    run = subprocess.run([sys.executable, "-c", MEMORY], capture_output=True, text=True, check=True)
    few, many = map(float, run.stdout.split())
    assert many < few + 80.0, f"{few:.0f} MB with 16 samples, {many:.0f} MB with 256"


@pytest.mark.parametrize("wanted", [[], [0] * 5, [10_000] * 100, "random", [0] * 3000 + [7] * 10 + [0] * 3000])
def test_passes_give_every_pixel_what_it_wants_in_bounded_portions(wanted):
    parameters = FilmParameters() if wanted == "random" else FilmParameters(paths_at_once=1000)
    counts = np.random.default_rng(1).integers(0, 1000, 70_000) if wanted == "random" else wanted
    wanted = np.array(counts, np.int32)
    given = np.zeros_like(wanted)
    for slots, portion in passes(wanted, parameters):
        assert 0 < portion.sum() < parameters.paths_at_once + parameters.samples_at_once
        assert len(np.unique(slots)) == len(slots)
        given[slots] += portion
    np.testing.assert_array_equal(given, wanted)

"""Renderings that are stopped, continued, interleaved, saved and shared give the picture of one that is not."""

import threading
from dataclasses import replace

import numpy as np
import pytest

from lightdepth.kernel.start import start

start("cpu")

import lightdepth  # noqa: E402
from lightdepth.api import begin_rendering  # noqa: E402
from lightdepth.errors import InputError  # noqa: E402
from lightdepth.film.checkpoint import resume, write_checkpoint  # noqa: E402
from lightdepth.film.sums import PixelSums, Share, merge  # noqa: E402
from lightdepth.parameters import FilmParameters, Parameters  # noqa: E402
from lightdepth.scene.materials import Metal  # noqa: E402
from tests.transport.places import GREY, ball, lamp_image, room  # noqa: E402

SMALL = FilmParameters(paths_at_once=1 << 13, light_list_paths=1 << 14, light_paths_at_once=1 << 11)
"""Small pictures in many passes, with several light lists and blocks of light paths."""


@pytest.fixture(scope="module")
def scene():
    """With metal, so that there are paths from the light as well."""
    metal = Metal(type="metal", name="Ag", roughness=0.3)
    return room(lamp_image(128), [ball(metal), ball(GREY, (-0.5, 1.0, 0.3), 0.3)], parameters=Parameters(film=SMALL))


def contents(frame):
    layers = (frame.change, frame.synthetic, frame.coverage, frame.variance, frame.samples)
    return [layer.tobytes() for layer in layers]


def noise(frame):
    """Relative error of the sampled pixels from their own samples; that of shared errors is estimated too roughly here."""
    sampled = frame.samples > 0
    return np.sqrt(np.mean(frame.variance.mean(axis=2)[sampled] / np.square(frame.beauty.mean(axis=2)[sampled])))


def whole(scene, camera, samples, seed=3):
    rendering = begin_rendering(scene, camera, seed=seed)
    list(rendering.run(samples))
    return contents(rendering.frame(auxiliary=False))


def passes(rendering, samples, count, **target):
    for _, _ in zip(range(count), rendering.run(samples, **target), strict=False):
        pass


def test_renderings_in_turn_give_what_each_gives_alone(scene):
    alone = [whole(scene, *each) for each in (("view", 16, 3), ("dome", 16, 4))]
    both = [begin_rendering(scene, camera, seed=seed) for camera, seed in (("view", 3), ("dome", 4))]
    steps = [rendering.run(16) for rendering in both]
    turns = 0
    while sum(next(each, None) is not None for each in steps):
        turns += 1
    assert turns > 4
    assert [contents(rendering.frame(auxiliary=False)) for rendering in both] == alone


def test_renderings_in_threads_give_what_each_gives_alone(scene):
    cameras = ("view", "dome", "pano")
    alone = [whole(scene, camera, 8, seed) for seed, camera in enumerate(cameras)]
    found = [None] * len(cameras)

    def render(number):
        found[number] = whole(scene, cameras[number], 8, number)

    threads = [threading.Thread(target=render, args=(number,)) for number in range(len(cameras))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == alone


@pytest.mark.parametrize("noise", [None, 0.1])
def test_a_stopped_rendering_goes_on_to_the_same_picture(scene, noise):
    plain = begin_rendering(scene, "view", seed=3)
    count = len(list(plain.run(64, noise)))
    assert 1 < count // 3 < count - 2
    for stop in (1, count // 3, count - 2):
        stopped = begin_rendering(scene, "view", seed=3)
        passes(stopped, 64, stop, noise=noise)
        last = list(stopped.run(64, noise))[-1]
        assert last.fraction == 1.0
        assert contents(stopped.frame(auxiliary=False)) == contents(plain.frame(auxiliary=False))
        assert len(list(stopped.run(64, noise))) == 1  # All is done.


def test_more_samples_are_added_to_those_that_there_are(scene):
    rendering = begin_rendering(scene, "view", seed=3)
    list(rendering.run(64))
    before = rendering.frame(auxiliary=False)
    fractions = [step.fraction for step in rendering.run(128)]
    after = rendering.frame(auxiliary=False)
    assert fractions[0] > 0.5
    assert fractions[-1] == 1.0
    assert after.samples.mean() == pytest.approx(128, rel=0.02)
    assert (after.samples >= before.samples).all()
    assert noise(after) < 0.8 * noise(before)
    # The samples lie where they are needed, about as well as if they had been taken at once.
    at_once = begin_rendering(scene, "view", seed=3).complete(128, auxiliary=False)
    assert noise(after) < 1.05 * noise(at_once)


def test_a_region_comes_first_and_the_rest_follows(scene):
    rendering = begin_rendering(scene, "view", seed=3)
    list(rendering.run(32, region=(8, 4, 24, 20)))
    first = rendering.frame(auxiliary=False)
    inside = np.zeros(first.samples.shape, bool)
    inside[4:20, 8:24] = True
    assert not first.samples[~inside].any()
    assert first.samples[inside].mean() == pytest.approx(32, rel=0.05)
    list(rendering.run(32))
    assert rendering.frame(auxiliary=False).samples.mean() == pytest.approx(32, rel=0.05)


@pytest.mark.parametrize("arguments", [(0,), (-3,), (4, 0.0), (4, None, (5, 5, 5, 9))])
def test_targets_out_of_range_are_refused(scene, arguments):
    with pytest.raises(InputError, match="samples = |noise = |region = "):
        begin_rendering(scene, "view").run(*arguments)


def test_no_samples_are_refused(scene):
    with pytest.raises(InputError, match="samples = 0: at least 1"):
        lightdepth.render(scene, "view", samples=0)


def test_a_scene_without_cameras_is_refused(scene):
    with pytest.raises(InputError, match="has no camera"):
        lightdepth.render(replace(scene, cameras={}), samples=1)


@pytest.mark.parametrize("stop", [0, 1, 5, 9])
def test_a_rendering_goes_on_from_its_checkpoint(scene, tmp_path, stop):
    first = begin_rendering(scene, "view", seed=3)
    passes(first, 32, stop)
    write_checkpoint(tmp_path / "x.checkpoint", first)
    second = begin_rendering(scene, "view", seed=3)
    resume(tmp_path / "x.checkpoint", second)
    list(second.run(32))
    assert contents(second.frame(auxiliary=False)) == whole(scene, "view", 32)


def test_a_checkpoint_of_something_else_is_refused(scene, tmp_path):
    first = begin_rendering(scene, "view", seed=3)
    passes(first, 4, 1)
    path = tmp_path / "x.checkpoint"
    write_checkpoint(path, first)
    moved = replace(scene, synthetic=scene.synthetic[:1])
    for other, message in (
        (begin_rendering(scene, "view", seed=4), r"another seed \(4 and 3\)"),
        (begin_rendering(scene, "dome", seed=3), "another camera"),
        (begin_rendering(moved, "view", seed=3), "another scene"),
    ):
        with pytest.raises(InputError, match=message):
            resume(path, other)
    whole_file = path.read_bytes()
    for damaged in (whole_file[: len(whole_file) // 2], b"", b"x" * 1000):
        path.write_bytes(damaged)
        with pytest.raises(InputError, match="damaged"):
            resume(path, begin_rendering(scene, "view", seed=3))


def part(scene, share, samples=48, **options):
    rendering = begin_rendering(scene, "view", seed=3, share=share, **options)
    list(rendering.run(samples))
    return rendering.sums()


@pytest.mark.parametrize("metal", [True, False])
def test_shares_merged_are_the_picture_of_one_process(scene, tmp_path, metal):
    if not metal:
        scene = replace(scene, synthetic=scene.synthetic[1:])
    files = []
    for index in range(3):
        files.append(tmp_path / f"{index}.sums")
        part(scene, Share(index, 3)).save(files[-1])
    merged = merge([PixelSums.load(file) for file in (files[2], files[0], files[1])])
    assert merged.complete
    whole_sums = part(scene, Share())
    for name in ("pixels", "taken", "change", "synthetic", "squares", "covered"):
        np.testing.assert_array_equal(getattr(merged, name), getattr(whole_sums, name))
    assert merged.light_count == whole_sums.light_count
    assert (merged.light_count > 0) == metal
    rendering = begin_rendering(scene, "view", seed=3)
    rendering.adopt(merged)
    frame, expected = (
        rendering.frame(auxiliary=False),
        begin_rendering(scene, "view", seed=3).complete(48, None, None, False),
    )
    if metal:  # Where light paths of several shares meet, the order of their sum is another.
        np.testing.assert_allclose(frame.beauty, expected.beauty, rtol=1e-6)
        assert frame.samples.tobytes() == expected.samples.tobytes()
    else:
        assert contents(frame) == contents(expected)


def test_parts_that_do_not_belong_together_are_refused(scene):
    one = part(scene, Share(0, 2), 8)
    with pytest.raises(InputError, match=r"holds share 1/2, which is in part 1 as well"):
        merge([one, one])
    with pytest.raises(InputError, match=r"another samples \(4 and 8\)|another samples \(8 and 4\)"):
        merge([one, part(scene, Share(1, 2), 4)])
    with pytest.raises(InputError, match="another division"):
        merge([one, part(scene, Share(1, 3), 8)])
    other = part(scene, Share(1, 2), 8)
    for name, value in (
        ("version", "0.0.1"),
        ("scene", "00"),
        ("method", "directional"),
        ("seed", 4),
        ("size", (9, 9)),
    ):
        with pytest.raises(InputError, match=f"part 2: does not belong to part 1: it has another {name}"):
            merge([one, replace(other, origin=replace(other.origin, **{name: value}))])
    assert merge([one]).missing == ("2/2",)
    assert merge([one, other]).complete
    with pytest.raises(InputError, match="depend on all shares"):
        begin_rendering(scene, "view", share=Share(0, 2)).run(8, 0.1)


def test_sums_of_regions_are_parts_that_can_be_saved_and_merged_again(scene, tmp_path):
    sums = [part(scene, Share(index, 2), 4) for index in range(2)]
    regions = (0, 0, 20, 32), (20, 0, 48, 10), (20, 10, 48, 32)
    parts = [each.within(region) for each in sums for region in regions]
    assert 0 < len(parts[0].pixels) < len(sums[0].pixels)
    parts[2].save(tmp_path / "x.sums")
    parts[2] = PixelSums.load(tmp_path / "x.sums")
    assert parts[2].regions == regions[2:]
    again, expected = merge([parts[index] for index in (4, 2, 0, 5, 1, 3)]), merge(sums)
    assert again.complete
    assert again.header() == expected.header()
    for name, values in expected.arrays().items():
        assert getattr(again, name).tobytes() == values.tobytes()
    assert merge([parts[0], parts[1]]).missing == ("2/2", "the region 20,10,48,32")
    with pytest.raises(InputError, match=r"part 2: holds share 1/2 of the region 20,0,30,10, which is in part 1"):
        merge([parts[1], sums[0].within((10, 0, 30, 32))])
    with pytest.raises(InputError, match="holds share 2/2, which is in part 1 as well"):
        merge([sums[1], sums[1]])
    with pytest.raises(InputError, match=r"it has other regions \(20,0,48,10 and 0,0,20,32\)"):
        merge([parts[0], parts[4]])
    with pytest.raises(InputError, match=r"holds other shares \(1/2\) than part 1 \(1/2, 2/2\)"):
        merge([merge(sums).within(regions[0]), parts[1]])
    with pytest.raises(InputError, match="another number of light paths"):
        merge([parts[0], replace(parts[1], light_count=1)])
    with pytest.raises(InputError, match=r"region = \(20, 0, 30, 9\): the sums have no pixel in it"):
        parts[0].within((20, 0, 30, 9))


def test_a_rendering_of_which_a_region_was_sampled_gives_the_sums_of_this_region(scene):
    rendering = begin_rendering(scene, "view", seed=3)
    list(rendering.run(4, region=(8, 4, 24, 20)))
    sums = rendering.sums()
    assert sums.regions == ((8, 4, 24, 20),)
    assert sums.missing[0] == "the region 0,0,48,4"
    list(rendering.run(4))
    assert rendering.sums().complete


@pytest.mark.parametrize("text", ["0/4", "5/4", "1", "a/b", "-1/4", "1/0", "²/4"])
def test_shares_are_written_as_two_numbers(text):
    with pytest.raises(InputError, match="share"):
        Share.parse(text)
    assert Share.parse("2/4") == Share(1, 4)

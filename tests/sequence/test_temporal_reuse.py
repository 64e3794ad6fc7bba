"""Samples that frames share: nothing that is known gets lost, nothing that moves is smeared."""

from dataclasses import replace

import numpy as np
import pytest

from lightdepth.kernel.start import start

start("cpu")

import mitsuba as mi  # noqa: E402

from lightdepth.api import begin_rendering  # noqa: E402
from lightdepth.cameras import Equirectangular, Perspective  # noqa: E402
from lightdepth.directions import look_at_rotation  # noqa: E402
from lightdepth.errors import InputError  # noqa: E402
from lightdepth.film.frame import Frame  # noqa: E402
from lightdepth.film.frame_file import load_frame, saved_facts  # noqa: E402
from lightdepth.images.exr import read_exr  # noqa: E402
from lightdepth.parameters.reuse import ReuseParameters  # noqa: E402
from lightdepth.preparation.place import forget_places  # noqa: E402
from lightdepth.scene.frames import SceneFrames  # noqa: E402
from lightdepth.scene.model import CameraView  # noqa: E402
from lightdepth.sequence.fingerprint import FINGERPRINT, State  # noqa: E402
from lightdepth.sequence.numbering import FrameFiles  # noqa: E402
from lightdepth.sequence.rendering import SequenceJob  # noqa: E402
from lightdepth.sequence.samples import SampledFrames  # noqa: E402
from lightdepth.sequence.steady import SteadyRendering  # noqa: E402
from lightdepth.sequence.temporal_reuse import SampledFrame, reuse  # noqa: E402
from lightdepth.session.session import Job  # noqa: E402
from tests.cli.room_folder import edit, make_room  # noqa: E402

TABLE = 0.4
"""Height of the table that stands on the floor where x > 0."""


def seen_from(position, kind="perspective"):
    """A camera, and what it sees of floor and table: points, depth, and where that is (0 nothing, 1 floor, 2 table)."""
    if kind == "perspective":
        camera = Perspective(type=kind, width=64, height=48, fov=60.0, position=tuple(position))
        view = CameraView(camera, np.array(position), look_at_rotation(np.array(position), (0.0, 1.5, 0.0)))
    else:
        view = CameraView(Equirectangular(type=kind, width=64), np.array(position), np.eye(3))
    width, height = view.resolution
    index = mi.UInt32(np.arange(width * height, dtype=np.uint32))
    rays = view.pixel_rays(mi.Float(index % width), mi.Float(index // width), mi.Point2f(0.5), mi.Point2f(0.5))
    directions = np.array(rays.ray.d).T.reshape(height, width, 3).astype(np.float64)
    with np.errstate(divide="ignore"):
        floor, table = (
            np.where(directions[..., 2] < 0, (z - position[2]) / directions[..., 2], np.inf) for z in (0, TABLE)
        )
    at = np.array(position) + directions * np.where(np.isfinite(table), table, 0.0)[..., None]
    on_table = np.isfinite(table) & (at[..., 0] > 0.0)
    depth = np.where(on_table, table, floor)
    points = np.array(position) + directions * np.where(np.isfinite(depth), depth, 0.0)[..., None]
    return view, points, depth, np.where(np.isfinite(depth), 1 + on_table, 0)


def sampled(position, relative, kind="perspective", scene="", noise=0.0, seed=0, count=8):
    """A frame whose change relative to a textured photograph is ``relative`` of points and surface, with noise."""
    view, points, depth, which = seen_from(position, kind)
    plate = (1.0 + 0.8 * np.sin(40 * points) * np.cos(25 * points[..., [1, 2, 0]])).astype(np.float32)
    change = np.broadcast_to(relative(points, which)[..., None], plate.shape)
    change = change + noise * np.random.default_rng(seed).standard_normal(which.shape)[..., None]
    none = np.zeros(which.shape, np.float32)
    support = which > 0
    frame = Frame(
        plate=plate,
        change=np.where(support[..., None], plate * change, 0.0).astype(np.float32),
        synthetic=np.zeros_like(plate),
        coverage=none,
        alpha=none + 1,
        object_id=none.astype(np.uint32),
        depth=depth.astype(np.float32),
        normal=np.broadcast_to(np.float32([0, 0, 1]), plate.shape).astype(np.float16),
        albedo=np.ones(plate.shape, np.float16),
        support=support,
        variance=(np.square(noise * plate)).astype(np.float32),
        samples=np.full(which.shape, count, np.uint32),
        metadata={"error": "0.1"},
        topology=view.topology,
    )
    return SampledFrame(frame, view, scene)


def shared(frames, at):
    return reuse(frames[at].frame, frames[at], (frames[:at][::-1], frames[at + 1 :]))


def even(points, which):
    return np.full(which.shape, -0.3)


def path(count=5, step=0.06):
    return [(step * (i - count // 2), -1.0 + 0.02 * i, 1.4) for i in range(count)]


@pytest.mark.parametrize("kind", ["perspective", "equirectangular"])
def test_what_every_frame_finds_stays_what_it_is(kind):
    """Under a texture, and beside a table of another change, which must not bleed into the floor."""
    frames = [sampled(at, lambda points, which: np.where(which == 2, 0.5, -0.3), kind) for at in path()]
    result = shared(frames, 2)
    np.testing.assert_allclose(result.change, frames[2].frame.change, rtol=1e-4, atol=1e-6)


def test_a_gradient_stays_where_it_is():
    frames = [sampled(at, lambda points, which: 0.3 * points[..., 0] - 0.2 * points[..., 1]) for at in path()]
    one, many = frames[2].frame, shared(frames, 2)
    near = frames[2].frame.depth < 4.0  # Farther, a pixel is as deep as the room.
    np.testing.assert_allclose((many.change / one.plate)[near], (one.change / one.plate)[near], atol=4e-3)


def test_noise_and_its_estimate_fall_with_the_frames():
    frames = [
        sampled(at, lambda points, which: 0.0 * points[..., 0] - 0.3, noise=0.2, seed=i)
        for i, at in enumerate(path(9, 0.03))
    ]
    one, many = frames[4].frame, shared(frames, 4)
    inner = (slice(8, 40), slice(8, 56))
    apart = replace(frames[4], tuned=ReuseParameters(same_normal=1.0))  # No cosine exceeds 1.
    np.testing.assert_allclose(reuse(one, apart, (frames[:4][::-1],)).variance, one.variance, rtol=1e-5)
    error = (many.change / many.plate)[inner] + 0.3
    assert np.sqrt(np.square(error).mean()) < 0.2 / 3 * 1.05
    assert many.variance[inner].sum() == pytest.approx(one.variance[inner].sum() / 9, rel=0.05)
    assert float(many.metadata["error"]) < 0.1
    assert one.metadata["error"] == "0.1"


def test_what_no_other_frame_may_know_is_left_as_it_is():
    """Gloss, rims, sky: bit for bit, and they give nothing to others."""
    frames = [sampled(at, even, noise=0.2, seed=i) for i, at in enumerate(path())]
    left = np.arange(64) < 32
    frames = [replace(each, frame=replace(each.frame, support=each.frame.support & left)) for each in frames]
    one, many = frames[2].frame, shared(frames, 2)
    assert many.change[:, 32:].tobytes() == one.change[:, 32:].tobytes()
    assert many.variance[:, 32:].tobytes() == one.variance[:, 32:].tobytes()
    assert (many.change[24, :31] != one.change[24, :31]).any(axis=1).all()


@pytest.mark.parametrize("mirrors", [False, True])
def test_an_object_at_rest(mirrors):
    """A textured tabletop that is new: matte, it has the samples of all; a mirror in which stripes run, its own."""

    def radiance(i, points, view):
        stripes = np.sign(np.sin(30 * points[..., 0] - 8 * view.position[0] * 20))
        return 0.5 + (0.4 * stripes if mirrors else 0.0 * stripes)

    frames, true = [], []
    for i, at in enumerate(path(7, 0.03)):
        each = sampled(at, even, noise=0.1, seed=i)
        view, points, _, which = seen_from(at)
        table = which == 2
        albedo = (0.5 + 0.3 * np.sin(20 * points)).astype(np.float16)
        noise = 0.1 * np.random.default_rng(i + 50).standard_normal(which.shape)
        true.append(radiance(i, points, view))
        light = np.where(table, true[-1] + noise, 0.0)[..., None] * albedo
        frame = replace(
            each.frame,
            change=each.frame.change * ~table[..., None],
            synthetic=light.astype(np.float32),
            coverage=table.astype(np.float32),
            object_id=table.astype(np.uint32),
            albedo=albedo,
            support=which == 1,
            variance=np.where(table[..., None], np.square(0.1 * albedo), each.frame.variance).astype(np.float32),
        )
        frames.append(replace(each, frame=frame))
    one, many = frames[3].frame, shared(frames, 3)
    table = one.object_id > 0
    alone, together = (np.square((f.synthetic / f.albedo).mean(axis=2) - true[3])[table].mean() for f in (one, many))
    assert together <= (1.0 if mirrors else 0.2) * alone
    assert not many.change[table].any()
    assert not many.synthetic[~table].any()


@pytest.mark.parametrize("step", [0.08, 0.02])
@pytest.mark.parametrize("noise", [0.1, 0.3])
def test_a_shadow_that_moves_is_not_smeared(step, noise):
    """Where it passes, fast or slowly, the error is not above that of the frame alone; elsewhere it falls all the same."""

    def shadow(i):
        return lambda points, which: -0.6 * (np.hypot(points[..., 0] + 0.2 - step * i, points[..., 1] - 1.5) < 0.25)

    frames = [sampled(at, shadow(i), scene=str(i), noise=noise, seed=i) for i, at in enumerate(path(7))]
    _, points, _, which = seen_from(path(7)[3])
    true = shadow(3)(points, which)
    passed = np.any([shadow(i)(points, which) != true for i in range(7)], axis=0) & (which > 0)
    alone, many = (np.square((f.change / f.plate).mean(axis=2) - true) for f in (frames[3].frame, shared(frames, 3)))
    assert passed.sum() > 20
    assert many[passed].mean() <= alone[passed].mean()
    still = ~passed & (which > 0)
    assert many[still].mean() < 0.25 * alone[still].mean()


# -- As a sequence ----------------------------------------------------------------------------------------------------

LAST, REACH = 6, 2


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A camera that travels, and a ball that rests until it moves in the last frame."""
    scene = make_room(tmp_path_factory.mktemp("room"))
    edit(scene, "[panorama]", f"[sequence]\nframes = [1, {LAST}]\n\n[panorama]")
    rolling = f"{{ frame = [{LAST - 1}, {LAST}], value = [[0.5, 1.0, 0.3], [0.6, 1.0, 0.3]] }}"
    edit(scene, "center = [0.5, 1.0, 0.3]", f"center = {rolling}")
    travelling = f"{{ frame = [1, {LAST}], value = [[0, -0.5, 1.3], [0.2, -0.6, 1.3]] }}"
    edit(
        scene,
        "width = 16\nheight = 9\n",
        f"width = 48\nheight = 32\nlook_at = [0.5, 1, 0.2]\nposition = {travelling}\n",
    )
    with scene.open("a") as file:
        file.write("\n[render]\nsamples = 16\nirradiance_samples = 16\n")
    return scene


def wanted(folder, numbers, **job):
    return SequenceJob(numbers, FrameFiles(folder / "shot.##.exr"), Job(cache=False, **job))


def steady(scene, folder, numbers, **job):
    return SteadyRendering(SceneFrames(scene), wanted(folder, numbers, **job), REACH, "cpu", lambda event: None)


@pytest.fixture(scope="module")
def shot(scene, tmp_path_factory):
    folder = tmp_path_factory.mktemp("shot")
    assert steady(scene, folder, range(1, LAST + 1)).run(lambda: False)
    return folder


def pixels(file):
    return [(part.name, name, plane.tobytes()) for part in read_exr(file) for name, plane in part.channels.items()]


def test_a_frame_is_the_same_whoever_renders_which(scene, shot, tmp_path):
    """Each frame by a rendering of its own, in another order, as other processes would."""
    for number in (4, 2):
        forget_places()
        assert steady(scene, tmp_path, [number]).run(lambda: False)
        assert pixels(tmp_path / f"shot.{number:02}.exr") == pixels(shot / f"shot.{number:02}.exr")
    assert not list(tmp_path.rglob("*.claim"))


def test_its_fingerprint_covers_all_that_it_is_made_of(scene, shot, tmp_path):
    numbers = range(1, LAST + 1)
    assert set(steady(scene, shot, numbers).states().values()) == {State.CURRENT}
    assert set(steady(scene, shot, numbers, samples=8).states().values()) == {State.OUTDATED}
    changed = SteadyRendering(SceneFrames(scene), wanted(shot, numbers), REACH + 1, "cpu", lambda event: None)
    assert set(changed.states().values()) == {State.OUTDATED}
    # The ball of the last frame matters to those that reach it.
    other = scene.with_name("other.toml")
    other.write_text(scene.read_text().replace("[0.6, 1.0, 0.3]", "[0.7, 1.0, 0.3]"))
    states = steady(other, shot, numbers).states()
    assert [states[number] is State.CURRENT for number in numbers] == [True, True, True, False, False, False]


def test_samples_go_where_they_are_not_shared(scene, shot):
    """The support of a frame that others share gets fewer, the ball more, on average as many as were asked for."""
    view = SceneFrames(scene).scene(2).cameras["view"]
    mine, last = (load_frame(shot / f"samples/shot.{number:02}.npz", view.topology) for number in (2, LAST))
    ball = [frame.samples[frame.coverage == 1.0].mean() for frame in (mine, last)]
    floor = [frame.samples[frame.support & (frame.coverage == 0.0)].mean() for frame in (mine, last)]
    assert mine.samples[mine.samples > 0].mean() == pytest.approx(16, rel=0.1)
    assert last.samples[last.samples > 0].mean() == pytest.approx(16, rel=0.1)
    assert ball[0] > 1.2 * ball[1]
    assert floor[0] < floor[1]
    assert mine.mattes is not None


def test_the_frame_is_nearer_to_what_all_samples_converge_to(scene, shot):
    frames = SceneFrames(scene)
    view = frames.scene(3).cameras["view"]
    converged = begin_rendering(frames.scene(3), "view", seed=99, cache=False).complete(1024)
    alone = load_frame(shot / "samples/shot.03.npz", view.topology)
    made = {part.name: part for part in read_exr(shot / "shot.03.exr")}
    change = np.stack([made["change"].channels[f"change.{letter}"] for letter in "RGB"], axis=-1)
    floor = alone.support & (alone.coverage == 0.0) & (converged.coverage == 0.0)
    before, after = (np.square(values - converged.change)[floor].mean() for values in (alone.change, change))
    assert after < 0.4 * before
    sums = [float(values[floor].sum()) for values in (change, converged.change)]
    assert sums[0] == pytest.approx(sums[1], rel=0.03)


def test_damaged_samples_are_rendered_again(scene, shot, tmp_path):
    around = SampledFrames(SceneFrames(scene), wanted(tmp_path, [1]), 0, "cpu", lambda event: None)
    assert around.states() == {1: State.MISSING}
    assert around.run(lambda: False)
    file = tmp_path / "samples/shot.01.npz"
    assert saved_facts(file)[FINGERPRINT]
    file.write_bytes(file.read_bytes()[:-100])
    assert around.states() == {1: State.DAMAGED}
    with pytest.raises(InputError, match="damaged"):
        around.frame(1)


def test_a_draft_has_no_surfaces_to_find_again(scene, tmp_path):
    with pytest.raises(InputError, match="--draft"):
        steady(scene, tmp_path, [1], draft=True)

"""Motion blur: the mean of instants, and nothing else."""

import json
import math
import time
from dataclasses import replace

import numpy as np
import pytest

from lightdepth.kernel.start import start

start("cpu")

import drjit as dr  # noqa: E402 - where LLVM is was settled by start()

from lightdepth.api import begin_rendering  # noqa: E402
from lightdepth.errors import InputError  # noqa: E402
from lightdepth.film.cryptomatte import Mattes  # noqa: E402
from lightdepth.film.frame import Frame  # noqa: E402
from lightdepth.film.layers import read_frame  # noqa: E402
from lightdepth.film.shutter import ShutterMean  # noqa: E402
from lightdepth.parameters import MotionBlurParameters, Parameters  # noqa: E402
from lightdepth.scene import load_scene  # noqa: E402
from lightdepth.scene.animation import SequenceTable  # noqa: E402
from lightdepth.scene.frames import SceneFrames  # noqa: E402
from lightdepth.sequence.film_motion import needed_instants  # noqa: E402
from lightdepth.sequence.fingerprint import State  # noqa: E402
from lightdepth.sequence.motion_blur import MotionBlur  # noqa: E402
from lightdepth.sequence.numbering import FrameFiles  # noqa: E402
from lightdepth.sequence.rendering import SequenceJob, SequenceRendering  # noqa: E402
from lightdepth.serve.worker import Worker  # noqa: E402
from lightdepth.session.displays import MemoryDisplay  # noqa: E402
from lightdepth.session.events import SCHEMA, Progress  # noqa: E402
from lightdepth.session.session import Job  # noqa: E402
from tests.cli.room_folder import edit, make_room, write_panorama  # noqa: E402
from tests.support.picture_file import undocumented  # noqa: E402

WIDTH, HEIGHT = 32, 16


def test_the_shutter_is_open_around_the_frame():
    sequence = SequenceTable(frames=(1, 9), shutter=0.5)
    assert sequence.opened(4, 1) == [4]
    np.testing.assert_allclose(sequence.opened(4, 4), [3.8125, 3.9375, 4.0625, 4.1875])


@pytest.mark.parametrize("shutter", ["-0.1", "1.5", '"half"'])
def test_a_shutter_is_a_share_of_a_frame(tmp_path, shutter):
    scene = make_room(tmp_path)
    edit(scene, "[panorama]", f"[sequence]\nframes = [1, 3]\nshutter = {shutter}\n\n[panorama]")
    with pytest.raises(InputError, match=r"\[sequence\]: shutter: must be .*(than or equal to|a number)"):
        load_scene(scene)


def random_frame(rng, plate):
    coverage = rng.choice([0.0, 0.3, 1.0], (4, 6)).astype(np.float32)
    there = coverage > 0.0
    return Frame(
        plate=plate,
        change=(rng.normal(size=(4, 6, 3)) * rng.choice([0, 1], (4, 6, 1))).astype(np.float32),
        synthetic=(rng.random((4, 6, 3)) * there[..., None]).astype(np.float32),
        coverage=coverage,
        alpha=np.ones((4, 6), np.float32),
        variance=np.full((4, 6, 3), 0.5, np.float32),
        samples=np.full((4, 6), 3, np.uint32),
        photograph=np.stack([coverage, 1.0 - coverage], axis=-1),
        object_names=("a",),
        mattes=Mattes(
            np.flatnonzero(there).astype(np.uint32),
            np.zeros(there.sum(), np.uint32),
            coverage[there],
            ("a",),
            ("a.diffuse",),
        ),
        object_id=there.astype(np.uint32),
        metadata={"error": "0.1", "samples": "3.0"},
    )


@pytest.mark.parametrize("travels", [False, True])
def test_the_picture_is_the_mean_of_pictures(travels):
    """Also where plate and coverage change together; the plate of a camera that stands is not touched."""
    rng = np.random.default_rng(3)
    plates = [rng.random((4, 6, 3)).astype(np.float32) for _ in range(3)]
    frames = [random_frame(rng, plates[(0, 0, 1, 2)[i] if travels else 0]) for i in range(4)]
    shares = [0.25, 0.125, 0.5, 0.125]
    mean = ShutterMean(middle=2)
    for frame, share in zip(frames, shares, strict=True):
        mean.add(frame, share)
    blurred = mean.frame()
    expected = sum(share * frame.beauty for frame, share in zip(frames, shares, strict=True))
    np.testing.assert_allclose(blurred.beauty, expected, atol=1e-6)
    np.testing.assert_allclose(blurred.variance, 0.5 * sum(share**2 for share in shares))
    assert (blurred.samples == 12).all()
    np.testing.assert_allclose(blurred.photograph[..., 0], blurred.coverage, atol=1e-6)
    np.testing.assert_array_equal(blurred.object_id, (blurred.coverage > 0.5).astype(np.uint32))
    matte = np.zeros(24, np.float32)
    matte[blurred.mattes.pixels] = blurred.mattes.shares
    np.testing.assert_allclose(matte.reshape(4, 6), blurred.coverage, atol=1e-6)
    if not travels:
        assert blurred.plate.tobytes() == plates[0].tobytes()


def test_where_a_part_of_the_time_is_missing_the_rest_counts_for_it():
    rng = np.random.default_rng(4)
    frame = random_frame(rng, rng.random((4, 6, 3)).astype(np.float32))
    mean = ShutterMean(middle=2)
    assert mean.is_empty
    for share in (0.25, 0.125):
        mean.add(frame, share)
    part = mean.frame()
    np.testing.assert_allclose(part.beauty, frame.beauty, atol=1e-6)
    np.testing.assert_allclose(part.mattes.shares, frame.mattes.shares, rtol=1e-6)
    np.testing.assert_allclose(part.variance, 0.5 * (2 / 3) ** 2 + 0.5 * (1 / 3) ** 2, rtol=1e-6)
    assert (part.samples == 6).all()


@pytest.fixture(scope="module")
def moving(tmp_path_factory):
    """A lit pane, square to the camera `view`, that moves 8 of its pixels in a frame; `travel` moves itself."""
    scene = make_room(tmp_path_factory.mktemp("room"))
    edit(scene, "[panorama]", "[sequence]\nframes = [1, 3]\nshutter = 0.5\ninstants = 8\n\n[panorama]")
    texture = np.random.default_rng(1).random((16, 32)).astype(np.float32)
    write_panorama(scene.with_name("room.exr"), texture)
    text = scene.read_text()
    text = text[: text.index("[[synthetic]]")]
    # 90 degrees at 2 metres: 4 metres on 32 pixels.
    text += """
[[synthetic]]
name = "pane"
shape = "rectangle"
scale = [0.25, 0.25, 1.0]
rotation = [90, 0, 0]
position = { frame = [1, 3], value = [[-1.0, 2.0, 1.3], [1.0, 2.0, 1.3]] }
material = { type = "emitter", radiance = 8.0 }
"""
    for name, place in (
        ("view", "[0, 0, 1.3]"),
        ("travel", "{ frame = [1, 3], value = [[-0.4, 0, 1.3], [0.4, 0, 1.3]] }"),
    ):
        text += f'[camera.{name}]\ntype = "perspective"\nwidth = {WIDTH}\nheight = {HEIGHT}\nfov = 90\n'
        text += f"rotation = [0, 0, 0]\nposition = {place}\n"
    scene.write_text(text + "\n[render]\nsamples = 32\nirradiance_samples = 16\n")
    return SceneFrames(scene)


def rendered(frames, camera, folder, **more):
    files = FrameFiles(folder / f"{camera}.#.exr")
    wanted = SequenceJob([2], files, Job(camera=camera, cache=False, **more))
    rendering = SequenceRendering(frames, wanted, "cpu", lambda event: None)
    assert rendering.run(lambda: False)
    assert rendering.states() == {2: State.CURRENT}
    assert undocumented(files.file(2)) == set()
    return read_frame(files.file(2))


def test_a_moving_pane_is_a_trapezoid(moving, tmp_path):
    """Open for half a frame it goes 4 pixels; it is 4 wide. So its coverage rises and falls by a quarter a pixel."""
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        frame = rendered(moving, "view", tmp_path)
        large = [kernel for kernel in dr.kernel_history() if kernel.get("operation_count", 0) > 2000]
        dr.kernel_history_clear()
    # Not one for each of the four instants: where a lamp stands is no part of a program. The lamp of the instant before
    # is still there when the next one is made, so that their numbers alternate: three layouts of the tables of calls.
    assert len({kernel["hash"] for kernel in large}) <= 3
    across = frame.coverage[HEIGHT // 2]
    column = np.arange(WIDTH) + 0.5
    closed_form = np.array(
        [np.clip((4 - np.abs(c + np.linspace(-0.5, 0.5, 101) - 16)) / 4, 0, 1).mean() for c in column]
    )
    np.testing.assert_allclose(across, closed_form, atol=0.05)
    np.testing.assert_allclose(frame.synthetic[HEIGHT // 2, :, 1], 8.0 * across, atol=1e-3)
    assert frame.metadata["instants"] == "4"
    plate = rendered(moving, "view", tmp_path / "sharp", samples=1).plate
    assert frame.plate.tobytes() == plate.tobytes()
    untouched = (frame.coverage == 0) & (frame.change == 0).all(axis=2)
    assert untouched.any()
    assert frame.beauty[untouched].tobytes() == plate[untouched].tobytes()


def test_a_travelling_camera_blurs_the_photograph_as_well(moving, tmp_path):
    frame = rendered(moving, "travel", tmp_path, samples=8)
    places = [rendered_plate(moving, instant) for instant in moving.sequence.opened(2, 4)]
    np.testing.assert_allclose(frame.plate, np.mean(places, axis=0), rtol=1e-5)
    assert not np.allclose(frame.plate, places[2], rtol=1e-3)


def answers(frames, **request):
    """Events of a worker's request, by kind and without the id."""
    told = []
    hello = {"request": "hello", "schema": SCHEMA}
    asked = {"request": "render", "id": "a", "scene": str(frames.path), "camera": "travel", "samples": 8} | request

    def asking():
        yield json.dumps(hello)
        yield json.dumps(asked)
        while not any(event["event"] in ("done", "failure") for event in told):
            time.sleep(0.01)

    Worker(lambda line: told.append(json.loads(line))).serve(asking())
    return told


def test_a_worker_renders_the_frame_of_the_sequence(moving, tmp_path):
    expected = rendered(moving, "travel", tmp_path, samples=8)
    *_, done = answers(moving, frame=2, output=str(tmp_path / "asked.exr"), preview_seconds=0.001)
    assert (done["event"], done["interrupted"]) == ("done", False)
    found = read_frame(tmp_path / "asked.exr")
    assert found.metadata["instants"] == "4"
    for name in ("plate", "change", "synthetic", "coverage", "variance"):
        assert getattr(found, name).tobytes() == getattr(expected, name).tobytes(), name
    *_, failure = answers(moving, frame=4, output=str(tmp_path / "none.exr"))
    assert "frame: 4 is outside the [sequence], which has frames 1 to 3" in failure["message"]


def test_a_blurred_frame_is_cancelled_with_what_there_is(moving):
    shown = MemoryDisplay()
    blur = MotionBlur([moving.scene(frame) for frame in moving.sequence.opened(2, 4)], Job(camera="view", samples=8))

    def stop(event):
        if isinstance(event, Progress) and event.fraction > 0.3:
            blur.cancel()

    done = blur.render([shown], "cpu", stop)
    assert done.interrupted
    assert shown.finished
    assert shown.frame.coverage.max() == pytest.approx(1.0, abs=1e-5)


def rendered_plate(frames, instant):
    return begin_rendering(frames.scene(instant), "travel", cache=False).plate


def test_instants_lie_close_on_the_film(moving):
    """The pane goes 4 pixels in half a frame; as seen from `travel`, which goes 0.2 metres along, less."""

    def needed(camera, opened, most=100, **tuned):
        scenes = [moving.scene(frame) for frame in (2 - opened / 2, 2, 2 + opened / 2)]
        render = replace(scenes[1].render, parameters=Parameters(motion_blur=MotionBlurParameters(**tuned)))
        scenes[1] = replace(scenes[1], render=render)
        return needed_instants(scenes, [scene.cameras[camera] for scene in scenes], most)

    assert needed("view", 0.5) == 4
    assert needed("view", 1.0) == math.ceil(8 / 1.5)
    assert needed("view", 1.0, most=5) == 5
    assert needed("view", 1.0, step=0.5) == 16
    assert needed("travel", 0.1, fewest_instants=2) == 2
    assert needed("travel", 0.1) == 4


def test_what_stands_is_rendered_once(moving):
    scenes = [moving.scene(2) for _ in range(16)]
    assert not MotionBlur(scenes, Job(camera="view")).moves
    assert [
        i.share for i in MotionBlur([*scenes[:4], *map(moving.scene, (2.1, 2.2))], Job(camera="view")).instants
    ] == (pytest.approx([4 / 6, 1 / 6, 1 / 6]))


def test_the_fingerprint_knows_the_motion(moving, tmp_path):
    """The next key moves the pane while the shutter is open, though not at the frame itself."""
    rendered(moving, "view", tmp_path, samples=2)
    text = moving.path.read_text()
    for old, new in (("shutter = 0.5", "shutter = 0.25"), ("[1.0, 2.0, 1.3]]", "[0.8, 2.0, 1.3]]")):
        path = moving.path.with_name("other.toml")
        path.write_text(text.replace(old, new))
        wanted = SequenceJob([2], FrameFiles(tmp_path / "view.#.exr"), Job(camera="view", cache=False, samples=2))
        assert SequenceRendering(SceneFrames(path), wanted, "cpu", json.dumps).states() == {2: State.OUTDATED}

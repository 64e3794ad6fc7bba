"""What does not change from frame to frame is the same, bit for bit."""

import numpy as np
import pytest

from lightdepth.kernel.start import start

start("cpu")

from lightdepth.api import begin_rendering  # noqa: E402
from lightdepth.preparation.place import forget_places, prepare_place  # noqa: E402
from lightdepth.scene.frames import SceneFrames  # noqa: E402
from lightdepth.sequence.fingerprint import frame_seed  # noqa: E402
from tests.cli.room_folder import edit, make_room  # noqa: E402

LAST = 12


@pytest.fixture(scope="module")
def frames(tmp_path_factory):
    """A camera that travels, another one that stands, and a ball that rolls."""
    scene = make_room(tmp_path_factory.mktemp("room"))
    edit(scene, "[panorama]", f"[sequence]\nframes = [1, {LAST}]\n\n[panorama]")
    rolling = f"{{ frame = [1, {LAST}], value = [[-0.8, 1.0, 0.3], [0.8, 1.0, 0.3]] }}"
    edit(scene, "center = [0.5, 1.0, 0.3]", f"center = {rolling}")
    travelling = f"{{ frame = [1, {LAST}], value = [[0, 0, 1.3], [0.6, -0.4, 1.3]] }}"
    text = scene.read_text()
    still = "width = 32\nheight = 18\nlook_at = [0, 1, 0.3]\nposition = [0, -0.5, 1.3]\n"
    text = text.replace("width = 16\nheight = 9\n", f'{still}\n[camera.travel]\ntype = "perspective"\n{still}')
    text = text[: text.rindex("position")] + f"position = {travelling}\n"
    scene.write_text(text + "\n[render]\nsamples = 4\nirradiance_samples = 16\n")
    return SceneFrames(scene)


def arrays(prepared):
    return {name: value for name, value in vars(prepared.real).items() if isinstance(value, np.ndarray)}


def test_what_is_recovered_of_the_place_does_not_depend_on_the_frame(frames):
    """Each time from the beginning, as another process would: no digit of irradiance or albedo may flicker."""
    found = []
    for number in (1, 5, LAST):
        forget_places()
        found.append(arrays(prepare_place(frames.scene(number))))
    assert found[0]["irradiance"].any()
    for other in found[1:]:
        for name, value in found[0].items():
            np.testing.assert_array_equal(value, other[name], err_msg=name)


def test_the_place_is_prepared_once(frames):
    assert len({id(prepare_place(frames.scene(number))) for number in range(1, LAST + 1)}) == 1


def test_the_photograph_stands_still_where_nothing_moves(frames):
    pictures = []
    for number in (1, 2, 7, LAST):
        rendering = begin_rendering(frames.scene(number), "view", seed=frame_seed(0, number), cache=False)
        pictures.append(rendering.complete(auxiliary=False))
    first = pictures[0]
    for other in pictures[1:]:
        assert other.plate.tobytes() == first.plate.tobytes()
        assert other.coverage.tobytes() != first.coverage.tobytes()
        still = (other.coverage == 0) & (first.coverage == 0)
        still &= (other.change == 0).all(axis=2) & (first.change == 0).all(axis=2)
        assert still.any()
        assert other.beauty[still].tobytes() == first.beauty[still].tobytes()

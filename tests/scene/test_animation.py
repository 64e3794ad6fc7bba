"""Tables of keys: the scene at a frame, and what is said where they are wrong."""

from fractions import Fraction

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from lightdepth.directions import euler_rotation
from lightdepth.errors import InputError, InputWarning
from lightdepth.scene import load_scene
from lightdepth.scene.animation import SequenceTable
from lightdepth.scene.animation.keys import Keys
from lightdepth.scene.frames import SceneFrames

SEQUENCE = """
[sequence]
frames = [1, 21]
fps = 25
"""
BALL = """
[[synthetic]]
name = "ball"
shape = "sphere"
center = {{ frame = [1, 11, 21], value = [[0, 2, 0.4], [1, 2, 0.4], [1, 2, 0.9]]{more} }}
radius = {{ frame = [1, 21], value = [0.2, 0.4] }}
material = {{ type = "emitter", radiance = {{ frame = [1, 21], value = [1, 3] }} }}
"""
CAMERA = """
[camera.view]
type = "perspective"
width = 32
height = 16
position = { frame = [1, 21], value = [[0, 0, 1.6], [2, 0, 1.6]] }
fov = { frame = [1, 21], value = [60, 40] }
"""


def ball_matrix(scene):
    return scene.synthetic[0].parts[0].geometry.to_world


def test_every_value_is_that_of_its_frame(write_scene):
    path = write_scene(SEQUENCE + BALL.format(more="") + CAMERA, panorama="scale = { frame = [1, 21], value = [1, 2] }")
    for frame, share in ((1, 0.0), (6, 0.25), (12.5, 0.575), (21, 1.0)):
        scene = load_scene(path, frame=frame)
        center = [min(2 * share, 1.0), 2, 0.4 + max(share - 0.5, 0.0)]
        np.testing.assert_allclose(ball_matrix(scene)[:3, 3], center, atol=1e-12)
        assert ball_matrix(scene)[0, 0] == pytest.approx(0.2 + 0.2 * share)
        assert scene.synthetic[0].parts[0].material.radiance == pytest.approx((1 + 2 * share,) * 3)
        np.testing.assert_allclose(scene.cameras["view"].position, [2 * share, 0, 1.6])
        assert scene.cameras["view"].camera.fov == pytest.approx(60 - 20 * share)
        np.testing.assert_allclose(scene.panorama.radiance, 0.5 * (1 + share), rtol=1e-6)
    assert load_scene(path).cameras["view"].camera.fov == 60.0


def test_a_step_waits_for_its_key(write_scene):
    path = write_scene(SEQUENCE + BALL.format(more=', interpolation = "step"'))
    assert [ball_matrix(load_scene(path, frame=frame))[0, 3] for frame in (1, 10.99, 11, 20)] == [0, 0, 1, 1]


def test_smooth_rests_at_its_ends_and_exceeds_no_key():
    frames, values = np.array([0.0, 4.0, 9.0, 10.0]), np.array([0.0, 3.0, 3.5, 3.5])
    keys = Keys(frames, values, "smooth")
    assert [keys.at(frame) for frame in frames] == values.tolist()
    path = np.array([keys.at(frame) for frame in np.linspace(-1.0, 11.0, 2401)])
    speed = np.diff(path) / 0.005
    assert (speed >= -1e-12).all()
    assert speed.max() > 1.0
    assert np.abs(np.diff(speed)).max() < 0.02  # No jolt.
    assert speed[201] < 0.01
    two = Keys(np.array([0.0, 2.0]), np.array([[1.0], [2.0]]), "smooth")
    assert [two.at(frame)[0] for frame in (0.5, 1.0)] == pytest.approx([1 + 0.25**2 * 2.5, 1.5])


@pytest.mark.parametrize("interpolation", ["linear", "smooth"])
def test_rotations_turn_the_short_way(interpolation):
    angles = np.array([[0.0, 0.0, 170.0], [0.0, 0.0, -170.0], [0.0, 0.0, -150.0]])
    keys = Keys(np.array([0.0, 10.0, 20.0]), angles, interpolation, turns=True)
    turned = [(keys.at(frame)[2] - 170.0) % 360.0 for frame in np.linspace(0.0, 20.0, 41)]
    assert np.diff(turned).min() > -1e-9
    assert turned[-1] == pytest.approx(40.0)
    if interpolation == "linear":
        np.testing.assert_allclose(np.diff(turned), 1.0, atol=1e-9)
    between = Keys(np.array([0.0, 1.0]), np.array([[80.0, 0.0, 0.0], [10.0, 50.0, -120.0]]), interpolation, turns=True)
    first, middle, last = (Rotation.from_matrix(euler_rotation(between.at(frame))) for frame in (0.0, 0.5, 1.0))
    whole = (first.inv() * last).magnitude()
    assert (first.inv() * middle).magnitude() == pytest.approx(0.5 * whole)
    assert (middle.inv() * last).magnitude() == pytest.approx(0.5 * whole)


def test_a_smooth_turn_stands_still_between_like_keys():
    angles = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 90.0], [0.0, 0.0, 90.0], [0.0, 0.0, 20.0]])
    keys = Keys(np.array([0.0, 10.0, 20.0, 30.0]), angles, "smooth", turns=True)
    turned = np.array([keys.at(frame)[2] for frame in np.linspace(0.0, 30.0, 301)])
    assert np.diff(turned[:101]).min() > -1e-9
    np.testing.assert_allclose(turned[100:201], 90.0, atol=1e-9)
    assert np.diff(turned[200:]).max() < 1e-9


@pytest.mark.parametrize("interpolation", ["linear", "smooth", "step"])
@pytest.mark.parametrize("turns", [False, True])
def test_what_is_held_does_not_change_in_its_last_digit(interpolation, turns):
    values = np.array([[0.1, 0.2, 0.3], [1.1, 2.7, 77.7], [1.1, 2.7, 77.7], [5.0, 6.0, 7.0]])
    keys = Keys(np.array([0.0, 10.0, 20.0, 30.0]), values, interpolation, turns)
    for frame in np.linspace(10.0, 20.0, 31):
        np.testing.assert_array_equal(keys.at(frame), values[1])


def test_a_smooth_turn_about_changing_axes_has_no_jolt():
    """The angular velocity is continuous at the keys, and is 0 at both ends."""
    angles = np.array([[0.0, 0.0, 0.0], [50.0, 20.0, 60.0], [120.0, 30.0, 100.0], [130.0, -60.0, 170.0]])
    frames = np.array([0.0, 7.0, 12.0, 20.0])
    keys = Keys(frames, angles, "smooth", turns=True)

    def velocity(begin, end):
        first, last = (Rotation.from_matrix(euler_rotation(keys.at(frame))) for frame in (begin, end))
        return (first.inv() * last).as_rotvec() / (end - begin)

    step = 1e-4
    assert np.linalg.norm(velocity(0.0, step)) < 1e-4
    assert np.linalg.norm(velocity(20.0 - step, 20.0)) < 1e-4
    for frame in frames[1:-1]:
        np.testing.assert_allclose(velocity(frame - step, frame), velocity(frame, frame + step), atol=2e-5)
    assert np.linalg.norm(velocity(12.0 - step, 12.0)) > 0.02


def test_a_long_turn_between_two_keys_is_warned_of(write_scene):
    text = (
        '\n[camera.c]\ntype = "fisheye"\nwidth = 8\nrotation = { frame = [1, 5], value = [[0, 0, 0], [0, 0, 360]] }\n'
    )
    with pytest.warns(
        InputWarning, match=r"scene.toml:\d+: \[camera.c\]: rotation: two keys are more than 180 degrees"
    ):
        load_scene(write_scene(SEQUENCE + text))


def test_what_does_not_change_is_read_once(write_scene):
    frames = SceneFrames(write_scene(SEQUENCE + BALL.format(more="") + CAMERA))
    first, second = frames.scene(1), frames.scene(2)
    assert first.panorama is second.panorama
    assert first.real[0] is second.real[0]
    assert not np.array_equal(ball_matrix(first), ball_matrix(second))
    assert frames.sequence.rate == 25


def test_images_are_read_once(write_scene, scene_folder):
    Image.new("RGB", (4, 4), (255, 0, 0)).save(scene_folder / "red.png")
    text = (
        '[[synthetic]]\nname = "b"\nshape = "cube"\nscale = 0.1\nmaterial = { type = "diffuse", color = "red.png" }\n'
    )
    moving = "position = { frame = [1, 3], value = [[0, 0, 1], [0, 1, 1]] }\n"
    frames = SceneFrames(write_scene(SEQUENCE + text + moving))
    first, second = (frames.scene(n).synthetic[0].parts[0].material.color for n in (1, 2))
    assert first is second
    Image.new("RGB", (4, 5), (0, 255, 0)).save(scene_folder / "red.png")
    assert frames.scene(3).synthetic[0].parts[0].material.color.pixels[0, 0].tolist() == [0.0, 1.0, 0.0]


@pytest.mark.parametrize(
    ("fps", "rate"),
    [(24, 24), (23.976, Fraction(24000, 1001)), (29.97, Fraction(30000, 1001)), (12.5, Fraction(25, 2))],
)
def test_frame_rates_are_exact(fps, rate):
    assert SequenceTable(frames=(0, 1), fps=float(fps)).rate == rate


WRONG = [
    (
        "fov = { frame = [1, 3, 2], value = [60, 50, 40] }",
        "fov: frame: keys must be in order, each after the one before",
    ),
    ("fov = { frame = [1, 3], value = [60, 50, 40] }", "equally long, found 2 frames and 3 values"),
    (
        'fov = { frame = [1, 3], value = [60, 50], interpolation = "bezier" }',
        "'bezier' is not known; allowed: linear, smooth, step",
    ),
    ("fov = { frame = [1, 30], value = [60, 50] }", "30 is outside the [sequence], which has frames 1 to 21"),
    ("fov = { frame = [1], value = [[60]], inter = 1 }", "unknown key 'inter'; a table of keys has frame, value"),
    ("fov = { frame = [1, 3] }", "the key 'value' is missing"),
    ('fov = { frame = [1, 3], value = [60, "wide"] }', "must be numbers, or lists of numbers"),
    ("look_at = { frame = [1, 3], value = [[1, 2, 3], [1, 2]] }", "all numbers, or all lists of as many numbers"),
    ("rotation = { frame = [1, 3], value = [1, 2] }", "rotation: value: must be lists of 3 angles"),
    ("fov = { frame = [1, 3], value = [60, 200] }", "fov: must be less than 180, found 200.0 (at frame 3)"),
    ("look_at = { frame = [1, 3], value = [[1, 2], [1, 2]] }", "look_at: must be a list of 3 numbers"),
]


@pytest.mark.parametrize(("key", "message"), WRONG, ids=[message for _, message in WRONG])
def test_a_wrong_key_has_one_message_with_its_line(write_scene, key, message):
    camera = f'[camera.view]\ntype = "perspective"\nwidth = 32\nheight = 16\n{key}\n'
    frames = SceneFrames(write_scene(SEQUENCE + camera))
    line = frames.path.read_text().splitlines().index(key) + 1
    problems = frames.table_problems()
    assert message in problems[0]
    assert all(f"scene.toml:{line}: [camera.view]: " in problem for problem in problems)
    assert len({problem.split(" (at frame")[0].split(", found")[0] for problem in problems}) == 1


def test_what_cannot_move_is_refused(write_scene):
    keys = "{ frame = [1, 3], value = [[0, 0, 0], [0, 0, 1]] }"
    camera = '[camera.view]\ntype = "equirectangular"\nwidth = { frame = [1, 3], value = [4, 8] }\n'
    real = f'[[real]]\nname = "floor"\nmesh = "floor.ply"\nrole = "support"\nposition = {keys}\n'
    with pytest.raises(InputError) as error:
        load_scene(write_scene(SEQUENCE + camera, panorama=f"position = {keys}", real=real))
    text = str(error.value)
    assert len(text.splitlines()) == 3
    assert "[panorama]: position: cannot have keys: of this table, only scale can" in text
    assert '[[real]] 1 ("floor"): position: cannot have keys: real surfaces stand where they were photographed' in text
    assert "[camera.view]: width: cannot have keys: of this table, only position, rotation, look_at, fov" in text


@pytest.mark.parametrize(
    ("sequence", "message"),
    [
        ("", "fov: has keys, but the file has no [sequence] with frames = [first, last]"),
        ("[sequence]\nframes = [5, 2]\n", "[sequence]: frames = [first, last]: 5 comes after 2"),
        ("[sequence]\nframes = [1]\n", "frames: must be a list of 2 numbers"),
        ("[sequence]\nframes = [1, 3]\nfps = 0\n", "fps: must be greater than 0"),
        ("[sequence]\nframes = [1, 3]\nshuter = 0\n", "unknown key 'shuter'"),
    ],
)
def test_a_wrong_sequence_is_named(write_scene, sequence, message):
    camera = (
        '[camera.view]\ntype = "perspective"\nwidth = 32\nheight = 16\nfov = { frame = [1, 3], value = [60, 50] }\n'
    )
    with pytest.raises(InputError) as error:
        load_scene(write_scene(sequence + camera))
    assert message in str(error.value)
    assert len(str(error.value).splitlines()) == 1


def test_there_is_no_frame_beyond_the_sequence(write_scene):
    with pytest.raises(InputError, match=r"has no frame 22; its \[sequence\] has frames 1 to 21"):
        load_scene(write_scene(SEQUENCE), frame=22)
    with pytest.raises(InputError, match=r"has no frame 3: it lacks \[sequence\]"):
        load_scene(write_scene(), frame=3)

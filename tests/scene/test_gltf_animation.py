"""Animations and cameras of glTF files, against closed forms."""

import json
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lightdepth.directions import look_at_rotation
from lightdepth.errors import InputError
from lightdepth.images.exr import ExrPart, write_exr
from lightdepth.scene import load_scene
from lightdepth.scene.frames import SceneFrames
from lightdepth.scene.identity import place_digest
from lightdepth.scene.meshes import AnimatedMesh
from tests.scene.gltf_writer import add_accessor, add_animation, gltf_document

SEQUENCE = "[sequence]\nframes = [1, 49]\nfps = 24\n"
CORNER = np.array([-1.0, -1.0, 0.0])  # The quad's first vertex, (-1, 0, 1) in the file.


def z_up(points):
    x, y, z = np.moveaxis(np.asarray(points, float), -1, 0)
    return np.stack([x, -z, y], axis=-1)


@pytest.fixture
def vertices_at(tmp_path):
    """Vertices of a document's first part at a time of an animation."""

    def read(document, name, time, loop=False):
        path = tmp_path / "moving.gltf"
        path.write_text(json.dumps(document))
        return AnimatedMesh(path, with_materials=True).parts(name, time, loop)[0].mesh.vertices

    return read


def test_nodes_move_in_lines_and_in_steps(vertices_at):
    places = [[0, 0, 0], [4, 2, 0], [4, 2, 8]]
    for interpolation, found in (("LINEAR", [3, 1.5, 0]), ("STEP", [0, 0, 0])):
        document = add_animation(gltf_document(), "go", (0, "translation", interpolation, [1, 3, 4], places))
        np.testing.assert_allclose(vertices_at(document, "go", 2.5)[0], CORNER + z_up(found), atol=1e-6)
        np.testing.assert_allclose(vertices_at(document, "go", 0.0)[0], CORNER)
        np.testing.assert_allclose(vertices_at(document, "go", 9.0)[0], CORNER + z_up([4, 2, 8]))
        np.testing.assert_allclose(vertices_at(document, "go", 3.0)[0], CORNER + z_up([4, 2, 0]))
        np.testing.assert_allclose(vertices_at(document, "go", 9.0, loop=True)[0], CORNER)


def test_a_cubic_spline_is_the_polynomial_that_it_samples(vertices_at):
    """With the true slopes at its keys, a cubic comes out as itself, whatever the distance of the keys."""

    def place(t):
        return np.array([t**3 - 2 * t, 0.5 * t**2, 1.0 - t**3])

    def slope(t):
        return np.array([3 * t**2 - 2, t, -3 * t**2])

    times = [0.0, 0.5, 2.0]
    values = [row for t in times for row in (slope(t), place(t), slope(t))]
    document = add_animation(gltf_document(), "curve", (0, "translation", "CUBICSPLINE", times, values))
    for time in (0.0, 0.2, 0.5, 1.1, 1.9, 2.0):
        np.testing.assert_allclose(
            vertices_at(document, "curve", time)[0], CORNER + z_up(place(time)), atol=2e-6, err_msg=str(time)
        )


def test_rotations_turn_evenly_the_short_way(vertices_at):
    """Evenly also where the sign of the quaternion says the long way, and as normalised shorts."""
    turns = [Rotation.from_euler("y", angle, degrees=True).as_quat() for angle in (20.0, 140.0)]
    turns[1] = -turns[1]
    shorts = np.round(np.array(turns) * 32767).astype(np.int16)
    document = add_animation(gltf_document(), "turn", (0, "rotation", "LINEAR", [0, 1], shorts))
    for time in (0.25, 0.5, 0.75):
        expected = Rotation.from_euler("y", 20 + 120 * time, degrees=True).apply([-1, 0, 1])
        np.testing.assert_allclose(vertices_at(document, "turn", time)[0], z_up(expected), atol=1e-4)


def test_children_skins_and_morph_targets_follow(vertices_at):
    """A skin of two joints, of which one swings; a morph target that rises as its weight does."""
    document = gltf_document(nodes=[{"mesh": 0, "skin": 0}, {"children": [2]}, {"translation": [0, 0, 0]}])
    document["scenes"][0]["nodes"] = [0, 1]
    primitive = document["meshes"][0]["primitives"][0]
    joints = np.array([[0, 0, 0, 0], [1, 0, 0, 0], [1, 0, 0, 0], [0, 0, 0, 0]], np.uint8)
    primitive["attributes"]["JOINTS_0"] = add_accessor(document, joints, "VEC4")
    document["accessors"][-1].pop("normalized")
    weights = np.tile(np.array([1, 0, 0, 0], np.float32), (4, 1))
    primitive["attributes"]["WEIGHTS_0"] = add_accessor(document, weights, "VEC4")
    rise = np.tile(np.array([0, 2, 0], np.float32), (4, 1))
    primitive["targets"] = [{"POSITION": add_accessor(document, rise, "VEC3")}]
    document["skins"] = [{"joints": [1, 2]}]
    quarter = Rotation.from_euler("x", [[0], [90]], degrees=True).as_quat()
    add_animation(
        document,
        "swing",
        (2, "rotation", "LINEAR", [0, 1], quarter),
        (1, "translation", "LINEAR", [0, 1], [[0, 0, 0], [10, 0, 0]]),
        (0, "weights", "LINEAR", [0, 2], [0.0, 1.0]),
    )
    found = vertices_at(document, "swing", 1.0)
    np.testing.assert_allclose(found[0], z_up([-1 + 10, 1, 1]), atol=1e-6)
    turned = Rotation.from_euler("x", 90, degrees=True).apply([1, 1, 1])
    np.testing.assert_allclose(found[1], z_up(turned + [10, 0, 0]), atol=1e-6)


def test_a_scene_shows_an_animation_with_offset_speed_and_loop(write_scene, scene_folder):
    document = add_animation(gltf_document(), "Walk", (0, "translation", "LINEAR", [0, 1], [[0, 0, 0], [1, 0, 0]]))
    (scene_folder / "figure.gltf").write_text(json.dumps(document))
    thing = '[[synthetic]]\nname = "figure"\nmesh = "figure.gltf"\nposition = [0, 0, 0.5]\nanimation = '

    def x_at(animation, frame):
        frames = SceneFrames(write_scene(SEQUENCE + thing + animation))
        frames.scene(2)  # What is kept of another frame must not show.
        return frames.scene(frame).synthetic[0].parts[0].geometry.vertices[0, 0] + 1.0

    assert x_at('"Walk"', 1) == 0.0
    assert x_at('"Walk"', 13) == pytest.approx(0.5)
    assert x_at('"Walk"', 49) == 1.0
    assert x_at('{ name = "Walk", offset = 0.25, speed = 0.5 }', 13) == pytest.approx(0.5)
    assert x_at('{ name = "Walk", offset = 0.25, loop = true }', 25) == pytest.approx(0.25)
    assert x_at('{ name = "Walk", offset = 1.0, speed = -1 }', 7) == pytest.approx(0.75)
    still = load_scene(write_scene(thing + '{ name = "Walk", offset = 0.75 }'))
    assert still.synthetic[0].parts[0].geometry.vertices[0, 0] == pytest.approx(-0.25)
    frames = SceneFrames(write_scene(SEQUENCE + thing + '"Walk"'))
    assert frames.scene(40).synthetic[0] is not frames.scene(3).synthetic[0]
    materials = [frames.scene(n).synthetic[0].parts[0].material for n in (1, 30)]
    assert materials[0] is materials[1]


def test_a_figure_that_stands_on_a_pixel_keeps_its_place_while_it_moves(write_scene, scene_folder):
    document = add_animation(gltf_document(), "hop", (0, "translation", "LINEAR", [0, 1], [[0, 0, 0], [3, 2, 0]]))
    (scene_folder / "figure.gltf").write_text(json.dumps(document))
    text = SEQUENCE + '[[synthetic]]\nname = "f"\nmesh = "figure.gltf"\nscale = 0.1\nat_angles = [0, -50]\n'
    frames = SceneFrames(write_scene(text + 'animation = "hop"', panorama="position = [0, 0, 1.5]\nsky = true"))
    first, last = (frames.scene(n).synthetic[0].parts[0].geometry.vertices for n in (1, 49))
    assert first[:, 2].min() == pytest.approx(0.0, abs=1e-6)
    np.testing.assert_allclose(last - first, np.tile([0.3, 0.0, 0.2], (4, 1)), atol=1e-6)


def broken(change):
    document = add_animation(gltf_document(), "Walk", (0, "translation", "LINEAR", [0, 1], [[0, 0, 0], [1, 0, 0]]))
    add_animation(document, None, (0, "scale", "LINEAR", [0, 1], [[1, 1, 1], [2, 2, 2]]))
    change(document)
    return document


WRONG = [
    (lambda d: None, "Run", r"has no animation 'Run'; it has 'Walk', '1'$"),
    (lambda d: d.pop("animations"), "Run", "has no animation 'Run'; it has no animations at all"),
    (
        lambda d: d["animations"][0]["samplers"][0].update(interpolation="BEZIER"),
        "Walk",
        r"animations\[0\] has the interpolation 'BEZIER'; allowed are LINEAR, STEP, CUBICSPLINE",
    ),
    (
        lambda d: d["animations"][0]["samplers"][0].update(interpolation="CUBICSPLINE"),
        "Walk",
        r"has 6 numbers for the translation of node 0, but 18 finite ones are needed",
    ),
    (
        lambda d: add_animation(d, "Back", (0, "scale", "LINEAR", [1, 0], [[1, 1, 1], [2, 2, 2]])),
        "Back",
        r"animations\[2\]: the times of accessor \d+ are not in order, each after the one before",
    ),
    (lambda d: d["animations"][0]["channels"][0].pop("target"), "Walk", r"animations\[0\]\.channels\[0\]\.target: is"),
    (lambda d: d["nodes"][0].update(matrix=np.eye(4).ravel().tolist()), "Walk", "which has a matrix instead"),
    (lambda d: d["animations"][0]["channels"][0].update(sampler=7), "Walk", "refers to animation sampler 7"),
]


@pytest.mark.parametrize(("change", "name", "message"), WRONG, ids=[message for *_, message in WRONG])
def test_a_wrong_animation_is_named(vertices_at, change, name, message):
    with pytest.raises(InputError, match=message):
        vertices_at(broken(change), name, 0.5)


def test_the_message_has_the_line_of_the_scene_file(write_scene, scene_folder):
    (scene_folder / "figure.gltf").write_text(json.dumps(broken(lambda d: None)))
    text = '[[synthetic]]\nname = "f"\nmesh = "figure.gltf"\nanimation = "Fly"\n'
    with pytest.raises(InputError, match=r"scene.toml:\d+: \[\[synthetic\]\] 1 \(\"f\"\): .*it has 'Walk', '1'"):
        load_scene(write_scene(text))
    with pytest.raises(InputError, match=r"floor.ply: '.ply' files have no animations; allowed are .gltf, .glb"):
        load_scene(write_scene(text.replace("figure.gltf", "floor.ply")))


# -- Cameras --------------------------------------------------------------------------------------------------------


def camera_document(**film):
    """A camera in a moving and turning dolly: at (1, 2, 3) in the file, that is (1, -3, 2), looking along its -z, +y."""
    nodes = [
        {"mesh": 0, "children": [1]},
        {"name": "dolly", "children": [2], "scale": [2, 2, 2]},
        {"name": "Shot", "camera": 0, "translation": [0.5, 1, 1.5]},
    ]
    film = {"yfov": math.radians(40.0), **film}
    cameras = [{"name": "Camera.001", "type": "perspective", "perspective": film}]
    document = gltf_document(nodes=nodes, cameras=cameras)
    turns = Rotation.from_euler("y", [[0], [90]], degrees=True).as_quat()
    return add_animation(
        document,
        "move",
        (1, "rotation", "LINEAR", [0, 2], turns),
        (1, "translation", "LINEAR", [0, 2], [[0, 0, 0], [2, 0, 0]]),
    )


def test_a_camera_comes_out_of_a_file(write_scene, scene_folder):
    (scene_folder / "shot.gltf").write_text(json.dumps(camera_document()))
    text = '[camera.shot]\nfile = "shot.gltf"\nwidth = 64\nheight = 32\n'
    view = load_scene(write_scene(text)).cameras["shot"]
    np.testing.assert_allclose(view.position, [1, -3, 2], atol=1e-9)
    np.testing.assert_allclose(view.rotation, look_at_rotation([1, -3, 2], [1, 7, 2]), atol=1e-9)
    assert view.camera.fov == pytest.approx(2 * math.degrees(math.atan(2 * math.tan(math.radians(20.0)))))

    moving = SceneFrames(write_scene(SEQUENCE + text + 'node = "Camera.001"\nanimation = "move"\n'))
    for frame, angle, x in ((1, 0, 0), (25, 45, 1), (49, 90, 2)):
        view = moving.scene(frame).cameras["shot"]
        turned = Rotation.from_euler("y", angle, degrees=True)
        place = z_up(turned.apply([1, 2, 3]) + [x, 0, 0])
        np.testing.assert_allclose(view.position, place, atol=1e-6)
        ahead = place + z_up(turned.apply([0, 0, -1]))
        np.testing.assert_allclose(view.rotation, look_at_rotation(place, ahead), atol=1e-6)


def test_other_cameras_take_the_pose_and_keep_their_lens(write_scene, scene_folder):
    (scene_folder / "shot.gltf").write_text(json.dumps(camera_document(aspectRatio=1.6)))
    text = '[camera.dome]\ntype = "fisheye"\nfile = "shot.gltf"\nwidth = 32\nfov = 200\n'
    text += '[camera.flat]\nfile = "shot.gltf"\nwidth = 64\nfov = { frame = [1, 49], value = [30, 40] }\n'
    cameras = load_scene(write_scene(SEQUENCE + text), frame=25).cameras
    assert cameras["dome"].camera.fov == 200
    np.testing.assert_allclose(cameras["dome"].position, [1, -3, 2], atol=1e-9)
    assert cameras["flat"].camera.height == 40
    assert cameras["flat"].camera.fov == pytest.approx(35)


WRONG_CAMERAS = [
    ('node = "Kamera"', {}, r"shot.gltf: has no camera 'Kamera'; it has 'Shot'$"),
    ('animation = "fly"', {}, "has no animation 'fly'; it has 'move'"),
    ('animation = { name = "move", sped = 2 }', {}, "animation: unknown key 'sped'; did you mean 'speed'"),
    ("position = [0, 0, 1]", {}, "position: the camera file gives the position and rotation already"),
    ("", {"cameras": [{"type": "orthographic"}]}, "its camera is of type 'orthographic'; only perspective"),
    ("", {"nodes": [{"mesh": 0}]}, "shot.gltf: no node of it has a camera"),
    (
        "",
        {"nodes": [{"camera": 0}, {"camera": 0, "name": "b"}], "scenes": [{"nodes": [0, 1]}]},
        "has 2 cameras, and node must name one of them: 'Camera.001', 'b'",
    ),
]


@pytest.mark.parametrize(("line", "more", "message"), WRONG_CAMERAS, ids=[message for *_, message in WRONG_CAMERAS])
def test_a_wrong_camera_is_named_once(write_scene, scene_folder, line, more, message):
    (scene_folder / "shot.gltf").write_text(json.dumps({**camera_document(), **more}))
    with pytest.raises(InputError, match=message) as error:
        load_scene(write_scene(f'[camera.shot]\nfile = "shot.gltf"\nwidth = 64\nheight = 32\n{line}\n'))
    assert "[camera.shot]: " in str(error.value)
    assert len(str(error.value).splitlines()) == 1


# -- Numbered files -------------------------------------------------------------------------------------------------


def test_numbered_meshes_follow_the_frames(write_scene, scene_folder):
    text = '[sequence]\nframes = [8, 11]\n[[synthetic]]\nname = "s"\nmesh = "splash.##.ply"\nposition = [0, 0, 1]\n'
    floor = (scene_folder / "floor.ply").read_text()
    for number in (8, 9, 10, 11):
        (scene_folder / f"splash.{number:02d}.ply").write_text(floor.replace("-3 -3 0", f"-{number} -3 0"))
    frames = SceneFrames(write_scene(text))
    found = [frames.scene(frame).synthetic[0].parts[0].geometry.vertices[0, 0] for frame in (8, 9, 9.4, 9.6, 11)]
    assert found == [-8, -9, -9, -10, -11]
    assert len(frames.contents(11).meshes) == 1  # A long sequence does not fill the memory.
    for number in (9, 10):
        (scene_folder / f"splash.{number:02d}.ply").unlink()
    problems = SceneFrames(frames.path).table_problems()
    assert len(problems) == 1
    assert problems[0].endswith("splash.##.ply: no such file for frames 9-10, 2 of 4")
    assert '[[synthetic]] 1 ("s"): mesh: ' in problems[0]


@pytest.mark.parametrize(
    ("mesh", "sequence", "message"),
    [
        ("s.##.ply", "", r"s.##.ply: numbered files belong to the frames of a \[sequence\]"),
        ("s#.##.ply", SEQUENCE, "s#.##.ply: the # that stand for the digits"),
        ("none/s.#.ply", "[sequence]\nframes = [3, 3]\n", "no such file for frame 3, 1 of 1"),
    ],
)
def test_wrong_numbered_names_are_explained(write_scene, mesh, sequence, message):
    with pytest.raises(InputError, match=message):
        load_scene(write_scene(f'{sequence}[[synthetic]]\nname = "s"\nmesh = "{mesh}"\n'))


def test_numbered_meshes_on_a_pixel_stand_by_their_origin(write_scene):
    text = f'{SEQUENCE}[[synthetic]]\nname = "s"\nmesh = "s.#.ply"\nat_angles = [0, -40]\n'
    with pytest.raises(InputError, match="they need stand = false"):
        load_scene(write_scene(text))


def test_a_filmed_panorama_changes_its_light_in_the_same_room(scene_folder, write_scene):
    for number, level in ((1, 0.5), (2, 0.75), (3, 1.0)):
        write_exr(scene_folder / f"plate.{number}.exr", [ExrPart({c: np.full((8, 16), level, "f4") for c in "RGB"})])
    path = write_scene("[sequence]\nframes = [1, 3]\n")
    path.write_text(path.read_text().replace("p.exr", "plate.#.exr"))
    frames = SceneFrames(path)
    scenes = [frames.scene(frame) for frame in (1, 2, 3)]
    assert [float(scene.panorama.radiance.mean()) for scene in scenes] == pytest.approx([0.5, 0.75, 1.0])
    assert scenes[0].real[0] is scenes[2].real[0]
    assert len({place_digest(scene) for scene in scenes}) == 3
    (scene_folder / "plate.2.exr").unlink()
    (problem,) = SceneFrames(path).table_problems()
    assert problem.endswith("plate.#.exr: no such file for frame 2, 1 of 3")
    assert "[panorama]: image: " in problem

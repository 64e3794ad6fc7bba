"""Objects that a pixel of the panorama places."""

import numpy as np
import pytest
import trimesh

from lightdepth.checks.sampling import object_mesh
from lightdepth.directions import direction_to_latlong, euler_rotation
from lightdepth.errors import InputError
from lightdepth.images.exr import ExrPart, write_exr
from lightdepth.scene.load import load_scene
from lightdepth.scene.model import AnalyticShape
from lightdepth.scene.spot import extents

POSITION, ROTATION = np.array([0.3, -0.2, 1.4]), [3.0, -4.0, 25.0]
LOW, HIGH = np.array([-2.0, -3.0, 0.0]), np.array([2.0, 3.0, 2.5])
WIDTH = 512
HEAD = f"""
[panorama]
image = "room.exr"
position = [0.3, -0.2, 1.4]
rotation = {ROTATION}
{{panorama}}
[[real]]
name = "floor"
mesh = "floor.ply"
role = "support"

{{walls}}
[[synthetic]]
name = "thing"
{{thing}}
"""
WALLS = '[[real]]\nname = "walls"\nmesh = "walls.ply"\nrole = "environment"\n'
GREY = 'material = { type = "diffuse" }'


def pixel_of(point):
    """Where a world point is seen, pixels."""
    u, v = direction_to_latlong((np.asarray(point) - POSITION) @ euler_rotation(ROTATION))
    return float(u) * WIDTH, float(v) * WIDTH / 2


def at(point):
    x, y = pixel_of(point)
    return f"at = [{x!r}, {y!r}]"


@pytest.fixture
def folder(tmp_path):
    write_exr(tmp_path / "room.exr", [ExrPart(dict.fromkeys("RGB", np.full((WIDTH // 2, WIDTH), 0.5, np.float32)))])
    box = trimesh.creation.box(bounds=[LOW, HIGH])
    box.invert()
    on_floor = np.all(box.triangles_center[:, 2:] < 0.1, axis=1)
    for name, faces in (("floor", on_floor), ("walls", ~on_floor)):
        trimesh.Trimesh(box.vertices, box.faces[faces]).export(tmp_path / f"{name}.ply")
    return tmp_path


@pytest.fixture
def place(folder):
    def load(thing, walls=WALLS, panorama=""):
        (folder / "scene.toml").write_text(HEAD.format(thing=thing, walls=walls, panorama=panorama))
        return object_mesh(load_scene(folder / "scene.toml").synthetic[0]).vertices.astype(np.float64)

    return load


def test_a_mesh_stands_on_its_lowest_point_in_the_middle_of_the_pixel(place, folder):
    # Far from its own origin, as exported files often are, and turned.
    trimesh.creation.box(bounds=[[5.0, 5.0, 3.0], [5.2, 5.6, 3.4]]).export(folder / "box.ply")
    vertices = place(f'mesh = "box.ply"\nrotation = [0, 30, 40]\nscale = 1.5\n{at([1.0, 1.5, 0.0])}')
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    assert low[2] == pytest.approx(0.0, abs=1e-5)
    np.testing.assert_allclose((low + high)[:2] / 2, [1.0, 1.5], atol=1e-4)


def test_angles_place_the_same(place):
    x, y = pixel_of([1.0, 1.5, 0.0])
    angles = f"at_angles = [{(x / WIDTH - 0.5) * 360!r}, {(0.5 - y / WIDTH * 2) * 180!r}]"
    one = place(f'shape = "sphere"\nradius = 0.2\n{GREY}\n{at([1.0, 1.5, 0.0])}')
    np.testing.assert_allclose(place(f'shape = "sphere"\nradius = 0.2\n{GREY}\n{angles}'), one, atol=1e-6)
    assert one[:, 2].min() == pytest.approx(0.0, abs=1e-6)


def test_without_stand_the_origin_is_at_the_point(place):
    vertices = place(f'shape = "sphere"\nradius = 0.2\n{GREY}\nstand = false\n{at([2.0, 1.0, 1.2])}')
    np.testing.assert_allclose(vertices.mean(axis=0), [2.0, 1.0, 1.2], atol=1e-4)


def test_aligned_it_is_fastened_to_a_wall(place):
    vertices = place(f'shape = "cylinder"\nscale = [0.1, 0.1, 0.5]\n{GREY}\nalign = true\n{at([2.0, 1.0, 1.2])}')
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    np.testing.assert_allclose([low[0], high[0]], [1.5, 2.0], atol=1e-5)  # Its axis along the wall's normal.
    np.testing.assert_allclose((low + high)[1:] / 2, [1.0, 1.2], atol=1e-4)


@pytest.mark.parametrize(
    ("thing", "message"),
    [
        (at([2.0, 1.0, 1.2]), r'\[\[synthetic\]\] 1 \("thing"\): at: shows "walls", which is 90 degrees steep'),
        ("at = [600, 10]", r"at: the point 600, 10 is not on the panorama; allowed are x from 0 to 512"),
        ("at_angles = [0, 95]", "allowed are -360 to 360 degrees right and -90 to 90 up"),
        (f"{at([1, 1, 0])}\ncenter = [0, 0, 0]", "at and center exclude each other"),
        ("center = [0, 0, 1]\nstand = true", "stand belong to an object that is placed by at or at_angles"),
        ("at = [1, 2, 3]", "must be a list of 2 numbers"),
    ],
)
def test_wrong_places_are_refused(place, thing, message):
    with pytest.raises(InputError, match=message):
        place(f'shape = "sphere"\nradius = 0.2\n{GREY}\n{thing}')


def test_a_pixel_of_sky_is_refused(place):
    with pytest.raises(InputError, match="at: shows no real surface but sky; take a pixel of the floor"):
        place(f'shape = "sphere"\nradius = 0.2\n{GREY}\n{at([1, 1, 2.5])}', walls="", panorama="sky = true")


def test_on_a_depth_image(folder):
    """A tilted plane: its reciprocal distance is linear in the direction, so that the place is exact."""
    height = 64
    from lightdepth.directions import pixel_directions

    normal = np.array([0.1, 0.2, 1.0]) / np.linalg.norm([0.1, 0.2, 1.0])
    directions = pixel_directions(height, 2 * height) @ euler_rotation(ROTATION).T
    facing = directions @ normal
    depth = np.where(facing < -0.02, -1.1 / np.minimum(facing, -1e-9), np.inf).astype(np.float32)
    np.save(folder / "depth.npy", depth)
    text = HEAD.format(panorama='depth = "depth.npy"', walls="", thing=f'shape="sphere"\nradius=0.1\n{GREY}\n%s')
    text = text.replace('[[real]]\nname = "floor"\nmesh = "floor.ply"\nrole = "support"\n', "")
    (folder / "scene.toml").write_text(text % "at_angles = [20, -50]\nalign = true")
    shape = load_scene(folder / "scene.toml").synthetic[0].parts[0].geometry
    centre = shape.to_world[:3, 3]
    assert (centre - POSITION) @ normal == pytest.approx(-1.0, abs=2e-3)
    (folder / "scene.toml").write_text(text % "at_angles = [20, 80]")
    with pytest.raises(InputError, match="shows no real surface but sky"):
        load_scene(folder / "scene.toml")


@pytest.mark.parametrize("kind", ["sphere", "cube", "rectangle", "disk", "cylinder"])
def test_extents_of_shapes_are_those_of_their_meshes(kind):
    linear = euler_rotation([20, 50, -70]) * [0.3, 1.2, 0.7]
    axes = euler_rotation([10, -20, 60])
    to_world = np.eye(4)
    to_world[:3, :3] = linear
    from lightdepth.scene.model import SyntheticObject, SyntheticPart

    vertices = object_mesh(SyntheticObject("a", (SyntheticPart(AnalyticShape(kind, to_world), None),))).vertices @ axes
    low, high = extents([AnalyticShape(kind, np.eye(4))], linear, axes)
    # The mesh of a round shape lies inside it by up to a thousandth.
    np.testing.assert_allclose(low, vertices.min(axis=0), atol=4e-3)
    np.testing.assert_allclose(high, vertices.max(axis=0), atol=4e-3)

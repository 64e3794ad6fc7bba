"""What users see of the transport, end to end, against closed forms and identities."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

import lightdepth
from lightdepth.cameras import Fisheye, Perspective
from lightdepth.directions import direction_to_latlong, euler_rotation, look_at_rotation, pixel_directions
from lightdepth.scene.materials import Diffuse, Emitter, Principled, Texture
from lightdepth.scene.meshes import read_mesh_file
from lightdepth.scene.meshes.geometry import placed
from lightdepth.scene.model import (
    AnalyticShape,
    CameraView,
    Gloss,
    Mesh,
    RealSurface,
    Role,
    SyntheticObject,
    SyntheticPart,
)
from tests.chance import Seen, check_mean, check_seen, enough, standard_errors
from tests.recovery.test_irradiance import corner_factor
from tests.scene.gltf_writer import gltf_document, write_glb
from tests.transport.places import (
    CAPTURE,
    GREY,
    HIGH,
    LOW,
    ball,
    box_depth,
    box_mesh,
    lamp_image,
    one_pass,
    picture,
    room,
)

FLOOR_RADIANCE = 0.2
"""Of the floor in walls of radiance 1: its albedo is 0.2 then, for E = pi."""
DOWN = Perspective(type="perspective", width=40, height=40, fov=70)


def floor_and_walls(image=None, rest=None, gloss=None, bump=None, objects=(), role=Role.SUPPORT, **settings):
    """A box with a floor of its own: a fine grid where it has rest positions; the walls are environment."""
    if image is None:
        directions = pixel_directions(128, 256)
        at = CAPTURE + directions * box_depth(directions)[..., None]
        image = np.where(at[..., 2:] < 1e-6, FLOOR_RADIANCE, 1.0) * np.ones(3)
    scene = room(image, objects, rotation=(0, 0, 0), **settings)
    box = scene.real[0].mesh
    on_floor = (box.vertices[box.faces][:, :, 2] == LOW[2]).all(axis=1)
    floor = Mesh(box.vertices, box.faces[on_floor])
    if rest is not None:
        floor = grid_floor()
        flat = floor.vertices
        bulged = flat if bump is None else flat + np.float32([0, 0, 1]) * bump(flat)[:, None].astype(np.float32)
        floor = Mesh(bulged, floor.faces, rest=rest(flat).astype(np.float32))
    real = (
        RealSurface("floor", floor, role, gloss),
        RealSurface("walls", Mesh(box.vertices, box.faces[~on_floor]), Role.ENVIRONMENT),
    )
    straight_down = look_at_rotation(CAPTURE, CAPTURE - [0, 1e-6, 1])
    cameras = {**scene.cameras, "down": CameraView(DOWN, CAPTURE, straight_down)}
    return replace(scene, real=real, cameras=cameras)


def grid_floor(count=40):
    x, y = np.meshgrid(np.linspace(LOW[0], HIGH[0], count + 1), np.linspace(LOW[1], HIGH[1], count + 1))
    vertices = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1).astype(np.float32)
    a = (np.arange(count)[:, None] * (count + 1) + np.arange(count)).ravel()
    faces = np.concatenate([np.stack([a, a + 1, a + count + 2], 1), np.stack([a, a + count + 2, a + count + 1], 1)])
    return Mesh(vertices, faces.astype(np.int32))


def seen_points(scene, camera="down"):
    """Where on the floor the camera's pixel centres look, shape (height, width, 3)."""
    view = scene.cameras[camera]
    width, height = view.camera.resolution
    half = np.tan(np.radians(view.camera.fov / 2))
    x = half * (2 * (np.arange(width) + 0.5) / width - 1)
    z = half * (1 - 2 * (np.arange(height) + 0.5) / height) * height / width
    local = np.stack(np.broadcast_arrays(x[None, :], 1.0, z[:, None]), axis=-1)
    direction = local @ view.rotation.T
    return view.position - direction * (view.position[2] / direction[..., 2])[..., None]


def flat(low, high, z, material, down=True):
    """A horizontal rectangle between two corners (x, y)."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    to_world = np.eye(4)
    to_world[:3, :3] = np.diag([*(high - low) / 2, 1.0]) @ np.diag([1, -1, -1] if down else [1, 1, 1])
    to_world[:3, 3] = [*(low + high) / 2, z]
    return SyntheticObject("sheet", (SyntheticPart(AnalyticShape("rectangle", to_world), material),))


def form_factor(points, low, high, z):
    """Of a horizontal rectangle above upward points."""

    def to(x, y):
        return np.sign(x) * np.sign(y) * corner_factor(np.abs(x), np.abs(y), z - points[..., 2])

    x0, y0 = low[0] - points[..., 0], low[1] - points[..., 1]
    x1, y1 = high[0] - points[..., 0], high[1] - points[..., 1]
    return to(x1, y1) - to(x0, y1) - to(x1, y0) + to(x0, y0)


RECOVERED = 0.01
"""Relative error of the floor's recovered albedo that is let pass."""
LAMP = np.array([-0.1, 0.1]), np.array([0.7, 0.5]), 2.2


def check_lamp_on_floor(thing, radiance):
    """The lamp replaces the walls' radiance 1 behind it, so that the floor changes by albedo (L - 1) F."""
    scene = floor_and_walls(objects=[thing], irradiance_samples=1024)
    points = seen_points(scene)
    expected = FLOOR_RADIANCE * (radiance - 1) * form_factor(points, *LAMP)
    inner = (np.abs(points[..., :2] - CAPTURE[:2]) < 0.8).all(axis=-1)

    def shares(seed):
        change = one_pass(scene, "down", seed).change.mean(axis=2)
        blocks = (change / expected).reshape(4, 10, 4, 10).mean(axis=(1, 3))
        return change[inner].mean() / expected[inner].mean(), *blocks[1:-1, 1:-1].ravel()

    check_mean(shares, 1.0, caught=[0.02] + [0.06] * 4, tolerance=RECOVERED)


def test_a_synthetic_lamp_lights_the_real_floor_as_the_closed_form_says():
    check_lamp_on_floor(flat(*LAMP, Emitter(type="emitter", radiance=(40.0, 40.0, 40.0))), 40.0)


def test_a_glowing_ball_lights_the_floor_right_up_to_where_it_stands():
    radiance, radius, centre = 300.0, 0.1, np.array([0.1, 0.2, 0.101])
    thing = ball(Emitter(type="emitter", radiance=(radiance,) * 3), centre, radius)
    scene = floor_and_walls(objects=[thing], irradiance_samples=1024)
    offset = centre - seen_points(scene)
    distance = np.linalg.norm(offset, axis=-1)
    expected = FLOOR_RADIANCE * (radiance - 1) * (radius / distance) ** 2 * offset[..., 2] / distance
    rings = [
        (distance > near * radius) & (distance < far * radius) for near, far in ((1.5, 2.5), (2.5, 4.0), (4.0, 8.0))
    ]
    free = one_pass(scene, "down", 0).coverage == 0
    assert all((ring & free).sum() > 20 for ring in rings)

    def shares(seed):
        change = one_pass(scene, "down", seed).change.mean(axis=2)
        return [change[ring & free].mean() / expected[ring & free].mean() for ring in rings]

    check_mean(shares, 1.0, caught=0.03, tolerance=RECOVERED)


def test_an_emissive_gltf_lights_the_real_floor_just_so(tmp_path):
    material = {
        "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "roughnessFactor": 1.0},
        "emissiveFactor": [1.0, 1.0, 1.0],
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 40.0}},
    }
    document = gltf_document(material=material, extensionsUsed=["KHR_materials_emissive_strength"])
    write_glb(tmp_path / "lamp.glb", document)
    low, high, z = LAMP
    to_world = np.eye(4)
    to_world[:3, :3] = np.diag([*(high - low) / 2, 1.0]) @ np.diag([1, -1, -1])
    to_world[:3, 3] = [*(low + high) / 2, z]
    parts = [
        SyntheticPart(placed(part.mesh, to_world), part.material)
        for part in read_mesh_file(tmp_path / "lamp.glb", with_materials=True)
    ]
    check_lamp_on_floor(SyntheticObject("lamp", tuple(parts)), 40.0)


@pytest.mark.parametrize("max_bounces", [1, 2])
def test_a_blended_sheet_casts_half_a_shadow(max_bounces):
    def shadow(opacity):
        """By seed; and the coverage."""
        sheet = Principled(base_color=(0, 0, 0), roughness=1.0, opacity=opacity)
        scene = floor_and_walls(objects=[flat((-0.2, -0.3), (0.4, 0.2), 0.5, sheet)], max_bounces=max_bounces)

        def total(seed):
            frame = one_pass(scene, "down", seed)
            return frame.change[free].sum(dtype=np.float64)

        return total, one_pass(scene, "down", 0).coverage

    (opaque, covered), (half, blended) = shadow(1.0), shadow(0.5)
    free = covered == 0.0
    whole = np.mean([opaque(seed) for seed in range(1000, 1004)])
    assert whole < -1
    check_mean(lambda seed: (half(seed) - 0.5 * opaque(seed + 500)) / whole, 0.0, caught=0.03)
    inside = covered == 1
    # Each of the pixels' samples hits or passes: half of the range of 16 in each.
    limit = standard_errors() * 0.5 / np.sqrt(16 * inside.sum())
    assert limit < 0.1
    assert abs(blended[inside].mean() - 0.5) < limit


def test_passing_a_hole_is_no_bounce():
    """The floor is seen through two sheets that are all hole, though no path may scatter at all."""
    hole = Principled(base_color=(0, 0, 0), opacity=0.0)
    sheets = [flat((-0.5, -0.5), (0.8, 0.5), z, hole) for z in (0.5, 0.8)]
    frame = lightdepth.render(floor_and_walls(objects=sheets, max_bounces=0), "down", samples=4)
    assert not frame.coverage.any()
    np.testing.assert_array_equal(frame.beauty, frame.plate)


def test_a_checkered_card_casts_half_the_shadow_of_a_solid_one():
    """A textured card, half of whose cells are holes; all of its shadow is seen by a camera between card and floor."""
    cells = (np.add.outer(np.arange(8), np.arange(8)) % 2).repeat(16, 0).repeat(16, 1)[..., None].astype(np.float16)
    holes, paper = Texture(cells, nearest=True), Texture(cells * np.float16([0.5, 0.3, 0.1]))
    corners = np.float32([[-0.2, -0.3, 0.5], [0.5, -0.3, 0.5], [0.5, 0.4, 0.5], [-0.2, 0.4, 0.5]])
    coordinates = np.float32([[0, 0], [1, 0], [1, 1], [0, 1]])
    card = Mesh(corners, np.int32([[0, 1, 2], [0, 2, 3]]), texture_coordinates=coordinates)
    fisheye = Fisheye(type="fisheye", width=32, fov=170)
    below = CameraView(fisheye, np.array([0.15, 0.05, 0.25]), euler_rotation([-90.0, 0.0, 0.0]))

    def shadows(opacity, seeds):
        part = SyntheticPart(card, Principled(base_color=paper, roughness=1.0, opacity=opacity))
        scene = replace(floor_and_walls(objects=[SyntheticObject("card", (part,))], max_bounces=1), cameras={"": below})
        return np.array([picture(scene, "", 64, seed).change.mean(dtype=np.float64) for seed in seeds])

    def off(seeds):
        """How much half a shadow and that of the holed card differ, of independent pictures."""
        return shadows(holes, [500 + seed for seed in seeds]) - 0.5 * shadows(1.0, seeds)

    expected = 0.5 * shadows(1.0, [400, 401]).mean()
    assert expected < -0.005
    first = off(range(12))
    limit = 0.02 * abs(expected)  # The error that is caught.
    count = enough(first, limit)
    assert count <= 48
    assert abs(np.append(first, off(range(12, count))).mean()) < limit


def test_a_surface_at_its_rest_position_is_the_photograph():
    scene = floor_and_walls(rest=lambda vertices: vertices, max_bounces=1)

    def shares(seed):
        frame = one_pass(scene, "down", seed)
        assert frame.coverage.mean() == pytest.approx(1.0)
        blocks = frame.beauty.reshape(4, 10, 4, 10, 3).mean(axis=(1, 3, 4))
        return np.array([frame.beauty.mean(), *blocks.ravel()]) / FLOOR_RADIANCE

    check_mean(shares, 1.0, caught=[0.01] + [0.03] * 16, tolerance=RECOVERED)


def side_light():
    """Grey floor, dim walls, a bright window in the wall at +x."""
    directions = pixel_directions(128, 256)
    at = CAPTURE + directions * box_depth(directions)[..., None]
    image = np.where(at[..., 2:] < 1e-6, 0.2, 0.1) * np.ones(3)
    image[(at[..., 0] > HIGH[0] - 1e-6) & (at[..., 2] > 0.5)] = 8.0
    red = (at[..., 2] < 1e-6) & (at[..., 0] < -0.2) & (at[..., 1] < -0.5)
    image[red] = [0.2, 0.05, 0.05]
    return image


def test_a_bulge_is_bright_toward_the_window_and_dark_away_from_it():
    def bump(vertices):
        radius = np.hypot(vertices[:, 0] - 0.4, vertices[:, 1] - 0.2)
        return 0.25 * np.exp(-((radius / 0.25) ** 2))

    scene = floor_and_walls(side_light(), rest=lambda vertices: vertices, bump=bump)
    frame = lightdepth.render(scene, "down", samples=64)
    points = seen_points(scene)
    x, y = points[..., 0] - 0.4, points[..., 1] - 0.2
    toward = (x > 0.1) & (x < 0.3) & (np.abs(y) < 0.15)
    away = (x < -0.1) & (x > -0.3) & (np.abs(y) < 0.15)
    apart = np.hypot(x, y) > 0.55
    luminance = frame.beauty.mean(axis=2)
    check_seen(luminance[toward].mean() / luminance[apart & (x > 0)].mean(), Seen(11, 1.53, 1.53, 0.0223), low=1.15)
    check_seen(luminance[away].mean() / luminance[apart & (x < 0)].mean(), Seen(11, 0.259, 0.259, 0.00245), high=0.85)


def test_retexturing_takes_colour_from_elsewhere():
    scene = floor_and_walls(side_light(), rest=lambda vertices: vertices - np.float32([0.8, 0.9, 0]))
    frame = lightdepth.render(scene, "down", samples=32)
    points = seen_points(scene)
    red = (points[..., 0] < 0.4) & (points[..., 1] < 0.2)
    ratio = frame.beauty[..., 1] / frame.beauty[..., 0]
    check_seen(np.median(ratio[red]) / 0.25, Seen(11, 1.0, 1.0, 2.32e-05), 0.9, 1.1)
    plain = (points[..., 0] > 0.8) | (points[..., 1] > 0.55)
    check_seen(np.median(ratio[plain]), Seen(11, 1.0, 1.0, 0.0), 0.9, 1.1)


def test_coloured_lamps_cast_coloured_shadows():
    directions = pixel_directions(128, 256)
    image = np.full((128, 256, 3), 0.1)
    lamps = {"red": np.array([-0.9, 0.3, 0.3]), "green": np.array([0.9, 0.3, 0.3])}
    for index, toward in enumerate(lamps.values()):
        image[directions @ (toward / np.linalg.norm(toward)) > 0.997] = np.eye(3)[index] * 200
    middle = np.array([0.2, 1.0, 0.5])
    scene = floor_and_walls(image, objects=[ball(GREY, middle, 0.2)])
    change = lightdepth.render(scene, "pano", samples=256).change
    for own, toward in enumerate(lamps.values()):
        toward = toward / np.linalg.norm(toward)
        lamp = CAPTURE + toward * box_depth(toward)
        at = middle + (middle - lamp) * (middle[2] / (lamp[2] - middle[2]))
        u, v = direction_to_latlong(at - CAPTURE)
        column, row = int(u * 256), int(v * 128)
        shadow = change[row - 1 : row + 2, column - 1 : column + 2].mean(axis=(0, 1))
        check_seen(shadow[own], Seen(11, -0.0743, -0.0735, 0.000432), high=0.0)
        check_seen(shadow[1 - own] / shadow[own], Seen(11, -0.00574, -0.00341, 8.26e-05), -0.2, 0.2)


@pytest.mark.parametrize("roughness", [0.15, 0.35])
def test_gloss_that_the_photograph_does_not_show_leaves_the_floor_its_own_light(roughness):
    """The walls are bright in one place, but the floor does not show its mirror image."""
    directions = pixel_directions(128, 256)
    at = CAPTURE + directions * box_depth(directions)[..., None]
    image = np.where(at[..., 2:] < 1e-6, 0.15, 0.6) * np.ones(3)
    image[directions @ np.array([0.25, 0.9, 0.36]) > 0.97] = 30.0
    scene = floor_and_walls(image, gloss=Gloss(roughness, 0.5), objects=[ball(GREY, (0.3, 0.9, 0.3), 0.3)])
    frame = lightdepth.render(scene, "pano", samples=64)
    on_floor = (frame.coverage == 0.0) & (frame.plate[..., 0] > 0.0) & (directions[..., 2] < -0.2)
    error = np.sqrt(frame.variance)
    check_seen(
        ((frame.change + frame.plate) / np.maximum(error, 1e-3 * frame.plate))[on_floor].min(),
        Seen(12, 2.38, 5.24, 0.944),
        low=-8.0,
    )
    # In the mean over a few pixels at a time, noise hides nothing.
    share = cv2.blur(np.where(on_floor[..., None], frame.change, 0.0), (5, 5)) / cv2.blur(frame.plate, (5, 5))
    check_seen(np.quantile(share[on_floor], 0.002), Seen(12, -0.85, -0.824, 0.00885), low=-0.95)


def fresnel(cosine):
    """Reflectance of a dielectric of specular 1."""
    index = (1 + np.sqrt(0.08)) / (1 - np.sqrt(0.08))
    inside = np.sqrt(index**2 - 1 + cosine**2)
    across, along = (cosine - inside) / (cosine + inside), (index**2 * cosine - inside) / (index**2 * cosine + inside)
    return 0.5 * (across**2 + along**2)


@pytest.mark.parametrize("role", [Role.SUPPORT, Role.ENVIRONMENT])
def test_a_glossy_floor_mirrors_a_lamp_at_the_mirrored_place(role):
    where = np.array([0.5, 1.2, 0.9])
    lamp = ball(Emitter(type="emitter", radiance=(300.0, 300.0, 300.0)), where, 0.08)
    image = np.full((128, 256, 3), 0.2)
    gloss = Gloss(0.05, 1.0)
    mirrored = lightdepth.render(floor_and_walls(image, gloss=gloss, objects=[lamp], role=role), "pano", samples=64)
    plain = lightdepth.render(floor_and_walls(image, objects=[lamp], role=role), "pano", samples=64)
    assert (plain.change != 0.0).any() == (role is Role.SUPPORT)
    # As much less of the floor's light is diffuse as it mirrors of the room, which is equally bright everywhere.
    directions = pixel_directions(128, 256)
    diffuse = 1.0 - fresnel(np.abs(directions[..., 2:]))
    reflection = (mirrored.change - diffuse * plain.change).mean(axis=2)
    row, column = np.unravel_index(np.argmax(reflection), reflection.shape)
    u, v = direction_to_latlong(where * [1, 1, -1] - CAPTURE)
    assert abs(column + 0.5 - 256 * u) < 2
    assert abs(row + 0.5 - 128 * v) < 2
    # Fresnel's reflectance of the lamp at that angle.
    cosine = abs((where * [1, 1, -1] - CAPTURE)[2]) / np.linalg.norm(where * [1, 1, -1] - CAPTURE)
    near = directions @ ((where * [1, 1, -1] - CAPTURE) / np.linalg.norm(where * [1, 1, -1] - CAPTURE)) > np.cos(0.12)
    solid_angle = np.sin(np.arccos(directions[..., 2])) * (np.pi / 128) ** 2
    found = (reflection * solid_angle)[near].sum()
    distance = np.linalg.norm(where * [1, 1, -1] - CAPTURE)
    expected = 300 * fresnel(cosine) * np.pi * (0.08 / distance) ** 2
    check_seen(found / expected, Seen(11, 0.999, 1.01, 0.0076), 0.88, 1.12)


def test_a_camera_in_a_strange_place_gives_a_picture():
    """Inside the object, outside the room, under the floor, on the floor."""
    scene = room(lamp_image(64), [ball(GREY)])
    plain = scene.cameras["view"]
    places = {"inside": (0.3, 1.2, 0.4), "outside": (8.0, 0.0, 1.0), "under": (0.0, 0.0, -3.0), "on": (0.2, -0.3, 0.0)}
    cameras = {name: CameraView(plain.camera, np.array(position), plain.rotation) for name, position in places.items()}
    scene = replace(scene, cameras=cameras)
    for name in places:
        frame = lightdepth.render(scene, name, samples=4)
        assert np.isfinite(frame.beauty).all()
        assert np.isfinite(frame.variance).all()


def test_many_objects_of_all_kinds_are_distinguished():
    things = [
        replace(ball(Diffuse(type="diffuse", color=(0.5, 0.5, 0.5)), (-1.2 + 0.5 * i, 1.5, 0.2), 0.2), name=f"ball {i}")
        for i in range(5)
    ]
    scene = room(0.5, things)
    frame = lightdepth.render(scene, "view", samples=1)
    assert set(np.unique(frame.object_id)) == {0, 1, 2, 3, 4, 5}
    assert frame.object_names == tuple(f"ball {i}" for i in range(5))


def test_walls_far_away_have_no_specks():
    """Cones toward an object 300 radii away are so narrow that their cosine is 1 in single precision."""
    far = np.array([200.0, 200.0, 200.0])
    scene = room(objects=[ball(GREY)], max_bounces=1)
    walls = replace(scene.real[0], mesh=box_mesh(-far, far))
    frame = lightdepth.render(replace(scene, real=(walls,)), "pano", samples=16, seed=1)
    # A sample counts as much as the cone of six radii that half of them are drawn from: no seed exceeds that. One that is
    # not recognised there counts in full, an eighth or a sixteenth of its pixel.
    assert np.abs(frame.change).max() < 2.0 * (6.0 * 0.4 / 198.0) ** 2
    assert np.abs(frame.change).mean() < 1e-5

"""Which pixels are sampled: none that the new objects influence may be missing."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from lightdepth.kernel.start import start

start("cpu")

import lightdepth  # noqa: E402
from lightdepth.api import begin_rendering  # noqa: E402
from lightdepth.directions import euler_rotation  # noqa: E402
from lightdepth.film import rendering as rendering_module  # noqa: E402
from lightdepth.parameters import FilmParameters, Parameters  # noqa: E402
from lightdepth.scene.materials import Diffuse, Emitter  # noqa: E402
from lightdepth.scene.model import AnalyticShape, Mesh, Role, SyntheticObject, SyntheticPart  # noqa: E402
from tests.chance import check_mean  # noqa: E402
from tests.transport.places import GREY, ball, lamp_image, one_pass, room  # noqa: E402

GLOW = Emitter(type="emitter", radiance=(30.0, 30.0, 30.0))


def box(center, size, material=GREY, turn=(0, 0, 0)):
    to_world = np.eye(4)
    to_world[:3, :3] = euler_rotation(turn) @ np.diag(np.asarray(size) / 2)
    to_world[:3, 3] = center
    return SyntheticObject("box", (SyntheticPart(AnalyticShape("cube", to_world), material),))


OBJECTS = {
    "a thin pole": box((0.3, 2.0, 1.0), (0.004, 0.004, 1.9)),
    "a thin slanted pole": box((0.1, 1.5, 1.2), (0.003, 0.003, 2.2), turn=(0, 50, 20)),
    "a tiny far ball": ball(GREY, (1.9, 2.6, 2.2), 0.006),
    "a ball that hangs": ball(GREY, (0.4, 1.4, 2.2), 0.15),
    "a ball above the camera": ball(GREY, (0.2, -0.3, 2.4), 0.1),
    "a ball below the camera": ball(GREY, (0.25, -0.2, 0.05), 0.05),
    "a ball on the panorama's edge": ball(GREY, (0.35, -2.0, 1.0), 0.05),
    "a lamp": ball(GLOW, (1.5, -1.5, 2.0), 0.03),
}


def every_pixel(view, prepared, tile):
    width, height = view.camera.resolution
    return np.arange(width * height, dtype=np.uint32)


SEEN_BY = {
    "pano": list(OBJECTS),
    "dome": ["a thin pole", "a ball that hangs"],
    "view": ["a thin pole", "a thin slanted pole", "a tiny far ball"],
}


@pytest.mark.parametrize(("camera", "name"), [(camera, name) for camera, names in SEEN_BY.items() for name in names])
def test_nothing_is_missed(name, camera, monkeypatch):
    """Against a picture for which every pixel was sampled, the walls being environment."""
    scene = room(lamp_image(128), [OBJECTS[name]], role=Role.ENVIRONMENT)
    chosen = begin_rendering(scene, camera, seed=1)
    monkeypatch.setattr(rendering_module, "influenced_pixels", every_pixel)
    reference = begin_rendering(scene, camera, seed=1)
    for rendering in (chosen, reference):
        list(rendering.run(16))
    full, sampled = reference.frame(), np.zeros(reference.plate.shape[:2], bool)
    sampled.reshape(-1)[chosen.pixels] = True
    touched = (full.coverage != 0) | (full.change != 0).any(axis=2) | (full.synthetic != 0).any(axis=2)
    assert not (touched & ~sampled).any()
    assert (full.object_id == 0)[~sampled].all()
    if camera == "pano":
        assert sampled.mean() < 0.8


def test_tiles_are_as_large_as_the_parameters_say():
    scene = room(lamp_image(128), [OBJECTS["a ball that hangs"]], role=Role.ENVIRONMENT)
    counts = []
    for tile in (4, 8, 16):
        tuned = Parameters(film=FilmParameters(selection_tile=tile))
        rendering = begin_rendering(replace(scene, render=replace(scene.render, parameters=tuned)), "pano")
        sampled = np.zeros(rendering.plate.shape[:2], bool)
        sampled.reshape(-1)[rendering.pixels] = True
        tiles = sampled.reshape(len(sampled) // tile, tile, -1, tile)
        assert (tiles.any(axis=(1, 3)) == tiles.all(axis=(1, 3))).all()
        counts.append(np.count_nonzero(sampled))
    assert counts[0] < counts[1] < counts[2]


def test_what_the_lens_blurs_is_not_missed(monkeypatch):
    """A ball near the lens, blurred over several times the tiles beside it."""
    scene = room(lamp_image(64), [], role=Role.ENVIRONMENT)
    view = scene.cameras["view"]
    near = view.position + 0.4 * view.rotation[:, 1]
    width, height = view.camera.resolution
    lens = {"width": 4 * width, "height": 4 * height, "aperture": 0.1, "focus_distance": 2.0}
    camera = view.camera.model_copy(update=lens)
    scene = replace(scene, synthetic=(ball(GREY, near, 0.01),), cameras={"view": replace(view, camera=camera)})
    chosen = begin_rendering(scene, "view", seed=1)
    monkeypatch.setattr(rendering_module, "influenced_pixels", every_pixel)
    reference = begin_rendering(scene, "view", seed=1)
    list(reference.run(8))
    sampled = np.zeros(reference.plate.shape[:2], bool)
    sampled.reshape(-1)[chosen.pixels] = True
    covered = reference.frame(auxiliary=False).coverage > 0.0
    assert covered.sum() > 500
    assert not (covered & ~sampled).any()


def test_the_room_between_an_objects_parts_is_not_sampled():
    """Two crossed wires in a single mesh: their common sphere fills the picture, they do not."""
    along = np.linspace(-0.8, 0.8, 81)
    wires = []
    for axis in (np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])):
        for at in along:
            box = trimesh.creation.box((0.02, 0.004, 0.02))
            box.apply_translation(at * axis)
            wires.append(box)
    cross = trimesh.util.concatenate(wires)
    scene = room(lamp_image(64), [], role=Role.ENVIRONMENT)
    view = scene.cameras["view"]
    centre = view.position + 1.2 * view.rotation[:, 1]
    mesh = Mesh(np.asarray(cross.vertices + centre, np.float32), np.asarray(cross.faces, np.int32))
    scene = replace(scene, synthetic=(SyntheticObject("cross", (SyntheticPart(mesh, GREY),)),))
    width, height = view.camera.resolution
    large = replace(view, camera=view.camera.model_copy(update={"width": 8 * width, "height": 8 * height}))
    rendering = begin_rendering(replace(scene, cameras={"view": large}), "view")
    assert 0.02 < len(rendering.pixels) / (64 * width * height) < 0.35


def test_support_is_sampled_everywhere_and_environment_nowhere():
    scene = room(lamp_image(64), [ball(GREY)])
    support = begin_rendering(scene, "pano")
    assert len(support.pixels) == 64 * 32
    environment = begin_rendering(replace(room(lamp_image(64), [], role=Role.ENVIRONMENT)), "pano")
    assert len(environment.pixels) == 0
    assert list(environment.run(16))[-1].fraction == 1.0


@pytest.mark.parametrize("corner", [(-1, -1), (1, 1)])
def test_an_object_in_the_images_corner_is_found(corner):
    view = room(1.0).cameras["view"]
    half = np.tan(np.radians(view.camera.fov / 2))
    x, z = corner[0] * half * 0.99, corner[1] * half * 0.985 * 32 / 48
    center = view.position + view.rotation @ (np.array([x, 1.0, z]) * 0.8)
    thing = ball(Diffuse(type="diffuse", color=(0.1, 0.1, 0.1)), center, 0.01)
    frame = lightdepth.render(room(1.0, [thing], role=Role.ENVIRONMENT), "view", samples=16)
    assert (frame.coverage > 0).any()


def test_the_panoramas_seam_is_nowhere():
    """A place turned by half a circle gives the same picture, moved by half its width."""
    image = np.full((32, 64, 3), 0.5, np.float32)
    image[10:12, 15:20] = 20.0
    things = [ball(GREY, (0.2, -2.0, 0.4), 0.4)]
    places = [
        (room(np.roll(image, shift, axis=1), things, rotation=(0, 0, heading), irradiance_samples=256), shift)
        for heading, shift in ((0.0, 0), (180.0, 32))
    ]

    def pictures(seed):
        """Of both, each with random numbers of its own."""
        frames = [one_pass(scene, "pano", seed + 1000 * number) for number, (scene, _) in enumerate(places)]
        return [
            (np.roll(frame.beauty, -shift, axis=1).astype(np.float64), np.roll(frame.variance > 0.0, -shift, axis=1))
            for frame, (_, shift) in zip(frames, places)
        ]

    (first, changes), (_, changes_too) = pictures(99)
    differs = changes & changes_too
    assert differs.mean() > 0.3

    def differences(seed):
        """Where the two are sampled, in all and in strips, relative to the mean there."""
        (one, _), (other, _) = pictures(seed)
        off = np.where(differs, one - other, 0.0) / first[differs].mean()
        return off[differs].mean(), *off.reshape(32, 8, 8, 3).mean(axis=(0, 2, 3))

    # Each of the two rooms has its irradiance and its cells' change estimated again, with errors that many pixels share: no
    # more than the half percent that is allowed against path tracing.
    check_mean(differences, 0.0, caught=[0.01] + [0.05] * 8, tolerance=0.005)


def test_what_lies_at_one_edge_of_a_view_does_not_sample_the_other():
    scene = room(lamp_image(64), [], role=Role.ENVIRONMENT)
    view = scene.cameras["view"]
    center = view.position + view.rotation @ (
        np.array([-np.tan(np.radians(view.camera.fov / 2)) * 0.97, 1.0, 0.0]) * 1.2
    )
    scene = replace(scene, synthetic=(ball(GREY, center, 0.04),))
    pixels = begin_rendering(scene, "view").pixels
    assert (pixels % 48).min() == 0
    assert (pixels % 48).max() < 24

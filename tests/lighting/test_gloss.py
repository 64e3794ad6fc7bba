"""Gloss recovered from what a floor mirrors, in photographs whose floors are computed."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
from bench.places.meshes import rectangle

from lightdepth.directions import pixel_directions
from lightdepth.errors import InputError
from lightdepth.images.radiance import write_radiance
from lightdepth.kernel.start import start
from lightdepth.lighting.gloss import recover_gloss
from lightdepth.lighting.gloss_fit import find_pairs, fit_lobe
from lightdepth.lighting.mirror_images import ROUGHNESSES, SPECULARS, MirrorImages
from lightdepth.parameters import LightingParameters, Parameters
from lightdepth.reconstruction.scene_file import write_meshes
from lightdepth.scene.load import load_scene
from lightdepth.scene.model import Gloss, Mesh, Panorama, RealSurface, RenderSettings, Role, Scene

HEIGHT, CAPTURE = 48, np.array([0.0, 0.0, 1.5])
LOW, HIGH = np.array([-3.0, -3.0, 0.0]), np.array([3.0, 3.0, 3.0])
WINDOW = ((-1.0, 1.0), (0.8, 2.2))
"""Along x and z in the wall at y = 3."""


def room():
    """Floor, and walls with ceiling."""
    dx, dy, up = np.diag(HIGH - LOW)
    walls = [
        rectangle(LOW, up, dx),
        rectangle(LOW + dy, dx, up),
        rectangle(LOW, dy, up),
        rectangle(LOW + dx, up, dy),
        rectangle(LOW + up, dy, dx),
    ]
    count = np.cumsum([0, *(len(wall.vertices) for wall in walls)])
    faces = np.concatenate([wall.faces + first for wall, first in zip(walls, count)])
    mesh = Mesh(np.concatenate([wall.vertices for wall in walls]), faces.astype(np.int32))
    return (
        RealSurface("floor", rectangle(LOW, dx, dy), Role.SUPPORT),
        RealSurface("walls", mesh, Role.ENVIRONMENT),
    )


@pytest.fixture(scope="module")
def place():
    """A photograph of walls with a window, each pixel's place on them, and its texture of the floor."""
    directions = pixel_directions(HEIGHT, 2 * HEIGHT)
    with np.errstate(divide="ignore"):
        exits = np.where(directions > 0, (HIGH - CAPTURE) / directions, (LOW - CAPTURE) / directions)
    at = CAPTURE + directions * exits.min(axis=-1, keepdims=True)
    floor = at[..., 2] < 1e-6
    (left, right), (bottom, top) = WINDOW
    window = (at[..., 1] > 3.0 - 1e-6) & (at[..., 0] > left) & (at[..., 0] < right)
    window &= (at[..., 2] > bottom) & (at[..., 2] < top)
    image = np.where(window, 12.0, np.where(floor, 0.1, 0.4))[..., None] * np.ones(3, np.float32)
    planks = np.random.default_rng(3).uniform(0.15, 0.35, (12, 12))
    column, row = ((at[..., :2] + 3.0) * 2.0).clip(0, 11).astype(int).transpose(2, 0, 1)
    albedo = planks[row, column][..., None] * np.array([1.0, 0.7, 0.5])
    settings = RenderSettings(parameters=Parameters(lighting=LightingParameters(mirror_samples=16)))
    panorama = Panorama(image.astype(np.float32), CAPTURE, np.eye(3))
    return Scene(panorama, room(), render=settings), at, floor, albedo


def photographed(place, gloss):
    """The place with a floor that sends what its albedo and its lobe make of the light of the walls."""
    start()
    from lightdepth.place.place import Place
    from lightdepth.place.real_surfaces import merge_real_surfaces
    from lightdepth.place.support_scattering import SpecularLobes
    from lightdepth.place.traced_surfaces import TracedSurfaces
    from lightdepth.recovery.irradiance import estimate_irradiance, estimate_mirrored

    scene, at, floor, albedo = place
    light = Place(scene.panorama, TracedSurfaces(merge_real_surfaces(scene.real)))
    points = at[floor].astype(np.float32)
    up, generator = np.broadcast_to(np.float32([0, 0, 1]), points.shape), np.random.default_rng(9)
    irradiance, _ = estimate_irradiance(light, points, up, generator, 256)
    image = scene.panorama.radiance.copy()
    image[floor] = albedo[floor] * irradiance / np.pi
    if gloss is not None:
        lobe, index = SpecularLobes((gloss,)), np.ones(len(points), np.uint32)
        image[floor] += estimate_mirrored(light, points, up, lobe, index, generator, 256)
    return replace(scene, panorama=replace(scene.panorama, radiance=image))


def test_roughness_and_level_of_a_floor_of_planks(place):
    roughness, specular = 0.35, 0.8
    (found,) = recover_gloss(photographed(place, Gloss(roughness, specular)))
    assert found.finding == "gloss"
    assert found.gloss.roughness == pytest.approx(roughness, abs=0.05)
    assert found.gloss.specular == pytest.approx(specular, rel=0.2)
    assert found.fit.roughness_bounds[0] <= found.gloss.roughness <= found.fit.roughness_bounds[1]
    np.testing.assert_allclose(found.gloss.albedo, [0.25, 0.175, 0.125], rtol=0.15)


def test_a_floor_that_mirrors_as_metal_does_is_no_dielectric(place):
    (found,) = recover_gloss(photographed(place, Gloss(0.2, 4.0)))
    assert (found.gloss.specular, found.finding, found.confidence) == (1.0, "too bright", "poor")


def written(scene, folder):
    """The scene as files with comments, and its text."""
    write_radiance(folder / "pano.exr", scene.panorama.radiance)
    write_meshes(scene.real, folder)
    few = "[render.parameters.lighting]\nmirror_samples = 16\n\n"
    text = f'# by tape\n{few}[panorama]\nimage = "pano.exr"\nposition = {CAPTURE.tolist()}\n'
    for surface in scene.real:
        text += f'\n[[real]]\nname = "{surface.name}"\nmesh = "{surface.name}.ply"\nrole = "{surface.role}"  # so\n'
    (folder / "room.toml").write_text(text)
    return folder / "room.toml", text


def test_the_command_writes_gloss_and_keeps_the_rest(place, command, tmp_path):
    file, text = written(photographed(place, Gloss(0.15, 0.5)), tmp_path)
    status, out, _ = command("recover", "gloss", file, "--write", "--json", "--picture", tmp_path / "gloss.png")
    (found,) = json.loads(out)["surfaces"]
    assert (status, found["finding"]) == (0, "gloss")
    gloss = load_scene(file).real[0].gloss
    assert (gloss.roughness, gloss.specular) == (found["gloss"]["roughness"], found["gloss"]["specular"])
    assert gloss.roughness == pytest.approx(0.15, abs=0.05)
    assert [line for line in file.read_text().splitlines() if not line.startswith("gloss")] == text.splitlines()
    picture = cv2.imread(str(tmp_path / "gloss.png")).astype(float).mean(axis=2)
    shown, mirrored, rest = np.split(picture, 3)
    # What is mirrored is bright in the photograph, and is not in what stays without it.
    highlight = mirrored > 0.5 * np.percentile(mirrored, 99.5)
    assert shown[highlight].mean() > rest[highlight].mean() + 25.0


def test_a_matte_floor_is_matt_and_nothing_is_written(place, command, tmp_path):
    file, text = written(photographed(place, None), tmp_path)
    status, out, _ = command("recover", "gloss", file, "--surface", "floor", "--write")
    assert status == 0
    assert "floor: matte as far as the photograph shows" in out
    assert "nothing is recovered" in out
    assert file.read_text() == text
    status, _, err = command("recover", "gloss", file, "--surface", "flor")
    assert status == 2
    assert "no [[real]] surface 'flor'; it has floor, walls" in err


def test_without_a_source_nothing_is_said(place):
    scene, _, _, _ = place
    even = np.full_like(scene.panorama.radiance, 0.5)
    (found,) = recover_gloss(replace(scene, panorama=replace(scene.panorama, radiance=even)))
    assert (found.gloss, found.finding) == (None, "no source")


def test_places_without_support_and_openings_are_refused(place):
    scene, _, _, _ = place
    with pytest.raises(InputError, match="no surface is support"):
        recover_gloss(replace(scene, real=scene.real[1:]))
    with pytest.raises(InputError, match="'walls' is an opening"):
        recover_gloss(replace(scene, real=(scene.real[0], replace(scene.real[1], opening=True))), ["walls"])


def test_a_texture_does_not_bias_the_lobe():
    """Cells whose highlight is known exactly, on textures with as much contrast: no shrinking toward less gloss."""
    rows, columns = 30, 44
    row, column = (each.ravel() for each in np.mgrid[:rows, :columns])
    lobes = np.zeros((len(ROUGHNESSES), len(SPECULARS), rows * columns, 3), np.float32)
    for i, roughness in enumerate(ROUGHNESSES):
        width = 2.0 + 20.0 * roughness
        spot = np.exp(-((row - 15) ** 2 + (column - 22) ** 2) / (2.0 * width**2)) / width**2
        lobes[i] = 40.0 * np.array(SPECULARS)[:, None, None] * spot[:, None]
    fits = []
    for seed in range(3):
        albedo = np.exp(np.random.default_rng(seed).uniform(-0.5, 0.5, (rows * columns, 1))) * np.ones(3)
        white = np.full((rows * columns, 3), np.pi)
        images = MirrorImages(row, column, columns, 1, albedo, white, lobes, np.zeros(0, np.int64), np.eye(3))
        shown = replace(images, shown=albedo + images.mirrored(0.25, 0.5))
        fits.append(fit_lobe(shown, find_pairs(shown)))
        assert fits[-1].specular_bounds[0] < 0.5 < fits[-1].specular_bounds[1]
    assert np.mean([fit.roughness for fit in fits]) == pytest.approx(0.25, abs=0.03)
    assert np.mean([fit.specular for fit in fits]) == pytest.approx(0.5, abs=0.05)
    assert fit_lobe(images, find_pairs(images)).explained < 0.01
    near = find_pairs(shown, LightingParameters(gloss_distances=(2,)))
    assert 0 < len(near.first) < len(find_pairs(shown).first)
    assert (np.abs(row[near.first] - row[near.second]) <= 2).all()

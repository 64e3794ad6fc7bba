"""Depth as a network estimates it: unknown scale and shift, blurred, and off by a smooth error."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from lightdepth.directions import pixel_directions
from lightdepth.errors import InputError
from lightdepth.images.distances import read_estimate
from lightdepth.kernel.raycasting import RayCaster
from lightdepth.reconstruction.depth_unit import Unit
from lightdepth.reconstruction.from_estimate import surfaces_from_estimate
from lightdepth.reconstruction.room_planes import find_room_planes
from tests.reconstruction.virtual_room import CAPTURE, FURNITURE, ROOM, trace

FILE = Path("estimate.npy")


@pytest.fixture(scope="module")
def exact(pose):
    return trace(CAPTURE, pose.to_world(pixel_directions(256, 512)))


def estimate(values, pose):
    """Blurred by a pixel, and off by 5 % (standard deviation)."""
    x, y, z = np.moveaxis(pose.to_world(pixel_directions(*values.shape)), -1, 0)
    error = x * y + 0.7 * z**2 - 0.5 * x * z + 0.6 * y**3 - 0.3
    blurred = gaussian_filter(values, 1.0, mode=("nearest", "wrap"))
    return blurred * (1.0 + 0.05 * error / error.std())


@pytest.fixture(scope="module", params=["ray", "disparity"])
def found(request, exact, pose):
    values = 0.37 * estimate(exact, pose)
    if request.param == "disparity":
        values = estimate(1.0 / exact, pose) + 0.1
        values = np.round(255.0 * (values - values.min()) / np.ptp(values))  # 8 bit.
    return request.param, surfaces_from_estimate(values, pose, CAPTURE[2], FILE)


def test_kind_and_unit_are_found(found):
    kind, result = found
    assert result.unit.kind == kind
    assert (result.unit.shift != 0.0) == (kind == "disparity")
    if kind == "ray":
        assert result.unit.scale == pytest.approx(1.0 / 0.37, rel=0.1)


def test_floor_and_walls_are_where_they_are(found):
    _, result = found
    surfaces = {surface.name: surface.mesh for surface in result.measured.surfaces}
    assert np.abs(surfaces["floor"].vertices[:, 2]).max() < 1e-4
    assert result.measured.floor.tilt == 0.0
    planes = result.planes.vectors
    distances = 1.0 / np.linalg.norm(planes, axis=1)
    places = CAPTURE + planes * distances[:, None] ** 2
    for axis, side in ((0, 0), (0, 1), (1, 0), (1, 1), (2, 1)):
        # The cupboard's front faces the same way as the wall behind it, which is the farther of the two.
        facing = np.flatnonzero(planes[:, axis] * (2 * side - 1) * distances > np.cos(np.radians(1.5)))
        plane = facing[np.argmax(distances[facing])]
        wanted = abs(ROOM[side][axis] - CAPTURE[axis])
        assert abs(places[plane, axis] - ROOM[side][axis]) < 0.03 * wanted


def test_few_triangles_show_the_room_and_its_furniture(found, pose):
    _, result = found
    meshes = [surface.mesh for surface in result.measured.surfaces]
    assert sum(len(mesh.faces) for mesh in meshes) < 12_000
    directions = pose.to_world(pixel_directions(128, 256).reshape(-1, 3))
    distance = RayCaster(meshes).cast(CAPTURE, directions).distance
    error = np.abs(distance / trace(CAPTURE, directions) - 1.0)
    assert np.isfinite(distance).mean() > 0.999
    assert np.median(error) < 0.005
    assert np.mean(error < 0.03) > 0.97
    # The chest stands on the floor, and the floor goes on below it.
    low, high = FURNITURE["chest"]
    below = RayCaster([meshes[0]]).cast(np.array([*(low + high)[:2] / 2.0, 1.0]), np.array([[0.0, 0.0, -1.0]]))
    assert below.distance[0] == pytest.approx(1.0, abs=1e-4)


def test_where_planes_meet_tells_their_distance():
    """A smooth error of 10 % that grows with the height does not move the walls: they stand on the floor."""
    directions = pixel_directions(256, 512)
    exact = 1.0 / trace(CAPTURE, directions)
    planes = find_room_planes(exact * (1.0 + 0.1 * directions[..., 2]), CAPTURE[2], Unit("disparity", 1.0, 0.0, 1.0))
    distances = np.sort(1.0 / np.linalg.norm(planes.vectors[1:], axis=1))
    # The fourth is the front of the cupboard.
    np.testing.assert_allclose(distances, [1.1, 1.6, 1.8, 2.3, 2.6, 2.7], rtol=0.01)


def test_what_cannot_be_is_explained(tmp_path, pose, exact):
    np.save(tmp_path / "same.npy", np.full((64, 128), 3.0))
    with pytest.raises(InputError, match="the same value, 3, everywhere"):
        read_estimate(tmp_path / "same.npy")
    colours = np.zeros((64, 128, 3), np.uint8)
    colours[:32, :, 1] = 200
    cv2.imwrite(str(tmp_path / "colours.png"), colours)
    with pytest.raises(InputError, match="false colours"):
        read_estimate(tmp_path / "colours.png")
    random = np.random.default_rng(0)
    with pytest.raises(InputError, match="no floor is found"):
        surfaces_from_estimate(random.uniform(0.1, 5.0, (64, 128)), pose, CAPTURE[2], FILE)


def test_the_command_takes_an_eight_bit_picture_and_says_what_it_means(command, tmp_path, panorama, exact, pose):
    disparity = estimate(1.0 / exact[::2, ::2], pose)
    grey = np.round(255.0 * (disparity - disparity.min()) / np.ptp(disparity)).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "estimate.png"), np.repeat(grey[..., None], 3, axis=2))
    place = ["--panorama", panorama, "--position", "0.1,-0.2,1.5", "--rotation", "2,-3,25", "-o", tmp_path / "meshes"]
    run = ["reconstruct", "from-depth", tmp_path / "estimate.png"]
    status, _, errors = command(*run, *place)
    assert status == 2
    assert "--estimated" in errors
    status, printed, errors = command(*run, "--estimated", "--write", tmp_path / "scene.toml", "--json", *place)
    assert status == 0
    assert errors.strip() == f"{tmp_path}/scene.toml does not exist and will be created with this panorama"
    report = json.loads(printed)
    assert report["estimate"]["kind"] == "disparity"
    assert report["floor"] == {"height": 0.0, "tilt": 0.0, "normal": [0.0, 0.0, 1.0]}
    assert report["surfaces"][0]["name"] == "floor"
    assert 'role = "support"' in (tmp_path / "scene.toml").read_text(encoding="utf-8")

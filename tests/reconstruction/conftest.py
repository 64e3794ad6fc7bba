"""The virtual room's panorama, depth and points."""

import numpy as np
import pytest

from lightdepth.directions import euler_rotation, pixel_directions
from lightdepth.images.exr import ExrPart, write_exr
from lightdepth.reconstruction.pose import Pose
from tests.reconstruction.virtual_room import CAPTURE, radiance, trace

ROTATION = (2.0, -3.0, 25.0)


@pytest.fixture(scope="session")
def pose():
    return Pose(CAPTURE, euler_rotation(ROTATION))


@pytest.fixture(scope="session")
def depth(pose):
    """Exact distances, shape (128, 256)."""
    return trace(CAPTURE, pose.to_world(pixel_directions(128, 256)))


@pytest.fixture(scope="session")
def panorama(pose, depth, tmp_path_factory):
    """The room's panorama as a file, 256 x 128."""
    path = tmp_path_factory.mktemp("room") / "room.exr"
    pixels = radiance(CAPTURE + pose.to_world(pixel_directions(128, 256)) * depth[..., None])
    write_exr(path, [ExrPart({name: pixels[..., i] for i, name in enumerate("RGB")})])
    return path


@pytest.fixture(scope="session")
def scan():
    """A scanner's points: 1 cm noise, 20 % of the directions missing in patches, one in 200 a stray point."""
    random = np.random.default_rng(0)
    directions = random.normal(size=(40_000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    points = CAPTURE + directions * (trace(CAPTURE, directions) + random.normal(0, 0.01, len(directions)))[:, None]
    missing = directions[:, 2] < -np.cos(np.radians(20))  # Below the tripod.
    while missing.mean() < 0.2:
        patch = random.normal(size=3)
        missing |= directions @ patch > np.cos(np.radians(7)) * np.linalg.norm(patch)
    stray = random.uniform([-3.2, -2.8, -1.0], [3.8, 3.4, 3.6], (200, 3))
    return np.concatenate([points[~missing], stray])

"""The light-depth map's file."""

import numpy as np
import OpenEXR
import pytest

from lightdepth.directions import euler_rotation
from lightdepth.errors import InputError
from lightdepth.images.exr import ExrPart, read_exr, write_exr
from lightdepth.images.radiance import read_radiance
from lightdepth.lightmap.file import LightDepthMap, read_light_depth_map, write_light_depth_map


def example():
    random = np.random.default_rng(9)
    depth = random.uniform(0.5, 9, (16, 32)).astype(np.float32)
    depth[2:5] = np.inf
    radiance = (10 ** random.uniform(-3, 5, (16, 32, 3))).astype(np.float32)
    return LightDepthMap(radiance, depth, np.array([1.0, -2.5, 1.62]), euler_rotation([10, -20, 130]))


def test_a_map_comes_back(tmp_path):
    write_light_depth_map(tmp_path / "map.exr", example())
    back = read_light_depth_map(tmp_path / "map.exr")
    np.testing.assert_array_equal(back.radiance, example().radiance, strict=True)
    np.testing.assert_array_equal(back.depth, example().depth, strict=True)
    np.testing.assert_allclose(back.position, example().position, atol=1e-6)
    np.testing.assert_allclose(back.rotation, example().rotation, atol=1e-6)
    np.testing.assert_allclose(back.rotation @ back.rotation.T, np.eye(3), atol=1e-14)


def test_the_file_is_as_designed_and_a_panorama_as_well(tmp_path):
    write_light_depth_map(tmp_path / "map.exr", example())
    (part,) = read_exr(tmp_path / "map.exr")
    assert sorted(part.channels) == ["B", "G", "R", "Z"]
    assert {channel.dtype for channel in part.channels.values()} == {np.dtype(np.float32)}
    assert part.header["envmap"] == "latlong"
    place = np.array([3.0, 1.0, 0.5])
    seen = np.append(place, 1.0) @ part.header["worldToCamera"]
    right, forward, up = example().rotation.T @ (place - example().position)
    np.testing.assert_allclose(seen, [right, up, forward, 1.0], atol=1e-6)
    np.testing.assert_array_equal(read_radiance(tmp_path / "map.exr"), example().radiance)


def change_nothing(channels, header):
    pass


def drop_depth(channels, header):
    del channels["Z"]


def drop_pose(channels, header):
    del header["worldToCamera"]


def shear(channels, header):
    header["worldToCamera"][0, 1] = 0.5


def right_handed(channels, header):
    header["worldToCamera"] = np.eye(4, dtype=np.float32)


def not_positive(channels, header):
    channels["Z"][3, 4:6] = 0.0, np.nan


def dark(channels, header):
    channels["RGB"][3, 4, 0] = np.nan


def cube(channels, header):
    header["envmap"] = OpenEXR.ENVMAP_CUBE


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (change_nothing, None),
        (drop_depth, "has the channels R, G, B and Z; found RGB"),
        (drop_pose, "must have worldToCamera"),
        (shear, "not a rotation and a translation"),
        (right_handed, "leads to a right-handed camera space; OpenEXR's is left-handed"),
        (not_positive, r"2 of 512 distances in channel Z are not positive, the first at row 3, column 4 \(0.0\)"),
        (dark, "1 pixel has NaN radiance"),
        (cube, "must be latlong"),
    ],
)
def test_a_bad_file_is_refused(tmp_path, spoil, message):
    path = tmp_path / "map.exr"
    channels = {"RGB": example().radiance, "Z": example().depth}
    header = {"envmap": OpenEXR.ENVMAP_LATLONG, "worldToCamera": np.eye(4, dtype=np.float32)[[0, 2, 1, 3]]}
    spoil(channels, header)
    write_exr(path, [ExrPart(channels, "", header)])
    if message is None:
        np.testing.assert_array_equal(read_light_depth_map(path).position, 0.0)
        np.testing.assert_array_equal(read_light_depth_map(path).rotation, np.eye(3))
        return
    with pytest.raises(InputError, match=message) as caught:
        read_light_depth_map(path)
    assert str(caught.value).startswith(str(path))

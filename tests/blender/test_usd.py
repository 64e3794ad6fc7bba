"""What Blender's USD exporter writes moves here as it does in Blender."""

import math

import numpy as np
import pytest

from lightdepth.scene.camera_file import read_camera
from lightdepth.scene.meshes import AnimatedMesh
from lightdepth.scene.meshes.geometry import face_areas

pytest.importorskip("pxr", reason="of the extra usd")


@pytest.fixture(scope="module")
def exported(blender, tmp_path_factory):
    path = tmp_path_factory.mktemp("usd") / "moving.usdc"
    return path, blender.run("usd", path)


def test_skeletons_shape_keys_and_cameras_are_blenders(exported):
    path, found = exported
    moving = AnimatedMesh(path, with_materials=True)  # A warning would be an error.
    for frame, expected in found["frames"].items():
        time = (int(frame) - 1) / found["rate"]
        parts = moving.parts("timeline", time, False)
        assert len(parts) == 2
        parts.sort(key=lambda part: part.mesh.vertices[:, 0].max())
        for part, name in zip(parts, ("lump", "bar")):
            vertices = part.mesh.vertices
            bounds = [expected[name]["low"], expected[name]["high"]]
            np.testing.assert_allclose([vertices.min(0), vertices.max(0)], bounds, atol=1e-4, err_msg=f"{name} {frame}")
            area = face_areas(vertices, part.mesh.faces).sum()
            assert area == pytest.approx(expected[name]["area"], rel=1e-4)
        camera = read_camera(path, "shot", "timeline", time, False)
        world = np.array(expected["camera"])
        np.testing.assert_allclose(camera.position, world[:3, 3], atol=1e-5)
        right, up, back = world[:3, :3].T
        np.testing.assert_allclose(camera.rotation.T, [right, -back, up], atol=1e-5)
        assert camera.aspect == pytest.approx(16 / 9, rel=1e-5)
        across = 2.0 * math.atan(math.tan(0.5 * math.radians(camera.vertical_fov)) * camera.aspect)
        assert across == pytest.approx(expected["fov"], abs=1e-5)

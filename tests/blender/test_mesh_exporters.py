"""What each exporter of Blender writes has the size, area and colours that it has in Blender."""

import numpy as np
import pytest

from lightdepth.scene.materials import VertexColors
from lightdepth.scene.meshes import read_mesh_file
from lightdepth.scene.meshes.geometry import face_areas

FORMATS = {"obj", "obj-smooth", "ply", "ply-ascii", "stl", "stl-ascii", "glb", "gltf", "draco", "usdc"}
ORANGE = (0.5, 0.25, 0.0)


@pytest.fixture(scope="module")
def exported(blender, tmp_path_factory):
    folder = tmp_path_factory.mktemp("exporters")
    found = blender.run("exporters", folder)
    assert found["skipped"] == []
    return folder, found["objects"]


def parts_of(folder, file):
    return read_mesh_file(folder / file, with_materials=True)  # A warning would be an error.


def test_sizes_and_areas_are_blenders(exported):
    folder, objects = exported
    assert len(objects) == 11
    for name, thing in objects.items():
        assert set(thing["files"]) == FORMATS
        for label, file in thing["files"].items():
            parts = parts_of(folder, file)
            vertices = np.concatenate([part.mesh.vertices for part in parts])
            area = sum(face_areas(part.mesh.vertices, part.mesh.faces).sum() for part in parts)
            # Draco rounds positions to 14 bits.
            exact = 2e-4 if label == "draco" else 2e-5
            np.testing.assert_allclose([vertices.min(0), vertices.max(0)], [thing["low"], thing["high"]], atol=exact)
            # The area of the monkey's warped quads depends a little on the diagonal along which they are cut.
            assert area == pytest.approx(thing["area"], rel=2e-4 if name == "monkey" else exact), file


def test_materials_are_blenders(exported):
    folder, objects = exported
    for label in ("obj", "obj-smooth", "glb", "gltf", "draco", "usdc"):
        (part,) = parts_of(folder, objects["monkey"]["files"][label])
        assert part.material.base_color == pytest.approx((0.8, 0.1, 0.1), abs=1e-6), label
        if label != "obj":  # Which has a Phong exponent, unless its PBR extensions are switched on.
            assert part.material.roughness == pytest.approx(0.5, abs=1e-6), label


def test_colours_of_vertices_are_blenders(exported):
    folder, objects = exported
    # Byte colours are rounded once in Blender and, in PLY, once more; "ply-ascii" was exported as linear bytes.
    for label in ("obj-smooth", "ply", "glb", "gltf", "draco"):
        (part,) = parts_of(folder, objects["uv_sphere"]["files"][label])
        assert isinstance(part.material.base_color, VertexColors)
        np.testing.assert_allclose(part.mesh.colors, np.tile(ORANGE, (len(part.mesh.colors), 1)), atol=0.005)

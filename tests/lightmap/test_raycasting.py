"""Rays against meshes."""

import numpy as np

from lightdepth.kernel.raycasting import RayCaster
from tests.lightmap.rooms import box


def test_the_first_mesh_its_face_and_normal_are_found():
    walls, cube = box(), box([1, 0, 1], [2, 1, 2])
    found = RayCaster([walls, cube]).cast(
        np.array([[0, 0.5, 1.5], [0, 0.5, 1.5], [1.5, 0.5, 1.5], [9, 9, 9]]),
        np.array([[1, 0, 0], [-1, 0, 0], [0, 0, 1], [1, 0, 0]]),
    )
    np.testing.assert_allclose(found.distance, [1.0, 2.0, 0.5, np.inf])
    assert found.mesh.tolist() == [1, 0, 1, -1]
    np.testing.assert_allclose(found.normal, [[-1, 0, 0], [-1, 0, 0], [0, 0, 1], [0, 0, 0]], atol=1e-7)
    corners = cube.vertices[cube.faces[found.face[0]]]
    np.testing.assert_array_equal(corners[:, 0], 1.0)
    assert found.face[3] == -1


def test_many_rays_are_cast_alike_in_parts(monkeypatch):
    random = np.random.default_rng(8)
    directions = random.normal(size=(1000, 3))
    caster = RayCaster([box(), box([1, 0, 1], [2, 1, 2])])
    origin = np.array([0.0, 0.5, 1.5])
    whole = caster.cast(origin, directions)
    monkeypatch.setattr("lightdepth.kernel.raycasting.RAYS_AT_ONCE", 64)
    parts = caster.cast(origin, directions)
    for name in ("distance", "mesh", "face", "normal"):
        np.testing.assert_array_equal(getattr(whole, name), getattr(parts, name), strict=True)


def test_without_meshes_nothing_is_hit():
    found = RayCaster([]).cast(np.zeros(3), np.eye(3))
    assert np.isinf(found.distance).all()
    assert (found.mesh == -1).all()

"""Spheres around parts of objects: nothing is outside of them all, and they leave out what is empty."""

import numpy as np
import pytest

from lightdepth.kernel.start import start

start("cpu")

from lightdepth.parameters.transport import DEFAULT, TransportParameters  # noqa: E402
from lightdepth.place.object_outline import ObjectOutline  # noqa: E402


def mesh(faces, seed=0):
    """Small triangles along a winding line."""
    generator = np.random.default_rng(seed)
    middle = np.cumsum(generator.normal(0.0, 0.05, (faces, 1, 3)), axis=0)
    vertices = (middle + generator.normal(0.0, 0.02, (faces, 3, 3))).reshape(-1, 3).astype(np.float32)
    return vertices, np.arange(3 * faces, dtype=np.uint32).reshape(-1, 3)


def sphere_of(vertices):
    centre = vertices.mean(axis=0).astype(np.float64)
    return centre, float(np.linalg.norm(vertices - centre, axis=1).max())


def is_enclosed(outline, triangles):
    """Whether all corners of each triangle lie in one sphere, so that all of it does."""
    distances = np.linalg.norm(triangles[:, :, None] - outline.centres, axis=3)
    return (distances <= outline.radii * (1 + 1e-5) + 1e-6).all(axis=1).any(axis=1)


@pytest.mark.parametrize("faces", [1, 100, 5000])
def test_every_face_is_in_a_sphere(faces):
    vertices, triangles = mesh(faces)
    outline = ObjectOutline([(sphere_of(vertices), (vertices, triangles))])
    assert is_enclosed(outline, vertices[triangles]).all()
    assert len(outline.radii) <= DEFAULT.outline_parts


def test_parts_of_a_wire_are_as_short_as_their_number_allows():
    """They are halves of halves, so that none is longer than twice their mean."""
    along = np.linspace(0.0, 10.0, 2048)[:, None, None] * [1.0, 0.0, 0.0]
    vertices = (along + 0.001 * np.eye(3)).reshape(-1, 3).astype(np.float32)
    faces = np.arange(len(vertices), dtype=np.uint32).reshape(-1, 3)
    outline = ObjectOutline([(sphere_of(vertices), (vertices, faces))])
    assert len(outline.radii) == 2048 // DEFAULT.outline_faces
    assert outline.radii.max() <= 10.0 / len(outline.radii)
    for tuned, count in ((TransportParameters(outline_faces=64), 32), (TransportParameters(outline_parts=8), 8)):
        coarser = ObjectOutline([(sphere_of(vertices), (vertices, faces))], parameters=tuned)
        assert len(coarser.radii) == count


def test_many_spheres_are_enclosed_by_fewer():
    generator = np.random.default_rng(1)
    centres, radii = generator.uniform(-5.0, 5.0, (2048, 3)), generator.uniform(0.01, 0.1, 2048)
    outline = ObjectOutline([((centre, radius), None) for centre, radius in zip(centres, radii)])
    assert len(outline.radii) <= DEFAULT.outline_parts
    distances = np.linalg.norm(centres[:, None] - outline.centres, axis=2) + radii[:, None]
    assert (distances <= outline.radii + 1e-9).any(axis=1).all()


def test_parts_are_those_of_the_mesh_that_is_given_and_are_found_once_for_each():
    (first, faces), (second, _) = mesh(200, 0), mesh(200, 1)
    here, there = (ObjectOutline([(sphere_of(each), (each, faces))]) for each in (first, second))
    assert is_enclosed(here, first[faces]).all()
    assert is_enclosed(there, second[faces]).all()
    both = ObjectOutline([(sphere_of(each), (each, faces)) for each in (first, second)])
    assert np.array_equal(both.radii, np.concatenate([here.radii, there.radii]))
    assert np.array_equal(both.centres, np.concatenate([here.centres, there.centres]))
    # Among many shapes, each may have fewer parts.
    many = ObjectOutline([(sphere_of(first), (first, faces)), *[(sphere_of(second), None)] * 100])
    assert len(many.radii) - 100 < len(here.radii)
    assert is_enclosed(many, first[faces]).all()

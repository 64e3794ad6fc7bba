"""Cells that remember what the objects change on support, as other surfaces see it."""

import numpy as np
import pytest

from lightdepth.kernel.start import start

start("cpu")

import drjit as dr  # noqa: E402
import mitsuba as mi  # noqa: E402

from lightdepth.place.object_bounds import ObjectBounds  # noqa: E402
from lightdepth.transport.difference import DifferenceIntegrator  # noqa: E402
from lightdepth.transport.radiance_cache import RadianceCache  # noqa: E402
from tests.transport.places import GREY, ball, lamp_image, picture, room  # noqa: E402

UP = mi.Vector3f(0.0, 0.0, 1.0)


@pytest.fixture
def cache():
    """For one object, a unit ball at the origin."""
    return RadianceCache(ObjectBounds([(np.zeros(3), 1.0)]))


def cells_of(cache, points, normal=UP):
    cell, edge = cache.cell(mi.Point3f(np.asarray(points, np.float32).T), normal)
    return cell.numpy(), edge.numpy()


def test_cells_are_small_near_objects_and_grow_with_the_distance(cache):
    distances = np.geomspace(0.1, 6.0, 50)
    directions = np.random.default_rng(1).normal(size=(50, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    _, edges = cells_of(cache, directions * (1.0 + distances)[:, None])
    limit = 0.5 * np.maximum(distances, 0.5)
    assert (edges <= limit * 1.001).all()
    assert (edges > 0.5 * limit * 0.999).all()


def test_a_cell_is_one_cube_of_one_facing(cache):
    points = np.random.default_rng(2).uniform(-9.0, 9.0, (20_000, 3))
    cells, edges = cells_of(cache, points)
    order = np.argsort(cells)
    _, first = np.unique(cells[order], return_index=True)
    corner = np.floor(points / edges[:, None])
    for group in np.split(order, first[1:]):
        assert np.ptp(edges[group]) == 0.0
        assert (corner[group] == corner[group[0]]).all()
    places = {(float(e), *c) for e, c in zip(edges, corner.tolist(), strict=True)}
    assert len(places) == len(first)
    facings = [mi.Vector3f(*(sign * np.eye(3)[axis]).tolist()) for axis in range(3) for sign in (1.0, -1.0)]
    assert len({int(cells_of(cache, points[:1], facing)[0][0]) for facing in facings}) == 6


def test_an_entry_is_the_mean_of_the_records_of_its_cell(cache):
    generator = np.random.default_rng(3)
    points = np.array([[3.0, 0.2, 0.1], [-3.0, 0.2, 0.1], [0.1, 2.2, 0.1], [0.1, -7.2, 0.1]])
    cells, _ = cells_of(cache, points)
    met = np.repeat([0, 1, 2], [50, 4, 1])
    changes = generator.normal(size=(len(met), 3)).astype(np.float32)
    for part in np.array_split(generator.permutation(len(met)), 3):  # Earlier records are kept.
        with cache.train(len(part)):
            slots = mi.UInt32(np.arange(len(part), dtype=np.uint32))
            cache.record(slots, mi.UInt64(cells[met[part]]), mi.Color3f(changes[part].T), mi.Bool(True))
    found, mean = cache.look_up(mi.UInt64(cells), mi.Bool(True))
    np.testing.assert_array_equal(found.numpy(), [True, True, True, False])
    for index in (0, 1, 2):
        np.testing.assert_allclose(mean.numpy()[:, index], changes[met == index].mean(axis=0), rtol=1e-4, atol=1e-6)
    assert not cache.look_up(mi.UInt64(cells), mi.Bool(False))[0].numpy().any()


def test_cells_with_few_records_are_shrunk_toward_the_mean_of_their_block(cache):
    """On the eight cells of one block; records of a neighbouring block do not matter."""
    edge = 4.0
    points = 16.0 + edge * (0.5 + np.array([[0, 0, 0], [1, 0, 0], [0, 1, 1], [2, 0, 0], [-1, 0, 0]]))
    cells, edges = cells_of(cache, points)
    assert (edges == edge).all()
    for cell, records, value in ((0, 1, 9.0), (1, 3000, 1.0), (3, 5, 100.0)):
        with cache.train(records):
            cache.record(dr.arange(mi.UInt32, records), mi.UInt64([int(cells[cell])]), mi.Color3f(value), mi.Bool(True))
    found, mean = cache.look_up(mi.UInt64(cells), mi.Bool(True))
    np.testing.assert_array_equal(found.numpy(), [True, True, True, True, False])
    around = (9.0 + 3000.0) / 3001.0
    expected = [(9.0 + 4.0 * around) / 5.0, (3000.0 + 4.0 * around) / 3004.0, around, 100.0]
    np.testing.assert_allclose(mean.numpy()[0, :4], expected, rtol=1e-5)


def test_paths_that_do_not_train_leave_no_record(cache):
    cells, _ = cells_of(cache, [[3.0, 0.2, 0.1]] * 10)
    cache.record(dr.arange(mi.UInt32, 10), mi.UInt64(cells), mi.Color3f(1.0), mi.Bool(True))
    with cache.train(10):
        pass
    assert not cache.look_up(mi.UInt64(cells), mi.Bool(True))[0].numpy().any()


def test_the_cache_reduces_noise_and_keeps_the_picture(monkeypatch):
    scene = room(lamp_image(128), [ball(GREY, (1.8, 1.2, 0.4))])

    def pictures():
        frames = [picture(scene, "view", 64, seed) for seed in range(8)]
        return np.array([frame.beauty for frame in frames])

    with_cells = pictures()
    monkeypatch.setattr(DifferenceIntegrator, "new_cache", lambda self: None)
    without = pictures()
    assert with_cells.var(axis=0, ddof=1).mean() < 0.6 * without.var(axis=0, ddof=1).mean()
    # Of means over blocks, since neighbours share the cells' errors.
    blocks = [each.reshape(8, 4, 8, 6, 8, 3).mean(axis=(2, 4)) for each in (with_cells, without)]
    np.testing.assert_allclose(blocks[0].mean(axis=0), blocks[1].mean(axis=0), rtol=0.01)

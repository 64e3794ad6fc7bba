"""Instances: what rays meet is the same as with one mesh of all of them, and memory goes with what stands once."""

from dataclasses import replace
from operator import attrgetter

import numpy as np
import pytest

from lightdepth.kernel.start import start

start("cpu")

import drjit as dr  # noqa: E402
import mitsuba as mi  # noqa: E402

import lightdepth  # noqa: E402
from lightdepth.kernel.instance_tree import END, instance_tree  # noqa: E402
from lightdepth.kernel.loading import load  # noqa: E402
from lightdepth.kernel.shapes import synthetic_shapes  # noqa: E402
from lightdepth.kernel.tracing import WithInstances, first_hit, interaction, meets  # noqa: E402
from lightdepth.kernel.variables import as_vectors  # noqa: E402
from lightdepth.parameters import Parameters  # noqa: E402
from lightdepth.parameters.transport import TransportParameters  # noqa: E402
from lightdepth.scene.model import Mesh, RenderSettings, Scene, SyntheticObject, SyntheticPart  # noqa: E402
from tests.chance import Seen, check_seen  # noqa: E402
from tests.transport.places import GREY, ball, lamp_image, room  # noqa: E402

RAYS = 20_000


def bush(seed, triangles=40):
    """A mesh with normals and texture coordinates, about one metre high."""
    rng = np.random.default_rng(seed)
    corners = rng.normal(size=(triangles, 1, 3)) * [0.2, 0.2, 0.3] + rng.normal(size=(triangles, 3, 3)) * 0.1
    normals = rng.normal(size=(3 * triangles, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    faces = np.arange(3 * triangles, dtype=np.int32).reshape(-1, 3)
    coordinates = rng.random((3 * triangles, 2)).astype(np.float32)
    return Mesh(corners.reshape(-1, 3).astype(np.float32), faces, normals.astype(np.float32), coordinates)


def places(seed, count, side=6.0, uneven=False):
    """Turned and scaled, perhaps sheared and of uneven scale, anywhere in a cube."""
    rng = np.random.default_rng(seed)
    matrices = np.tile(np.eye(4), (count, 1, 1))
    scales = rng.uniform(0.3, 1.5, (count, 1, 3 if uneven else 1))
    matrices[:, :3, :3] = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0] @ (np.eye(3) * scales)
    matrices[:, 0, 1] += 0.1 if uneven else 0.0
    matrices[np.linalg.det(matrices[:, :3, :3]) < 0.0, :3, 0] *= -1.0
    matrices[:, :3, 3] = (rng.random((count, 3)) - 0.5) * side
    return matrices


def settings(limit):
    return RenderSettings(parameters=Parameters(transport=TransportParameters(expanded_triangles=limit)))


@pytest.fixture(scope="module")
def both():
    """The same objects as instances and expanded, as scenes to trace rays in; the shapes of the former and the rays."""
    # Normals are interpolated before they are scaled, and not afterwards: where scales are uneven, those of faces count.
    flat = replace(bush(2), normals=None)
    things = tuple(
        SyntheticObject(f"bush {index}", (SyntheticPart(mesh, GREY, at),))
        for index, (mesh, at) in enumerate(
            [(bush(1), places(1, 37)), (flat, places(2, 300, uneven=True)), (bush(3), places(3, 64))]
        )
    )
    single = SyntheticObject("single", (SyntheticPart(bush(9), GREY),))
    rng = np.random.default_rng(5)
    origins, directions = (rng.random((RAYS, 3)) - 0.5) * 8.0, rng.normal(size=(RAYS, 3))
    directions[: RAYS // 20] = np.eye(3)[rng.integers(3, size=RAYS // 20)] * rng.choice([-1.0, 1.0], (RAYS // 20, 1))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    ray = mi.Ray3f(mi.Point3f(as_vectors(origins)), as_vectors(directions))
    found = []
    for limit in (1, 1_000_000):
        shapes = synthetic_shapes(Scene(panorama=None, synthetic=(*things, single), render=settings(limit)))
        plain = load(
            {"type": "scene", "embree_use_robust_intersections": True}
            | {f"shape_{index}": shape for index, shape in enumerate(shapes.plain)}
        )
        found.append((plain if shapes.instances is None else WithInstances(plain, shapes.instances), shapes))
    (instanced, shapes), (expanded, every) = found
    assert isinstance(instanced, WithInstances)
    assert not isinstance(expanded, WithInstances)
    return instanced, expanded, shapes, every, ray


def test_rays_meet_the_same(both):
    instanced, expanded, _, _, ray = both
    hits = [first_hit(scene, ray) for scene in (instanced, expanded)]
    ours, theirs = (hit.t.numpy() for hit in hits)
    assert 0.2 < np.isfinite(theirs).mean() < 0.9
    # Rays through edges may meet either side of them.
    same = np.isclose(ours, theirs, rtol=1e-5, atol=2e-5)
    assert same.mean() > 0.999
    where = same & np.isfinite(theirs)
    surfaces = [
        interaction(scene, hit, ray, hit.is_valid()) for scene, hit in zip((instanced, expanded), hits, strict=True)
    ]
    dr.eval(surfaces)  # at once, not one by one
    for name in ("p", "n", "uv", "wi", "t", "dp_du", "dp_dv", "sh_frame.s", "sh_frame.t", "sh_frame.n"):
        first, second = (attrgetter(name)(si).numpy()[..., where] for si in surfaces)
        # Derivatives by texture coordinates are as large as those lie close together.
        apart = np.abs(first - second) / np.maximum(1.0, np.abs(second))
        assert np.quantile(apart, 0.999) < 5e-4, name
        assert np.median(apart) < 2e-6, name


def test_rays_are_blocked_by_the_same(both):
    instanced, expanded, _, _, ray = both
    short = mi.Ray3f(ray)
    short.maxt = dr.select(dr.arange(mi.UInt32, RAYS) % 2 == 0, 1.0, dr.inf)
    active = dr.arange(mi.UInt32, RAYS) % 3 > 0
    ours, theirs = (meets(scene, short, active).numpy() for scene in (instanced, expanded))
    assert 0.1 < theirs.mean() < 0.6
    assert (ours == theirs).mean() > 0.999
    assert not ours[::3].any()


def test_spheres_enclose_all_instances(both):
    _, _, shapes, every, _ = both
    for (centre, radius), (_, shape) in zip(shapes.spheres, every.numbered, strict=True):
        vertices = shape.vertex_position(dr.arange(mi.UInt32, shape.vertex_count())).numpy().T
        reach = np.linalg.norm(vertices - centre, axis=1).max()
        assert reach <= radius * (1.0 + 1e-5)
        assert radius < 1.4 * reach


@pytest.mark.parametrize("count", [1, 2, 5, 64, 300])
def test_every_leaf_is_come_by_once_in_every_octant(count):
    low = np.random.default_rng(count).random((count, 3))
    tree = instance_tree(low, low + 0.01)
    leaves = len(tree.leaves)
    for octant, onward in enumerate(tree.onward):
        node, met = 0, []
        while node != END:
            if node >= leaves - 1:
                met.append(tree.leaves[node - (leaves - 1)])
                node = int(onward[node])
            else:
                node = 2 * node + 1 + ((octant >> tree.axis[node]) & 1)
        assert sorted(each for each in met if each >= 0) == list(range(count))


def test_a_picture_is_that_of_the_expanded_mesh():
    thing = bush(4)
    standing = places(4, 60, 1.2) @ np.diag([0.3, 0.3, 0.3, 1.0])
    standing[:, :3, 3] += [0.0, 1.2, 0.8]
    scene = room(lamp_image(64), [ball(GREY, (0.6, 1.2, 0.4))], irradiance_samples=16)
    bushes = SyntheticObject("bushes", (SyntheticPart(thing, GREY, standing),))
    scene = replace(scene, synthetic=(*scene.synthetic, bushes))
    frames = []
    for limit in (1, 1_000_000):
        parameters = Parameters(transport=TransportParameters(expanded_triangles=limit))
        changed = replace(scene, render=replace(scene.render, parameters=parameters))
        frames.append(lightdepth.render(changed, "view", samples=64))
    first, second = frames
    assert (first.object_id == 2).mean() > 0.02
    assert (first.object_id == second.object_id).mean() > 0.998
    same = (first.object_id == second.object_id) & (first.object_id == 2)
    np.testing.assert_allclose(first.depth[same], second.depth[same], rtol=1e-4)
    # Spheres around instances are a little larger, and other random numbers follow.
    for where in (first.object_id == 2, first.object_id == 0):
        ratio = first.beauty[where].mean() / second.beauty[where].mean() - 1.0
        check_seen(ratio, Seen(25, -0.000233, 0.00027, 0.00282), -0.025, 0.025)

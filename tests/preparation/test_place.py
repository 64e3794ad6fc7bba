"""The place is prepared without a look at the objects, and kept: whatever moves in it, it stays what it was."""

from dataclasses import replace

import numpy as np
import pytest

from lightdepth.kernel.start import start

start("cpu")

import lightdepth  # noqa: E402
from lightdepth.errors import InputWarning  # noqa: E402
from lightdepth.parameters import Parameters, RecoveryParameters  # noqa: E402
from lightdepth.preparation.place import forget_places, prepare_place  # noqa: E402
from lightdepth.scene.model import Gloss  # noqa: E402
from lightdepth.store import Store  # noqa: E402
from tests.transport.places import GREY, ball, lamp_image, room  # noqa: E402

NEAR, FAR = (0.3, 1.2, 0.4), (-1.2, -1.0, 0.4)


def scene(*centers, **settings):
    """The room with balls, small enough to be prepared in a moment."""
    return room(lamp_image(64), [ball(GREY, center) for center in centers], **{"irradiance_samples": 16, **settings})


def arrays(prepared):
    return {name: value for name, value in vars(prepared.real).items() if isinstance(value, np.ndarray)}


def prepared_afresh(scene, **arguments):
    forget_places()
    return prepare_place(scene, **arguments)


def assert_same(first, second):
    assert arrays(first).keys() == arrays(second).keys()
    for name, value in arrays(first).items():
        np.testing.assert_array_equal(value, arrays(second)[name], err_msg=name)


@pytest.fixture(scope="module")
def alone():
    return prepared_afresh(scene())


def test_what_is_recovered_does_not_depend_on_the_objects(alone):
    moved = tuple(np.add(NEAR, (0.01, 0.0, 0.0)))
    for centers in ((NEAR,), (moved,), (NEAR, FAR)):
        assert_same(prepared_afresh(scene(*centers)), alone)
    assert alone.real.irradiance.any()


def test_what_is_recovered_depends_on_the_place_and_its_settings(alone):
    other_light = scene(rotation=(0.0, 0.0, 41.0))
    for other in (scene(seed=1), scene(irradiance_samples=18), other_light):
        assert not np.array_equal(prepared_afresh(other).real.irradiance, alone.real.irradiance)
    varied = prepared_afresh(scene(parameters=Parameters(recovery=RecoveryParameters(most_vertices=100))))
    assert varied.errors.vertices < 150 < alone.errors.vertices


def test_a_moved_object_finds_the_place_prepared():
    forget_places()
    first = scene(NEAR)
    prepared = prepare_place(first)
    assert prepare_place(replace(first, synthetic=scene(FAR).synthetic)) is prepared
    # The same content read again, as by a program that writes a scene file for every frame.
    assert prepare_place(scene(FAR)) is prepared
    assert prepare_place(scene(seed=1)) is not prepared


def test_a_picture_does_not_depend_on_what_was_rendered_in_the_place_before():
    def picture(*before):
        lightdepth.api.forget_prepared()
        for center in before:
            lightdepth.render(scene(center), "view", samples=1)
        return lightdepth.render(scene(NEAR), "view", samples=2)

    alone, after = picture(), picture(FAR)
    for name in ("plate", "change", "synthetic", "coverage", "variance"):
        np.testing.assert_array_equal(getattr(alone, name), getattr(after, name), err_msg=name)


def test_errors_are_those_where_the_objects_are():
    errors = prepared_afresh(scene()).errors
    left = errors.points[:, 0] < 0.0
    one_sided = replace(errors, error=np.where(left, 0.5 * errors.irradiance, 0.0))
    beside = [(np.array([-1.8, 0.0, 0.1]), 0.1)], [(np.array([2.3, 0.0, 0.1]), 0.1)]
    of_left, of_right = (one_sided.report(spheres).mean_error for spheres in beside)
    assert of_left > 0.4 > 0.1 > of_right
    share = errors.irradiance[left].sum() / errors.irradiance.sum()
    assert one_sided.report([]).mean_error == pytest.approx(0.5 * share)
    assert one_sided.report([]).largest_error == pytest.approx(0.5)


def test_a_picture_from_the_cache_is_the_picture_without(tmp_path, monkeypatch):
    def picture(folder):
        lightdepth.api.forget_prepared()
        monkeypatch.setenv("LIGHTDEPTH_CACHE", str(folder))
        return lightdepth.render(scene(NEAR), "view", samples=2)

    without, filling = picture("off"), picture(tmp_path / "cache")
    (entry,) = Store(tmp_path / "cache").entries()
    before = entry.path.read_bytes()
    found = picture(tmp_path / "cache")
    assert entry.path.read_bytes() == before
    for frame in (filling, found):
        assert frame.metadata == without.metadata
        for name in ("plate", "change", "synthetic", "coverage", "variance"):
            np.testing.assert_array_equal(getattr(frame, name), getattr(without, name), err_msg=name)


def test_the_cache_holds_what_glossy_surfaces_mirror(tmp_path):
    store, few = Store(tmp_path), RecoveryParameters(gloss_points=64, gloss_samples=16, mirrored_samples=4)
    glossy = scene(gloss=Gloss(0.3, 0.5), parameters=Parameters(recovery=few))
    first, second = (prepared_afresh(glossy, store=store) for _ in range(2))
    assert first.real.glosses == second.real.glosses
    assert first.real.glosses[0].albedo != Gloss(0.3, 0.5).albedo
    one, other = (np.array(known.place.photograph._mirrored.tensor()) for known in (first, second))
    assert one.any()
    np.testing.assert_array_equal(one, other)


def test_the_cache_gives_what_was_recovered_and_nothing_else(tmp_path, monkeypatch):
    store = Store(tmp_path)
    first = prepared_afresh(scene(), store=store)
    with monkeypatch.context() as patch:
        patch.setattr("lightdepth.preparation.place.recover_irradiance", None)  # Nothing is recovered a second time.
        second = prepared_afresh(scene(NEAR), store=store)
    assert_same(first, second)
    np.testing.assert_array_equal(first.errors.error, second.errors.error)
    (entry,) = store.entries()
    contents = entry.path.read_bytes()
    for damaged in (contents[:100], contents[:-1] + bytes([contents[-1] ^ 1])):
        entry.path.write_bytes(damaged)
        with pytest.warns(InputWarning, match=f"{entry.path}: damaged"):
            assert_same(first, prepared_afresh(scene(), store=store))
        assert entry.path.read_bytes() == contents

"""What `check` reports of the plate of an ordinary camera."""

from dataclasses import replace

import numpy as np
import pytest

from lightdepth.checks import Severity, inspect_scene
from lightdepth.checks.plate import gain_problems
from lightdepth.cli.check import _plate
from lightdepth.scene.model import Plate, Scene
from tests.film.test_plate import GAIN, VIEW, plate_of
from tests.place.virtual_room import CAPTURES, REAL, photograph


@pytest.fixture(scope="module")
def scene():
    return Scene(
        photograph(CAPTURES[0], 128), REAL, cameras={"photo": VIEW}, plate=Plate(plate_of(VIEW) * GAIN, "photo")
    )


def test_gain_and_coverage_are_reported(scene):
    found = inspect_scene(scene)
    assert found.plate.gain == pytest.approx(GAIN.tolist(), rel=0.005)
    assert not found.plate.given
    assert not any("plate" in problem.message or "camera.photo" in problem.message for problem in found.problems)
    said = _plate(found.plate)
    assert said.startswith("gain 0.5 0.4 0.31, solved; 100.0 % of it shows a real surface, ")
    assert f"{100 * found.plate.seen:.1f} % what a panorama sees too" in said


def test_a_gain_that_does_not_fit_is_warned_of(scene):
    given = replace(scene, plate=replace(scene.plate, gain=(1.0, 1.0, 1.0)))
    found = inspect_scene(given)
    (warning,) = [problem for problem in found.problems if "[plate]" in problem.message]
    assert warning.severity is Severity.WARNING
    assert "100 % of what it shares" in warning.message
    assert found.plate.given


def test_another_picture_is_an_error(scene):
    noise = np.random.default_rng(0).lognormal(0.0, 1.0, (9, 12, 1)).astype(np.float32)
    other = replace(scene.plate, radiance=scene.plate.radiance * np.kron(noise, np.ones((8, 8, 1), np.float32)))
    found = inspect_scene(replace(scene, plate=other))
    errors = [problem.message for problem in found.problems if problem.severity is Severity.ERROR]
    assert any("differs from the panoramas by" in message or "contrast is" in message for message in errors)
    assert found.plate is None


def test_gains_that_differ_from_frame_to_frame_flicker(scene):
    """A filmed plate one frame of which is 3 % brighter: a warning, with the gain that the others have."""
    reports = [inspect_scene(scene, hints=False).plate] * 2
    assert not gain_problems(reports)
    brighter = replace(scene, plate=replace(scene.plate, radiance=scene.plate.radiance * np.float32(1.03)))
    [problem] = gain_problems([*reports, inspect_scene(brighter, hints=False).plate])
    assert problem.severity is Severity.WARNING
    assert "by up to 3.0 %" in problem.message
    gain = [float(value) for value in problem.message.split("[")[2].split("]")[0].split(",")]
    assert gain == pytest.approx(reports[0].gain, rel=1e-3)
    held = replace(brighter, plate=replace(brighter.plate, gain=tuple(gain)))
    assert not gain_problems([*reports[:1], inspect_scene(held, hints=False).plate])

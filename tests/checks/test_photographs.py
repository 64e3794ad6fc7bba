"""What `check` reports of several photographs of one place."""

from dataclasses import replace

import numpy as np
import pytest

from lightdepth.checks import Severity, inspect_scene
from lightdepth.images.exr import ExrPart, write_exr
from lightdepth.reconstruction.scene_file import write_meshes
from lightdepth.scene.model import Scene
from tests.place.virtual_room import CAPTURES, REAL, photograph

PILLAR = 1.0 - np.array([1.5, 3.0]) / (4 * 1.5 + 2 * 0.36)
"""Share of its area that one capture, and both, cannot see: each sees one of its sides."""


@pytest.fixture(scope="module")
def first():
    return photograph(CAPTURES[0], 64)


@pytest.fixture(scope="module")
def second():
    return photograph(CAPTURES[1], 64, balanced=False)


def test_a_second_capture_sees_what_the_first_cannot(first, second):
    one, both = (inspect_scene(Scene(first, REAL, further=some)) for some in ((), (second,)))
    assert one.photographs == ()
    assert [found.coverage.unseen["pillar"] for found in (one, both)] == pytest.approx(PILLAR, abs=0.02)
    assert both.coverage.unseen["room"] < 0.5 * one.coverage.unseen["room"]
    message = next(problem.message for problem in both.problems if '"pillar"' in problem.message)
    assert f"no capture point sees {100.0 * both.coverage.unseen['pillar']:.2g} % of this support's area" in message
    _, report = both.photographs
    assert report.gain == pytest.approx((1.0, 1.0, 1.0), abs=0.01)
    assert not report.given
    assert report.disagrees < 0.01


def test_people_are_reported_with_their_place(first, second):
    spoilt = second.radiance.copy()
    spoilt[24:50, 12:30] *= 0.3
    found = inspect_scene(Scene(first, REAL, further=(replace(second, radiance=spoilt),)))
    (message,) = [
        p.message for p in found.problems if "differs by more than a quarter" in p.message and " 2: " in p.message
    ]
    assert "most of it around column" in message


@pytest.mark.parametrize(
    ("position", "message"),
    [((0.31, 0.0, 1.2), '10.0 mm from the surface of "pillar"'), ((9.0, 0.0, 1.2), "outside the room")],
)
def test_a_further_capture_point_that_is_wrong_is_named(first, second, position, message):
    found = inspect_scene(Scene(first, REAL, further=(replace(second, position=np.array(position)),)))
    errors = [problem.message for problem in found.problems if problem.severity is Severity.ERROR]
    assert any(error.startswith("[[panorama]] 2: position: ") and message in error for error in errors)


def test_the_command_prints_gains_and_what_none_sees(command, tmp_path, first, second):
    write_meshes(REAL, tmp_path)
    tables = []
    for name, panorama, factor in (("a", first, 1.0), ("b", second, 0.5)):
        pixels = panorama.radiance * np.float32(factor)
        write_exr(tmp_path / f"{name}.exr", [ExrPart({"RGB": pixels})])
        tables.append(f'[[panorama]]\nimage = "{name}.exr"\nposition = {panorama.position.tolist()}\n')
    tables += [f'[[real]]\nname = "{each.name}"\nmesh = "{each.name}.ply"\nrole = "support"\n' for each in REAL]
    (tmp_path / "scene.toml").write_text("\n".join(tables))
    status, output, _ = command("check", tmp_path / "scene.toml")
    assert status == 0
    assert "seen by no panorama, of each surface's area: room " in output
    assert "panorama 1: as given; " in output
    assert "panorama 2: gain 2 2 2, solved; " in output

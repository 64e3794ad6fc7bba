"""The button that checks the modelled place."""

import numpy as np
import pytest


def _solid_angle(a: float, b: float, height: float) -> float:
    """Of a rectangle of sides a and b whose corner is at some height over the eye (textbook formula)."""
    return np.arctan2(a * b, height * np.sqrt(a * a + b * b + height * height))


def test_an_open_ceiling_is_measured_and_shown_in_red(blender, tmp_path):
    found = blender.run("holes", tmp_path)
    # The room reaches 2 m to three sides of the capture point and 3 m to the fourth; its edge is 0.9 m higher.
    hole = 2 * (_solid_angle(2.0, 2.0, 0.9) + _solid_angle(2.0, 3.0, 0.9))
    assert found["coverage"] == pytest.approx(1.0 - hole / (4 * np.pi), abs=0.003)
    assert any("no real surface" in note for note in found["notes"])

    # The patches cover the same directions, and no other.
    cells = np.array(found["cells"])
    middle = cells.mean(axis=1)
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    heading = middle / np.maximum(middle[:, 2:], 1e-6) * 0.9
    assert np.all(middle[:, 2] > 0.0)
    assert np.all(heading[:, :2] > np.array([-2.0, -2.0]) - 0.2)
    assert np.all(heading[:, :2] < np.array([2.0, 3.0]) + 0.2)
    up = np.cross(cells[:, 1] - cells[:, 0], cells[:, 3] - cells[:, 0])
    other = np.cross(cells[:, 3] - cells[:, 2], cells[:, 1] - cells[:, 2])
    area = 0.5 * (np.linalg.norm(up, axis=1) + np.linalg.norm(other, axis=1)).sum()
    assert area == pytest.approx(hole, rel=0.03)
    assert found["around"] == pytest.approx([0.0, 0.0, 1.6])
    for red, green, blue, _ in found["colours"]:
        assert red > 0.8
        assert max(green, blue) < 0.1
    assert not found["rendered"]
    assert found["closed"] == [pytest.approx(1.0), False]

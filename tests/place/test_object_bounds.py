"""Directions toward the objects: what is near is aimed at alone, what looks small with what is around it."""

import numpy as np
import pytest

from lightdepth.kernel.start import start

start("cpu")

import drjit as dr  # noqa: E402
import mitsuba as mi  # noqa: E402

from lightdepth.place.object_bounds import ObjectBounds  # noqa: E402

RADIUS, CENTRE = 0.4, np.array([0.3, 1.2, 0.4])


@pytest.mark.parametrize(("radii_away", "wanted"), [(2.0, 1.0), (39.0, 1.0), (100.0, 2.5), (1000.0, 6.0)])
def test_cones_have_the_size_and_the_density_that_they_say(radii_away, wanted):
    point = CENTRE + radii_away * RADIUS * np.array([0.6, 0.0, 0.8])
    cones = ObjectBounds([(CENTRE, RADIUS)]).cones(mi.Point3f(*([each] for each in point.tolist())))
    sine = wanted / radii_away
    solid_angle = 2.0 * np.pi * sine**2 / (1.0 + np.sqrt(1.0 - sine**2))
    assert cones.solid_angle.numpy()[0] == pytest.approx(solid_angle, rel=1e-3)
    u, count = (np.arange(4096) + 0.5) / 4096, 4096
    v = np.mod(np.arange(count) * 0.6180339887, 1.0)
    direction = cones.sample(mi.Float(np.float32(u)), mi.Point2f(np.float32(u), np.float32(v)))
    np.testing.assert_allclose(cones.pdf(direction).numpy(), 1.0 / solid_angle, rtol=1e-3)
    toward = (CENTRE - point) / np.linalg.norm(CENTRE - point)
    off = np.linalg.norm(np.cross(direction.numpy().T, toward), axis=1)
    assert off.max() == pytest.approx(sine, rel=1e-2)
    # Beside them nothing is drawn.
    beside = dr.normalize(mi.Vector3f(toward.tolist()) + 1.05 * np.tan(np.arcsin(sine)) * mi.Vector3f(0.8, 0.0, -0.6))
    assert cones.pdf(beside).numpy()[0] == 0.0

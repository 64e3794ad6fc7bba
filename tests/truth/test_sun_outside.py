"""The rooms whose sun the capture point does not see."""

import numpy as np
import pytest
from bench.places import PLACES
from bench.truth import truth

from lightdepth.kernel.raycasting import RayCaster

ROOMS = ("sunlit_room", "barred_windows")


@pytest.mark.parametrize("name", ROOMS)
def test_the_capture_point_does_not_see_the_sun(name):
    place = PLACES[name]()
    toward = np.array(place.sun().direction)[None]
    walls = RayCaster([part.mesh for part in place.parts if not part.opening])
    assert np.isfinite(walls.cast(np.array(place.position), toward).distance).all()


@pytest.mark.parametrize("name", ROOMS)
def test_the_sun_reaches_the_first_object_and_not_the_last(name):
    place = PLACES[name]()
    toward = np.array(place.sun().direction) / np.linalg.norm(place.sun().direction)
    walls = RayCaster([part.mesh for part in place.parts if not part.opening])
    centers = np.array([thing.parts[0].geometry.to_world[:3, 3] for thing in (place.objects[0], place.objects[2])])
    hits = walls.cast(centers, np.broadcast_to(toward, (2, 3)))
    assert np.isinf(hits.distance[0])
    assert np.isfinite(hits.distance[1])


def test_lights_apart_add_up_to_what_the_patch_shows(tmp_path, monkeypatch):
    monkeypatch.setattr("bench.truth.CACHE", tmp_path)
    place = PLACES["sunlit_room"]()
    sun, floor = place.sun(), np.array(place.parts[0].color)
    indoors, sunlit = (truth(part, "panorama", 64, 256, objects=False) for part in place.lights_apart())
    both = truth(place, "panorama", 64, 256, objects=False)
    np.testing.assert_allclose(both.mean, indoors.mean + sunlit.mean)
    # In the patch's middle the sun alone gives rho E cos / pi; what walls send back to it adds a few percent.
    brightest = np.median(np.sort(sunlit.mean.reshape(-1, 3), axis=0)[-40:], axis=0)
    direct = floor * np.array(sun.irradiance) * sun.direction[2] / np.linalg.norm(sun.direction) / np.pi
    assert np.all(brightest > direct)
    assert np.all(brightest < 1.1 * direct)

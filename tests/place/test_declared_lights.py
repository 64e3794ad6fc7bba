"""A new kind of declared light is a class and a line where the kinds are listed: integrators and recovery do not change."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from lightdepth.kernel.start import start

start("cpu")

import drjit as dr  # noqa: E402
import mitsuba as mi  # noqa: E402

from lightdepth.kernel.tracing import meets  # noqa: E402
from lightdepth.place import declared_lights  # noqa: E402
from lightdepth.place.light_list import LightSample  # noqa: E402
from lightdepth.place.place import Place  # noqa: E402
from lightdepth.place.real_light import DeclaredLight  # noqa: E402
from lightdepth.place.real_surfaces import merge_real_surfaces  # noqa: E402
from lightdepth.place.traced_surfaces import TracedSurfaces  # noqa: E402
from lightdepth.recovery.irradiance import estimate_irradiance  # noqa: E402
from lightdepth.scene.materials import Diffuse  # noqa: E402
from lightdepth.scene.model import Light, Panorama  # noqa: E402
from tests.place.test_sun import CAPTURE, HEIGHT, SUN, black_room  # noqa: E402
from tests.transport.places import ball, picture  # noqa: E402

RADIUS, RADIANCE = 0.3, np.array([30.0, 20.0, 10.0])
CENTER = np.array([0.5, 0.0, HEIGHT])


@dataclass(frozen=True)
class DownlightLight(Light):
    """A disc in the ceiling, which shines down."""

    center: NDArray[np.float64]
    radius: float
    radiance: NDArray[np.float64]


class Downlight(DeclaredLight):
    def __init__(self, settings, surfaces, _parameters):
        self.settings, self.surfaces = settings, surfaces
        self.density = 1.0 / (np.pi * settings.radius**2)

    def with_surfaces(self, surfaces):
        return Downlight(self.settings, surfaces, None)

    def sample(self, u, v):
        radius, (sine, cosine) = self.settings.radius * dr.sqrt(u), dr.sincos(dr.two_pi * v)
        position = mi.Vector3f(*self.settings.center.tolist()) + mi.Vector3f(radius * cosine, radius * sine, 0.0)
        below = mi.Vector3f(0.0, 0.0, -1.0)
        radiance = mi.Color3f(*self.settings.radiance.tolist())
        return LightSample(
            position, below, mi.Float(self.density), radiance, mi.Bool(True), mi.Bool(False), mi.UInt32(0)
        )

    def arriving(self, ray, hit, distance, active, kept=False):
        offset = mi.Vector3f(hit.point) - mi.Vector3f(*self.settings.center.tolist())
        within = active & hit.valid & (dr.norm(offset) < self.settings.radius) & (ray.d.z > 0.0)
        pdf = self.density * dr.square(distance) / dr.maximum(ray.d.z, 1e-6)
        radiance = mi.Color3f(*self.settings.radiance.tolist())
        return dr.select(within, radiance, 0.0), dr.select(within, pdf, 0.0), mi.Bool(True)

    def blocked(self, ray, active, kept=False):
        return meets(self.surfaces.kept if kept else self.surfaces.real, ray, active)


@pytest.fixture(scope="module", autouse=True)
def kind():
    declared_lights.KINDS[DownlightLight] = Downlight
    yield
    del declared_lights.KINDS[DownlightLight]


LAMP = DownlightLight("lamp", CENTER, RADIUS, RADIANCE)


def irradiance_below(height):
    """Of a level surface on the disc's axis."""
    return np.pi * RADIANCE * RADIUS**2 / (RADIUS**2 + height**2)


@pytest.mark.parametrize("lights", [(LAMP,), (SUN, LAMP)], ids=["alone", "beside a sun"])
def test_recovery_finds_its_irradiance(lights):
    scene = black_room(suns=lights)
    place = Place(scene.panorama, TracedSurfaces(merge_real_surfaces(scene.real)), declared=lights)
    points = np.array([[CENTER[0], CENTER[1], 0.0]], np.float32)
    up = np.array([[0.0, 0.0, 1.0]], np.float32)
    found, _ = estimate_irradiance(place, points, up, np.random.default_rng(1), 1024)
    sun = SUN.irradiance * SUN.direction[2] if SUN in lights else 0.0
    np.testing.assert_allclose(found[0], irradiance_below(HEIGHT) + sun, rtol=5e-3)


def test_an_object_is_lit_by_it_and_shades_the_floor():
    """A matte ball on the axis: its top, and its umbra on the floor; the photograph is even."""
    shown, radius, middle = 0.05, 0.2, 0.6
    thing = ball(Diffuse(type="diffuse", color=(0.5, 0.5, 0.5)), (*CENTER[:2], middle), radius)
    even = Panorama(np.full((64, 128, 3), shown, np.float32), CAPTURE, np.eye(3), sky=True)
    frame = picture(replace(black_room([thing], suns=(LAMP,)), panorama=even), "view", 64, 1)
    brightest = np.percentile(frame.synthetic[frame.coverage > 0.99], 98, axis=0)
    top = irradiance_below(HEIGHT - middle - radius) + np.pi * shown
    np.testing.assert_allclose(brightest, 0.5 / np.pi * top, rtol=0.05)
    floor, around = irradiance_below(HEIGHT), np.pi * shown
    lost = shown * (floor + (radius / middle) ** 2 * around) / (floor + around)
    darkest = np.percentile(frame.change[(frame.coverage == 0.0) & (frame.samples > 0)], 1, axis=0)
    np.testing.assert_allclose(darkest, -lost, rtol=0.05)

"""The photograph of an ordinary camera as the picture: its gain, its own pixels, and the change on it."""

from dataclasses import replace

import numpy as np
import pytest

import lightdepth
from lightdepth.cameras import Perspective
from lightdepth.directions import look_at_rotation
from lightdepth.errors import InputError
from lightdepth.film.frame import Frame
from lightdepth.film.layers import write_frame
from lightdepth.images.radiance import read_radiance
from lightdepth.kernel.raycasting import RayCaster
from lightdepth.kernel.start import start
from lightdepth.scene.materials import Diffuse
from lightdepth.scene.model import CameraView, Plate, RenderSettings, Role, Scene
from tests.place.virtual_room import CAPTURES, REAL, photograph, radiance
from tests.support.picture_file import undocumented
from tests.transport.places import ball

start("cpu")

import drjit as dr  # noqa: E402 - where LLVM is was settled by start()

from lightdepth.preparation.place import prepare_place  # noqa: E402
from lightdepth.recovery.plate_gain import solve_plate_gain  # noqa: E402

GAIN = np.float32([0.5, 0.4, 0.31])
WIDTH, HEIGHT = 96, 72
POSITION = np.array([-0.4, 1.2, 1.4])
VIEW = CameraView(
    Perspective(type="perspective", width=WIDTH, height=HEIGHT, fov=75, distortion=(-0.16, 0.03)),
    POSITION,
    look_at_rotation(POSITION, (-1.0, -0.7, 0.2)),
)


def plate_of(view: CameraView) -> np.ndarray:
    """What the camera sees at its pixels' centres, in the unit of the panorama."""
    width, height = view.resolution
    column, row = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    film = np.stack([column, row], axis=-1).reshape(-1, 2)
    direction = view.camera.directions_of(film) @ view.rotation.T
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    distance = RayCaster([surface.mesh for surface in REAL]).cast(view.position, direction).distance
    return radiance(view.position + distance[:, None] * direction).reshape(height, width, 3).astype(np.float32)


@pytest.fixture(scope="module")
def scene() -> Scene:
    thing = ball(Diffuse(type="diffuse", color=(0.5, 0.5, 0.5)), (-1.0, -0.7, 0.3), 0.3)
    settings = RenderSettings(irradiance_samples=32, max_bounces=3)
    room, pillar = REAL
    return Scene(
        photograph(CAPTURES[0], 128),
        (room, replace(pillar, role=Role.ENVIRONMENT)),
        (thing,),
        {"photo": VIEW},
        settings,
        plate=Plate(plate_of(VIEW) * GAIN, "photo"),
    )


@pytest.fixture(scope="module")
def frame(scene: Scene) -> Frame:
    return lightdepth.render(scene, camera="photo", samples=16)


def test_gain_is_solved_from_what_both_see(scene: Scene) -> None:
    place = prepare_place(scene).place
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        balance = solve_plate_gain(scene.plate.radiance, VIEW, place)
        programs = {kernel["hash"] for kernel in dr.kernel_history() if kernel.get("operation_count", 0) > 100}
        dr.kernel_history_clear()
    assert balance.problem is None
    np.testing.assert_allclose(balance.gain, GAIN, rtol=0.005)
    assert balance.deviation < 0.02
    assert balance.modelled == 1.0
    assert 0.7 < balance.seen < 1.0  # The pillar hides some of the room from the panorama.
    assert len(programs) == 1  # A second takes long to compile: one for all points of a block.


def test_untouched_pixels_are_those_of_the_plate(scene: Scene, frame: Frame, tmp_path) -> None:
    write_frame(tmp_path / "x.exr", frame)
    assert undocumented(tmp_path / "x.exr") == set()
    touched = np.stack([frame.touched(row) for row in range(HEIGHT)])
    assert (~touched).mean() > 0.05
    np.testing.assert_array_equal(read_radiance(tmp_path / "x.exr")[~touched], scene.plate.radiance[~touched])


def test_what_is_new_has_the_plates_exposure(scene: Scene, frame: Frame) -> None:
    """Where the plate shows no more than the panorama does, all is as without it, but for the gain."""
    without = lightdepth.render(replace(scene, plate=None), camera="photo", samples=16)
    brighter = float(frame.metadata["exposure"]) - float(without.metadata["exposure"])
    assert brighter == pytest.approx(-np.log2(GAIN.mean()), abs=0.02)
    for layer in ("change", "synthetic"):
        own, other = (getattr(each, layer).sum(axis=(0, 1)) for each in (frame, without))
        np.testing.assert_allclose(own / other, GAIN, rtol=0.01)


def test_a_shadow_is_a_factor_on_what_the_plate_shows(scene: Scene, frame: Frame) -> None:
    """Also on a texture that the panorama does not resolve: eq. (17)."""
    checks = np.where((np.indices((HEIGHT, WIDTH)).sum(axis=0) % 2)[..., None], 0.75, 1.25).astype(np.float32)
    gain = tuple(map(float, GAIN))
    textured = replace(scene, plate=replace(scene.plate, radiance=scene.plate.radiance * checks, gain=gain))
    other = lightdepth.render(textured, camera="photo", samples=16)
    shadowed = (frame.change < -0.1 * frame.plate).all(axis=2) & (frame.coverage == 0.0)
    assert shadowed.mean() > 0.01
    # Green alone: this room's red and blue are brighter than its light allows, and an albedo is at most 1.
    factors = [(each.change / each.plate)[..., 1] for each in (other, frame)]
    for dark_or_bright in (0, 1):  # They are a factor of 0.6 apart.
        here = shadowed & (np.indices((HEIGHT, WIDTH)).sum(axis=0) % 2 == dark_or_bright)
        np.testing.assert_allclose(np.median(factors[0][here] / factors[1][here]), 1.0, rtol=0.01)


@pytest.mark.parametrize(
    ("spoilt", "message"),
    [
        (lambda plate: plate**0.45, r"contrast is 0\.\d+ times that of the panoramas.*not linear"),
        (
            lambda plate: plate * np.linspace(0.2, 2.0, WIDTH, dtype=np.float32)[:, None],
            r"differs from the panoramas by \d+ %",
        ),
    ],
)
def test_more_than_a_gain_is_refused(scene: Scene, spoilt, message: str) -> None:
    wrong = replace(scene, plate=replace(scene.plate, radiance=spoilt(scene.plate.radiance)))
    with pytest.raises(InputError, match=rf"\[plate\]: .*{message}"):
        lightdepth.render(wrong, camera="photo", samples=1)


def test_the_method_of_the_paper_refuses_it(scene: Scene) -> None:
    with pytest.raises(InputError, match=r"'envpath' cannot use a \[plate\]"):
        lightdepth.render(scene, camera="photo", samples=1, method="envpath")

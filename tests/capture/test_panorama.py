import numpy as np

from lightdepth.capture.lens import Lens
from lightdepth.capture.panorama import blend, natural_width
from lightdepth.capture.photometry import Photograph, estimate_photometry
from lightdepth.capture.rig import PRESETS
from lightdepth.directions import pixel_directions
from lightdepth.images.filling import fill, mark
from lightdepth.parameters import CaptureParameters
from tests.support.photography import PAPER_RIG, TestCamera, look_up, rig_rotation, sensor_radiance


def photographs(place, factors=(1.0,) * 7, vignetting=(0.3, 0.1)):
    camera = TestCamera(size=(240, 240), fov=185, vignetting=vignetting)
    seen = (camera.rays(1)[1] < 0.99).astype(np.float32)
    return [
        Photograph(
            sensor_radiance(place, rig_rotation(yaw, pitch), camera) * np.float32(factor),
            seen,
            Lens(240, 240, "fisheye", 185, yaw=yaw, pitch=pitch),
        )
        for (yaw, pitch), factor in zip(PAPER_RIG, factors, strict=True)
    ]


def test_preset_is_the_papers_rig():
    assert [pose[:2] for pose in PRESETS["paper"]] == PAPER_RIG


def test_vignetting_and_gains_are_found_from_overlaps(place):
    factors = np.array([1.0, 1.2, 0.9, 1.0, 1.1, 0.95, 1.0])
    shots = photographs(place, factors)
    photometry = estimate_photometry(shots)
    radius = np.array([0.3, 0.6, 0.9])
    np.testing.assert_allclose(
        photometry.falloff(radius * np.sqrt(0.5)), 1 - 0.3 * radius**2 - 0.1 * radius**4, atol=0.01
    )
    product = photometry.gains.mean(axis=1) * factors
    np.testing.assert_allclose(product / product.mean(), 1, atol=0.01)
    assert photometry.disagreement < 0.02 < photometry.disagreement_before
    held = CaptureParameters(photometry_prior=1e3, photometry_directions=10_000)
    np.testing.assert_allclose(estimate_photometry(shots, tuned=held).gains, 1, atol=0.01)


def test_known_poses_give_the_panorama_back(place):
    shots = photographs(place)
    assert natural_width([shot.lens for shot in shots]) == 448
    panorama = blend(shots, estimate_photometry(shots), 448)
    truth = look_up(place, pixel_directions(224, 448))
    assert panorama.covered.all()
    error = np.abs(np.log(np.maximum(panorama.radiance, 1e-9) / truth))
    assert np.median(error) < 0.02
    assert abs(np.median(np.log(panorama.radiance / truth))) < 0.01


def test_uncovered_directions_are_filled_smoothly():
    """The logarithm of radiance is linear in z here, which is harmonic nowhere but nearly so over a small cap."""
    directions = pixel_directions(128, 256)
    truth = np.exp(1.5 * directions[..., :1] + 0.5 * directions[..., 1:2]) * np.array([1.0, 0.7, 0.4])
    covered = directions[..., 2] > -np.cos(np.radians(20))
    filled = fill(np.where(covered[..., None], truth, 0).astype(np.float32), covered)
    np.testing.assert_array_equal(filled[covered], truth.astype(np.float32)[covered])
    assert np.abs(np.log(filled / truth)).max() < 0.06
    # The gap may as well lie across the seam at the back.
    behind = np.abs(directions[..., 1] + 1) > 0.05
    assert np.abs(np.log(fill(truth.astype(np.float32) * behind[..., None], behind) / truth)).max() < 0.1


def test_uncovered_directions_are_marked():
    radiance = np.full((4, 8, 3), 0.5, np.float32)
    covered = np.ones((4, 8), bool)
    covered[3] = False
    marked = mark(radiance, covered)
    np.testing.assert_array_equal(marked[:3], 0.5)
    np.testing.assert_array_equal(marked[3], np.tile([1.0, 0.0, 1.0], (8, 1)))

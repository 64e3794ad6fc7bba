"""Bad panoramas are recognised, located and repaired; real ones pass."""

from pathlib import Path

import numpy as np
import pytest

from lightdepth.directions import latlong_to_direction
from lightdepth.errors import InputError
from lightdepth.images.radiance import read_radiance
from lightdepth.images.validation import clipped_plateau, find_defects, validate_panorama
from lightdepth.parameters import ChecksParameters

FILE = Path("room.exr")


def panorama(height=64):
    return np.random.default_rng(5).uniform(0.2, 5.0, (height, 2 * height, 3)).astype(np.float32)


def test_a_good_panorama_is_returned_as_it_is():
    radiance = panorama()
    radiance[3, 4], radiance[5] = 1e5, 0.0
    assert validate_panorama(radiance, FILE) is radiance
    assert validate_panorama(radiance, FILE, repair=True) is radiance
    assert find_defects(radiance) == []


REAL = """lebombo_1k.hdr interior_hotelroom_1k.exr vestibule_1k.hdr comfy_cafe_1k.hdr thatch_chapel_1k.hdr
    noon_grass_1k.hdr rooitou_park_1k.hdr modern_buildings_2_1k.hdr"""


@pytest.mark.parametrize("name", REAL.split())
def test_real_panoramas_pass(shared_data, name):
    radiance = read_radiance(shared_data / "hdr" / name)
    valid = validate_panorama(radiance, Path(name))
    assert valid.min() >= 0
    np.testing.assert_array_equal(valid, np.maximum(radiance, 0))
    assert clipped_plateau(valid) is None


def test_negligible_negative_radiance_becomes_black_and_is_reported():
    radiance = panorama()
    radiance[10, 20, 1] = -1e-4
    (defect,) = find_defects(radiance)
    assert defect.negligible
    assert validate_panorama(radiance, FILE)[10, 20, 1] == 0
    assert radiance[10, 20, 1] == np.float32(-1e-4)
    radiance[10, 20, 1] = -0.1
    with pytest.raises(InputError, match="1 pixel has negative"):
        validate_panorama(radiance, FILE)


def test_defects_are_counted_and_located():
    radiance = panorama()
    radiance[7, 100, 1], radiance[9, 3] = np.nan, np.nan
    radiance[20, 30, 0], radiance[0, 1, 2] = np.inf, -np.inf
    radiance[40:42, 60:70] = -1.0
    nan, infinite, negative = find_defects(radiance)
    assert (nan.kind, nan.count, nan.row, nan.column) == ("NaN", 2, 7, 100)
    assert (infinite.kind, infinite.count, infinite.row, infinite.column) == ("infinite", 2, 0, 1)
    assert (negative.kind, negative.count, negative.row, negative.column) == ("negative", 20, 40, 60)
    assert negative.share == 20 / 8192
    np.testing.assert_allclose(nan.direction, latlong_to_direction(100.5 / 128, 7.5 / 64))
    with pytest.raises(InputError) as caught:
        validate_panorama(radiance, FILE)
    message = str(caught.value)
    assert message.startswith("room.exr: 2 pixels have NaN radiance (0.0244 % of all), the first at row 7, column 100")
    assert "2 pixels have infinite" in message
    assert "20 pixels have negative" in message
    assert "--repair" in message


def test_repair_replaces_by_neighbours_largest_and_black():
    radiance = panorama()
    radiance[:, :, 1] = 3.0
    radiance[0, 0], radiance[30, 40, 0], radiance[50, 60, 2] = np.nan, np.inf, -2.0
    repaired = validate_panorama(radiance, FILE, repair=True)
    assert repaired[0, 0, 1] == 3.0
    assert 0.2 <= repaired[0, 0, 0] <= 5.0
    assert repaired[30, 40, 0] == radiance[:, :, 0][np.isfinite(radiance[:, :, 0])].max()
    assert repaired[50, 60, 2] == 0.0
    good = np.isfinite(radiance) & (radiance >= 0)
    np.testing.assert_array_equal(repaired[good], radiance[good])
    assert np.isnan(radiance[0, 0]).all()
    hopeless = np.full((8, 16, 3), np.nan, np.float32)
    assert (validate_panorama(hopeless, FILE, repair=True) == 0).all()


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        ((64, 64, 3), "is 64 x 64 pixels; a panorama must be twice as wide as high .* such as 128 x 64"),
        ((2, 4, 3), "at least 8 pixels wide"),
        ((8, 16), r"shape \(height, width, 3\) is needed, got \(8, 16\)"),
    ],
)
@pytest.mark.parametrize("repair", [False, True])
def test_a_wrong_shape_is_refused(shape, message, repair):
    with pytest.raises(InputError, match=message):
        validate_panorama(np.ones(shape, np.float32), FILE, repair)


def test_a_clipped_panorama_is_recognised(shared_data):
    radiance = read_radiance(shared_data / "hdr" / "lebombo_1k.hdr")
    plateau = clipped_plateau(np.minimum(radiance, 8.0))
    assert plateau.value == 8.0
    flat = radiance.max(axis=2) >= 8.0 * 0.995
    assert plateau.count == flat.sum() > 3000
    weight = np.sin(np.pi * (np.arange(512) + 0.5) / 512)
    assert plateau.share == pytest.approx(flat.sum(axis=1) @ weight / (weight.sum() * 1024), rel=1e-4)


def test_what_counts_as_clipped_goes_by_the_parameters():
    radiance = panorama()
    radiance[3, 4:12] = 100.0
    assert clipped_plateau(radiance) is None
    assert clipped_plateau(radiance, ChecksParameters(plateau_pixels=8)).count == 8


def test_half_floats_that_overflowed_are_recognised():
    radiance = panorama()
    radiance[3, 4:6] = 65504.0
    assert clipped_plateau(radiance).count == 2
    assert clipped_plateau(np.zeros((8, 16, 3), np.float32)) is None

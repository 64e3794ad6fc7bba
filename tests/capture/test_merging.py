import cv2
import numpy as np
import pytest

from lightdepth.capture.exposure import read_exposures
from lightdepth.capture.fisheye import Circle, find_circle, parse_circle
from lightdepth.capture.merging import merge, shared_response
from lightdepth.capture.photograph import read_photograph
from lightdepth.capture.response import linear_response, normalised, srgb_response
from lightdepth.errors import InputError
from lightdepth.parameters import CaptureParameters
from tests.support.dng import write_dng
from tests.support.photography import TestCamera, film_curve, photograph, sensor_radiance, write_photograph


def relative_error(radiance, truth, where):
    """Errors of the logarithm, one free scale for each channel (the camera's own)."""
    error = np.log(np.maximum(radiance[where], 1e-12) / truth[where])
    return error - np.median(error, axis=0)


def test_radiance_over_five_orders_of_magnitude(bracket):
    response, source = shared_response([bracket.pairs])
    assert source == "recovered from the bracket"
    merged = merge(bracket.pairs, response)
    assert merged.radiance.shape == (320, 320, 3)
    inside = Circle(160, 160, 158).inside(320, 320)
    light = bracket.light.mean(axis=2)
    for low in (1e-3, 1e-2, 1e-1, 1e1, 1e2):
        error = relative_error(merged.radiance, bracket.light, inside & (light > 1e-3))
        band = (light[inside & (light > 1e-3)] > low) & (light[inside & (light > 1e-3)] < 10 * low)
        assert band.sum() > 50
        assert np.median(np.abs(error[band])) < 0.05, low


def test_clipped_pixels_are_counted(bracket):
    long = merge(bracket.pairs[:4], srgb_response())
    inside = Circle(160, 160, 155).inside(320, 320)
    lamps = (bracket.light.max(axis=2) * bracket.pairs[3][1].amount > 1.05) & inside
    assert long.clipped[lamps].all()
    assert long.clipped[inside].mean() == pytest.approx(lamps[inside].mean(), rel=0.1)
    assert not merge(bracket.pairs, srgb_response()).clipped.any()


def test_black_and_clipped_in_every_exposure_exactly(tmp_path):
    """Columns: black in all, seen by the long one only, seen by both, by the short one only, clipped in all."""
    table = tmp_path / "t.csv"
    table.write_text("file,time\nlong.png,4\nshort.png,1\n")
    codes = {"long.png": [0, 20000, 40000, 65535, 65535], "short.png": [0, 100, 10000, 40000, 65535]}
    for name, row in codes.items():
        cv2.imwrite(str(tmp_path / name), np.tile(np.array(row, np.uint16)[None, :, None], (3, 1, 3)))
    files = [tmp_path / name for name in codes]
    merged = merge(list(zip(files, read_exposures(files, table), strict=True)), linear_response())
    np.testing.assert_array_equal(merged.black, np.tile([True, False, False, False, False], (3, 1)))
    np.testing.assert_array_equal(merged.clipped, np.tile([False, False, False, False, True], (3, 1)))
    expected = np.array([0, 5000, 10000, 40000, 65535]) / 65535
    np.testing.assert_allclose(merged.radiance[0, :, 1], expected, rtol=1e-3, atol=1e-5)


def test_noise_of_short_exposures_does_not_shine_in_the_dark(bracket):
    merged = merge(bracket.pairs, shared_response([bracket.pairs])[0])
    inside = Circle(160, 160, 155).inside(320, 320)
    dark = inside & (bracket.light.max(axis=2) < 2e-3)
    scale = np.median(merged.radiance[inside] / bracket.light[inside])
    assert dark.sum() > 100
    assert merged.radiance[dark].max() / scale < 0.01


def test_circle_is_found_and_cropped_to(bracket):
    response = shared_response([bracket.pairs])[0]
    merged = merge(bracket.pairs, response, circle="auto")
    circle = merged.circle
    assert abs(circle.x - 160) < 1.5
    assert abs(circle.y - 160) < 1.5
    assert abs(circle.radius - 160) < 2
    assert merged.seen.sum() == pytest.approx(np.pi * circle.radius**2, rel=0.01)
    assert not merged.radiance[~merged.seen].any()


def test_circle_of_a_real_lens(shared_data):
    """Stray light surrounds the circle in the long exposures; the file that comes with them says 2825, 1864, 1806."""
    files = sorted((shared_data / "brackets/fisheye_office").glob("*.JPG"))[6:10]
    circle = find_circle(cv2.imread(str(file), cv2.IMREAD_REDUCED_COLOR_4) for file in files)
    assert abs(4 * circle.x - 2825) < 20
    assert abs(4 * circle.y - 1864) < 20
    assert abs(4 * circle.radius - 1806) < 30


def test_circle_given_or_absent():
    assert parse_circle("10, 20,5.5") == Circle(10, 20, 5.5)
    for text in ("1,2", "a,b,c", "1,2,0"):
        with pytest.raises(InputError, match="--circle"):
            parse_circle(text)
    with pytest.raises(InputError, match="no fisheye circle"):
        find_circle([np.random.default_rng(0).integers(0, 255, (100, 100, 3)).astype(np.uint8)])


@pytest.fixture(scope="module")
def view(place):
    camera = TestCamera(size=(480, 360), fov=75, mapping="rectilinear", vignetting=(0, 0))
    return camera, sensor_radiance(place, np.eye(3), camera)


def expose(light, times, camera, folder, change=lambda light, index: light):
    rng = np.random.default_rng(4)
    files = []
    for index, time in enumerate(times):
        files.append(folder / f"{index}.jpg")
        write_photograph(files[-1], photograph(change(light, index), time, camera, rng), time, index, aperture=1.0)
    return list(zip(files, read_exposures(files), strict=True))


def true_response():
    levels = np.linspace(0, 1, 20001)
    curve = np.interp(np.arange(256) / 255, film_curve(levels), levels)
    return normalised(np.tile(curve, (3, 1)))


MOVES = [(0, 0, 0), (7, -4, 0.4), (-5, 9, -0.3), (3, 3, 0.2), (-8, 2, 0.5)]


def test_hand_held_bracket_is_aligned(view, tmp_path):
    camera, light = view

    def shake(light, index):
        dx, dy, degrees = MOVES[index]
        matrix = cv2.getRotationMatrix2D((240, 180), degrees, 1.0)
        matrix[:, 2] += dx, dy
        return cv2.warpAffine(light, matrix, (480, 360), borderMode=cv2.BORDER_REFLECT)

    response = true_response()
    still = merge(expose(light, [64, 16, 4, 1, 0.25], camera, tmp_path), response)
    pairs = expose(light, [64, 16, 4, 1, 0.25], camera, tmp_path, shake)
    # The middle exposure, number 2, decides where the result lies.
    truth = shake(light, 2)
    middle = np.s_[40:-40, 40:-40]
    errors = []
    for align in (False, True):
        merged = merge(pairs, response, align=align)
        where = np.zeros(truth.shape[:2], bool)
        where[middle] = True
        errors.append(np.median(np.abs(relative_error(merged.radiance, truth, where))))
    noise = np.median(np.abs(relative_error(still.radiance, light, where)))
    assert errors[0] > 0.05
    print(f"median error {errors[0]:.1%} as shot, {errors[1]:.1%} aligned, {noise:.1%} from a tripod")
    assert errors[1] < noise + 0.02


def test_what_moved_is_left_out(view, tmp_path):
    camera, light = view

    def walker(light, index):
        changed = light.copy()
        changed[100:260, 40 + 90 * index : 110 + 90 * index] = 0.002
        return changed

    times = [64, 16, 4, 1, 0.25]
    response = true_response()
    pairs = expose(light, times, camera, tmp_path, walker)
    plain, deghosted = merge(pairs, response), merge(pairs, response, deghost=True)
    assert deghosted.ghosts > 0.05
    assert merge(pairs, response, deghost=True, tuned=CaptureParameters(merge_ghost=1.0)).ghosts == 0.0
    # The middle exposure's walker stays; every other one's place shows what is behind it.
    scale = np.median(deghosted.radiance / walker(light, 2))
    for index in (0, 1, 3, 4):
        box = np.s_[110:250, 50 + 90 * index : 100 + 90 * index]
        errors = [
            abs(np.log(np.maximum(image.radiance[box], 1e-9) / scale / light[box])) for image in (plain, deghosted)
        ]
        assert np.median(errors[1]) < 0.08, index
    box = np.s_[110:250, 50:100]
    assert np.median(np.abs(np.log(plain.radiance[box] / scale / light[box]))) > 0.3


def test_sixteen_bit_and_lossless_files(tmp_path):
    ramp = np.tile(np.linspace(0.05, 0.9, 64)[None, :, None], (16, 1, 3))
    table = tmp_path / "t.csv"
    table.write_text("file,time\na.png,1\nb.tif,0.5\n")
    for name, time in (("a.png", 1.0), ("b.tif", 0.5)):
        cv2.imwrite(str(tmp_path / name), (ramp * time * 65535).astype(np.uint16))
    files = [tmp_path / "a.png", tmp_path / "b.tif"]
    merged = merge(list(zip(files, read_exposures(files, table), strict=True)), linear_response())
    np.testing.assert_allclose(merged.radiance, ramp, rtol=1e-3)


def test_raw_file_is_linear(tmp_path):
    """A raw file as a camera writes it: a DNG with a Bayer mosaic, white at 16000."""
    mosaic = np.zeros((64, 64), np.uint16)
    mosaic[:, :32], mosaic[:, 32:] = 2000, 8000
    path = tmp_path / "photo.dng"
    write_dng(path, mosaic, [0], 16000)
    pixels = read_photograph(path).astype(float)
    assert pixels.shape == (64, 64, 3)
    assert pixels[20:40, 40:60].mean() / pixels[20:40, 4:24].mean() == pytest.approx(4, rel=0.02)


@pytest.mark.parametrize("name", ["missing.jpg", "notes.txt", "broken.jpg"])
def test_unreadable_photograph_is_named(tmp_path, name):
    if not name.startswith("missing"):
        (tmp_path / name).write_text("no picture")
    with pytest.raises(InputError, match=name):
        read_photograph(tmp_path / name)


def test_photographs_of_different_size_are_refused(tmp_path):
    for name, side in (("a.jpg", 40), ("b.jpg", 48)):
        write_photograph(tmp_path / name, np.full((side, side, 3), 90, np.uint8), 1.0, 0)
    files = [tmp_path / "a.jpg", tmp_path / "b.jpg"]
    pairs = list(zip(files, read_exposures(files), strict=True))
    with pytest.raises(InputError, match="others of its bracket are"):
        merge(pairs, linear_response())

"""The recovered response against the truth, against OpenCV's, and on a real camera."""

import cv2
import numpy as np
import pytest

from lightdepth.capture.exposure import read_exposures
from lightdepth.capture.photograph import read_photograph
from lightdepth.capture.recovery import choose_samples, recover_response, sample_patches
from lightdepth.capture.response import (
    linear_response,
    load_response,
    normalised,
    save_response,
    srgb_response,
)
from lightdepth.errors import InputError
from tests.support.photography import film_curve

CODES = np.arange(256) / 255


def recovered(photographs, amounts):
    return recover_response(choose_samples([sample_patches(photograph) for photograph in photographs]), amounts)


def opencv(photographs, amounts, samples=200):
    cv2.setRNGSeed(1)
    calibrate = cv2.createCalibrateDebevec(samples, 10.0, True)
    bgr = [np.ascontiguousarray(photograph[..., ::-1]) for photograph in photographs]
    return calibrate.process(bgr, np.array(amounts, np.float32))[:, 0, ::-1].T.astype(float)


def curve_error(curves, truth):
    """Root mean square error of the logarithm over the readings that merging trusts, the scale being free."""
    error = np.log(curves[:, 12:246]) - np.log(truth[:, 12:246])
    return np.sqrt(((error - np.median(error, axis=1, keepdims=True)) ** 2).mean())


def disagreement(curves, photographs, amounts):
    """Median difference of the logarithm of radiance between neighbouring exposures, averaged over pairs."""
    means = [sample_patches(photograph)[0] for photograph in photographs]
    found = []
    for j in range(len(means) - 1):
        for channel in range(3):
            first, second = means[j][..., channel], means[j + 1][..., channel]
            both = (first > 0.1) & (first < 0.9) & (second > 0.1) & (second < 0.9)
            if both.sum() > 50:
                radiance = [
                    np.interp(values[both], CODES, curves[channel]) / amounts[j + k]
                    for k, values in enumerate((first, second))
                ]
                found.append(abs(np.median(np.log(radiance[0] / radiance[1]))))
    return np.mean(found)


def test_known_response_is_recovered_better_than_by_opencv(bracket):
    photographs = [read_photograph(path) for path, _ in bracket.pairs]
    amounts = [exposure.amount for _, exposure in bracket.pairs]
    levels = np.linspace(0, 1, 20001)
    truth = np.tile(np.interp(CODES, film_curve(levels), levels), (3, 1))
    own, reference = (
        curve_error(recovered(photographs, amounts).curves, truth),
        curve_error(opencv(photographs, amounts), truth),
    )
    print(f"error of the response: {own:.2%}, OpenCV's {reference:.2%}")
    assert own < 0.02
    assert own < reference


@pytest.mark.parametrize(
    "reduced", [cv2.IMREAD_REDUCED_COLOR_8, pytest.param(cv2.IMREAD_REDUCED_COLOR_2, marks=pytest.mark.truth)]
)
def test_real_camera(shared_data, reduced):
    """The file that comes with the bracket holds a polynomial of degree 4, good to 6 per cent or so."""
    folder = shared_data / "brackets/fisheye_office"
    files = sorted(folder.glob("*.JPG"))[5:13]
    amounts = [exposure.amount for exposure in read_exposures(files)]
    photographs = [np.ascontiguousarray(cv2.imread(str(file), reduced)[..., ::-1]) for file in files]
    published = np.array(
        [
            np.polyval([float(number) for number in line.split()[1:]], CODES)
            for line in (folder / "Response_function.rsp").read_text().splitlines()
        ]
    )
    own, reference = recovered(photographs, amounts).curves, opencv(photographs, amounts, 70)
    figures = [disagreement(curves, photographs, amounts) for curves in (own, reference, published)]
    print("neighbouring exposures differ by: own {:.2%}, OpenCV {:.2%}, published {:.2%}".format(*figures))
    assert curve_error(own, published) < 0.10
    assert figures[0] < 0.025
    assert figures[0] < figures[1] * 1.2
    assert figures[0] < figures[2]


def test_undetermined_response_is_said_to_be_so(bracket):
    photograph = read_photograph(bracket.pairs[4][0])
    assert recovered([photograph], [1.0]) is None
    assert recovered([np.zeros_like(photograph)] * 3, [1, 2, 4]) is None


def test_scale_makes_middle_grey_alike_in_all_channels():
    curves = np.stack([CODES**2.2, 3 * CODES**2, 0.1 * CODES**1.8])
    np.testing.assert_allclose(
        [np.interp(0.5, CODES, curve) for curve in normalised(curves).curves], 0.21404, rtol=1e-4
    )


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_readings_are_the_inverse_of_exposures(dtype):
    white = np.iinfo(dtype).max
    codes = np.tile(np.linspace(white * 0.02, white, 200).astype(dtype)[:, None, None], (1, 2, 3))
    for response in (srgb_response(), linear_response()):
        exposure = response.linear(codes)
        assert exposure.dtype == np.float32
        np.testing.assert_allclose(response.readings(exposure), codes / white, atol=1e-3)


def test_response_survives_its_file(tmp_path):
    path = tmp_path / "camera.json"
    save_response(path, srgb_response())
    np.testing.assert_array_equal(load_response(path).curves, srgb_response().curves)


@pytest.mark.parametrize("text", ["{", "{}", '{"exposure_by_reading": {"red": [1], "green": [1], "blue": [1]}}'])
def test_wrong_response_file_is_explained(tmp_path, text):
    path = tmp_path / "camera.json"
    path.write_text(text)
    with pytest.raises(InputError, match=r"camera\.json"):
        load_response(path)

"""Photographs of unusual kinds: RAW of several exposures, mirrored ones, other numbers of channels."""

from pathlib import Path

import numpy as np
import pytest
import rawpy
from PIL import Image, ImageCms

from lightdepth.capture.exposure import Exposure, read_exposures
from lightdepth.capture.merging import merge, shared_response
from lightdepth.capture.photograph import camera_colours, read_photograph, shared_white_balance, unlike_srgb
from lightdepth.capture.response import linear_response, srgb_response
from lightdepth.capture.shoot import MergeOptions, read_shoot
from lightdepth.errors import InputError, InputWarning
from lightdepth.images.exr import ExrPart, write_exr
from lightdepth.images.radiance import write_radiance
from tests.support.dng import write_dng

FAULTS = Path(__file__).parents[1] / "faults"


def bracket(pattern):
    files = sorted(FAULTS.glob(pattern))
    assert len(files) == 3
    return list(zip(files, read_exposures(files), strict=True))


def test_raw_exposures_are_scaled_alike():
    """White is the sensor's, whether the brightest pixel reaches it or four fifths of it."""
    pairs = bracket("02-rawmax/*.dng")
    merged = merge(pairs, linear_response()).radiance
    for path, exposure in pairs:
        reading = read_photograph(path) / 65535.0
        usable = (reading > 0.02) & (reading < 0.9)
        assert usable.sum() > 1000
        error = np.abs(reading[usable] / exposure.amount / merged[usable] - 1.0)
        assert np.percentile(error, 99.5) < 0.01  # The rest is beside clipped pixels, which colour their neighbours.


def test_a_shoot_has_one_white_balance():
    """Camera RAW of a grey place, for which the camera chose another balance in every exposure."""
    pairs = bracket("03-rawwb/*.dng")
    with pytest.warns(InputWarning, match=r"white balance changes between the photographs.*median of all 3"):
        merged = merge(pairs, linear_response()).radiance
    ratios = merged[8:-8, 8:-8, 0] / merged[8:-8, 8:-8, 1]
    assert np.percentile(ratios, 1) == pytest.approx(np.percentile(ratios, 99), rel=0.01)
    np.testing.assert_allclose(ratios, 1.0, rtol=0.02)
    with pytest.warns(InputWarning):
        balance = shared_white_balance([path for path, _ in pairs])
    assert balance == pytest.approx((2.0, 1.0, 5 / 3, 1.0), rel=1e-3)


def test_raw_and_developed_photographs_are_not_mixed(tmp_path):
    Image.new("RGB", (8, 8)).save(tmp_path / "a.png")
    with pytest.raises(InputError, match=r"a.png: is not a RAW file, but 080_long.dng is"):
        shared_white_balance([FAULTS / "02-rawmax/080_long.dng", tmp_path / "a.png"])


def test_colours_of_raw_are_right_where_exposures_clip(tmp_path):
    """A lamp of a saturated colour, seen by a camera of other primaries: what clips in it must not count as colour."""
    colours = np.array([[0.6, 0.35, 0.05], [0.2, 0.7, 0.1], [0.05, 0.25, 0.7]])
    neutral = np.array([0.5, 1.0, 0.7])
    row = np.linspace(0.05, 1.0, 48)[None, :, None] ** 3 * np.array([60.0, 25.0, 5.0])
    truth = 0.02 + np.repeat(row, 32, axis=0)
    pairs = []
    for index, amount in enumerate((1 / 64, 1 / 16, 1 / 4, 1)):
        path = tmp_path / f"{index}.dng"
        readings = np.clip(truth @ colours.T * neutral * amount * 15000 + 512, 0, 16000)
        write_dng(path, readings, [512] * 3, 16000, neutral, colours=colours)
        pairs.append((path, Exposure(amount)))
    merged = merge(pairs, linear_response()).radiance
    np.testing.assert_allclose(merged / np.median(merged / truth), truth, rtol=0.02)
    # LibRaw's own development, of an exposure in which nothing clips.
    with rawpy.imread(str(pairs[0][0])) as raw:
        expected = raw.postprocess(
            gamma=(1, 1), no_auto_bright=True, adjust_maximum_thr=0.0, output_bps=16, use_camera_wb=True
        )
    found = read_photograph(pairs[0][0]) @ camera_colours(pairs[0][0]).T
    scale = np.median(found[:, 24:] / expected[:, 24:])
    np.testing.assert_allclose(found[:, 24:], scale * expected[:, 24:], rtol=0.01)


def test_grey_raw_is_grey(tmp_path):
    grey = np.round(np.linspace(1000, 15000, 48))[None, :, None].repeat(32, axis=0)
    write_dng(tmp_path / "grey.dng", grey, [512], 16000, (0.5, 1.0, 0.7))
    pixels = read_photograph(tmp_path / "grey.dng", white_balance=shared_white_balance([tmp_path / "grey.dng"]))
    assert pixels.shape == (32, 48, 3)
    np.testing.assert_allclose(pixels / 65535, np.repeat((grey - 512) / (16000 - 512), 3, axis=2), atol=2e-4)
    assert camera_colours(tmp_path / "grey.dng") is None


def test_white_levels_that_differ_are_named(tmp_path):
    for name, white in (("a", 16000), ("b", 15000)):
        write_dng(tmp_path / f"{name}.dng", np.full((32, 48, 3), 4000), [0] * 3, white)
    with pytest.warns(InputWarning, match=r"white level is 16000 in a.dng and another in b.dng"):
        shared_white_balance([tmp_path / "a.dng", tmp_path / "b.dng"])


def written(folder, exposures, pixels):
    pairs = []
    for index, (amount, linear) in enumerate(zip(exposures, pixels, strict=True)):
        path = folder / f"{index}.dng"
        write_dng(path, np.clip(linear * 15000, 0, 16000), [0] * 3, 16000)
        pairs.append((path, Exposure(amount)))
    return pairs


def test_photographs_of_different_views_and_brightness_are_named(tmp_path):
    rng = np.random.default_rng(5)
    views = 0.12 * np.exp(rng.normal(0, 0.5, (2, 4, 6, 1))).repeat(8, axis=1).repeat(8, axis=2).repeat(3, axis=3)
    with pytest.warns(InputWarning, match=r"0.dng and 1.dng hardly show the same view.*--bracket"):
        merge(written(tmp_path, (1, 4), (views[0], 4 * views[1])), linear_response())
    with pytest.warns(InputWarning, match=r"0.dng and 1.dng: their brightness differs by 3.0 stops.*--exposures"):
        merge(written(tmp_path, (1, 4), (views[0], views[0] / 2)), linear_response())
    pairs = written(tmp_path, (1, 4), (views[0], 4 * views[0]))
    merge(pairs, linear_response())
    with pytest.raises(InputError, match=r"0.dng: is RAW, whose values are linear.*--response"):
        merge(pairs, srgb_response())


@pytest.mark.parametrize("black", [(0, 0, 0), (512, 512, 512), (512, 256, 1024), (100, 256, 1024)])
def test_black_levels_of_linear_raw(tmp_path, black):
    """A ramp from black to white, of which the sensor sees half in red and six tenths in blue."""
    ramp, neutral = np.linspace(0.0, 1.0, 64), np.array([0.5, 1.0, 0.6])
    levels = np.array(black)
    write_dng(tmp_path / "x.dng", ramp[None, :, None] * neutral * (16383 - levels) + levels + np.zeros((48, 64, 3)),
              black, 16383, neutral)  # fmt: skip
    readings = read_photograph(tmp_path / "x.dng") / 65535.0
    np.testing.assert_allclose(readings[24], np.tile(ramp[:, None], 3), atol=2e-3)


@pytest.mark.parametrize("level", [0, 512])
def test_black_level_of_a_mosaic(tmp_path, level):
    ramp = np.linspace(0.0, 1.0, 64)
    write_dng(tmp_path / "x.dng", np.tile(ramp * (16383 - level) + level, (48, 1)), [level], 16383)
    readings = read_photograph(tmp_path / "x.dng") / 65535.0
    np.testing.assert_allclose(readings[24, 2:-2], np.tile(ramp[2:-2, None], 3), atol=0.02)


ORIENTATIONS = {
    1: lambda shown: shown,
    2: lambda shown: shown[:, ::-1],
    3: lambda shown: shown[::-1, ::-1],
    4: lambda shown: shown[::-1],
    5: lambda shown: shown.swapaxes(0, 1),
    6: lambda shown: np.rot90(shown, 1),
    7: lambda shown: shown[::-1, ::-1].swapaxes(0, 1),
    8: lambda shown: np.rot90(shown, -1),
}
"""How a picture is stored under each EXIF orientation."""


@pytest.mark.parametrize("orientation", ORIENTATIONS)
def test_every_orientation_is_undone(tmp_path, orientation):
    shown = np.random.default_rng(1).integers(0, 256, (6, 10, 3), dtype=np.uint8)
    Image.fromarray(np.ascontiguousarray(ORIENTATIONS[orientation](shown))).save(tmp_path / "x.png")
    np.testing.assert_array_equal(read_photograph(tmp_path / "x.png", orientation), shown)


def test_pillow_undoes_orientations_alike(tmp_path):
    """The test's table agrees with an independent reader."""
    from PIL import ImageOps

    shown = np.random.default_rng(1).integers(0, 256, (6, 10, 3), dtype=np.uint8)
    for orientation, store in ORIENTATIONS.items():
        image = Image.fromarray(np.ascontiguousarray(store(shown)))
        image.getexif()[0x0112] = orientation
        np.testing.assert_array_equal(np.asarray(ImageOps.exif_transpose(image)), shown)


def test_mirrored_photographs_are_mirrored_back():
    files = sorted((FAULTS / "24-orient").glob("*.jpg"))
    pairs = list(zip(files, read_exposures(files), strict=True))
    assert {exposure.orientation for _, exposure in pairs} == {2}
    stored = merge([(path, Exposure(exposure.time, 8.0)) for path, exposure in pairs], linear_response()).radiance
    assert np.abs(stored - stored[:, ::-1]).mean() > 0.1 * stored.mean()
    np.testing.assert_allclose(merge(pairs, linear_response()).radiance, stored[:, ::-1], rtol=1e-6)
    # Where a rig turns the pictures, they are only mirrored.
    for orientation in (2, 4, 5, 7):
        turned = [(path, Exposure(exposure.time, 8.0, orientation=orientation)) for path, exposure in pairs]
        np.testing.assert_allclose(merge(turned, linear_response(), upright=False).radiance, stored[:, ::-1], rtol=1e-6)


def test_what_is_exposed_alike_but_is_not_is_refused(tmp_path):
    pairs = []
    for index, level in enumerate((40, 80, 160)):
        Image.new("RGB", (32, 32), (level,) * 3).save(tmp_path / f"{index}.png")
        pairs.append((tmp_path / f"{index}.png", Exposure(1 / 60)))
    with pytest.raises(InputError, match=r"2.png: is exposed like 0.png by its EXIF data, but is 4 times as bright"):
        merge(pairs, linear_response())
    merge(pairs[:1] * 3, linear_response())
    # Nothing can be learned of the response either.
    assert shared_response([pairs])[1].startswith("sRGB")


def test_numbers_of_channels(tmp_path):
    shown = np.random.default_rng(2).integers(0, 256, (6, 10, 4), dtype=np.uint8)
    Image.fromarray(shown).save(tmp_path / "alpha.png")
    Image.fromarray(shown[..., 0]).save(tmp_path / "grey.png")
    with pytest.warns(InputWarning, match=r"alpha.png: 100 % of it are transparent; .* not applied"):
        np.testing.assert_array_equal(read_photograph(tmp_path / "alpha.png"), shown[..., :3])
    np.testing.assert_array_equal(read_photograph(tmp_path / "grey.png"), np.repeat(shown[..., :1], 3, axis=2))


def test_a_photograph_that_is_cut_off_is_refused(tmp_path, capfd):
    Image.fromarray(np.random.default_rng(3).integers(0, 256, (64, 64, 3), dtype=np.uint8)).save(tmp_path / "x.jpg")
    whole = (tmp_path / "x.jpg").read_bytes()
    (tmp_path / "x.jpg").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match="pixels are damaged or cut off"):
        read_photograph(tmp_path / "x.jpg")
    assert capfd.readouterr() == ("", "")


def test_a_raw_file_that_is_cut_off_is_refused(tmp_path):
    whole = (FAULTS / "02-rawmax/080_long.dng").read_bytes()
    (tmp_path / "x.dng").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match="not a RAW file that LibRaw can read"):
        read_photograph(tmp_path / "x.dng")


def test_other_colour_profiles_are_named(tmp_path):
    for name, profile in {"lab": ImageCms.createProfile("LAB"), "srgb": ImageCms.createProfile("sRGB")}.items():
        icc = ImageCms.ImageCmsProfile(profile).tobytes()
        Image.new("RGB", (64, 48), (90, 90, 90)).save(tmp_path / f"{name}.jpg", icc_profile=icc)
    assert unlike_srgb([tmp_path / "srgb.jpg"]) is None
    assert "Lab" in unlike_srgb([tmp_path / "srgb.jpg", tmp_path / "lab.jpg"])
    # Cameras that are set to Adobe RGB state it by the mark of their files' interoperability.
    exif = Image.Exif()
    exif[0x0110] = "Test camera"
    exif.get_ifd(0x8769)[0xA005] = {1: "R03"}
    Image.new("RGB", (64, 48)).save(tmp_path / "adobe.jpg", exif=exif)
    assert "adobe.jpg: its EXIF data say that its colours are those of Adobe RGB" in unlike_srgb(
        [tmp_path / "adobe.jpg"]
    )
    (tmp_path / "t.csv").write_text("file,time\nlab.jpg,1\n")
    shoot = read_shoot([tmp_path / "lab.jpg"], MergeOptions(exposures=tmp_path / "t.csv"))
    assert any("colour profile is 'Lab" in warning for warning in shoot.warnings)


def test_hdr_images_with_layers_alpha_and_impossible_pixels(tmp_path):
    planes = {name: np.full((8, 8), 2.0, np.float32) for name in "RGB"}
    alpha = np.ones((8, 8), np.float32)
    alpha[0] = 0.0
    planes["R"][5, 5] = np.nan
    albedo = ExrPart({name: np.full((8, 8), 0.5, np.float32) for name in "RGB"}, "albedo")
    write_exr(tmp_path / "a.exr", [albedo, ExrPart(planes | {"A": alpha}, "beauty")])
    shoot = read_shoot([tmp_path / "a.exr"], MergeOptions())
    (orientation,) = shoot.orientations
    assert not orientation.seen[0].any()
    assert not orientation.seen[5, 5]
    assert orientation.seen.sum() == 55
    assert (orientation.radiance[orientation.seen] == 2.0).all()
    assert np.isfinite(orientation.radiance).all()
    assert shoot.warnings == ["a.exr: 1 pixels are not finite; they count as not photographed"]


def test_one_lens_has_one_circle_also_in_hdr_images(tmp_path):
    """A black image shows none; the others' differ by what they show at the rim."""
    rows, columns = np.mgrid[:160, :160] + 0.5
    for index, radius in enumerate((0.0, 60.0, 62.0, 61.0)):
        inside = np.hypot(rows - 80, columns - 80) < radius
        write_radiance(tmp_path / f"{index}.hdr", np.repeat(inside[..., None].astype(np.float32), 3, axis=2))
    shoot = read_shoot([tmp_path], MergeOptions(circle="auto"))
    sizes = {orientation.radiance.shape for orientation in shoot.orientations}
    assert len(sizes) == 1
    assert abs(sizes.pop()[0] - 122) <= 2
    write_radiance(tmp_path / "plain.hdr", np.ones((160, 160, 3), np.float32))
    with pytest.raises(InputError, match="no fisheye circle was found"):
        read_shoot([tmp_path / "plain.hdr"] * 2, MergeOptions(circle="auto"))

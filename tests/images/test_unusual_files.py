"""Files as cameras, renderers and compositors write them, which are not always as one expects."""

import os
import threading
from pathlib import Path

import numpy as np
import OpenEXR
import OpenImageIO
import pytest

from lightdepth.errors import InputError, InputWarning
from lightdepth.images.beauty import read_beauty
from lightdepth.images.exr import ExrPart, ExrReader, read_exr, write_exr
from lightdepth.images.panorama_file import read_panorama
from lightdepth.images.picture_file import read_picture
from lightdepth.images.plate_file import read_plate
from lightdepth.images.radiance import read_radiance, write_radiance
from tests.images.exr_bytes import uncompressed_exr

FAULTS = Path(__file__).parents[1] / "faults"
SIZE = (8, 16)
ACESCG = (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767)


@pytest.fixture(scope="module")
def reference():
    """The picture of ``rec709.exr``, which the others of its kind show as well."""
    return read_radiance(FAULTS / "15-chroma/rec709.exr")


@pytest.mark.parametrize("name", ["acescg", "xyz"])
def test_other_primaries_become_rec709(reference, name):
    np.testing.assert_allclose(read_radiance(FAULTS / f"15-chroma/{name}.exr"), reference, rtol=1e-3, atol=2e-4)


@pytest.mark.parametrize(
    "header", [{"colorInteropID": "lin_ap1_scene"}, {"colorInteropID": "lin_rec709_scene", "chromaticities": ACESCG}]
)
def test_a_colour_space_may_be_stated_by_name(tmp_path, reference, header):
    """Numbers go before the name."""
    stored = read_exr(FAULTS / "15-chroma/acescg.exr", interleaved=True)[0].channels
    write_exr(tmp_path / "x.exr", [ExrPart(stored, "", header)])
    np.testing.assert_allclose(read_radiance(tmp_path / "x.exr"), reference, rtol=1e-3, atol=2e-4)
    write_exr(tmp_path / "y.exr", [ExrPart(stored, "", {"colorInteropID": "srgb_rec709_scene"})])
    with pytest.warns(InputWarning, match="its colour space 'srgb_rec709_scene' is not known"):
        np.testing.assert_array_equal(read_radiance(tmp_path / "y.exr"), stored["RGB"])


def test_tristimulus_values_relative_to_a_white_keep_grey(tmp_path):
    """By the format's definition the white of the chromaticities is what equal channels show."""
    header = {"chromaticities": (1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.3127, 0.3290)}
    write_exr(tmp_path / "x.exr", [ExrPart(grey(0.5), "", header)])
    np.testing.assert_allclose(read_radiance(tmp_path / "x.exr"), 0.5, rtol=1e-3)


def test_aces_containers_have_the_widest_primaries(tmp_path):
    """Rec.709's red in ACES2065-1 (SMPTE ST 2065-1), by the matrix of the Academy's reference transform."""
    red = np.array([0.4396328, 0.0897764, 0.0175412], np.float32)
    planes = {name: np.full(SIZE, value, np.float32) for name, value in zip("RGB", red, strict=True)}
    write_exr(tmp_path / "x.exr", [ExrPart(planes, "", {"acesImageContainerFlag": 1})])
    np.testing.assert_allclose(read_radiance(tmp_path / "x.exr")[0, 0], [1.0, 0.0, 0.0], atol=2e-3)


def test_transparent_pixels_are_named_where_nothing_is_behind(tmp_path):
    alpha = np.ones(SIZE, np.float32)
    alpha[:2] = 0.0
    filled = grey(1.0) | {"A": alpha}
    write_exr(tmp_path / "filled.exr", [ExrPart(filled)])
    assert (read_radiance(tmp_path / "filled.exr") == 1.0).all()
    write_exr(tmp_path / "empty.exr", [ExrPart({name: plane * alpha for name, plane in filled.items()})])
    with pytest.warns(InputWarning, match="empty.exr: 25 % of its pixels are transparent"):
        read_radiance(tmp_path / "empty.exr")


def test_pixels_that_are_not_square_or_opaque_are_named(tmp_path):
    write_exr(tmp_path / "x.exr", [ExrPart(grey(1.0), "", {"pixelAspectRatio": 2.0})])
    with pytest.warns(InputWarning, match="states pixels 2 times as wide as high"):
        read_radiance(tmp_path / "x.exr")
    write_exr(tmp_path / "x.exr", [ExrPart(grey(1.0) | {"A": np.full(SIZE, 0.5, np.float32)})])
    with pytest.warns(InputWarning, match="100 % of its pixels are partly transparent"):
        read_radiance(tmp_path / "x.exr")


def test_the_y_of_a_vector_is_no_luminance(tmp_path):
    write_exr(tmp_path / "x.exr", [ExrPart(grey(1.0, "XYZ"))])
    with pytest.raises(InputError, match="has channels X, Y, Z; R, G and B, or Y, are needed"):
        read_radiance(tmp_path / "x.exr")
    write_exr(
        tmp_path / "x.exr", [ExrPart({f"P.{axis}": np.ones(SIZE, np.float32) for axis in "XYZ"} | grey(3.0, "Y"))]
    )
    assert (read_radiance(tmp_path / "x.exr") == 3.0).all()


def test_overscan_is_cut_to_the_display_window(reference):
    np.testing.assert_array_equal(read_radiance(FAULTS / "14-window/overscan_2to1.exr"), reference)


def test_a_cropped_picture_is_laid_into_the_display_window(reference):
    with pytest.warns(InputWarning, match=r"floor_cropped.exr: the data window covers 75 % of the display window"):
        radiance = read_radiance(FAULTS / "14-window/floor_cropped.exr")
    np.testing.assert_array_equal(radiance[:24], reference[:24])
    assert radiance.shape == reference.shape
    assert (radiance[24:] == 0.0).all()


def test_the_beauty_is_taken_though_another_part_comes_first(reference):
    np.testing.assert_array_equal(read_radiance(FAULTS / "23-make/parts_albedo_first.exr"), reference)


@pytest.mark.parametrize("name", ["06-exposure/freeimage", "23-make/crlf", "23-make/old_rle"])
def test_radiance_files_of_other_makes(reference, name):
    radiance = read_radiance(FAULTS / f"{name}.hdr")
    if name.endswith("old_rle"):  # Its rows are their first pixel throughout.
        reference = np.repeat(reference[:, :1], 64, axis=1)
    _, exponent = np.frexp(reference.max(axis=2, keepdims=True))
    # Some of the writers cut mantissas off, some round.
    assert (np.abs(radiance - reference) <= np.ldexp(1.001, exponent - 8)).all()


def grey(value, channels="RGB"):
    return {name: np.full(SIZE, value, np.float32) for name in channels}


def layered(**layers):
    return {
        f"{layer.replace('__', '.')}.{name}": np.full(SIZE, value, np.float32)
        for layer, value in layers.items()
        for name in "RGB"
    }


DEPTH = {"ViewLayer.Depth.Z": np.ones(SIZE, np.float32)}


@pytest.mark.parametrize(
    "parts",
    [
        # Blender's multilayer file of one part, with and without a compositor's output.
        [("", layered(ViewLayer__Combined=3.0, ViewLayer__DiffCol=1.0, ViewLayer__Env=2.0) | DEPTH)],
        [("", layered(ViewLayer__Combined=1.0, Composite__Combined=3.0))],
        # Channels without a layer beside those of layers, as Nuke, Arnold and V-Ray write them.
        [("", grey(3.0) | layered(diffuse=1.0, beauty=2.0))],
        [("", grey(3.0, "RGBA") | {"depth.Z": np.ones(SIZE, np.float32)})],
        # A part for each layer.
        [("depth", {"Z": np.ones(SIZE, np.float32)}), ("rgba", grey(3.0)), ("diffuse", grey(1.0))],
        [
            ("ViewLayer.Normal", layered(ViewLayer__Normal=1.0)),
            ("ViewLayer.Combined", layered(ViewLayer__Combined=3.0)),
        ],
        [("RGB color", grey(3.0)), ("VRayRawLighting", grey(1.0))],
        [("C", grey(3.0)), ("direct_diffuse", grey(1.0))],
        [("alpha", {"Y": np.ones(SIZE, np.float32)}), ("image", grey(3.0))],
        # Other spellings of channels, and grey.
        [("", {name: np.full(SIZE, 3.0, np.float32) for name in ("red", "green", "blue")})],
        [("", {"Y": np.full(SIZE, 3.0, np.float32)})],
        [("", {name: np.full(SIZE, value, np.float32) for name, value in (("Y", 3.0), ("RY", 0.0), ("BY", 0.0))})],
    ],
)
def test_the_finished_picture_is_found(tmp_path, parts):
    write_exr(tmp_path / "x.exr", [ExrPart(channels, name) for name, channels in parts])
    np.testing.assert_allclose(read_radiance(tmp_path / "x.exr"), np.full((*SIZE, 3), 3.0, np.float32), rtol=1e-6)


def test_the_alpha_is_that_of_the_picture(tmp_path):
    write_exr(tmp_path / "x.exr", [ExrPart(grey(1.0) | {"A": np.full(SIZE, 0.5, np.float16)} | layered(other=2.0))])
    assert (read_beauty(tmp_path / "x.exr").alpha == 0.5).all()
    assert read_beauty(FAULTS / "15-chroma/rec709.exr").alpha is None


def test_several_pictures_of_equal_right_are_named(tmp_path):
    write_exr(tmp_path / "x.exr", [ExrPart(grey(1.0), "left"), ExrPart(grey(2.0), "right")])
    with pytest.raises(InputError, match=r"holds 2 pictures that may be the finished one: part 'left'; part 'right'"):
        read_radiance(tmp_path / "x.exr")
    write_exr(tmp_path / "y.exr", [ExrPart(layered(Near__Combined=1.0, Far__Combined=2.0))])
    with pytest.raises(InputError, match=r"layer 'Far.Combined'; the file, layer 'Near.Combined'"):
        read_radiance(tmp_path / "y.exr")


def test_the_unused_view_of_a_stereo_picture_is_named(tmp_path):
    views = grey(1.0) | layered(right=2.0)
    write_exr(tmp_path / "x.exr", [ExrPart(views, "", {"multiView": ["left", "right"]})])
    with pytest.warns(InputWarning, match=r"stereo picture \(left, right\); the view 'left' is used"):
        assert (read_radiance(tmp_path / "x.exr") == 1.0).all()


def test_what_cannot_be_shown_is_named(tmp_path):
    write_exr(tmp_path / "cube.exr", [ExrPart(grey(1.0), "", {"envmap": OpenEXR.ENVMAP_CUBE})])
    subsampled = {"Y": (np.ones((8, 16)), 1), "RY": (np.zeros((4, 8)), 2), "BY": (np.zeros((4, 8)), 2)}
    (tmp_path / "chroma.exr").write_bytes(uncompressed_exr(subsampled, (16, 8)))
    flat = (np.arange(8, dtype=np.float32) * 0 + 0.3).tolist()
    write_exr(tmp_path / "primaries.exr", [ExrPart(grey(1.0), "", {"chromaticities": tuple(flat)})])
    for name, message in {
        "cube": "is a cube map; convert it to an equirectangular panorama",
        "chroma": "luminance and subsampled chroma",
        "primaries": "span no colour space",
    }.items():
        with pytest.raises(InputError, match=message):
            read_radiance(tmp_path / f"{name}.exr")


def test_the_test_writes_what_is_read(tmp_path):
    pixels = np.random.default_rng(1).random((3, 8, 16))
    (tmp_path / "x.exr").write_bytes(uncompressed_exr({n: (p, 1) for n, p in zip("RGB", pixels)}, (16, 8)))
    np.testing.assert_array_equal(read_radiance(tmp_path / "x.exr"), np.moveaxis(pixels, 0, 2).astype(np.float32))


@pytest.mark.parametrize("wrong", ["x.hdr", "x.pic", "x"])
def test_content_decides_what_a_file_is(tmp_path, wrong):
    write_exr(tmp_path / "x.exr", [ExrPart(grey(3.0))])
    (tmp_path / "x.exr").rename(tmp_path / wrong)
    with pytest.warns(InputWarning, match="is read as .exr"):
        assert (read_radiance(tmp_path / wrong) == 3.0).all()


@pytest.mark.parametrize("wrong", ["x.jpg", "x.pic"])
def test_content_decides_for_panoramas_plates_and_pictures(tmp_path, wrong):
    write_radiance(tmp_path / "x.hdr", np.full((8, 16, 3), 3.0, np.float32))
    (tmp_path / "x.hdr").rename(tmp_path / wrong)
    for read in (read_panorama, read_plate, read_picture):
        with pytest.warns(InputWarning, match=rf"{wrong}: is read as .hdr, which it is by its content"):
            found = read(tmp_path / wrong)
        shape = found.pixels.shape if read is read_picture else getattr(found, "radiance", found).shape
        assert shape == (8, 16, 3)


def radiance_file(path, header, pixels, size=b"-Y 8 +X 16"):
    """A flat file from mantissas and exponents of shape (rows, columns, 4)."""
    path.write_bytes(b"#?RADIANCE\n" + header + b"FORMAT=32-bit_rle_rgbe\n\n" + size + b"\n" + pixels.tobytes())


def mantissas():
    pixels = np.random.default_rng(2).integers(128, 256, (8, 16, 4), dtype=np.uint8)
    pixels[..., 3] = 129
    return pixels


def test_primaries_and_colour_correction_are_undone(tmp_path):
    radiance_file(tmp_path / "plain.hdr", b"", mantissas())
    plain = read_radiance(tmp_path / "plain.hdr")
    radiance_file(tmp_path / "x.hdr", b"COLORCORR= 2 4 8\nEXPOSURE=0.5\nCOLORCORR=1 1 0.5\n", mantissas())
    np.testing.assert_allclose(read_radiance(tmp_path / "x.hdr") * [1, 2, 2], plain, rtol=1e-6)
    # Swapped primaries are swapped channels.
    radiance_file(tmp_path / "y.hdr", b"PRIMARIES=.15 .06 .30 .60 .64 .33 .3127 .3290\n", mantissas())
    np.testing.assert_allclose(read_radiance(tmp_path / "y.hdr"), plain[..., ::-1], rtol=1e-5, atol=1e-5)
    # Grey stays grey whatever white the primaries are measured against.
    white = mantissas()
    white[...] = [200, 200, 200, 129]
    radiance_file(tmp_path / "z.hdr", b"PRIMARIES=.64 .33 .29 .60 .15 .06 .3333 .3333\n", white)
    np.testing.assert_allclose(read_radiance(tmp_path / "z.hdr"), 200 / 128, rtol=1e-5)


def test_tristimulus_values_are_converted(tmp_path):
    pixels = mantissas()
    pixels[...] = [122, 128, 139, 128]  # D65 white, nearly: 0.9505 1 1.089
    radiance_file(tmp_path / "x.hdr", b"", pixels)
    data = (tmp_path / "x.hdr").read_bytes().replace(b"rle_rgbe", b"rle_xyze")
    (tmp_path / "x.hdr").write_bytes(data)
    np.testing.assert_allclose(read_radiance(tmp_path / "x.hdr"), 0.5, atol=0.01)


@pytest.mark.parametrize("run_lengths", [False, True])
def test_rows_and_columns_may_run_any_way(tmp_path, run_lengths):
    """What a picture of 8 rows and 16 columns looks like where its scanlines are stored in another order."""
    if run_lengths:
        write_radiance(tmp_path / "plain.hdr", read_radiance_of(mantissas(), tmp_path))
    else:
        radiance_file(tmp_path / "plain.hdr", b"", mantissas())
    stored = (tmp_path / "plain.hdr").read_bytes()
    plain = read_radiance(tmp_path / "plain.hdr")
    for size, expected in {
        b"+Y 8 +X 16": plain[::-1],
        b"-Y 8 -X 16": plain[:, ::-1],
        b"+X 8 -Y 16": plain.swapaxes(0, 1),
        b"-X 8 +Y 16": plain.swapaxes(0, 1)[::-1, ::-1],
    }.items():
        (tmp_path / "x.hdr").write_bytes(stored.replace(b"-Y 8 +X 16", size, 1))
        np.testing.assert_array_equal(read_radiance(tmp_path / "x.hdr"), expected)


def read_radiance_of(pixels, folder):
    radiance_file(folder / "flat.hdr", b"", pixels)
    return read_radiance(folder / "flat.hdr")


def test_old_run_lengths_of_several_digits(tmp_path):
    """300 pixels are 1 and a run of 43 + 256 of which the second marker is the higher digit."""
    records = np.array([[200, 100, 50, 129], [1, 1, 1, 43], [1, 1, 1, 1], [50, 60, 200, 129]], np.uint8)
    radiance_file(tmp_path / "x.hdr", b"", records, b"-Y 7 +X 43")
    radiance = read_radiance(tmp_path / "x.hdr").reshape(-1, 3)
    np.testing.assert_array_equal(radiance[:300], np.tile(np.array([[200, 100, 50]]) / 128, (300, 1)))
    np.testing.assert_array_equal(radiance[300], np.array([50, 60, 200]) / 128)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("GAMMA=2.2", "GAMMA=2.2 in its header is not applied"),
        ("PIXASPECT=2.0", "PIXASPECT=2.0 in its header is not applied: its pixels are taken to be square"),
        ("VIEW= -vtv -vh 45 -vv 45", "'VIEW=-vtv -vh 45 -vv 45' in its header is not applied"),
        ("COLORSPACE=ACEScg", "'COLORSPACE=ACEScg' in its header is not applied"),
        ("EXPOSURE = 2", "'EXPOSURE =2' in its header is not applied"),
        (" EXPOSURE=2", "'EXPOSURE=2' is indented in its header"),
        ("FORMAT=32-bit_rle_xyze", "states several formats; the first counts"),
    ],
)
def test_lines_of_the_header_that_are_not_applied_are_named(tmp_path, line, message):
    radiance_file(
        tmp_path / "plain.hdr", b"SOFTWARE=PTGui\nPIXASPECT=1.0\nEXPOSURE=1\n\tEXPOSURE=7\nrpict -vta\n", mantissas()
    )
    plain = read_radiance(tmp_path / "plain.hdr")
    radiance_file(tmp_path / "x.hdr", b"FORMAT=32-bit_rle_rgbe\n" + line.encode() + b"\n", mantissas())
    with pytest.warns(InputWarning, match=message):
        np.testing.assert_array_equal(read_radiance(tmp_path / "x.hdr"), plain)


def test_a_header_that_claims_too_much_is_refused_before_memory_is_taken(tmp_path):
    write_exr(tmp_path / "x.exr", [ExrPart(grey(1.0))])
    data = (tmp_path / "x.exr").read_bytes()
    window = np.array([0, 0, SIZE[1] - 1, SIZE[0] - 1], "<i4").tobytes()
    huge = np.array([0, 0, 39_999, 19_999], "<i4").tobytes()
    assert data.count(window) == 2
    (tmp_path / "x.exr").write_bytes(data.replace(window, huge))
    with pytest.raises(InputError, match="its header claims more pixels than it can hold"):
        read_exr(tmp_path / "x.exr")


def test_a_plain_picture_may_be_very_small(tmp_path):
    image = OpenImageIO.ImageOutput.create(str(tmp_path / "x.exr"))
    spec = OpenImageIO.ImageSpec(6000, 3000, 1, "float")
    spec.channelnames = ("Y",)
    spec["compression"] = "dwab"
    assert image.open(str(tmp_path / "x.exr"), spec)
    assert image.write_image(np.zeros((3000, 6000, 1), np.float32))
    image.close()
    assert (tmp_path / "x.exr").stat().st_size < 72e6 / 3000
    with ExrReader(tmp_path / "x.exr") as reader:
        assert reader.headers[0].display_window == (0, 0, 6000, 3000)


def test_damaged_exr_files_are_refused_without_a_sound(tmp_path, capfd):
    channels = {name: np.random.default_rng(3).random(SIZE, np.float32) for name in "RGB"}
    write_exr(tmp_path / "x.exr", [ExrPart(channels, "a"), ExrPart(channels, "b")])
    whole = (tmp_path / "x.exr").read_bytes()
    random, refusals = np.random.default_rng(4), []
    for _ in range(100):
        damaged = bytearray(whole)
        for place in random.integers(0, len(whole), 3):
            damaged[place] = random.integers(0, 256)
        (tmp_path / "x.exr").write_bytes(damaged[: random.integers(1, 2 * len(whole))])
        try:
            read_exr(tmp_path / "x.exr")
        except (InputError, InputWarning) as error:  # The warning is of a window that is another one now.
            refusals.append(str(error))
    assert len(refusals) > 50
    assert all(words.startswith(f"{tmp_path}/x.exr: ") and "EXR_ERR" not in words for words in refusals)
    assert capfd.readouterr() == ("", "")


def test_reading_leaves_other_threads_their_output(tmp_path, capfd):
    write_exr(tmp_path / "x.exr", [ExrPart(grey(1.0, "RGBA"), name) for name in "abcd"])
    done = threading.Event()

    def read():
        while not done.is_set():
            read_exr(tmp_path / "x.exr")

    reading = threading.Thread(target=read)
    reading.start()
    for number in range(3000):
        os.write(1, b"%d\n" % number)
    done.set()
    reading.join()
    assert capfd.readouterr().out.split() == [str(number) for number in range(3000)]


def test_writing_leaves_the_librarys_threads_as_they_were(tmp_path):
    before = OpenEXR.global_thread_count()
    OpenEXR.set_global_thread_count(3)
    try:
        write_exr(tmp_path / "x.exr", [ExrPart(grey(1.0))])
        assert OpenEXR.global_thread_count() == 3
    finally:
        OpenEXR.set_global_thread_count(before)

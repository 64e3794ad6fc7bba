"""Panoramas as cameras save them."""

import struct
import zlib

import cv2
import numpy as np
import OpenImageIO
import pytest
from PIL import Image, ImageCms
from PIL.PngImagePlugin import PngInfo

from lightdepth.directions import euler_rotation, pixel_directions
from lightdepth.errors import InputError, InputWarning
from lightdepth.images.icc import read_profile, srgb_profile
from lightdepth.images.panorama_file import read_panorama
from lightdepth.images.picture_file import read_picture
from lightdepth.images.plate_file import read_plate
from lightdepth.images.tonemapping import tone_map
from tests.cli.room_folder import make_room

PACKET = '<x:xmpmeta><rdf:Description xmlns:GPano="http://ns.google.com/photos/1.0/panorama/" {}/></x:xmpmeta>'


def sphere(**values):
    return PACKET.format(" ".join(f'GPano:{name}="{value}"' for name, value in values.items())).encode()


@pytest.fixture(scope="module")
def radiance():
    """A smooth panorama within what a screen shows."""
    directions = pixel_directions(64, 128)
    return (0.4 + 0.3 * directions * [1.0, -1.0, 0.5]).astype(np.float32)


@pytest.fixture(scope="module")
def pixels(radiance):
    return tone_map(radiance, 0.0, "linear")


def test_a_jpeg_is_linearised_and_its_clipping_is_reported(tmp_path, pixels):
    bright = pixels.copy()
    bright[10:20, 30:40] = 255
    Image.fromarray(bright).save(tmp_path / "p.jpg", quality=98, subsampling=0)
    image = read_panorama(tmp_path / "p.jpg")
    away = np.ones((64, 128), bool)
    away[4:28, 20:52] = False
    # JPEG's rounding moves a code by a few at this quality.
    codes = tone_map(image.radiance, 0.0, "linear").astype(int)
    assert np.abs(codes - pixels)[away].max() <= 4
    assert abs(codes[away].mean() - pixels[away].mean()) < 0.2
    assert image.radiance.dtype == np.float32
    (note,) = image.notes
    assert "8 bits a channel" in note
    assert "capture merge" in note


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("ending", ["png", "tif"])
def test_integers_are_srgb(tmp_path, radiance, bits, ending):
    code = np.where(radiance <= 0.0031308, 12.92 * radiance, 1.055 * radiance ** (1 / 2.4) - 0.055)
    levels = 2**bits - 1
    stored = np.rint(code * levels).astype(np.uint8 if bits == 8 else np.uint16)
    cv2.imwrite(str(tmp_path / f"p.{ending}"), stored[:, :, ::-1])
    image = read_panorama(tmp_path / f"p.{ending}")
    np.testing.assert_allclose(image.radiance, radiance, atol=1.5 / levels)
    assert f"{bits} bits a channel" in image.notes[0]


def test_float_tiff_is_linear_and_keeps_what_is_brighter_than_white(tmp_path, radiance):
    bright = radiance.copy()
    bright[3, 4] = [200.0, 100.0, 50.0]
    cv2.imwrite(str(tmp_path / "p.tif"), bright[:, :, ::-1])
    image = read_panorama(tmp_path / "p.tif")
    np.testing.assert_array_equal(image.radiance, bright)
    assert image.notes == ()


def matrix_profile(primaries, gamma):
    """A version 2 profile as Adobe's programs write it: three primaries and a power."""

    def xyz(values):
        return b"XYZ \0\0\0\0" + struct.pack(">3i", *(round(v * 65536) for v in values))

    curve = b"curv\0\0\0\0" + struct.pack(">IH", 1, round(gamma * 256)) + b"\0\0"
    tags = [(f"{c}XYZ".encode(), xyz(p)) for c, p in zip("rgb", np.transpose(primaries))]
    tags += [(f"{c}TRC".encode(), curve) for c in "rgb"]
    offset, table, data = 132 + 12 * len(tags), b"", b""
    for name, content in tags:
        table += struct.pack(">4sII", name, offset + len(data), len(content))
        data += content
    head = bytearray(128)
    head[8:12], head[12:16], head[16:20], head[20:24] = b"\x02\x10\0\0", b"mntr", b"RGB ", b"XYZ "
    head[36:40] = b"acsp"
    head[68:80] = struct.pack(">3i", *(round(v * 65536) for v in (0.9642, 1.0, 0.8249)))
    whole = struct.pack(">I", 128 + 4 + len(table) + len(data)) + bytes(head[4:])
    return whole + struct.pack(">I", len(tags)) + table + data


ADOBE = [[0.60974, 0.20528, 0.14919], [0.31111, 0.62567, 0.06322], [0.01947, 0.06087, 0.74457]]


def test_a_profile_is_read_as_littlecms_reads_it():
    """Adobe RGB (1998): what a program that manages colour shows must be what is read here."""
    profile_bytes = matrix_profile(ADOBE, 2.19921875)
    codes = np.random.default_rng(0).integers(60, 200, (16, 16, 3)).astype(np.uint8)
    import io

    expected = ImageCms.profileToProfile(
        Image.fromarray(codes),
        ImageCms.ImageCmsProfile(io.BytesIO(profile_bytes)),
        ImageCms.createProfile("sRGB"),
        renderingIntent=ImageCms.Intent.RELATIVE_COLORIMETRIC,
    )
    profile = read_profile(profile_bytes)
    linear = np.stack([profile.curves[c][np.rint(codes[..., c] / 255 * 4095).astype(int)] for c in range(3)], axis=-1)
    found = tone_map((linear @ profile.to_rec709.T).astype(np.float32), 0.0, "linear").astype(int)
    inside = (found > 0).all(axis=2) & (found < 255).all(axis=2)
    assert inside.mean() > 0.6
    assert np.abs(found - np.asarray(expected).astype(int))[inside].max() <= 2


def test_an_srgb_profile_changes_nothing():
    built_in = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    profile = read_profile(built_in)
    np.testing.assert_array_equal(profile.to_rec709, np.eye(3))
    np.testing.assert_allclose(profile.curves, srgb_profile().curves, atol=2e-4)


def test_the_embedded_profile_is_used(tmp_path, pixels):
    Image.fromarray(pixels).save(tmp_path / "a.png", icc_profile=matrix_profile(ADOBE, 2.19921875))
    Image.fromarray(pixels).save(tmp_path / "s.png")
    wide, plain = (read_panorama(tmp_path / f"{name}.png").radiance for name in "as")
    assert np.abs(wide - plain).max() > 0.02
    # White is white in both.
    Image.fromarray(np.full_like(pixels, 255)).save(tmp_path / "a.png", icc_profile=matrix_profile(ADOBE, 2.19921875))
    np.testing.assert_allclose(read_panorama(tmp_path / "a.png").radiance, 1.0, atol=2e-3)


@pytest.mark.parametrize("profile", [b"nonsense", matrix_profile(ADOBE, 2.2)[:150]])
def test_a_damaged_profile_is_refused(tmp_path, pixels, profile):
    Image.fromarray(pixels).save(tmp_path / "p.png", icc_profile=profile)
    with pytest.raises(InputError, match="profile .*save the picture in sRGB"):
        read_panorama(tmp_path / "p.png")


def test_a_cropped_sphere_is_padded_and_its_rest_is_unknown(tmp_path, pixels, radiance):
    part = Image.fromarray(pixels[16:56, 24:104])
    xmp = sphere(
        FullPanoWidthPixels=256,  # The metadata of the picture before it was halved.
        FullPanoHeightPixels=128,
        CroppedAreaImageWidthPixels=160,
        CroppedAreaImageHeightPixels=80,
        CroppedAreaLeftPixels=48,
        CroppedAreaTopPixels=32,
        ProjectionType="equirectangular",
    )
    part.save(tmp_path / "p.jpg", quality=98, subsampling=0, xmp=xmp)
    image = read_panorama(tmp_path / "p.jpg")
    assert image.radiance.shape == (64, 128, 3)
    known = np.zeros((64, 128), bool)
    known[16:56, 24:104] = True
    np.testing.assert_array_equal(image.unknown, ~known)
    np.testing.assert_allclose(image.radiance[known], radiance[known], atol=0.02)
    # Filled from around: no darker and no brighter than what is known.
    assert image.radiance.min() > 0.8 * image.radiance[known].min()
    assert image.radiance.max() < 1.2 * image.radiance[known].max()
    assert "shows only a part of the sphere" in image.notes[1]


@pytest.mark.parametrize("form", ["attributes", "elements"])
def test_the_pose_of_the_metadata_is_a_rotation(tmp_path, pixels, form):
    values = {"PoseHeadingDegrees": 90, "PosePitchDegrees": 10, "PoseRollDegrees": 5}
    xmp = sphere(**values)
    if form == "elements":
        xmp = "".join(f"<GPano:{name}>{value}</GPano:{name}>" for name, value in values.items()).encode()
    Image.fromarray(pixels).save(tmp_path / "p.jpg", xmp=xmp)
    rotation = read_panorama(tmp_path / "p.jpg").rotation
    # The picture's centre looks to the east, 10 degrees above the horizon.
    np.testing.assert_allclose(rotation @ [0, 1, 0], [np.cos(np.radians(10)), 0, np.sin(np.radians(10))], atol=1e-12)
    # The horizon turns counter-clockwise in the picture: to the right of its centre it is higher than on the left.
    right, left = (euler_rotation([0, 0, azimuth]) @ [0, 1, 0] for azimuth in (-90, 90))
    assert (rotation @ right)[2] < (rotation @ left)[2]


def test_a_png_has_its_metadata_in_a_chunk(tmp_path, pixels):
    info = PngInfo()
    info.add_itxt("XML:com.adobe.xmp", sphere(PosePitchDegrees=20).decode())
    Image.fromarray(pixels).save(tmp_path / "p.png", pnginfo=info)
    assert (read_panorama(tmp_path / "p.png").rotation @ [0, 1, 0])[2] == pytest.approx(np.sin(np.radians(20)))


def png_with(path, pixels, **chunks):
    """Write a PNG with chunks before its pixels."""
    Image.fromarray(pixels).save(path)
    content = path.read_bytes()
    more = b""
    for name, data in chunks.items():
        body = name.encode() + data
        more += struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))
    path.write_bytes(content[:33] + more + content[33:])


def test_a_png_states_its_colours_by_chunks(tmp_path, pixels):
    path = tmp_path / "p.png"
    linear, wide = (
        struct.pack(">I", 100000),
        struct.pack(">8I", *(31270, 32900, 70800, 29200, 17000, 79700, 13100, 4600)),
    )
    Image.fromarray(pixels).save(path)
    plain = read_panorama(path).radiance
    for chunks in ({"gAMA": struct.pack(">I", 45455)}, {"sRGB": b"\0", "gAMA": linear}, {"cICP": bytes([1, 13, 0, 1])}):
        png_with(path, pixels, **chunks)
        np.testing.assert_array_equal(read_panorama(path).radiance, plain)
    png_with(path, pixels, gAMA=linear)
    np.testing.assert_allclose(read_panorama(path).radiance, pixels / 255.0, atol=1e-6)
    png_with(path, pixels, cHRM=wide)
    red, green, blue = np.moveaxis(plain, 2, 0)  # ITU-R BT.2087 has the matrix.
    np.testing.assert_allclose(
        read_panorama(path).radiance[..., 0],
        np.maximum(1.6605 * red - 0.5876 * green - 0.0728 * blue, 0.0),
        atol=2e-4,
    )
    png_with(path, pixels, cICP=bytes([9, 16, 0, 1]))
    with pytest.raises(InputError, match=r"primaries 9, curve 16 of ITU-T H.273\) are not those of sRGB"):
        read_panorama(path)


def test_the_mark_of_adobe_rgb_is_heeded(tmp_path):
    """As the same pixels with that profile."""
    exif = Image.Exif()
    exif[0x0110] = "Test camera"
    exif.get_ifd(0x8769)[0xA005] = {1: "R03"}
    colour = np.full((64, 128, 3), [200, 90, 40], np.uint8)
    Image.fromarray(colour).save(tmp_path / "p.jpg", exif=exif, quality=100, subsampling=0)
    # 563/256 is the exponent, and the matrix between the primaries leaves green as it is.
    linear = (colour[0, 0] / 255.0) ** (563 / 256)
    expected = [1.39836 * linear[0] - 0.39836 * linear[1], linear[1], -0.04293 * linear[1] + 1.04293 * linear[2]]
    np.testing.assert_allclose(read_panorama(tmp_path / "p.jpg").radiance[30, 30], expected, atol=0.002)


@pytest.mark.parametrize("kind", ["half", "double"])
def test_tiffs_of_other_depths_are_linear(tmp_path, radiance, kind):
    write_tiff(tmp_path / "p.tif", radiance, kind)
    np.testing.assert_allclose(read_panorama(tmp_path / "p.tif").radiance, radiance, rtol=1e-3)


def test_what_a_tiff_holds_beside_is_named(tmp_path, pixels, radiance):
    page = Image.fromarray(pixels)
    page.save(tmp_path / "pages.tif", save_all=True, append_images=[page])
    with pytest.warns(InputWarning, match="holds several pages; the first is used"):
        read_panorama(tmp_path / "pages.tif")
    page.convert("CMYK").save(tmp_path / "cmyk.tif")
    with pytest.raises(InputError, match="its colours are CMYK"):
        read_panorama(tmp_path / "cmyk.tif")
    write_tiff(tmp_path / "turned.tif", radiance, "float", Orientation=6)
    with pytest.raises(InputError, match="stored on its side"):
        read_panorama(tmp_path / "turned.tif")


def write_tiff(path, pixels, kind, **attributes):
    spec = OpenImageIO.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], kind)
    for name, value in attributes.items():
        spec[name] = value
    image = OpenImageIO.ImageOutput.create(str(path))
    assert image.open(str(path), spec)
    assert image.write_image(pixels)
    image.close()


def test_transparent_pixels_are_unknown(tmp_path, pixels):
    alpha = np.full((64, 128, 1), 255, np.uint8)
    alpha[54:] = 0
    Image.fromarray(np.concatenate([pixels, alpha], axis=2)).save(tmp_path / "p.png")
    image = read_panorama(tmp_path / "p.png")
    np.testing.assert_array_equal(image.unknown, np.broadcast_to(alpha[..., 0] == 0, (64, 128)))
    alpha[50:54] = 100
    Image.fromarray(np.concatenate([pixels, alpha], axis=2)).save(tmp_path / "p.png")
    assert any("6.2 % of it are partly transparent" in note for note in read_panorama(tmp_path / "p.png").notes)


@pytest.mark.parametrize("orientation", [2, 3, 4, 6])
def test_mirrored_and_turned_pictures_are_refused(tmp_path, pixels, orientation):
    exif = Image.Exif()
    exif[274] = orientation
    Image.fromarray(pixels).save(tmp_path / "p.jpg", exif=exif)
    with pytest.raises(InputError, match="orientation.* stored (mirrored|upside down|on its side)"):
        read_panorama(tmp_path / "p.jpg")


@pytest.mark.parametrize("orientation", range(1, 9))
def test_a_plate_is_turned_upright(tmp_path, pixels, orientation):
    """Like the picture that is calibrated, which Pillow turns."""
    exif = Image.Exif()
    exif[274] = orientation
    Image.fromarray(pixels).save(tmp_path / "p.png", exif=exif)
    shown = read_picture(tmp_path / "p.png").pixels
    assert shown.shape[:2] == (pixels.shape[:2] if orientation < 5 else pixels.shape[1::-1])
    Image.fromarray(shown).save(tmp_path / "upright.png")
    np.testing.assert_array_equal(read_plate(tmp_path / "p.png"), read_plate(tmp_path / "upright.png"))


def test_damaged_exif_data_are_not_spoken_of(tmp_path, pixels):
    """Pillow would warn; warnings are errors here."""
    exif = Image.Exif()
    exif[274], exif[34665] = 1, {33434: 0.01}
    Image.fromarray(pixels).save(tmp_path / "p.jpg", exif=exif)
    content = (tmp_path / "p.jpg").read_bytes()
    place = content.index(b"Exif") + 14
    (tmp_path / "p.jpg").write_bytes(content[:place] + b"\xff\x7f" + content[place + 2 :])  # How many tags there are.
    assert read_panorama(tmp_path / "p.jpg").radiance.shape == (*pixels.shape[:2], 3)


def two_circles():
    rows, columns = np.mgrid[0:64, 0:128] + 0.5
    inside = np.hypot(rows - 32, columns % 64 - 32) < 31
    return np.where(inside[..., None], 120, 0).astype(np.uint8).repeat(3, axis=2)


@pytest.mark.parametrize(
    ("picture", "xmp", "message"),
    [
        (np.full((96, 64, 3), 90, np.uint8), b"", "64 x 96 pixels and stands upright like a portrait"),
        (np.full((64, 96, 3), 90, np.uint8), b"", "96 x 64 pixels and is an ordinary photograph"),
        (two_circles(), b"", "two fisheye circles side by side"),
        (np.full((64, 128, 3), 90, np.uint8), sphere(PoseRollDegrees=180), "upside down"),
        (np.full((64, 128, 3), 90, np.uint8), sphere(ProjectionType="cylindrical"), "projection is 'cylindrical'"),
        (np.full((64, 128, 3), 90, np.uint8), sphere(PosePitchDegrees="up"), "PosePitchDegrees .*'up'"),
        (
            np.full((64, 128, 3), 90, np.uint8),
            sphere(FullPanoWidthPixels=128, FullPanoHeightPixels=64, CroppedAreaTopPixels=20),
            "at column 0, row 20 of a sphere of 128 x 64",
        ),
    ],
)
def test_what_is_no_panorama_is_refused(tmp_path, picture, xmp, message):
    Image.fromarray(picture).save(tmp_path / "p.jpg", xmp=xmp or None)
    with pytest.raises(InputError, match=message):
        read_panorama(tmp_path / "p.jpg")


@pytest.mark.parametrize("ending", ["jpg", "png", "tif"])
def test_damaged_files_are_refused(tmp_path, pixels, ending):
    path = tmp_path / f"p.{ending}"
    Image.fromarray(pixels).save(path)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 3])
    with pytest.raises(InputError, match="not a readable picture"):
        read_panorama(path)
    path.write_bytes(b"no picture")
    with pytest.raises(InputError, match="not a readable picture"):
        read_panorama(path)


def test_other_formats_are_refused_with_what_to_do(tmp_path):
    (tmp_path / "p.webp").write_bytes(b"")
    with pytest.raises(InputError, match=r"'.webp' is not a format for a panorama; .*convert it to JPEG"):
        read_panorama(tmp_path / "p.webp")


def test_a_jpeg_in_a_scene_warns_loudly(command, tmp_path, pixels):
    scene = make_room(tmp_path)
    Image.fromarray(pixels).save(tmp_path / "room.jpg")
    scene.write_text(scene.read_text().replace("room.exr", "room.jpg"))
    status, out, _ = command("check", scene)
    assert status == 0
    assert "LAMPS AND SUN ARE MUCH TOO DARK" in out
    assert (
        command(
            "calibrate",
            tmp_path / "room.jpg",
            "--vertical",
            "1,30 1,35",
            "--vertical",
            "40,30 40,35",
            "--vertical",
            "80,30 80,36",
        )[0]
        == 0
    )
    status, _, err = command("preview", tmp_path / "room.jpg", "-o", tmp_path / "p.png")
    assert status == 0
    assert "capture merge" in err

"""Radiance files, against their definitions."""

import numpy as np
import pytest

from lightdepth.errors import InputError
from lightdepth.images.exr import ExrPart, read_exr, write_exr
from lightdepth.images.radiance import read_radiance, write_radiance


def rgbe_by_definition(data):
    """Decode run-length encoded RGBE: value = mantissa * 2 ** (exponent - 136)."""
    header, _, rest = data.partition(b"\n\n")
    assert b"32-bit_rle_rgbe" in header
    size, _, rest = rest.partition(b"\n")
    _, height, _, width = size.split()
    height, width = int(height), int(width)
    stream, planes = iter(rest), np.empty((height, 4, width), np.uint8)
    for row in range(height):
        assert [next(stream) for _ in range(4)] == [2, 2, width >> 8, width & 255]
        for channel in range(4):
            values = []
            while len(values) < width:
                count = next(stream)
                values += [next(stream)] * (count - 128) if count > 128 else [next(stream) for _ in range(count)]
            planes[row, channel] = values
    scale = np.where(planes[:, 3] > 0, np.ldexp(1.0, planes[:, 3].astype(int) - 136), 0.0)
    return np.moveaxis(planes[:, :3] * scale[:, None], 1, -1)


def bright_and_dark(height=16, width=32):
    random = np.random.default_rng(3)
    radiance = (10.0 ** random.uniform(-4, 5, (height, width, 1)) * random.uniform(0, 1, (height, width, 3))).astype(
        np.float32
    )
    radiance[0] = 0.0
    radiance[1] = [1.0, 255 / 256, 511 / 512]
    return radiance


@pytest.mark.parametrize("name", ["lebombo_1k", "rooitou_park_1k", "vestibule_1k"])
def test_hdr_is_read_as_defined(shared_data, name):
    path = shared_data / "hdr" / f"{name}.hdr"
    np.testing.assert_array_equal(read_radiance(path), rgbe_by_definition(path.read_bytes()))


def test_hdr_is_written_to_the_nearest_mantissa(tmp_path):
    radiance = bright_and_dark()
    write_radiance(tmp_path / "x.hdr", radiance)
    back = read_radiance(tmp_path / "x.hdr")
    np.testing.assert_array_equal(back, rgbe_by_definition((tmp_path / "x.hdr").read_bytes()))
    _, exponent = np.frexp(back.max(axis=2, keepdims=True))
    assert (np.abs(back - radiance) <= 0.5 * np.ldexp(1.0, exponent - 8)).all()
    assert (back[0] == 0).all()
    write_radiance(tmp_path / "y.hdr", back)
    np.testing.assert_array_equal(read_radiance(tmp_path / "y.hdr"), back)


def test_exr_keeps_every_bit(tmp_path):
    write_radiance(tmp_path / "x.exr", bright_and_dark())
    np.testing.assert_array_equal(read_radiance(tmp_path / "x.exr"), bright_and_dark(), strict=True)


def test_exr_with_alpha_and_half_floats(tmp_path):
    radiance = np.minimum(bright_and_dark(), 6e4).astype(np.float16)
    channels = {name: radiance[:, :, i] for i, name in enumerate("RGB")}
    write_exr(tmp_path / "x.exr", [ExrPart(channels | {"A": np.ones((16, 32), np.float16)})])
    back = read_radiance(tmp_path / "x.exr")
    np.testing.assert_array_equal(back, radiance.astype(np.float32), strict=True)
    assert back.flags["C_CONTIGUOUS"]


def test_exposure_in_the_header_is_undone(tmp_path):
    write_radiance(tmp_path / "x.hdr", bright_and_dark())
    stored = (tmp_path / "x.hdr").read_bytes()
    (tmp_path / "y.hdr").write_bytes(stored.replace(b"FORMAT", b"EXPOSURE=4\nEXPOSURE= 0.5\nFORMAT", 1))
    np.testing.assert_array_equal(read_radiance(tmp_path / "y.hdr") * 2, read_radiance(tmp_path / "x.hdr"))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda data: data[: len(data) // 2], "damaged or cut off"),
        (lambda data: b"", "does not start with"),
        (lambda data: b"\xff\xd8\xff\xe0 a photograph", "is a JPEG image; formats for radiance are .exr, .hdr"),
        (lambda data: b"<!doctype html>", "is a text"),
        (
            lambda data: data.replace(b"rle_rgbe", b"rle_cmyk"),
            "'32-bit_rle_cmyk'; '32-bit_rle_rgbe' or '32-bit_rle_xyze'",
        ),
        (lambda data: data.replace(b"-Y 16", b"-X 16"), r"'-X 16 \+X 32'; two of X and Y"),
        (lambda data: data.replace(b"-Y 16", b"-Y 1600000000"), "not a readable"),
        (lambda data: data.replace(b"FORMAT", b"EXPOSURE=none\nFORMAT", 1), "EXPOSURE .* 'none'; numbers are needed"),
        (lambda data: data.replace(b"FORMAT", b"EXPOSURE=-2\nFORMAT", 1), "EXPOSURE .* '-2'; 1 positive"),
        (
            lambda data: data.replace(b"FORMAT", b"EXPOSURE=1e-60\nFORMAT", 1),
            "EXPOSURE and COLORCORR in its header multiply",
        ),
        (lambda data: data.replace(b"FORMAT", b"COLORCORR=1 0 1\nFORMAT", 1), "COLORCORR .* '1 0 1'; 3 positive"),
        (lambda data: data.replace(b"FORMAT", b"PRIMARIES=1 1 1 1 1 1 1 1\nFORMAT", 1), "span no colour space"),
    ],
)
def test_a_broken_hdr_is_refused_in_one_message(tmp_path, capfd, change, message):
    write_radiance(tmp_path / "x.hdr", bright_and_dark())
    broken = tmp_path / "broken.hdr"
    broken.write_bytes(change((tmp_path / "x.hdr").read_bytes()))
    with pytest.raises(InputError, match=message) as caught:
        read_radiance(broken)
    assert str(caught.value).startswith(str(broken))
    assert capfd.readouterr() == ("", "")


def test_broken_and_foreign_files_are_refused(tmp_path):
    write_radiance(tmp_path / "x.exr", bright_and_dark())
    (tmp_path / "cut.exr").write_bytes((tmp_path / "x.exr").read_bytes()[:900])
    (tmp_path / "x.jpg").write_bytes(b"")
    write_exr(tmp_path / "depth.exr", [ExrPart({"Z": np.ones((4, 8), np.float32)})])
    for name, message in {
        "cut.exr": "not a readable OpenEXR file",
        "x.jpg": "'.jpg' is not a format for radiance; allowed are .exr, .hdr",
        "absent.exr": "no such file",
        "depth.exr": "has channels Z; R, G and B, or Y, are needed",
    }.items():
        with pytest.raises(InputError, match=message):
            read_radiance(tmp_path / name)
    with pytest.raises(InputError, match=r"allowed are .exr, .hdr"):
        write_radiance(tmp_path / "x.png", bright_and_dark())


def test_parts_and_headers_come_back(tmp_path):
    ids = np.arange(32, dtype=np.uint32).reshape(4, 8)
    parts = [
        ExrPart({"RGB": np.ones((4, 8, 3), np.float32)}, "beauty", {"note": "käfer"}),
        ExrPart({"id": ids}, "ids", {"names": ["a", "b"]}),
    ]
    write_exr(tmp_path / "x.exr", parts)
    first, second = read_exr(tmp_path / "x.exr")
    assert (first.name, sorted(first.channels), first.header["note"]) == ("beauty", ["B", "G", "R"], "käfer")
    np.testing.assert_array_equal(second.channels["id"], ids, strict=True)
    assert second.header["names"] == ["a", "b"]
    assert list(read_exr(tmp_path / "x.exr", interleaved=True)[0].channels) == ["RGB"]

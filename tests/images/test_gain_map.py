"""Panoramas with more than the screen's range in files for the screen: gain maps, and HEIC."""

import io
import struct

import cv2
import numpy as np
import pytest
from PIL import Image

from lightdepth.directions import pixel_directions
from lightdepth.errors import InputError
from lightdepth.images.panorama_file import read_panorama
from lightdepth.images.tonemapping import tone_map

XMP = (
    '<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">'
    '<rdf:Description xmlns:hdrgm="http://ns.adobe.com/hdr-gain-map/1.0/" hdrgm:Version="1.0" {}>{}</rdf:Description>'
    "</rdf:RDF></x:xmpmeta>"
)
HEADROOM, GAMMA, OFFSET = 6.0, 0.8, 1.0 / 64.0


def jpeg(pixels, xmp, **more):
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "jpeg", quality=98, subsampling=0, xmp=xmp.encode(), **more)
    return stream.getvalue()


def ultra_hdr(path, radiance, attributes, elements="", shrink=1):
    """Write a file as the format's description has it: the picture, its index, and the gain map behind it."""
    screen = np.clip(radiance, 0.0, 1.0)
    factor = np.log2((radiance + OFFSET).mean(axis=2) / (screen + OFFSET).mean(axis=2))
    small = cv2.resize(factor, None, fx=1 / shrink, fy=1 / shrink, interpolation=cv2.INTER_AREA)
    recovery = np.rint(255 * np.clip(small / HEADROOM, 0, 1) ** GAMMA).astype(np.uint8)
    second = jpeg(recovery, XMP.format(attributes, elements))
    first = jpeg(tone_map(screen, 0.0, "linear"), XMP.format("", ""))
    # The index goes before the first quantisation table; offsets count from its own byte order mark.
    at = first.index(b"\xff\xdb")
    length = 2 + 4 + 8 + 2 + 3 * 12 + 4 + 2 * 16
    mark = at + 2 + 2 + 4
    total = len(first) + 2 + length
    entries = struct.pack(">HHI4s", 0xB000, 7, 4, b"0100") + struct.pack(">HHII", 0xB001, 4, 1, 2)
    entries += struct.pack(">HHII", 0xB002, 7, 32, 8 + 2 + 36 + 4)
    index = b"MM\0*" + struct.pack(">I", 8) + struct.pack(">H", 3) + entries + struct.pack(">I", 0)
    index += struct.pack(">IIIHH", 0x030000, total, 0, 0, 0) + struct.pack(">IIIHH", 0, len(second), total - mark, 0, 0)
    segment = b"\xff\xe2" + struct.pack(">H", length) + b"MPF\0" + index
    path.write_bytes(first[:at] + segment + first[at:] + second)


@pytest.fixture(scope="module")
def radiance():
    """Smooth, with a lamp forty times as bright as the screen's white."""
    directions = pixel_directions(64, 128)
    lamp = np.exp(30.0 * (directions @ [0.6, 0.7, 0.39] - 1.0))[..., None]
    return (0.35 + 0.2 * directions * [1.0, -1.0, 0.5] + 40.0 * lamp).astype(np.float32)


ITEM = "<rdf:li>{0}</rdf:li>"
LIST = f"<hdrgm:GainMapMax><rdf:Seq>{3 * ITEM}</rdf:Seq></hdrgm:GainMapMax>"


@pytest.mark.parametrize(("as_list", "shrink", "bound"), [(False, 1, 0.03), (True, 2, 0.15)])
def test_a_gain_map_gives_back_what_the_screen_does_not_show(tmp_path, radiance, as_list, shrink, bound):
    """In stops: 8 bits for 6 of them; a smaller map is smooth where the screen's white is reached."""
    attributes = f'hdrgm:Gamma="{GAMMA}" hdrgm:HDRCapacityMax="6"'
    most = LIST.format(HEADROOM) if as_list else ""
    attributes += "" if as_list else f' hdrgm:GainMapMax="{HEADROOM}"'
    ultra_hdr(tmp_path / "p.jpg", radiance, attributes, most, shrink)
    image = read_panorama(tmp_path / "p.jpg")
    error = np.abs(np.log2(image.radiance.mean(axis=2) / radiance.mean(axis=2)))
    assert np.quantile(error, 0.99) < bound
    assert image.radiance.max() == pytest.approx(radiance.max(), rel=0.1)
    (note,) = image.notes
    assert "HDR by its gain map, up to 64 times" in note


@pytest.mark.parametrize(
    ("attributes", "reason"),
    [
        ('hdrgm:BaseRenditionIsHDR="True"', "leads from HDR"),
        ('hdrgm:Gamma="0"', "make no sense"),
        ('hdrgm:GainMapMax="nan"', "make no sense"),
    ],
)
def test_a_gain_map_that_is_not_read_is_reported(tmp_path, radiance, attributes, reason):
    ultra_hdr(tmp_path / "p.jpg", radiance, attributes)
    image = read_panorama(tmp_path / "p.jpg")
    assert image.radiance.max() <= 1.0
    assert any("gain map, which is not read" in note and reason in note for note in image.notes)


def test_a_file_cut_off_before_its_gain_map_is_read_without(tmp_path, radiance):
    ultra_hdr(tmp_path / "p.jpg", radiance, "")
    whole = (tmp_path / "p.jpg").read_bytes()
    (tmp_path / "p.jpg").write_bytes(whole[: whole.rindex(b"\xff\xd8\xff")])
    notes = read_panorama(tmp_path / "p.jpg").notes
    assert any("gain map, which is not read (it is damaged)" in note for note in notes)


def test_heic_is_read(tmp_path, radiance):
    heif = pytest.importorskip("pillow_heif", reason="pillow-heif is not installed")
    heif.register_heif_opener()
    screen = tone_map(np.clip(radiance, 0.0, 1.0), 0.0, "linear")
    Image.fromarray(screen).save(tmp_path / "p.heic", quality=95)
    image = read_panorama(tmp_path / "p.heic")
    codes = tone_map(image.radiance, 0.0, "linear").astype(int)
    assert np.quantile(np.abs(codes - screen), 0.95) <= 6
    assert "8 bits a channel" in image.notes[0]
    (tmp_path / "q.heic").write_bytes((tmp_path / "p.heic").read_bytes()[:200])
    with pytest.raises(InputError, match="not a readable picture"):
        read_panorama(tmp_path / "q.heic")

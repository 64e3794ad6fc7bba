"""A frame's finished image and its file."""

import subprocess
import sys
from fractions import Fraction

import numpy as np
import OpenEXR
import OpenImageIO
import pytest
from PIL import Image

from lightdepth.cameras import Equirectangular, Perspective, Viewpoint
from lightdepth.cameras.topology import Flat, Pictures, Rectangle, Spherical
from lightdepth.directions import euler_rotation
from lightdepth.errors import InputError
from lightdepth.film.cryptomatte import Mattes
from lightdepth.film.frame import Frame
from lightdepth.film.header import time_attributes, view_matrices
from lightdepth.film.layers import FILE_NAMES, LAYERS, part_path, read_frame, write_frame, write_picture
from lightdepth.images.beauty import read_beauty
from lightdepth.images.exr import ExrPart, read_exr, write_exr
from lightdepth.images.tonemapping import tone_map
from lightdepth.kernel.start import start
from tests.support.picture_file import ROOT, documented, undocumented


def small_frame(height=24, width=48, seed=1, **optional):
    random = np.random.default_rng(seed)

    def colour(low=0.0, high=1.0):
        return random.uniform(low, high, (height, width, 3)).astype(np.float32)

    coverage = np.zeros((height, width), np.float32)
    coverage[8:16, 10:20] = random.uniform(0, 1, (8, 10))
    change = np.zeros((height, width, 3), np.float32)
    change[12:20, 5:40] = random.normal(0, 0.1, (8, 35, 3))
    plate = (10.0 ** colour(-6, 5)).astype(np.float32)
    plate[0, 0] = [1e5, 0.0, 1e-30]
    alpha = np.ones((height, width), np.float32)
    return Frame(plate, change, colour() * coverage[:, :, None], coverage, alpha, **optional)


def full_frame():
    frame = small_frame()
    random = np.random.default_rng(2)
    shape = frame.coverage.shape
    frame.object_id = random.integers(0, 4, shape).astype(np.uint32)
    frame.depth = random.uniform(0.1, 9, shape).astype(np.float32)
    frame.depth[0] = np.inf
    normal = random.normal(size=(*shape, 3))
    frame.normal = (normal / np.linalg.norm(normal, axis=-1, keepdims=True)).astype(np.float32)
    frame.albedo = random.uniform(0, 1, (*shape, 3)).astype(np.float32)
    frame.photograph = random.uniform(0, 1, (*shape, 2)).astype(np.float32)
    frame.variance = random.uniform(0, 1e-9, (*shape, 3)).astype(np.float32)
    frame.samples = random.integers(1, 2**32, shape, dtype=np.uint32)
    frame.metadata = {"method": "difference", "seed": "7"}
    frame.matrices = {"worldToCamera": np.arange(16, dtype=np.float32).reshape(4, 4)}
    frame.object_names = ("Flasche", "küche", "ball")
    height, width = shape
    frame.topology = Spherical((Rectangle(0, height, 0, width),))
    return frame


def test_untouched_pixels_are_the_plate_bit_for_bit():
    frame = small_frame()
    frame.plate[0, 1] = -0.0
    untouched = (frame.coverage == 0) & (frame.change == 0).all(2) & (frame.synthetic == 0).all(2)
    assert 0.5 < untouched.mean() < 1
    np.testing.assert_array_equal(
        frame.beauty[untouched].view(np.uint32), frame.plate[untouched].view(np.uint32), strict=True
    )


def test_beauty_is_the_sum_of_the_layers():
    frame = small_frame()
    exact = frame.plate.astype(np.float64) * (1 - frame.coverage.astype(np.float64))[:, :, None]
    exact += frame.change.astype(np.float64) + frame.synthetic
    np.testing.assert_allclose(frame.beauty, exact, rtol=1e-6, atol=1e-6)


def test_full_coverage_leaves_nothing_of_a_bright_lamp():
    frame = small_frame()
    frame.coverage[3, 4], frame.synthetic[3, 4], frame.plate[3, 4] = 1.0, [0.1, 0.2, 0.3], 1e5
    np.testing.assert_array_equal(frame.beauty[3, 4], np.float32([0.1, 0.2, 0.3]))


def test_a_frame_comes_back_from_its_file(tmp_path):
    frame = full_frame()
    write_frame(tmp_path / "f.exr", frame)
    back = read_frame(tmp_path / "f.exr")
    for name in (
        "plate",
        "change",
        "synthetic",
        "coverage",
        "alpha",
        "object_id",
        "depth",
        "variance",
        "samples",
        "photograph",
    ):
        np.testing.assert_array_equal(getattr(back, name), getattr(frame, name), strict=True)
    np.testing.assert_allclose(back.normal, frame.normal, atol=5e-4)
    np.testing.assert_allclose(back.albedo, frame.albedo, atol=5e-4)
    assert back.metadata == frame.metadata
    assert back.object_names == frame.object_names
    np.testing.assert_array_equal(back.matrices["worldToCamera"], frame.matrices["worldToCamera"])
    assert back.topology.environment_map == "latlong"
    np.testing.assert_array_equal(back.beauty, frame.beauty, strict=True)


CHANNELS = {
    "beauty": ["R", "G", "B", "A"],
    "plate": ["plate.R", "plate.G", "plate.B"],
    "change": ["change.R", "change.G", "change.B"],
    "shadow": ["shadow.R", "shadow.G", "shadow.B"],
    "synthetic": ["synthetic.R", "synthetic.G", "synthetic.B"],
    "coverage": ["coverage.Y"],
    "object_id": ["object_id.id"],
    "depth": ["depth.Z"],
    "normal": ["N.X", "N.Y", "N.Z"],
    "albedo": ["albedo.R", "albedo.G", "albedo.B"],
    "photograph": ["photograph.share1", "photograph.share2"],
    "variance": ["variance.R", "variance.G", "variance.B"],
    "samples": ["samples.count"],
}


def specs(path):
    source = OpenImageIO.ImageInput.open(str(path))
    found, index = [], 0
    while source.seek_subimage(index, 0):
        found.append(OpenImageIO.ImageSpec(source.spec()))
        index += 1
    source.geterror()
    source.close()
    return found


def window(roi):
    return roi.xbegin, roi.xend, roi.ybegin, roi.yend


def test_the_file_says_what_other_programs_look_for(tmp_path):
    """The first part has bare channels and all others those of a layer; windows, colour and time are the same in all."""
    frame = full_frame()
    frame.metadata["frame"] = "1234"
    write_frame(tmp_path / "f.exr", frame, rate=Fraction(24000, 1001))
    parts = specs(tmp_path / "f.exr")
    assert {spec["oiio:subimagename"]: list(spec.channelnames) for spec in parts} == CHANNELS
    assert {(window(spec.roi), window(spec.roi_full), spec["openexr:lineOrder"]) for spec in parts} == {
        ((0, 48, 0, 24), (0, 48, 0, 24), "increasingY")
    }
    for spec in parts:
        np.testing.assert_allclose(spec["chromaticities"], [0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329])
        assert spec["colorInteropID"] == "lin_rec709_scene"
        assert spec["textureformat"] == "LatLong Environment"
        assert spec["smpte:TimeCode"] == (0x00005110, 0)  # Its digits: 1234 = 51 x 24 + 10.
    assert parts[0]["framesPerSecond"] == (24000, 1001)
    assert parts[0]["software"].startswith("lightdepth ")
    assert undocumented(tmp_path / "f.exr") == set()


def test_what_the_page_of_the_file_names_is_written():
    """The other direction, that a file has nothing else, is tested where files are rendered."""
    attributes, channels = documented()
    code = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "src/lightdepth").rglob("*.py"))
    own = {name.removeprefix("lightdepth:") for name in attributes if name.startswith("lightdepth:")}
    assert {name for name in own if f'"{name}"' not in code and f'"lightdepth:{name}"' not in code} == set()
    several = {"RGB": "RGB", "XYZ": "XYZ", "share": ["share1"]}
    assert channels == {"R", "G", "B", "A", "CryptoObject00.R"} | {
        f"{FILE_NAMES.get(layer, layer)}.{letter}"
        for layer, (names, _) in LAYERS.items()
        for letter in several.get(names, [names])
        if layer != "cryptomatte"
    }


def test_above_30_frames_per_second_a_time_code_counts_pairs():
    code = time_attributes(60 * 3600 + 61, Fraction(60))["timeCode"]
    assert (code.hours, code.minutes, code.seconds, code.frame, code.fieldPhase) == (1, 0, 1, 0, True)
    assert "timeCode" not in time_attributes(1, Fraction(120))
    assert "timeCode" not in time_attributes(None, Fraction(24))


def oiiotool(*arguments):
    """OpenImageIO's own program, as its package brings it."""
    call = "import sys; from OpenImageIO import _command_line; sys.argv[0] = 'oiiotool'; sys.exit(_command_line())"
    return subprocess.run(
        [sys.executable, "-c", call, *map(str, arguments)], capture_output=True, text=True, check=True
    )


def test_one_part_on_wish(tmp_path):
    """oiiotool takes the layers out of it by their names."""
    frame = full_frame()
    write_frame(tmp_path / "f.exr", frame, structure="single")
    (spec,) = specs(tmp_path / "f.exr")
    assert sorted(spec.channelnames) == sorted(name for names in CHANNELS.values() for name in names)
    back = read_frame(tmp_path / "f.exr")
    np.testing.assert_array_equal(back.beauty, frame.beauty, strict=True)
    np.testing.assert_array_equal(back.samples, frame.samples, strict=True)
    assert back.object_names == frame.object_names
    oiiotool(tmp_path / "f.exr", "--ch", "R=plate.R,G=plate.G,B=plate.B", "-o", tmp_path / "plate.exr")
    (plate,) = read_exr(tmp_path / "plate.exr", interleaved=True)
    np.testing.assert_array_equal(plate.channels["RGB"], frame.plate)
    write_frame(tmp_path / "parts.exr", frame)
    listed = oiiotool("--info", "-v", "-a", tmp_path / "parts.exr").stdout
    assert listed.count("channel list") == len(CHANNELS)
    assert read_beauty(tmp_path / "f.exr").radiance.tobytes() == frame.beauty.tobytes()
    assert read_beauty(tmp_path / "parts.exr").radiance.tobytes() == frame.beauty.tobytes()


def test_files_of_earlier_versions_are_read(tmp_path):
    frame = full_frame()
    planes = {
        "plate": {"RGB": frame.plate}, "change": {"RGB": frame.change}, "synthetic": {"RGB": frame.synthetic},
        "alpha": {"Y": frame.coverage}, "object_id": {"id": frame.object_id}, "depth": {"Z": frame.depth},
        "normal": {name: frame.normal[..., i] for i, name in enumerate("XYZ")}, "samples": {"samples": frame.samples},
    }  # fmt: skip
    beauty = ExrPart({"RGB": frame.beauty, "A": frame.alpha}, "beauty", {"lightdepth:seed": "7"})
    write_exr(tmp_path / "f.exr", [beauty, *(ExrPart(channels, name) for name, channels in planes.items())])
    back = read_frame(tmp_path / "f.exr")
    for name in ("plate", "change", "synthetic", "coverage", "alpha", "object_id", "depth", "normal", "samples"):
        np.testing.assert_array_equal(getattr(back, name), getattr(frame, name))
    assert back.metadata == {"seed": "7"}
    assert back.variance is None


def test_the_shadow_multiplies_the_plate():
    frame = small_frame()
    frame.change = np.maximum(frame.change, -0.5 * frame.plate * (1 - frame.coverage[..., None]))
    shadow = frame.shadow.astype(np.float64)
    sum_of_layers = frame.plate * (1.0 - frame.coverage[..., None].astype(np.float64)) * shadow + frame.synthetic
    exact = (shadow > 0.4) & (shadow < 60000)
    assert exact.mean() > 0.95
    np.testing.assert_allclose(sum_of_layers[exact], frame.beauty[exact], rtol=6e-4, atol=1e-6)
    assert (shadow[(frame.change == 0).all(2)] == 1.0).all()
    frame.plate[13, 6], frame.change[13, 6] = 0.0, 0.1
    frame.coverage[13, 7], frame.change[13, 7] = 1.0, 0.1
    frame.plate[13, 8], frame.change[13, 8] = 1e-30, -0.1
    assert frame.shadow[13, 6:9, 0].tolist() == [1.0, 1.0, 0.0]


@pytest.mark.parametrize("lens", [{"shift": (0.1, -0.2)}, {"principal_point": (0.4, 0.35)}])
def test_matrices_are_those_of_the_camera(lens):
    """A point is where the camera's own rays show it, by the standard's convention: row vectors, z forward."""
    start("cpu")
    import mitsuba as mi

    camera = Perspective(type="perspective", width=40, height=30, fov=70, **lens)
    view = Viewpoint(camera, np.array([1.0, -2.0, 3.0]), euler_rotation([20.0, -30.0, 140.0]))
    place = view.position + view.rotation @ np.array([0.3, 2.0, -0.2])
    panorama = Viewpoint(Equirectangular(type="equirectangular", width=8), np.zeros(3), np.eye(3))
    matrices = view_matrices(view, panorama)
    np.testing.assert_allclose([*place, 1.0] @ matrices["worldToCamera"], [0.3, -0.2, 2.0, 1.0], atol=1e-5)
    x, y, _, w = [*place, 1.0] @ matrices["worldToNDC"]
    film = view.project(mi.Point3f(place.tolist()), mi.Point2f(0.5)).film
    np.testing.assert_allclose([x / w, y / w], [film.x[0], film.y[0]], atol=1e-5)
    np.testing.assert_allclose([1, 2, 3, 1] @ matrices["lightdepth:worldToPanorama"], [1, 3, 2, 1])
    assert "worldToNDC" not in view_matrices(panorama, view)


def test_some_layers_only(tmp_path):
    frame = full_frame()
    frame.topology = Flat(48, 24)
    write_frame(tmp_path / "f.exr", frame, layers=("depth",))
    with OpenEXR.File(str(tmp_path / "f.exr"), header_only=True) as file:
        assert [part.name() for part in file.parts] == ["beauty", "depth"]
        assert "envmap" not in file.parts[0].header
    with pytest.raises(InputError, match=r"lacks the layers plate, .*depth\.Z"):
        read_frame(tmp_path / "f.exr")
    with pytest.raises(InputError, match="'depht' is unknown; allowed are plate"):
        write_frame(tmp_path / "g.exr", full_frame(), layers=("depht",))
    assert not (tmp_path / "g.exr").exists()


def test_the_picture_is_transparent_outside_the_image_circle(tmp_path):
    frame = small_frame()
    write_picture(tmp_path / "opaque.png", frame)
    with Image.open(tmp_path / "opaque.png") as picture:
        assert picture.mode == "RGB"
    frame.alpha[:3] = 0.0
    for layer in (frame.plate, frame.change, frame.synthetic):
        layer[:3] = 0.0
    write_picture(tmp_path / "round.png", frame)
    with Image.open(tmp_path / "round.png") as picture:
        pixels = np.asarray(picture)
    assert pixels.shape == (24, 48, 4)
    assert (pixels[:3] == 0).all()
    assert (pixels[3:, :, 3] == 255).all()


def test_all_cameras_of_a_scene_are_shown_at_the_panoramas_exposure(tmp_path):
    """What one camera sees of a place has the same brightness in its picture as in that of another."""
    bright, dark = small_frame(), small_frame()
    bright.plate[:, :24] = dark.plate[:, :24] = 0.25
    bright.plate[:, 24:], dark.plate[:, 24:] = 2.0, 0.01
    pictures = []
    for name, frame in (("bright", bright), ("dark", dark)):
        frame.change[:], frame.synthetic[:], frame.coverage[:] = 0.0, 0.0, 0.0
        frame.metadata["exposure"] = "0.500"
        write_picture(tmp_path / f"{name}.png", frame)
        with Image.open(tmp_path / f"{name}.png") as picture:
            pictures.append(np.asarray(picture))
    np.testing.assert_array_equal(pictures[0][:, :24], pictures[1][:, :24])
    expected = tone_map(np.full((1, 1, 3), 0.25, np.float32), 0.5)
    np.testing.assert_array_equal(pictures[0][0, 0], expected[0, 0])


@pytest.mark.parametrize(
    ("name", "wanted"),
    [
        ("shot.0012.exr", "shot.left.0012.exr"),
        ("shot_0012.exr", "shot.left_0012.exr"),
        ("view.exr", "view.left.exr"),
        ("view2.png", "view2.left.png"),
        ("a.b.exr", "a.b.left.exr"),
    ],
)
def test_files_of_views_are_numbered_last(tmp_path, name, wanted):
    assert part_path(tmp_path / name, "left") == tmp_path / wanted


@pytest.mark.parametrize("spherical", [True, False])
def test_views_become_files_of_their_own_with_all_layers(tmp_path, spherical):
    frame = full_frame()
    charts, names = (Rectangle(0, 24, 0, 24), Rectangle(0, 24, 24, 48)), ("left", "right")
    frame.topology = (Spherical if spherical else Pictures)(charts, names, names)
    write_picture(tmp_path / "shot.0001.png", frame)
    write_frame(tmp_path / "shot.0001.exr", frame)
    files = {f"shot.{view}0001.{kind}" for view in ("", "left.", "right.") for kind in ("exr", "png")}
    assert {path.name for path in tmp_path.iterdir()} == files
    whole = read_frame(tmp_path / "shot.0001.exr")
    for name, chart in zip(names, charts, strict=True):
        part = read_frame(tmp_path / f"shot.{name}.0001.exr")
        for layer in ("plate", "change", "synthetic", "coverage", "object_id", "depth", "normal", "samples"):
            np.testing.assert_array_equal(getattr(part, layer), getattr(whole, layer)[chart.slices], layer)
        assert part.metadata == {**frame.metadata, "part": name}
        assert undocumented(tmp_path / f"shot.{name}.0001.exr") == set()
        assert part.object_names == frame.object_names
        assert part.topology.environment_map == ("latlong" if spherical else None)
        # Both eyes have the exposure of the whole.
        shown, of_whole = (np.asarray(Image.open(tmp_path / f"shot.{n}0001.png")) for n in (f"{name}.", ""))
        np.testing.assert_array_equal(shown, of_whole[chart.slices])


def test_mattes_are_cut_with_the_views():
    """Each pixel of a view has the shapes and shares that it has in the whole picture."""
    pixels = np.array([0, 0, 5, 7, 12, 19], np.uint32)  # Of 4 x 5 pixels: rows 0, 0, 1, 1, 2, 3.
    mattes = Mattes(pixels, np.array([0, 1, 1, 0, 1, 0], np.uint32), np.linspace(0.1, 0.6, 6, dtype=np.float32), (), ())
    cut = mattes.cut(Rectangle(1, 4, 2, 5), 5)
    np.testing.assert_array_equal(cut.pixels, [0, 3, 8])
    np.testing.assert_array_equal(cut.shapes, [0, 1, 0])
    np.testing.assert_allclose(cut.shares, [0.4, 0.5, 0.6])

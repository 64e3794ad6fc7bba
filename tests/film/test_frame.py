"""A frame's finished image and its file."""

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from lightdepth.cameras.topology import Flat, Pictures, Rectangle, Spherical
from lightdepth.errors import InputError
from lightdepth.film.cryptomatte import Mattes
from lightdepth.film.frame import Frame
from lightdepth.film.layers import part_path, read_frame, write_frame, write_picture
from lightdepth.images.tonemapping import tone_map


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
    frame.variance = random.uniform(0, 1e-9, (*shape, 3)).astype(np.float32)
    frame.samples = random.integers(1, 2**32, shape, dtype=np.uint32)
    frame.metadata = {"method": "difference", "seed": "7"}
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
    for name in ("plate", "change", "synthetic", "coverage", "alpha", "object_id", "depth", "variance", "samples"):
        np.testing.assert_array_equal(getattr(back, name), getattr(frame, name), strict=True)
    np.testing.assert_allclose(back.normal, frame.normal, atol=5e-4)
    np.testing.assert_allclose(back.albedo, frame.albedo, atol=5e-4)
    assert back.metadata == frame.metadata
    assert back.object_names == frame.object_names
    assert back.topology.environment_map == "latlong"
    np.testing.assert_array_equal(back.beauty, frame.beauty, strict=True)


def test_the_file_says_what_other_programs_look_for(tmp_path):
    write_frame(tmp_path / "f.exr", full_frame())
    with OpenEXR.File(str(tmp_path / "f.exr"), separate_channels=True) as file:
        parts = {part.name(): sorted(part.channels) for part in file.parts}
        assert file.parts[0].name() == "beauty"
        assert all(part.header["envmap"] == OpenEXR.ENVMAP_LATLONG for part in file.parts)
        assert file.parts[0].channels["R"].pixels.dtype == np.float32
    assert parts == {
        "beauty": ["A", "B", "G", "R"],
        "plate": ["B", "G", "R"],
        "change": ["B", "G", "R"],
        "synthetic": ["B", "G", "R"],
        "alpha": ["Y"],
        "object_id": ["id"],
        "depth": ["Z"],
        "normal": ["X", "Y", "Z"],
        "albedo": ["B", "G", "R"],
        "variance": ["B", "G", "R"],
        "samples": ["samples"],
    }


def test_some_layers_only(tmp_path):
    frame = full_frame()
    frame.topology = Flat(48, 24)
    write_frame(tmp_path / "f.exr", frame, layers=("depth",))
    with OpenEXR.File(str(tmp_path / "f.exr"), header_only=True) as file:
        assert [part.name() for part in file.parts] == ["beauty", "depth"]
        assert "envmap" not in file.parts[0].header
    with pytest.raises(InputError, match=r"lacks the parts? .*plate"):
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

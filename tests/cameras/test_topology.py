"""Which pixel lies beyond an edge: the one whose ray continues the picture there."""

import shutil
import subprocess

import numpy as np
import pytest

from lightdepth.kernel.start import start

start("cpu")

import mitsuba as mi  # noqa: E402

from lightdepth.cameras import (  # noqa: E402
    VR180,
    Cubemap,
    DomeMaster,
    DomeStereo,
    EquiAngularCubemap,
    Equirectangular,
    Fisheye,
    OmnidirectionalStereo,
    Perspective,
    StereoPerspective,
)
from lightdepth.cameras.topology import Rectangle  # noqa: E402
from lightdepth.directions import pixel_directions  # noqa: E402


def directions_of(camera):
    """Of the rays through all pixel centres, camera space, shape (height, width, 3)."""
    width, height = camera.resolution
    x, y = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    film = mi.Point2f(x.ravel().astype(np.float32), y.ravel().astype(np.float32))
    _, direction, _ = camera.camera_rays(film, mi.Point2f(0.5))
    return direction.numpy().T.reshape(height, width, 3)


def test_a_panorama_goes_on_around_its_seam_and_over_its_poles():
    camera = Equirectangular(type="equirectangular", width=24)
    (chart,) = camera.topology.charts
    window = camera.topology.window(chart, chart, 5)
    found = window.cut(directions_of(camera))
    # The formulas of the projection, taken beyond the film.
    theta = np.pi * (np.arange(-5, 17) + 0.5)[:, None] / 12
    phi = 2 * np.pi * ((np.arange(-5, 29) + 0.5)[None, :] / 24 - 0.5)
    expected = np.stack(
        np.broadcast_arrays(np.sin(theta) * np.sin(phi), np.sin(theta) * np.cos(phi), np.cos(theta)), -1
    )
    np.testing.assert_allclose(found, expected, atol=1e-5)
    np.testing.assert_array_equal(found[window.inner], directions_of(camera))


@pytest.mark.parametrize(
    "camera", [Fisheye(type="fisheye", width=24), Perspective(type="perspective", width=30, height=20)]
)
def test_a_picture_with_edges_ends_there(camera):
    topology = camera.topology
    (chart,) = topology.charts
    image = directions_of(camera)
    np.testing.assert_array_equal(topology.window(chart, chart, 4).cut(image), image)
    window = topology.window(chart, Rectangle(3, 16, 0, 10), 4)
    np.testing.assert_array_equal(window.cut(image), image[:20, :14])
    np.testing.assert_array_equal(window.cut(image)[window.inner], image[3:16, :10])


def test_pixels_of_a_panorama_lie_where_the_photographs_do():
    camera = Equirectangular(type="equirectangular", width=24)
    np.testing.assert_allclose(directions_of(camera), pixel_directions(12, 24), atol=1e-6)


@pytest.mark.parametrize("layout", ["top-bottom", "side-by-side"])
def test_the_views_of_two_eyes_are_panoramas_each_by_itself(layout):
    camera = OmnidirectionalStereo(type="ods", width=48, layout=layout)
    image = directions_of(camera)
    single = Equirectangular(type="equirectangular", width=camera.topology.charts[0].width)
    (whole,) = single.topology.charts
    expected = single.topology.window(whole, whole, 3).cut(directions_of(single))
    assert camera.topology.views == ("left", "right")
    for chart in camera.topology.charts:
        np.testing.assert_allclose(camera.topology.window(chart, chart, 3).cut(image), expected, atol=1e-6)


@pytest.mark.parametrize(
    ("camera", "least", "most"),
    [
        (Cubemap(type="cubemap", width=192, layout="strip"), 0.3, 1.0),
        (Cubemap(type="cubemap", width=96), 0.3, 1.0),
        # From the middle of a face to its corners, pixels shrink by a third.
        (EquiAngularCubemap(type="eac", width=96), 0.5, 0.25 * np.pi),
    ],
    ids=["strip", "3x2", "eac"],
)
def test_faces_of_a_cube_go_on_as_their_neighbours(camera, least, most):
    image, size, margin = directions_of(camera), 32, 12
    number = np.arange(image[..., 0].size).reshape(image.shape[:2])
    for chart in camera.topology.charts:
        window = camera.topology.window(chart, chart, margin)
        found, pixels = window.cut(image), window.cut(number)
        np.testing.assert_array_equal(found[window.inner], image[chart.slices])
        for over_edge, which in ((found, pixels), (found.swapaxes(0, 1), pixels.swapaxes(0, 1))):
            strip = over_edge[:, margin:-margin]
            # From pixel to pixel, over the edges as well, no direction is farther than in the middle of a face.
            step = np.linalg.norm(np.diff(strip, axis=0), axis=-1)
            assert step.max() < 1.001 * most * 2 / size
            assert step.min() > least * 2 / size
            assert len(np.unique(which[:, margin:-margin])) == strip[..., 0].size
        # Beyond the corners are pixels of the two neighbours there, far less than a face away.
        corner = np.sum(found[:margin, :margin] * image[chart.slices][0, 0], axis=-1)
        assert corner.min() > np.cos(2 * np.sqrt(2) * margin / size)


def _normal(face):
    """The direction of a face's middle."""
    middle = face.mean(axis=(0, 1))
    return middle / np.linalg.norm(middle)


def test_a_cubes_faces_lie_as_ffmpeg_has_them():
    """The filter v360's order "rludfb", each seen from inside; up and down have the front at their bottom and top."""
    image = directions_of(Cubemap(type="cubemap", width=30))
    middles = {"r": (5, 5), "l": (5, 15), "u": (5, 25), "d": (15, 5), "f": (15, 15), "b": (15, 25)}
    wanted = {"r": (1, 0, 0), "l": (-1, 0, 0), "u": (0, 0, 1), "d": (0, 0, -1), "f": (0, 1, 0), "b": (0, -1, 0)}
    for name, (row, column) in middles.items():
        face = image[row - 5 : row + 5, column - 5 : column + 5]
        np.testing.assert_allclose(_normal(face), wanted[name], atol=1e-6)
        if name in "rlfb":
            assert (face[0, :, 2] > 0.4).all()
    assert (image[9, 20:30, 1] > 0.4).all()
    assert (image[10, 0:10, 1] > 0.4).all()
    assert (image[15, 10:20, 0] > 0).tolist() == [False] * 5 + [True] * 5


@pytest.mark.parametrize(
    ("camera", "single"),
    [
        (VR180(type="vr180", width=40), None),
        (DomeStereo(type="dome_stereo", width=20, layout="top-bottom"), DomeMaster(type="dome_master", width=20)),
        (
            StereoPerspective(type="stereo_perspective", width=40, height=16),
            Perspective(type="perspective", width=20, height=16),
        ),
    ],
    ids=["vr180", "dome", "view"],
)
def test_the_pictures_of_two_eyes_end_where_the_other_begins(camera, single):
    image, topology = directions_of(camera), camera.topology
    assert topology.views == ("left", "right")
    for chart in topology.charts:
        found = topology.window(chart, chart, 3).cut(image)
        np.testing.assert_array_equal(found, image[chart.slices])
        if single is not None:  # Both eyes look in parallel.
            np.testing.assert_allclose(found, directions_of(single), atol=1e-6)


def test_faces_are_named_in_the_order_of_the_film():
    camera = Cubemap(type="cubemap", width=6, layout="separate")
    image = directions_of(camera)
    wanted = {"right": (1, 0, 0), "left": (-1, 0, 0), "up": (0, 0, 1), "down": (0, 0, -1)}
    wanted |= {"front": (0, 1, 0), "back": (0, -1, 0)}
    assert dict(zip(camera.topology.parts, camera.topology.charts, strict=True)).keys() == wanted.keys()
    for name, chart in zip(camera.topology.parts, camera.topology.charts, strict=True):
        assert chart.width == chart.height == 6
        np.testing.assert_allclose(_normal(image[chart.slices]), wanted[name], atol=1e-6)


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="ffmpeg is the referee")
@pytest.mark.parametrize(
    ("camera", "projection"),
    [
        (Cubemap(type="cubemap", width=48), "c3x2"),
        (Cubemap(type="cubemap", width=96, layout="strip"), "c6x1"),
        (EquiAngularCubemap(type="eac", width=48), "eac"),
    ],
    ids=["3x2", "strip", "eac"],
)
def test_cubes_are_those_of_ffmpeg(tmp_path, camera, projection):
    """The filter v360 turns a panorama of directions into each layout.

    FFmpeg repeats 2 pixels along the edges of ``eac``, whatever its size: hence the large picture, of which the middle of
    32 by 32 pixels is compared.
    """
    width, height, finer = 384, 192, 32
    colours = np.round((pixel_directions(height, width) * 0.5 + 0.5) * 65535).astype(np.uint16)
    (tmp_path / "in").write_bytes(np.moveaxis(colours[..., [1, 2, 0]], -1, 0).tobytes())  # Planes G, B, R.
    command = ["ffmpeg", "-v", "error", "-f", "rawvideo", "-pix_fmt", "gbrp16le", "-s", f"{width}x{height}"]
    options = "w={}:h={}".format(*(finer * size for size in camera.resolution))
    command += ["-i", "in", "-vf", f"v360=e:{projection}:{options}", "-f", "rawvideo", "-pix_fmt", "gbrp16le", "out"]
    subprocess.run(command, cwd=tmp_path, check=True)
    image = directions_of(camera)
    rows, columns = image.shape[:2]
    planes = np.fromfile(tmp_path / "out", np.uint16).reshape(3, rows, finer, columns, finer)[:, :, 16, :, 16]
    found = np.moveaxis(planes, 0, -1)[..., [2, 0, 1]] / 65535 * 2 - 1
    np.testing.assert_allclose(found, image, atol=0.02)

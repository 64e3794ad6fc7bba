"""Denoising: less error on the new layers, nothing else touched, no seams."""

import copy
import sys
from dataclasses import replace

import cv2
import numpy as np
import pytest

from lightdepth.kernel.start import start

start("cpu")

import mitsuba as mi  # noqa: E402

from lightdepth.cameras import VR180, Cubemap, DomeStereo, EquiAngularCubemap, OmnidirectionalStereo  # noqa: E402
from lightdepth.cameras.topology import Flat, Rectangle, Spherical  # noqa: E402
from lightdepth.directions import pixel_directions  # noqa: E402
from lightdepth.errors import SetupError  # noqa: E402
from lightdepth.film.denoising import (  # noqa: E402
    _boxes,
    _changed_tiles,
    _margins,
    _windows,
    denoise,
)
from lightdepth.film.frame import Frame  # noqa: E402
from lightdepth.parameters.denoising import DEFAULT  # noqa: E402

HEIGHT, WIDTH = 128, 256
PANORAMA = Spherical((Rectangle(0, HEIGHT, 0, WIDTH),))


def fixed(seed):
    """Random numbers that `tests.machine` does not change: denoising has none of its own, and the same input is given."""
    return np.random.Generator(np.random.PCG64(seed))


def panorama_frame(noise=True, seed=11):
    """A panorama of :func:`place_seen`."""
    return place_seen(pixel_directions(HEIGHT, WIDTH), PANORAMA, noise, seed)


def place_seen(direction, topology, noise=True, seed=11, contrast=0.4):
    """A striped floor with a soft shadow and a bright spot near the pole and across the seam, and one round object."""
    random = fixed(seed)
    stripes = 0.5 + contrast * np.sign(np.sin(40 * direction[..., 0]) * np.sin(40 * direction[..., 1]))
    plate = (stripes[..., None] * [1.0, 0.8, 0.5]).astype(np.float32)
    below = direction[..., 2] < -0.2
    down, behind = direction @ [0.3, -0.6, -0.742], direction @ [-0.05, -0.8, -0.598]
    taken = 0.6 / (1 + np.exp((0.75 - down) / 0.06)) * below
    added = 0.5 * np.exp((behind - 1) / 0.02) * below * (behind > 0.9)
    if noise:
        taken, added = (part * random.gamma(3.0, 1 / 3.0, part.shape) for part in (taken, added))
    change = plate * (added - taken)[..., None]
    covered = direction @ [0.0, -0.98, 0.2] > 0.9
    shade = 0.4 + 0.3 * direction[..., 0:1]
    synthetic = covered[..., None] * shade * (random.gamma(3.0, 1 / 3.0, (*covered.shape, 1)) if noise else 1.0)
    normal = np.where(below[..., None], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0])
    normal = np.where(covered[..., None], direction, normal)
    return Frame(
        plate,
        np.where(covered[..., None], 0, change).astype(np.float32),
        (synthetic * [0.9, 0.3, 0.2]).astype(np.float32),
        covered.astype(np.float32),
        np.ones(covered.shape, np.float32),
        normal=normal.astype(np.float32),
        albedo=np.where(covered[..., None], [0.9, 0.3, 0.2], plate).astype(np.float32),
        topology=topology,
    )


def rolled(frame, by):
    layers = {name: getattr(frame, name) for name in ("plate", "change", "synthetic", "coverage", "alpha", "normal")}
    return Frame(
        **{k: np.roll(v, by, axis=1) for k, v in layers.items()},
        albedo=np.roll(frame.albedo, by, axis=1),
        topology=PANORAMA,
    )


def rms(values):
    return float(np.sqrt(np.mean(np.square(values, dtype=np.float64))))


@pytest.fixture(scope="module")
def denoised():
    pytest.importorskip("mitsuba_oidn", reason="Open Image Denoise is not installed")
    return denoise(panorama_frame())


@pytest.mark.parametrize("layer", ["change", "synthetic"])
def test_the_error_falls(denoised, layer):
    truth, noisy = getattr(panorama_frame(noise=False), layer), getattr(panorama_frame(), layer)
    there = noisy.any(axis=2)
    assert rms((getattr(denoised, layer) - truth)[there]) < rms((noisy - truth)[there]) / 3
    assert abs((getattr(denoised, layer) - truth)[there].mean()) < 0.04 * np.abs(truth[there]).mean()


def test_nothing_else_is_touched(denoised):
    frame = panorama_frame()
    for layer in ("plate", "coverage", "alpha", "normal", "albedo"):
        np.testing.assert_array_equal(getattr(denoised, layer), getattr(frame, layer), strict=True)
    for layer in ("change", "synthetic"):
        nothing = ~getattr(frame, layer).any(axis=2)
        assert 0.2 < nothing.mean() < 1
        assert (getattr(denoised, layer)[nothing] == 0).all()
    untouched = ~frame.change.any(axis=2) & (frame.coverage == 0)
    np.testing.assert_array_equal(denoised.beauty[untouched], frame.plate[untouched])


def test_there_is_no_seam(denoised):
    """The panorama turned by half, whose seam lies elsewhere, is denoised to the same."""
    turned = denoise(rolled(panorama_frame(), WIDTH // 2))
    for layer in ("change", "synthetic"):
        expected = getattr(denoised, layer)
        difference = np.roll(getattr(turned, layer), -WIDTH // 2, axis=1) - expected
        assert np.abs(difference).max() < 0.01 * np.abs(expected).max()


def test_bands_meet_without_a_seam(denoised):
    banded = denoise(panorama_frame(), replace(DEFAULT, largest_box=1))
    assert rms(banded.change - denoised.change) < 0.1 * rms(denoised.change - panorama_frame().change)


def test_only_what_is_new_is_filtered(denoised):
    """Boxes around the layers' pixels, with their margins, and together all of these pixels."""
    frame = panorama_frame()
    frame.topology = Flat(WIDTH, HEIGHT)
    frame.change[:], frame.synthetic[:, 40:] = 0, 0
    frame.change[90:100, 200:204], frame.change[5, 7] = -0.1, 0.2
    (chart,) = frame.topology.charts
    tiles = np.zeros((HEIGHT // DEFAULT.tile, WIDTH // DEFAULT.tile), bool)
    tiles[[5, 6, 0], [12, 12, 0]] = True
    rectangles = [window.rectangle for window in _windows(frame.topology, chart, tiles, DEFAULT)]
    assert sorted((each.top, each.bottom, each.left, each.right) for each in rectangles) == [
        (0, 16, 0, 16),
        (80, 112, 192, 208),
    ]
    result = denoise(frame)
    assert (result.change[90:100, 200:204] < 0).all()
    assert not np.delete(result.change[90:100], range(200, 204), axis=1).any()


def test_boxes_hold_every_tile_and_little_else():
    """Of an L, whose long arms a single box would fill with what is not there."""
    tiles = np.zeros((40, 60), bool)
    tiles[:, :4], tiles[36:] = True, True
    boxes, held = _boxes(tiles, False, DEFAULT), np.zeros_like(tiles)
    for box in boxes:
        held[box.slices] = True
    assert (held >= tiles).all()
    assert sum(box.height * box.width for box in boxes) < 1.05 * tiles.sum()
    # Each is shown more where the layer goes on beyond it, and only there.
    assert all(_margins(box, tiles, False, DEFAULT).count(DEFAULT.wide_margin) in (1, 2) for box in boxes)


def test_a_smooth_change_is_denoised_without_the_network(denoised):
    """Its mean stays, far less noise is left, and beside an edge there is no step between both ways."""
    random = fixed(5)
    plate = np.full((96, 288, 3), 0.5, np.float32)
    shadow = np.where(np.arange(288) < 230, np.linspace(-0.03, -0.12, 288), -0.4).astype(np.float32)
    truth = 0.5 * shadow[None, :, None] + np.zeros_like(plate)
    noisy = truth * random.gamma(12.0, 1 / 12.0, (96, 288, 1)).astype(np.float32)
    nothing = np.zeros_like(plate)
    frame = Frame(plate, noisy, nothing, nothing[..., 0], nothing[..., 0] + 1.0)
    there, strong = _changed_tiles(frame, frame.topology.charts[0], np.float32(0.0), DEFAULT)
    assert there.all()
    tile = np.arange(18)
    assert (strong == ((tile >= 13) & (tile <= 15))).all()
    result = denoise(frame).change
    error = result - truth
    assert rms(error) < 0.1 * rms(noisy - truth)
    for beside in (slice(176, 208), slice(256, 280)):
        assert rms(error[:, beside].mean(axis=0)) < 0.03 * np.abs(truth[:, beside]).mean()


@pytest.mark.parametrize(("noise", "seen"), [(0.005, True), (0.1, False)])
def test_an_edge_that_stands_out_of_the_noise_is_left_to_the_network(noise, seen):
    plate = np.ones((96, 160, 3), np.float32)
    shadow = np.where(np.arange(160) < 88, -0.1, -0.14)[None, :, None] + fixed(6).normal(0.0, noise, (96, 160, 1))
    nothing = np.zeros_like(plate)
    frame = Frame(plate, nothing + shadow.astype(np.float32), nothing, nothing[..., 0], nothing[..., 0] + 1.0)
    _, strong = _changed_tiles(frame, frame.topology.charts[0], np.float32(0.0), DEFAULT)
    assert (strong.any(axis=0) == (seen & (np.abs(np.arange(10) - 5) <= 1))).all()


def test_an_ordinary_image_without_guides_is_denoised_as_well(denoised):
    frame, truth = panorama_frame(), panorama_frame(noise=False)
    frame.albedo = frame.normal = None
    frame.topology = Flat(WIDTH, HEIGHT)
    plain = denoise(frame)
    assert rms(plain.change - truth.change) < rms(frame.change - truth.change) / 2


def test_an_empty_frame_stays_empty(denoised):
    frame = panorama_frame()
    frame.change[:], frame.synthetic[:] = 0, 0
    result = denoise(frame)
    assert not result.change.any()
    assert not result.synthetic.any()


def test_a_missing_denoiser_is_reported(monkeypatch):
    monkeypatch.setitem(sys.modules, "mitsuba_oidn", None)
    with pytest.raises(SetupError, match=r"pip install 'lightdepth\[denoise\]'"):
        denoise(panorama_frame())


def directions_of(camera):
    """Of the rays through all pixel centres, shape (height, width, 3)."""
    width, height = camera.resolution
    x, y = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    film = mi.Point2f(x.ravel().astype(np.float32), y.ravel().astype(np.float32))
    return camera.camera_rays(film, mi.Point2f(0.5))[1].numpy().T.reshape(height, width, 3)


def steps(image, topology):
    """Differences of neighbouring pixels across the edges of charts, where neither is NaN."""
    found = []
    for chart in topology.charts:
        wide = topology.window(chart, chart, 1).cut(image)
        # Around a panorama's poles pixels of one row lie closer together than those of two.
        for part in (wide[1:-1].swapaxes(0, 1), *([] if len(topology.charts) == 2 else [wide[:, 1:-1]])):
            found += [part[1] - part[0], part[-1] - part[-2]]
    return np.concatenate([values[np.isfinite(values)] for values in found])


@pytest.mark.parametrize(
    "camera",
    [
        Cubemap(type="cubemap", width=384),
        EquiAngularCubemap(type="eac", width=384),
        OmnidirectionalStereo(type="ods", width=256),
    ],
    ids=["cubemap", "eac", "stereo"],
)
def test_charts_meet_without_a_seam(denoised, camera):
    """Across the edges of charts a twentieth of the noise is left at most; without topology, far more."""
    direction, topology = directions_of(camera), camera.topology
    noisy = place_seen(direction, topology, contrast=0.0)
    truth = place_seen(direction, topology, noise=False, contrast=0.0)
    changed = noisy.change.any(axis=2) & (direction[..., 2] < -0.25)
    there = changed & (cv2.Laplacian(changed.astype(np.float32), -1) == 0)

    def left(frame):
        found = steps(np.where(there[..., None], (frame.change - truth.change) / truth.plate, np.nan), topology)
        assert len(found) > 100
        return rms(found)

    assert left(denoise(noisy)) < 0.05 * left(noisy)
    height, width = noisy.coverage.shape
    assert left(denoise(replace(noisy, topology=Flat(width, height)))) > 0.1 * left(noisy)


@pytest.mark.parametrize(
    "camera",
    [VR180(type="vr180", width=256), DomeStereo(type="dome_stereo", width=128, fov=220)],
    ids=["vr180", "dome"],
)
def test_each_eye_is_denoised_by_itself(denoised, camera):
    """The picture of an eye does not depend on where what the other sees is, but both have the same scale."""
    noisy = place_seen(directions_of(camera), camera.topology)
    left, right = camera.topology.charts
    other = copy.deepcopy(noisy)
    for layer in (other.plate, other.change, other.synthetic, other.coverage):
        layer[right.slices] = np.roll(layer[right.slices], right.height // 2, axis=0)
    found, beside = (denoise(frame).change[left.slices] for frame in (noisy, other))
    assert rms(found - noisy.change[left.slices]) > 0.01
    np.testing.assert_array_equal(found, beside)


def test_precise_pixels_are_left_as_they_are(denoised):
    """No pixel changes by more than three of its standard errors, a firefly by six: more samples lead to the truth."""
    frame = panorama_frame()
    frame.variance = np.full(frame.plate.shape, 1e-4, np.float32)
    frame.change = np.maximum(frame.change, -frame.plate)  # More than there is cannot be taken away.
    result = denoise(frame)
    for layer in ("change", "synthetic"):
        change = np.abs(getattr(result, layer) - getattr(frame, layer))
        assert 0.02 < change.max() <= 0.01 * (3.0 + 8.0**0.5) + 1e-3
        assert np.quantile(change, 0.99) <= 0.0301


def test_single_samples_are_denoised(denoised):
    """Their variance is not known, and stored as none: that is not to be taken for precision."""
    frame = panorama_frame()
    frame.variance, frame.samples = np.zeros(frame.plate.shape, np.float32), np.ones(frame.coverage.shape, np.uint32)
    np.testing.assert_array_equal(denoise(frame).change, denoised.change)

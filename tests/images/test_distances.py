"""Images of distances as renderers, scanners and estimators write them."""

from pathlib import Path

import numpy as np
import OpenImageIO
import pytest

from lightdepth.directions import pixel_directions
from lightdepth.errors import InputError, InputWarning
from lightdepth.images.distances import along_rays, check_kind, likely_kind, read_distances, warn_of_sky, warn_of_unit
from lightdepth.images.exr import ExrPart, read_exr, write_exr
from lightdepth.parameters import DistancesParameters
from lightdepth.scene.depth import read_depth

FAULTS = Path(__file__).parents[1] / "faults"
FILE = Path("depth.exr")


def room(height=32, half=(3.0, 4.0, 1.4)):
    """Distances to the walls of a box around the capture point."""
    directions = pixel_directions(height, 2 * height)
    return (np.array(half) / np.maximum(np.abs(directions), 1e-12)).min(axis=2)


@pytest.mark.parametrize("name", ["layer_z", "rgb_and_layer_z"])
def test_the_only_distances_are_taken_whatever_their_layer_is_called(name):
    stored = read_exr(FAULTS / f"07-depth/{name}.exr")[0].channels["ViewLayer.Depth.Z"]
    distances, whole = read_distances(FAULTS / f"07-depth/{name}.exr")
    np.testing.assert_array_equal(distances, stored)
    assert not whole
    np.testing.assert_array_equal(read_depth(FAULTS / f"07-depth/{name}.exr"), stored)


def test_the_largest_half_float_is_sky():
    distances, _ = read_distances(FAULTS / "07-depth/sky_65504.exr")
    stored = read_exr(FAULTS / "07-depth/sky_65504.exr")[0].channels["Z"].astype(float)
    assert np.isinf(distances).sum() == (stored == 65504).sum() > 0
    np.testing.assert_array_equal(distances[stored < 65504], stored[stored < 65504])


@pytest.mark.parametrize("mark", [1e10, 1e9, 3.4e38, np.inf])
def test_the_background_of_renderers_is_sky(tmp_path, mark):
    depth = room().astype(np.float32)
    depth[:8] = mark
    write_exr(tmp_path / "x.exr", [ExrPart({"Z": depth})])
    np.save(tmp_path / "x.npy", depth)
    for name in ("x.exr", "x.npy"):
        assert np.isinf(read_depth(tmp_path / name)[:8]).all()


CHANNELS = {
    "Z beside layers": ({"Z": 1.0, "Normal.X": 2.0, "Normal.Y": 2.0, "Normal.Z": 2.0, "R": 3.0, "G": 4.0, "B": 5.0}, 1.0),
    "Blender": ({"ViewLayer.Depth.Z": 1.0, "ViewLayer.Position.X": 2.0, "ViewLayer.Position.Y": 2.0,
                 "ViewLayer.Position.Z": 2.0}, 1.0),
    "Blender with more": ({"ViewLayer.Depth.Z": 1.0, "ViewLayer.Mist.Z": 2.0, "ViewLayer.Denoising Depth.Z": 3.0}, 1.0),
    "an unusual channel": ({"Depth.V": 1.0, "R": 3.0, "G": 4.0, "B": 5.0}, 1.0),
    "its layer's name": ({"depth": 1.0, "R": 3.0, "G": 4.0, "B": 5.0}, 1.0),
    "the only channel": ({"Y": 1.0, "A": 0.5}, 1.0),
    "grey": ({"R": 1.0, "G": 1.0, "B": 1.0}, 1.0),
}  # fmt: skip


@pytest.mark.parametrize("name", CHANNELS)
def test_the_channel_of_distances_is_found(tmp_path, name):
    channels, expected = CHANNELS[name]
    planes = {channel: np.full((8, 16), value, np.float32) for channel, value in channels.items()}
    write_exr(tmp_path / "x.exr", [ExrPart(planes)])
    assert (read_distances(tmp_path / "x.exr")[0] == expected).all()


@pytest.mark.parametrize("name", ["ZDepth", "VRayZDepth.R", "Z depth.R", "linear_depth"])
def test_other_programs_names_are_known(tmp_path, name):
    planes = {own: np.full((8, 16), 0.5, np.float32) for own in "RGB"}
    write_exr(tmp_path / "x.exr", [ExrPart(planes | {name: np.full((8, 16), 7.0, np.float32)})])
    assert (read_distances(tmp_path / "x.exr")[0] == 7.0).all()


def test_distances_may_stand_in_three_channels_of_their_layer(tmp_path):
    planes = {own: np.full((8, 16), 0.5, np.float32) for own in "RGB"}
    for last, same in ((7.0, True), (8.0, False)):
        depth = {f"FinalImageWorldDepth.{own}": np.full((8, 16), 7.0, np.float32) for own in "RGA"}
        depth["FinalImageWorldDepth.B"] = np.full((8, 16), last, np.float32)
        write_exr(tmp_path / "x.exr", [ExrPart(planes | depth)])
        if same:
            assert (read_distances(tmp_path / "x.exr")[0] == 7.0).all()
        else:
            with pytest.raises(InputError, match="holds a colour picture"):
                read_distances(tmp_path / "x.exr")


def test_a_part_of_its_own_is_found(tmp_path):
    colour = ExrPart({name: np.full((8, 16), value, np.float32) for name, value in zip("RGB", (2, 3, 4))}, "beauty")
    write_exr(tmp_path / "x.exr", [colour, ExrPart({"Y": np.ones((8, 16), np.float32)}, "depth")])
    assert (read_distances(tmp_path / "x.exr")[0] == 1.0).all()


def test_a_channel_may_be_stated(tmp_path):
    planes = {name: np.full((8, 16), value, np.float32) for name, value in (("Near.Z", 1), ("Far.Z", 2))}
    write_exr(tmp_path / "x.exr", [ExrPart(planes, "a"), ExrPart({"Near.Z": planes["Far.Z"]}, "b")])
    for channel, expected in (("Far.Z", 2.0), ("a.Near.Z", 1.0), ("b.Near.Z", 2.0)):
        assert (read_distances(tmp_path / "x.exr", channel)[0] == expected).all()
    for channel in ("Near.Z", "Z"):
        with pytest.raises(InputError, match=r"none of its channels, or several; allowed: a.Far.Z, a.Near.Z, b.Near.Z"):
            read_distances(tmp_path / "x.exr", channel)
    np.save(tmp_path / "x.npy", room())
    with pytest.raises(InputError, match="has no channels with names"):
        read_distances(tmp_path / "x.npy", "Z")


def test_what_is_not_clear_is_refused(tmp_path):
    ones = np.ones((8, 16), np.float32)
    files = {
        "colour": [ExrPart({"R": ones, "G": 2 * ones, "B": ones})],
        "two": [ExrPart({"Near.Z": ones, "Far.Z": ones})],
        "mist": [ExrPart({"L.Mist.Z": ones, "L.Combined.R": ones})],
        "fog": [ExrPart({"Mist.Z": ones})],
        "normal": [ExrPart({"N.X": ones, "N.Y": ones, "N.Z": ones})],
    }
    for name, parts in files.items():
        write_exr(tmp_path / f"{name}.exr", parts)
    np.save(tmp_path / "whole.npy", np.ones((8, 16), np.uint16))
    np.save(tmp_path / "complex.npy", np.ones((8, 16), complex))
    np.save(tmp_path / "objects.npy", np.array([None] * 128).reshape(8, 16))
    for path, message in {
        tmp_path / "colour.exr": r"holds a colour picture \(R, G, B\), and no channel of distances",
        tmp_path / "two.exr": "several channels of distances, 'Far.Z', 'Near.Z'",
        tmp_path / "mist.exr": r"no channel of distances \(Z\), but L.Combined.R, L.Mist.Z",
        tmp_path / "fog.exr": r"no channel of distances \(Z\), but Mist.Z; .*--channel",
        tmp_path / "normal.exr": r"no channel of distances \(Z\), but N.X, N.Y, N.Z",
        tmp_path / "whole.npy": "holds whole numbers, whose unit is not known",
        tmp_path / "complex.npy": "holds complex128; distances are numbers",
        tmp_path / "objects.npy": "damaged, cut off, or holds Python objects",
        FAULTS / "28-depth/npz_called_npy.npy": r"is an archive of arrays \(.npz\), though it is named .npy",
        FAULTS / "28-depth/zdepth.npy": "negative behind the viewing axis: distances along that axis",
    }.items():
        with pytest.raises(InputError, match=message) as caught:
            read_depth(path)
        assert str(caught.value).startswith(str(path))


def test_kinds_are_distinguished_and_converted():
    truth = room()
    forward = pixel_directions(*truth.shape)[..., 1]
    kinds = {"ray": truth, "z": truth * np.abs(forward), "disparity": 2.0 / truth}
    for kind, values in kinds.items():
        assert likely_kind(values) == kind
        back = along_rays(values, kind, 2.0 if kind == "disparity" else 1.0)
        known = np.isfinite(back)
        assert known.mean() > 0.97
        np.testing.assert_allclose(back[known], truth[known], rtol=1e-9)
    assert likely_kind(truth * forward) == "z"
    assert likely_kind(truth * forward, DistancesParameters(fewest_known=truth.size + 1)) == "ray"
    np.testing.assert_array_equal(along_rays(truth * forward, "z"), along_rays(truth * np.abs(forward), "z"))
    assert np.isinf(along_rays(np.zeros((8, 16)), "disparity")).all()
    assert np.isnan(along_rays(np.full((8, 16), np.nan), "disparity")).all()


@pytest.mark.parametrize("half", [(50.0, 80.0, 1.6), (0.5, 0.5, 0.5), (3.0, 4.0, 20.0)])
def test_ordinary_rooms_raise_no_doubts(half):
    depth = room(half=half)
    depth[:4] = np.inf
    depth[20, 5:9] = np.nan
    depth[-2:] = 0.0  # A tripod that was not measured.
    check_kind(FILE, depth)
    warn_of_sky(FILE, depth)
    warn_of_unit(FILE, depth)


def test_doubts_are_reported():
    truth = room()
    forward = pixel_directions(*truth.shape)[..., 1]
    for values, message in ((truth * np.abs(forward), "--kind z"), (1.0 / truth, "--kind disparity")):
        with pytest.warns(InputWarning, match=message):
            check_kind(FILE, values)
    horizon = truth.copy()
    horizon[:10] = 1000.0
    clamped = np.minimum(truth, 3.2)
    far = truth.copy()
    far[:2, :3] = [[1e5, 1e6, 1e7]]
    for reported, values, message in (
        (warn_of_unit, truth * 1000.0, "half of its distances are above"),
        (warn_of_unit, truth / truth.max(), "end at 1; if they are normalised"),
        (
            warn_of_sky,
            horizon,
            r"640 pixels have the same distance, 1000, and all others at most 5.\d+; if that means the sky",
        ),
        (
            warn_of_sky,
            clamped,
            r"\d+ pixels have the same distance, 3.2, and all others at most 3.\d+; if that means the sky",
        ),
        (warn_of_sky, far, r"its distances go up to 1e\+07 m; if that means the sky"),
    ):
        with pytest.warns(InputWarning, match=message):
            reported(FILE, values)


def test_a_png_of_another_kind_is_named(tmp_path):
    (tmp_path / "x.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    with pytest.raises(InputError, match="not a readable PNG file"):
        read_distances(tmp_path / "x.png")
    assert OpenImageIO.geterror() == ""

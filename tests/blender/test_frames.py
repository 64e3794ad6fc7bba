"""What Blender makes of the engine's pictures, and that none is written where something failed."""

import json

import numpy as np
import pytest

from lightdepth.film.cryptomatte import matte_id
from lightdepth.images.exr import read_exr


@pytest.fixture(scope="module")
def made(blender, tmp_path_factory):
    folder = tmp_path_factory.mktemp("frames")
    return folder, blender.run("frames", folder)


def _channels(path, layer="ViewLayer"):
    channels = {}
    for part in read_exr(path):
        channels |= {name.removeprefix(f"{layer}."): pixels for name, pixels in part.channels.items() if layer in name}
    return channels


def _picture(channels, name, letters="RGB"):
    return np.stack([channels[f"{name}.{letter}"] for letter in letters], axis=-1)


def test_the_compositor_gets_every_pass(made):
    folder, _ = made
    channels = _channels(folder / "passes.exr")
    combined = _picture(channels, "Combined")
    assert combined.min() > 0.0
    np.testing.assert_allclose(np.load(folder / "combined.npy")[..., :3], combined, rtol=1e-5)
    np.testing.assert_allclose(np.load(folder / "sum.npy")[..., :3], combined, rtol=1e-4, atol=1e-5)


def test_pass_indices_are_blenders(made):
    channels = _channels(made[0] / "passes.exr")
    index, number = channels["IndexOB.X"], channels["Object ID.X"]
    assert set(np.unique(index)) == {0.0, 7.0}
    np.testing.assert_array_equal(index == 7.0, number == 1.0)
    material = channels["IndexMA.X"]
    assert set(np.unique(material)) == {0.0, 2.0, 3.0}
    # The camera looks at the seam of the ball's halves, which is in the middle of the picture.
    middle = material.shape[1] // 2
    assert not (material[:, :middle] == 3.0).any()
    assert not (material[:, middle:] == 2.0).any()
    whole = channels["Coverage.Y"] == 1.0
    assert (material[whole] > 0.0).all()


def test_mattes_are_of_blenders_objects(made):
    folder, found = made
    channels = _channels(folder / "passes.exr")
    header = {key: value for part in read_exr(folder / "passes.exr") for key, value in part.header.items()}
    wanted = {"CryptoObject": [found["ball"]], "CryptoMaterial": ["Left", "Right"], "CryptoAsset": ["Toys"]}
    for layer, names in wanted.items():
        manifests = [
            header[key[:-4] + "manifest"] for key, value in header.items() if str(value) == f"ViewLayer.{layer}"
        ]
        ids = {name: matte_id(name) for name in names}
        assert [json.loads(manifest) for manifest in manifests] == [{name: f"{id_:08x}" for name, id_ in ids.items()}]
        share = np.zeros_like(channels["Coverage.Y"])
        for index in range(2):
            for number, part in ("RG", "BA"):
                here = channels[f"{layer}{index:02}.{number}"].view(np.uint32)
                assert set(np.unique(here)) <= {0, *ids.values()}
                share += np.where(here != 0, channels[f"{layer}{index:02}.{part}"], 0.0)
        # The mattes have more samples than the picture.
        coverage = channels["Coverage.Y"]
        assert share.sum() == pytest.approx(coverage.sum(), rel=0.05)
        np.testing.assert_allclose(share, coverage, atol=0.6)
        assert share.max() == pytest.approx(1.0, abs=1e-6)


def test_a_transparent_film_lies_over_the_photograph(made):
    folder, _ = made
    channels = _channels(folder / "passes.exr")
    film = np.load(folder / "transparent.npy")
    colour, alpha = film[..., :3], film[..., 3:]
    coverage = channels["Coverage.Y"]
    assert (alpha[..., 0] >= coverage - 1e-6).all()
    assert ((alpha[..., 0] > coverage + 0.01) & (coverage == 0.0)).sum() > 20  # the shadow
    assert (alpha == 0.0).sum() > 100
    # Straight or premultiplied, laid over the plate it is the finished picture.
    over = colour + _picture(channels, "Plate") * (1.0 - alpha)
    np.testing.assert_allclose(over, _picture(channels, "Combined"), rtol=1e-3, atol=1e-3)


def test_a_region_is_that_part_of_the_picture(made):
    folder, _ = made
    for part, whole, rows, columns in (
        ("region", "passes", slice(12, 27), slice(10, 30)),
        ("panorama region", "pano", slice(8, 18), slice(10, 30)),
    ):
        expected = _picture(_channels(folder / f"{whole}.exr"), "Plate")[rows, columns]
        found = _picture(_channels(folder / f"{part}.exr"), "Plate")
        np.testing.assert_allclose(found, expected, rtol=2e-3, err_msg=part)


def test_both_eyes_of_a_lens_are_cameras_beside_each_other(made):
    folder, _ = made
    left, right, alone = (_channels(folder / f"{name}.exr") for name in ("stereo_L", "stereo_R", "left eye"))
    for name in ("Combined", "Plate", "Depth"):
        letters = "Z" if name == "Depth" else "RGB"
        expected = _picture(alone, name, letters)
        np.testing.assert_allclose(_picture(left, name, letters), expected, rtol=1e-4, atol=1e-4, err_msg=name)
        assert np.abs(_picture(right, name, letters) - expected).max() > 0.05


def test_spherical_stereo_has_an_eye_at_each_end_of_a_turning_line(made):
    folder, _ = made
    middle = slice(19, 21)  # where the left eye is on the camera's left
    eyes = {name: _picture(_channels(folder / f"ods_{name[0]}.exr"), "Plate")[:, middle] for name in ("Left", "Right")}
    alone = {name: _picture(_channels(folder / f"ods {name.lower()}.exr"), "Plate")[:, middle] for name in eyes}
    apart = np.abs(alone["Left"] - alone["Right"]).mean()
    assert apart > 0.01
    for name, picture in eyes.items():  # of two samples a pixel of nine degrees
        assert np.abs(picture - alone[name]).mean() < 0.2 * apart


def test_each_view_layer_has_its_own_objects(made):
    folder, _ = made
    assert _channels(folder / "layers.exr")["Coverage.Y"].max() == 1.0
    assert _channels(folder / "layers.exr", "Without")["Coverage.Y"].max() == 0.0


def test_what_fails_is_told_and_no_picture_is_written(made):
    _, found = made
    for said in found["failed"]:
        assert "full of eels" in said
    assert "No such file" in found["no folder"] or "gone" in found["no folder"]
    assert found["written"] == []


def test_worlds_scenes_and_slots_keep_what_is_the_users(made):
    _, found = made
    assert found["world"] == ["lightdepth panorama", "The user's"]
    assert found["while support"] == "lightdepth projection"
    assert found["slot again"] == ["OBJECT", "Blue"]
    assert found["two scenes"]
    assert found["worlds kept"]
    assert found["world again"] == "The user's"

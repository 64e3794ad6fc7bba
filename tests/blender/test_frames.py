"""What Blender makes of the engine's pictures, and that none is written where something failed."""

import numpy as np
import pytest

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

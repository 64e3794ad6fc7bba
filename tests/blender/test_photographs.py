"""Several panoramas as several capture empties, and a plate as a camera's background image."""

import json
import tomllib

import numpy as np
import pytest
from PIL import Image

from lightdepth.directions import euler_rotation
from lightdepth.images.radiance import read_radiance, write_radiance
from lightdepth.scene.load import load_scene

WIDTH = 256
SECOND = {"position": [2.6, 2.9, 1.4], "rotation": [-2.0, 1.0, 140.0]}
PLATE_SIZE = 300, 200


@pytest.fixture(scope="module")
def folder(room, tmp_path_factory):
    folder = tmp_path_factory.mktemp("photographs")
    places = np.array(SECOND["position"]), np.array(SECOND["rotation"])
    write_radiance(folder / "first.exr", room.radiance(WIDTH))
    write_radiance(folder / "second.exr", room.radiance(WIDTH, *places))
    write_radiance(folder / "plate.exr", room.photo(PLATE_SIZE[0]) / np.float32(255))
    Image.new("L", (WIDTH, WIDTH // 2), 255).save(folder / "mask.png")
    start, end, top = room.DOOR
    left, right, sill, head = room.WINDOW
    x, y, _ = room.HIGH
    points = np.array(
        [
            *room.RUG[1:],
            (x, start, 0),
            (x, start, top),
            (x, end, top),
            (left, y, sill),
            (right, y, head),
            (left, y, head),
        ]
    )
    shares = np.array([WIDTH, WIDTH / 2])
    edges = [
        (name[0].upper(), *(room.photo_pixels(ends[[0, -1]]) / room.PHOTO.resolution).tolist())
        for name, ends in room.photo_lines()
    ]
    truth = {
        "first": {"position": room.POSITION.tolist(), "rotation": room.ROTATION.tolist()},
        "floor": room.FLOOR[:, :2].tolist(),
        "height": float(room.HIGH[2]),
        "in first": (room.pixels(points, WIDTH) / shares).tolist(),
        "in second": (room.pixels(points, WIDTH, *places) / shares).tolist(),
        "in plate": (room.photo_pixels(points) / room.PHOTO.resolution).tolist(),
        "edges": edges,
        "ball": [1.0, 1.2, 0.3],
    }
    (folder / "truth.json").write_text(json.dumps(truth))
    (folder / "numbered.toml").write_text('[panorama]\nimage = "first.####.exr"\n')
    (folder / "none.toml").write_text("[render]\nsamples = 4\n")
    return folder


@pytest.fixture(scope="module")
def found(blender, folder):
    return blender.run("photographs", folder)


def _off(pose, rotation) -> float:
    """Degrees between a matrix and a rotation."""
    turned = np.array(pose)[:3, :3].T @ rotation
    return float(np.degrees(np.arccos(np.clip((np.trace(turned) - 1.0) / 2.0, -1.0, 1.0))))


def test_clicked_points_place_the_second_capture_point(found):
    assert _off(found["second"], euler_rotation(SECOND["rotation"])) < 0.02
    np.testing.assert_allclose(np.array(found["second"])[:3, 3], SECOND["position"], atol=0.002)
    assert found["report"].startswith("Pose solved from 9 points, residual 0.0")
    assert found["shown"] == [1, "second.exr"]
    assert found["asked to snap"] == [False, True]


def test_a_click_counts_on_the_picture_that_is_asked_for(found):
    on_the_first, on_the_second = found["clicks"]
    assert on_the_first is None
    assert len(on_the_second) == 2


def test_clicked_points_and_edges_give_the_plates_camera(found, room, folder):
    assert found["resolution"] == list(PLATE_SIZE)
    camera = tomllib.loads((folder / "once.toml").read_text())["camera"]["Camera"]
    # Blender keeps the places of clicks in single precision.
    assert camera["fov"] == pytest.approx(room.PHOTO.fov, abs=0.02)
    np.testing.assert_allclose(camera["distortion"], room.PHOTO.distortion, atol=0.003)
    np.testing.assert_allclose(camera["position"], room.PHOTO_POSITION, atol=0.003)
    assert _off(euler_rotation(camera["rotation"]), room.PHOTO_ROTATION) < 0.02
    assert found["plate report"].startswith("Camera solved, residual 0.0")


def test_the_panels_name_what_there_is(found):
    operators = {"add_panorama", "clear_clicks", "click_axis_line", "click_shared_points", "import_photographs"}
    operators |= {"load_plate", "relate_panorama", "remove_panorama", "solve_plate"}
    assert {name.removeprefix("lightdepth.") for name in found["drawn"] if "." in name} == operators
    assert {"shown", "image", "capture", "gain", "mask", "retouched", "snap", "use", "solve_distortion"} <= set(
        found["drawn"]
    )


def test_photographs_go_to_a_scene_file_and_back(found, folder):
    scene = load_scene(folder / "once.toml")
    assert scene.further[0].mask is not None
    assert scene.panorama.plate is not None
    assert scene.plate.camera == "Camera"
    np.testing.assert_allclose(scene.plate.gain, [0.9, 1.0, 1.1], rtol=1e-6)
    once, twice = (tomllib.loads((folder / name).read_text()) for name in ("once.toml", "twice.toml"))
    assert len(once["panorama"]) == len(twice["panorama"]) == 2
    tables = [(a, b) for a, b in zip(once["panorama"], twice["panorama"], strict=True)]
    tables += [(once["plate"], twice["plate"]), (once["camera"]["Camera"], twice["camera"]["Camera"])]
    for before, after in tables:
        assert before.keys() == after.keys()
        for key, value in before.items():
            if isinstance(value, (list, float)):
                np.testing.assert_allclose(after[key], value, rtol=1e-5, atol=1e-5, err_msg=key)
            else:
                assert after[key] == value
    assert found["empties"] == ["Capture point", "Capture point 2"]
    assert found["left"] == ["Capture point"]
    assert any("its plate is left out; a scene has one" in note for note in found["notes"])


def test_untouched_pixels_are_the_plates(found, folder):
    plate, whole, part = (
        read_radiance(folder / "plate.exr"),
        np.load(folder / "whole.npy"),
        np.load(folder / "part.npy"),
    )
    same = (whole[..., :3] == plate).all(axis=-1)
    assert 0.5 < same.mean() < 0.99
    height, width = plate.shape[:2]
    np.testing.assert_array_equal(part, whole[: height // 2, width // 4 : 3 * width // 4])


def test_what_cannot_be_is_refused_in_words(found):
    assert "poll" in found["before a panorama"]
    assert "plate.exr has 300 x 200 pixels; a panorama is twice as wide as high" in found["no panorama"]
    assert "No point was clicked" in found["before clicks"]
    assert found["nothing clicked"]
    assert "its plate 'plate.exr' has 300 x 200 pixels, the picture 600 x 200" in found["another size"]
    missing, numbered, none = found["refused"]
    assert "missing.toml cannot be read" in missing
    assert "numbered files are not taken over" in numbered
    assert "its photographs cannot be read" in none

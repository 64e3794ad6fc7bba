"""Level and walls from straight edges found in the panorama."""

import cv2
import numpy as np
import pytest

from lightdepth.calibration.arcs import Arcs
from lightdepth.calibration.line_detection import detect_arcs
from lightdepth.calibration.rectangle import FloorRectangle
from lightdepth.calibration.room_frame import RoomFrame, find_room_frame
from lightdepth.calibration.solve import Cues, calibrate
from lightdepth.directions import (
    direction_to_latlong,
    euler_rotation,
    latlong_to_direction,
    pixel_directions,
    rotation_to_euler,
)
from lightdepth.errors import InputError
from lightdepth.images.radiance import read_radiance
from lightdepth.images.validation import validate_panorama
from lightdepth.parameters import CalibrationParameters
from tests.calibration.calibration_helpers import angle_between

CAFE_PLUMB_EDGES = Arcs(
    latlong_to_direction(
        *np.moveaxis(
            np.array(
                [
                    [[61.1, 195.5], [61.2, 281.5]],
                    [[66.8, 190.5], [67.4, 291.5]],
                    [[80.7, 190.5], [80.6, 291.5]],
                    [[85.0, 193.5], [85.5, 306.5]],
                    [[187.8, 193.5], [188.5, 296.5]],
                    [[199.3, 193.5], [200.6, 304.5]],
                    [[453.5, 134.5], [454.9, 350.5]],
                    [[497.3, 145.5], [497.0, 258.5]],
                    [[814.3, 195.5], [813.5, 291.5]],
                    [[899.8, 185.5], [899.0, 332.5]],
                    [[912.0, 188.5], [911.6, 294.5]],
                    [[914.2, 195.5], [913.7, 294.5]],
                    [[1000.6, 203.5], [1000.5, 283.5]],
                    [[1012.5, 203.5], [1012.4, 286.5]],
                ]
            )
            / [1024, 512],
            -1,
            0,
        )
    )
)
"""Edges of pilasters, panels and the pillar in comfy_cafe_1k.hdr: the top and bottom of straight lines fitted to the
steepest change of brightness in each row between. All that were long enough and straight within 0.05 degrees."""


def turned(radiance: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """The panorama as a camera turned by the rotation's inverse sees it: old light space to new is the rotation."""
    height, width = radiance.shape[:2]
    u, v = direction_to_latlong(pixel_directions(height, width) @ rotation)
    padded = np.concatenate([radiance[:, -2:], radiance, radiance[:, :2]], axis=1)
    column, row = (u * width + 1.5).astype(np.float32), (v * height - 0.5).astype(np.float32)
    return cv2.remap(padded, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)


def error_of_heading(found: np.ndarray, truth: np.ndarray) -> float:
    """Degrees between two rotations about z, walls being alike after a quarter turn."""
    x, y, _ = (found @ truth.T)[:, 1]
    return abs((np.degrees(np.arctan2(x, y)) + 45.0) % 90.0 - 45.0)


def test_edges_of_the_virtual_room_are_found_exactly(room):
    """The edge between the ceiling and the wall at the far end of y: the longest arc found along it lies on it."""
    arcs = detect_arcs(room.radiance(512))
    ends = (np.array([room.LOW, room.HIGH]) * [1, 0, 0] + room.HIGH * [0, 1, 1] - room.POSITION) @ euler_rotation(
        room.ROTATION
    )
    edge = Arcs(ends / np.linalg.norm(ends, axis=1, keepdims=True))
    near = np.abs(np.degrees(np.arcsin(arcs.ends @ edge.normal[0]))).max(axis=1) < 1.0
    found = arcs.take(near)
    assert np.degrees(found.length.max()) > 15
    longest = found.take([np.argmax(found.length)])
    assert np.abs(np.degrees(np.arcsin(longest.ends @ edge.normal[0]))).max() < 0.2 * 360 / 512  # A fifth of a pixel.
    long = detect_arcs(room.radiance(512), tuned=CalibrationParameters(edge_shortest=15.0))
    np.testing.assert_array_equal(long.ends, arcs.take(np.degrees(arcs.length) > 15.0).ends)


def test_the_virtual_room_is_levelled_and_aligned(room, poses):
    for _ in range(3):
        rotation = poses.rotation()
        position = room.POSITION + poses.random.uniform(-0.5, 0.5, 3)
        frame = find_room_frame(detect_arcs(room.radiance(512, position, rotation_to_euler(rotation))))
        assert angle_between(frame.rotation[2], rotation[2]) < 0.2
        assert error_of_heading(frame.rotation, rotation) < 0.2
        assert frame.confidence > 0.9
        assert frame.residual < 0.2


@pytest.mark.parametrize(
    "name",
    ["lebombo_1k.hdr", "interior_hotelroom_1k.exr", "vestibule_1k.hdr", "comfy_cafe_1k.hdr", "thatch_chapel_1k.hdr"],
)
def test_real_rooms_are_levelled(shared_data, poses, name):
    """Against the panorama's level, where that was seen to lean the one measured, and the original's own result."""
    path = shared_data / "hdr" / name
    if not path.is_file():
        pytest.skip(f"{name} is absent")
    radiance = validate_panorama(read_radiance(path), path, repair=True)
    turn = poses.rotation(tilt=35.0)
    frame = find_room_frame(detect_arcs(turned(radiance, turn)))
    up = calibrate(Cues(verticals=CAFE_PLUMB_EDGES)).rotation[2] if name == "comfy_cafe_1k.hdr" else [0.0, 0.0, 1.0]
    assert angle_between(frame.rotation[2] @ turn, np.array(up)) < 0.5
    original = find_room_frame(detect_arcs(radiance))
    assert angle_between(frame.rotation[2] @ turn, original.rotation[2]) < 0.3
    assert error_of_heading(frame.rotation @ turn, original.rotation) < 1.0
    assert min(frame.confidence, original.confidence) > 0.7


def test_the_cafe_leans_by_its_own_plumb_edges(shared_data):
    """The fourteen edges agree with each other, and not with the panorama's zenith."""
    if not (shared_data / "hdr/comfy_cafe_1k.hdr").is_file():
        pytest.skip("the real panorama is absent")
    level = calibrate(Cues(verticals=CAFE_PLUMB_EDGES))
    assert level.tilt == pytest.approx(0.48, abs=0.05)
    assert level.residual < 0.08
    assert np.sqrt(np.mean(CAFE_PLUMB_EDGES.deviation([0.0, 0.0, 1.0]) ** 2)) > 2 * level.residual


def test_a_meadow_gets_no_confidence(shared_data):
    path = shared_data / "hdr/noon_grass_1k.hdr"
    if not path.is_file():
        pytest.skip("the real panorama is absent")
    frame = find_room_frame(detect_arcs(read_radiance(path)))
    assert frame.confidence < 0.5
    found = calibrate(Cues(room=frame))
    assert any("automatic directions are doubtful" in warning for warning in found.warnings)


def test_random_edges_get_no_confidence():
    ends = np.random.default_rng(2).normal(size=(300, 1, 3))
    ends = np.concatenate([ends, ends + 0.2 * np.random.default_rng(3).normal(size=(300, 1, 3))], axis=1)
    frame = find_room_frame(Arcs(ends / np.linalg.norm(ends, axis=2, keepdims=True)))
    assert frame.confidence < 0.5


def test_an_empty_panorama_is_refused():
    with pytest.raises(InputError, match="0 straight edges found, at least 20 are needed"):
        find_room_frame(detect_arcs(np.ones((128, 256, 3), dtype=np.float32)))
    with pytest.raises(InputError, match="3 straight edges found, at least 4 are needed"):
        find_room_frame(Arcs(np.eye(3)[[[0, 1], [1, 2], [2, 0]]]), tuned=CalibrationParameters(frame_fewest_edges=4))


def frame_of(rotation: np.ndarray, confidence: float = 1.0) -> RoomFrame:
    """A frame as if it had been found."""
    return RoomFrame(rotation, confidence, 0.2, 0.2, 0.1, Arcs(np.empty((0, 2, 3))), np.empty(0, dtype=np.int64))


def test_walls_found_help_noisy_clicks(room, poses):
    alone, together = [], []
    for _ in range(30):
        rotation = poses.rotation()
        seen = (room.RUG - room.POSITION) @ rotation
        rug = FloorRectangle(poses.click(seen / np.linalg.norm(seen, axis=1, keepdims=True), deviation=3.0), width=2.0)
        # Named along other walls than the rug's sides, as an automatic search may.
        frame = frame_of(euler_rotation([0.1, -0.1, 90.1]) @ rotation)
        click_error = 3.0 * 360 / 2048
        alone.append(angle_between(calibrate(Cues(rug, click_error=click_error)).rotation, rotation))
        cues = Cues(rug, room=frame, click_error=click_error)
        together.append(angle_between(calibrate(cues).rotation, rotation))
    assert np.median(together) < 0.3
    assert np.median(together) < np.median(alone) / 3


def test_walls_askew_to_the_rug_only_level(room):
    seen = (room.RUG - room.POSITION) @ euler_rotation([2.0, 1.0, 30.0])
    rug = FloorRectangle(seen / np.linalg.norm(seen, axis=1, keepdims=True), width=2.0)
    found = calibrate(Cues(rug, room=frame_of(euler_rotation([2.0, 1.0, 50.0]))))
    assert any("20.0 degrees askew to the walls" in warning for warning in found.warnings)
    np.testing.assert_allclose(rotation_to_euler(found.rotation), [2.0, 1.0, 30.0], atol=0.01)


def test_doubtful_walls_are_left_out(room):
    seen = (room.RUG - room.POSITION) @ euler_rotation([2.0, 1.0, 30.0])
    rug = FloorRectangle(seen / np.linalg.norm(seen, axis=1, keepdims=True), width=2.0)
    found = calibrate(Cues(rug, room=frame_of(euler_rotation([9.0, 9.0, 30.0]), confidence=0.2)))
    assert any("left out: their confidence is only 0.20" in warning for warning in found.warnings)
    np.testing.assert_allclose(rotation_to_euler(found.rotation), [2.0, 1.0, 30.0], atol=1e-4)

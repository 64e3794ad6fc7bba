"""Two hand-held photographs of a house from one spot: the turn between them by clicked edges, and by features."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from lightdepth.cameras import Perspective
from lightdepth.directions import euler_rotation
from tests.support.commands import run_command

PHOTOGRAPHS = Path(__file__).parents[3] / "shared/data/stitch/durlach_saumarkt"
FOV = 66.0
"""With which the features agree best on one turn; the EXIF data say 25 mm, rounded, which is 69.4."""
LEFT = {
    "y": ["1280,271 811,352.5", "1280,285 811,361.5", "1280,72.5 800,215", "1280,527 892.5,533", "1190,454 882.5,471"],
    "z": ["816.5,532.5 809,230", "1105,459 1090,161.5", "1249,450 1232,123"],
}
"""Edges of the house with the pink cornice, clicked by eye, in the first photograph;"""
RIGHT = {
    "y": ["672.2,291.3 92.7,314.5", "672.2,302.4 92.7,326.5", "693.4,118.9 50.4,154.2", "637,511 186.5,518"],
    "z": [
        "95.7,519 90.7,181.4",
        "173.4,453.5 168.3,183.4",
        "636,564.4 626.9,131",
        "581.5,443.5 577.5,161.3",
        "395,448.5 391,171.3",
    ],
}
"""and in the second."""


def calibrated(name, edges, fov=FOV):
    words = [word for axis, lines in edges.items() for line in lines for word in (f"--{axis}-line", line)]
    return json.loads(run_command("calibrate", "view", PHOTOGRAPHS / name, "--fov", fov, "--json", *words).stdout)


@pytest.mark.skipif(not PHOTOGRAPHS.is_dir(), reason="the photographs of ../shared/data/stitch are not here")
def test_edges_of_a_house_give_the_turn_that_features_give():
    names = "P1060372.JPG", "P1060373.JPG"
    solved = [calibrated(name, edges) for name, edges in zip(names, (LEFT, RIGHT), strict=True)]
    assert all(each["residual"] < 1.0 for each in solved)
    assert calibrated(names[0], LEFT, "exif")["fov"] == pytest.approx(69.39, abs=0.01)
    found = [
        cv2.SIFT_create(4000).detectAndCompute(np.asarray(Image.open(PHOTOGRAPHS / n).convert("L")), None)
        for n in names
    ]
    pairs = cv2.BFMatcher().knnMatch(found[0][1], found[1][1], k=2)
    sure = [first for first, second in pairs if first.distance < 0.75 * second.distance]
    here = np.array([found[0][0][pair.queryIdx].pt for pair in sure])
    there = np.array([found[1][0][pair.trainIdx].pt for pair in sure])
    _, agree = cv2.findHomography(here, there, cv2.RANSAC, 3.0)
    houses = (agree.ravel() > 0) & (here[:, 1] < 540) & (there[:, 1] < 540)  # what is near has parallax
    assert houses.sum() > 60
    camera = Perspective(type="perspective", width=1280, height=960, fov=FOV)
    one, other = (camera.directions_of(points[houses] / (1280, 960)) for points in (here, there))
    left, _, right = np.linalg.svd(other.T @ one)
    turn = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    first, second = (euler_rotation(each["rotation"]) for each in solved)
    off = turn.T @ second.T @ first
    degrees = np.degrees(np.arccos((np.trace(off) - 1.0) / 2.0))
    assert degrees < 2.0 * np.hypot(*(each["direction_error"] for each in solved))
    assert degrees < 1.5

"""A bracket of a made-up place, shared by the tests of capture."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from lightdepth.capture.exposure import Exposure, read_exposures
from tests.support.photography import TestCamera, rig_rotation, room_panorama, sensor_radiance, shoot

TIMES = [64 * 4.0 ** (3 - index) for index in range(9)]
"""Nine exposures two stops apart, as in the paper."""


@dataclass(frozen=True)
class ShotBracket:
    pairs: list[tuple[Path, Exposure]]
    light: np.ndarray
    camera: TestCamera


@pytest.fixture(scope="session")
def place() -> np.ndarray:
    return room_panorama(256)


@pytest.fixture(scope="session")
def bracket(place, tmp_path_factory) -> ShotBracket:
    camera = TestCamera(size=(320, 320))
    rotation = rig_rotation(20, 10)
    files = shoot(place, [rotation], TIMES, tmp_path_factory.mktemp("bracket"), camera)[0]
    return ShotBracket(
        list(zip(files, read_exposures(files), strict=True)), sensor_radiance(place, rotation, camera), camera
    )

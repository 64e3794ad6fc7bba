"""The comparison of two devices' pictures: what it must let pass, and what it must catch."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from bench.device_check import BLOCK, ROOT, compare

SHAPE = (8, 4 * BLOCK, 6 * BLOCK, 3)
PLATE = np.ones(SHAPE[1:])


@pytest.fixture(scope="module")
def pictures() -> np.ndarray:
    """Pictures of eight seeds with 50 % of noise a pixel."""
    return 1.0 + 0.5 * np.random.default_rng(1).standard_normal(SHAPE)


def test_rounding_and_chance_agree(pictures: np.ndarray) -> None:
    generator = np.random.default_rng(2)
    rounded = pictures * (1.0 + 1e-6 * generator.standard_normal(SHAPE))
    chance = 1.0 + 0.5 * generator.standard_normal(SHAPE)
    assert compare(pictures, rounded, PLATE, PLATE)["agree"]
    assert compare(pictures, chance, PLATE, PLATE)["agree"]


def test_a_block_that_is_a_percent_darker_is_caught(pictures: np.ndarray) -> None:
    darker = pictures.copy()
    darker[:, :BLOCK, BLOCK : 2 * BLOCK] *= 0.99
    found = compare(pictures, darker, PLATE, PLATE)
    assert not found["agree"]
    assert found["most"] == pytest.approx(-0.01, rel=1e-6)


def test_another_plate_is_caught_but_not_a_ray_that_grazes_an_edge(pictures: np.ndarray) -> None:
    plate = PLATE.copy()
    plate[0, 0] *= 1.01
    assert compare(pictures, pictures, PLATE, plate)["agree"]
    plate[0, :10] *= 1.01
    assert not compare(pictures, pictures, PLATE, plate)["agree"]


def test_a_device_that_is_not_there_is_named_before_anything_is_rendered(tmp_path) -> None:
    command = [sys.executable, ROOT / "bench/device_check.py", "--devices", "abacus", "--output", tmp_path]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr.startswith("abacus: device 'abacus'")
    assert list(tmp_path.iterdir()) == []

"""The computed room of the examples, and random poses."""

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

from tests.calibration.calibration_helpers import Poses


@pytest.fixture(scope="session")
def room() -> ModuleType:
    """The module `examples/calibration/room.py`."""
    path = Path(__file__).parents[2] / "examples/calibration/room.py"
    spec = importlib.util.spec_from_file_location("calibration_example_room", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def poses(request) -> Poses:
    """Random poses, the same in every run."""
    return Poses(sum(map(ord, request.node.name)))

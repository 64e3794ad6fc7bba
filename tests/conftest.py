"""Shared by all tests."""

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of real captures outside the repository; tests that need it are skipped where it is absent."""
    default = Path(__file__).parents[1] / "../shared/data"
    folder = Path(os.environ.get("LIGHTDEPTH_SHARED_DATA", default))
    if not folder.is_dir():
        pytest.skip(f"real captures are not at {folder}")
    return folder

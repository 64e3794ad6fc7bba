"""Files that other files name."""

from __future__ import annotations

from pathlib import Path


def is_file(path: Path) -> bool:
    """Whether there is such a file; names that no file can have, too long ones for example, are none."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False

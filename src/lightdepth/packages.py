"""Packages that only some commands need, and the message where one is missing."""

from __future__ import annotations

import importlib
import importlib.util
from types import ModuleType

from lightdepth.errors import SetupError


def optional_package(name: str, extra: str) -> ModuleType:
    """Import a package of one of the project's extras.

    Args:
        name: of the module.
        extra: the extra that installs it.

    Raises:
        SetupError: it is not installed, or cannot be loaded.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise _missing(name, extra, f" ({error})") from error


def require_package(name: str, extra: str) -> None:
    """Find out whether a package is installed without loading it.

    Args:
        name: of the module.
        extra: the extra that installs it.

    Raises:
        SetupError: it is not installed.
    """
    if importlib.util.find_spec(name) is None:
        raise _missing(name, extra)


def _missing(name: str, extra: str, why: str = "") -> SetupError:
    return SetupError(f"the Python package '{name}' is needed for this{why}: pip install 'lightdepth[{extra}]'")

"""The command line as tests call it, and pictures for it."""

from pathlib import Path

import numpy as np
from typer.testing import CliRunner

from lightdepth.cli.app import app
from lightdepth.images.exr import ExrPart, write_exr


def run_command(*words):
    """Run ``lightdepth`` with words; what it raises beside an exit status is raised here."""
    result = CliRunner().invoke(app, [str(word) for word in words])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


def write_rgb(path: Path, radiance: np.ndarray) -> Path:
    """Write linear RGB, shape (height, width, 3), as OpenEXR; returns the path."""
    channels = {name: radiance[..., index].astype(np.float32) for index, name in enumerate("RGB")}
    write_exr(path, [ExrPart(channels, "", {})])
    return path

"""Results of the capture commands as files: linear radiance, and a picture of it to judge."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError
from lightdepth.images.exr import ExrPart, write_exr
from lightdepth.images.png import write_png
from lightdepth.images.tonemapping import auto_exposure, tone_map
from lightdepth.images.writing import check_writable


def check_output(output: Path, *others: Path | None) -> None:
    """Make sure, before the work, that results can be written.

    Raises:
        InputError: the name is not that of an EXR file, or a folder is missing or not writable.
    """
    if output.suffix.lower() != ".exr":
        raise InputError(f"{output}: linear radiance is written as OpenEXR; the name must end in .exr")
    for path in (output, output.with_suffix(".png"), *others):
        if path is not None:
            check_writable(path)


def write_image(output: Path, radiance: NDArray[np.float32], known: NDArray[np.bool_], panorama: bool = False) -> Path:
    """Write ``output`` (EXR: R, G, B, and A, 0 where nothing was photographed) and a PNG of the same name.

    Args:
        output: the EXR file.
        radiance: shape (height, width, 3), float32.
        known: what was photographed, shape (height, width).
        panorama: mark the file as latitude-longitude map.

    Returns:
        The PNG's path.
    """
    alpha = known.astype(np.float32)
    channels = {name: radiance[..., index].astype(np.float32) for index, name in enumerate("RGB")}
    header: dict[str, Any] = {}
    if panorama:
        header["envmap"] = "latlong"
    picture = tone_map(radiance, auto_exposure(radiance, alpha))
    write_exr(output, [ExrPart({**channels, "A": alpha}, "", header)])
    write_png(output.with_suffix(".png"), picture)
    return output.with_suffix(".png")

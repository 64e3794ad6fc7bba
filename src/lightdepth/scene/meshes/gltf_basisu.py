"""KTX2 images of ``KHR_texture_basisu``."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import SetupError
from lightdepth.packages import optional_package

KTX2_MAGIC = b"\xabKTX 20\xbb\r\n\x1a\n"


def decoded_ktx2(data: bytes) -> NDArray[np.uint8]:
    """Pixels of a KTX2 file, shape (height, width, 4).

    Raises:
        ValueError: it is damaged, not of Basis Universal, or the package that decodes it is missing.
    """
    try:
        basisu: Any = optional_package("opengl_basisu", "gltf")
    except SetupError as error:
        raise ValueError(f"it is KTX2; {error}") from error
    try:
        image = basisu.open(data).transcode(basisu.Target.RGBA8)
    except ValueError as error:
        raise ValueError("its KTX2 data is damaged or not of Basis Universal") from error
    return np.array(image.data, np.uint8)

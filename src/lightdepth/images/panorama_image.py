"""What reading a panorama's file gives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class PanoramaImage:
    """A panorama as its file has it.

    Attributes:
        radiance: linear Rec.709, shape (height, width, 3), float32, unchecked.
        rotation: light space to a level world with y to the north, as the file's metadata has it, shape (3, 3);
            ``None`` where it has none.
        notes: what of the file makes pictures wrong in places, a sentence each.
        unknown: directions that the file does not show, filled from around, shape (height, width); ``None`` where there
            are none.
    """

    radiance: NDArray[np.float32]
    rotation: NDArray[np.float64] | None = None
    notes: tuple[str, ...] = ()
    unknown: NDArray[np.bool_] | None = None

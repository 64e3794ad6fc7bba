"""A rendered image with its layers kept apart."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lightdepth.cameras.topology import Flat, Topology
from lightdepth.film.cryptomatte import Mattes

EXPOSURE = "exposure"
"""Among a frame's facts: stops that bring the panorama's brightness to the screen's, alike for all cameras."""


@dataclass
class Frame:
    """What a rendering gives. Row 0 is the top; radiance is linear Rec.709.

    Attributes:
        plate: the photograph, resampled for the camera, shape (height, width, 3), float32.
        change: what the new objects change on support surfaces, shape (height, width, 3), float32, signed.
        synthetic: radiance of the new objects times their coverage, shape (height, width, 3), float32.
        coverage: share of each pixel that new objects cover, shape (height, width), float32.
        alpha: 1 inside the camera's image and 0 outside it (beyond a fisheye's circle), shape (height, width), float32.
        object_id: which object covers most of a pixel, shape (height, width), uint32: 0 is none, i + 1 is
            ``scene.synthetic[i]``.
        depth: distance along the ray in metres, shape (height, width), float32; inf is sky.
        normal: unit normals in world space, shape (height, width, 3), float16 or float32.
        albedo: albedo of what is seen, shape (height, width, 3), float16 or float32.
        photograph: of several photographs, the share of each in the plate, shape (height, width, k), float32; all are 0
            where none of them sees what the pixel shows. ``None`` where there is one.
        variance: variance of the mean of ``beauty``, shape (height, width, 3), float32.
        samples: number of samples spent, shape (height, width), uint32.
        metadata: facts for the file's header, by name.
        object_names: names of the objects, those of ``object_id`` 1, 2, ... in order.
        mattes: how much of each pixel objects and materials cover.
        topology: how the pixels lie beside each other; by default, a picture that ends at its edges.
    """

    plate: NDArray[np.float32]
    change: NDArray[np.float32]
    synthetic: NDArray[np.float32]
    coverage: NDArray[np.float32]
    alpha: NDArray[np.float32]
    object_id: NDArray[np.uint32] | None = None
    depth: NDArray[np.float32] | None = None
    normal: NDArray[np.floating] | None = None
    albedo: NDArray[np.floating] | None = None
    photograph: NDArray[np.float32] | None = None
    variance: NDArray[np.float32] | None = None
    samples: NDArray[np.uint32] | None = None
    metadata: dict[str, str] = field(default_factory=dict)
    object_names: tuple[str, ...] = ()
    mattes: Mattes | None = None
    topology: Topology = None  # type: ignore[assignment]  # filled in below

    def __post_init__(self) -> None:
        if self.topology is None:
            height, width = self.coverage.shape
            self.topology = Flat(width, height)

    @property
    def beauty(self) -> NDArray[np.float32]:
        """The finished image ``plate (1 - coverage) + change + synthetic``, shape (height, width, 3), float32.

        It is computed where something is new and copied from the plate elsewhere, so that untouched pixels are those of
        the photograph bit for bit.
        """
        return self.beauty_rows(0, len(self.plate))

    def beauty_rows(self, first: int, end: int) -> NDArray[np.float32]:
        """The same of the rows from ``first`` to before ``end`` alone: of a large image, the whole counts."""
        beauty = self.plate[first:end].copy()
        for row, line in enumerate(beauty, first):  # Row by row, so that a large image needs no large temporaries.
            touched = self.touched(row)
            line[touched] *= 1.0 - self.coverage[row, touched, None]
            line[touched] += self.change[row, touched] + self.synthetic[row, touched]
        return beauty

    def touched(self, row: int) -> NDArray[np.bool_]:
        """Which pixels of a row new objects cover or change, shape (width,)."""
        return (self.coverage[row] != 0.0) | (self.change[row] != 0.0).any(1) | (self.synthetic[row] != 0.0).any(1)

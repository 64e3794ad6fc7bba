"""A rendered image with its layers kept apart."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightdepth.cameras.topology import Flat, Rectangle, Topology
from lightdepth.film.cryptomatte import Mattes

EXPOSURE = "exposure"
"""Key of a frame's metadata: stops that bring the panorama's brightness to the screen's, alike for all cameras."""
CAMERA = "camera"
"""Likewise: the camera's settings without its pose, a JSON object with the keys of the scene file."""
PLATE_GAIN = "plate_gain"
"""Likewise, of the camera of a ``[plate]``: by what the light of the panorama was multiplied, per channel."""
NUMBER = "frame"
"""Likewise: its number, of a frame of a sequence."""
LARGEST_SHADOW = 65504.0
"""What a half float holds."""


@dataclass
class Frame:
    """The result of a rendering. Row 0 is the top; radiance is linear Rec.709.

    Attributes:
        plate: the photograph, resampled for the camera or its own, shape (height, width, 3), float32.
        change: what the new objects change on support surfaces, shape (height, width, 3), float32, signed.
        synthetic: radiance of the new objects times their coverage, shape (height, width, 3), float32.
        coverage: share of each pixel that new objects cover, shape (height, width), float32.
        alpha: 1 inside the camera's image and 0 outside it (beyond a fisheye's circle), shape (height, width), float32.
        object_id: which object covers most of a pixel, shape (height, width), uint32: 0 is none, i + 1 is
            ``scene.synthetic[i]``.
        depth: distance along the ray in metres, shape (height, width), float32; inf is sky.
        normal: unit normals in world space, shape (height, width, 3), float16 or float32.
        albedo: albedo of what is seen, shape (height, width, 3), float16 or float32.
        support: which pixels show support without gloss in their middle, shape (height, width), bool; of frames that
            share samples. It is in no picture file.
        photograph: of several photographs, the share of each in the plate, shape (height, width, k), float32; all are 0
            where none of them sees what the pixel shows. ``None`` where there is one.
        variance: variance of the mean of ``beauty``, shape (height, width, 3), float32.
        samples: number of samples spent, shape (height, width), uint32.
        metadata: facts for the file's header, by name.
        matrices: poses for the file's header, by name, shape (4, 4), float32; see :mod:`lightdepth.film.header`.
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
    support: NDArray[np.bool_] | None = None
    photograph: NDArray[np.float32] | None = None
    variance: NDArray[np.float32] | None = None
    samples: NDArray[np.uint32] | None = None
    metadata: dict[str, str] = field(default_factory=dict)
    matrices: dict[str, NDArray[np.float32]] = field(default_factory=dict)
    object_names: tuple[str, ...] = ()
    mattes: Mattes | None = None
    topology: Topology = None  # type: ignore[assignment]  # filled in below

    def __post_init__(self) -> None:
        if self.topology is None:
            height, width = self.coverage.shape
            self.topology = Flat(width, height)

    def parts(self) -> Iterator[tuple[str, Frame]]:
        """The charts that are to be files of their own, with their names: eyes, or faces of a cube."""
        for name, chart in zip(self.topology.parts, self.topology.charts, strict=False):
            yield name, self._cut(chart, name)

    def _cut(self, chart: Rectangle, name: str) -> Frame:
        planes: dict[str, Any] = {
            layer.name: np.ascontiguousarray(value[chart.slices])
            for layer in fields(self)
            if isinstance(value := getattr(self, layer.name), np.ndarray)
        }
        mattes = None if self.mattes is None else self.mattes.cut(chart, self.coverage.shape[1])
        facts = {**self.metadata, "part": name}
        return replace(self, **planes, mattes=mattes, metadata=facts, topology=self.topology.alone(chart))

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

    @property
    def shadow(self) -> NDArray[np.float16]:
        """The change as a factor of the plate, shape (height, width, 3), float16.

        ``beauty = plate (1 - coverage) shadow + synthetic`` but for rounding. It is 1 where the plate is black or fully
        covered.
        """
        shadow = np.ones(self.plate.shape, np.float16)
        for row, line in enumerate(shadow):
            before = self.plate[row] * (1.0 - self.coverage[row, :, None])
            known = (before > 0.0) & (self.change[row] != 0.0)
            factor = 1.0 + self.change[row, known].astype(np.float64) / before[known]
            line[known] = np.clip(factor, 0.0, LARGEST_SHADOW)
        return shadow

    def touched(self, row: int) -> NDArray[np.bool_]:
        """Which pixels of a row new objects cover or change, shape (width,)."""
        return (self.coverage[row] != 0.0) | (self.change[row] != 0.0).any(1) | (self.synthetic[row] != 0.0).any(1)

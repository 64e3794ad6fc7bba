"""The interface of one or several photographs to the place: its appearance and its light."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING, Self

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightdepth.place.light_list import LightSample
from lightdepth.place.real_light import RealLight
from lightdepth.place.traced_surfaces import RealHit, TracedSurfaces

if TYPE_CHECKING:
    from lightdepth.place.photograph import Photograph


class Photographed(RealLight):
    """The appearance of a place, and the light of everything seen in it.

    Attributes:
        surfaces: the real surfaces to trace.
        each: the photographs, the first one first.
        one_sided: whether light samples lie on one side of their surface only, that of their normal.
    """

    surfaces: TracedSurfaces
    each: tuple[Photograph, ...]
    one_sided: bool = False

    @property
    def capture(self) -> NDArray[np.float64]:
        """The capture point of the first, shape (3,), world, metres."""
        return self.each[0].capture

    @property
    def rows(self) -> int:
        """Rows of pixels of the finest photograph."""
        return max(photograph.map.height for photograph in self.each)

    @property
    def standing_out(self) -> float:
        """Share of their light above their mean, which light sampling finds better than BSDF sampling."""
        light = sum(photograph.map.light for photograph in self.each)
        return sum(photograph.map.standing_out for photograph in self.each) / max(light, 1e-30)

    @abstractmethod
    def with_surfaces(self, surfaces: TracedSurfaces) -> Self:
        """The same, with other meshes of the same surfaces, refined ones for instance."""

    @abstractmethod
    def with_mirrored(self, images: Sequence[NDArray[np.float32]]) -> Self:
        """The same with the radiance that specular lobes mirror in each photograph.

        Args:
            images: ``S`` of each, radiance that the lobes of real surfaces send to its capture point, shape (h, 2 h, 3),
                in the layout of the panorama.
        """

    @abstractmethod
    def presample(self, generator: np.random.Generator, count: int) -> LightSample:
        """Draw ``count`` light samples, by the density that :meth:`arriving` gives."""

    @abstractmethod
    def sharp(self, hit: RealHit, ray: mi.Ray3f) -> mi.Color3f:
        """``M(q)`` as a camera sees it: sharply interpolated, at the rest position of what is deformed."""

    @abstractmethod
    def shares(self, hit: RealHit, ray: mi.Ray3f) -> list[mi.Float]:
        """Share of each photograph in what a camera sees; 0 for all where none of them sees it."""

    @abstractmethod
    def surface_radiance(self, hit: RealHit, direction: mi.Vector3f, active: mi.Bool) -> mi.Color3f:
        """M at points of real surfaces seen from their front, at their rest positions (paper, section 5.8).

        Args:
            hit: the points.
            direction: of view toward them, unit, world.
            active: lanes to evaluate.
        """

    @abstractmethod
    def mirrored(self, hit: RealHit, direction: mi.Vector3f, active: mi.Bool) -> mi.Color3f:
        """``S`` at points of real surfaces: what of their radiance specular lobes mirror, 0 where it was not estimated.

        The arguments are those of :meth:`surface_radiance`.
        """

    @abstractmethod
    def sight(self, point: mi.Vector3f, normal: mi.Vector3f) -> tuple[mi.Bool, mi.Bool, mi.Color3f]:
        """Which real points are seen, which are certainly unseen, and the picture's radiance there.

        Args:
            point: world, metres.
            normal: of the surface there, either side, unit, world.
        """

    @abstractmethod
    def shares_at(self, point: mi.Vector3f, normal: mi.Vector3f) -> list[NDArray[np.float32]]:
        """Share of each photograph in what points send, shapes (n,); the arguments are those of :meth:`sight`."""

    @abstractmethod
    def surface_shares(self, hit: RealHit, direction: mi.Vector3f, active: mi.Bool) -> list[NDArray[np.float32]]:
        """Share of each photograph in :meth:`surface_radiance`, whose arguments these are; shapes (n,)."""

    @abstractmethod
    def faced(self, points: NDArray[np.float32], normals: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Which points, of those that are seen, are seen from the side of their normals; shape (n,).

        Args:
            points: world, metres, shape (n, 3).
            normals: of the surface there, unit, world, shape (n, 3).
        """

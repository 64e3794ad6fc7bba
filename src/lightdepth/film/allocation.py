"""How many samples each pixel gets next."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lightdepth.film.accumulation import Accumulator
from lightdepth.film.picture_error import PictureError
from lightdepth.film.pixel_list import PixelList
from lightdepth.film.schedule import Round, Target, pilot_samples
from lightdepth.kernel.start import DEVICE_LOCK
from lightdepth.parameters.film import FilmParameters


@dataclass(frozen=True)
class Sharing:
    """How n pixels of a frame share their samples with those of other frames.

    Attributes:
        frames: that will share the samples of each pixel, shape (n,), int32.
        unchanged: pixels that show nothing new, and no support, as far as their middles and those beside them tell,
            shape (n,).
    """

    frames: NDArray[np.int32]
    unchanged: NDArray[np.bool_]


class Allocation:
    """Decides on the rounds of a rendering.

    Args:
        pixels: the pixels that are sampled.
        accumulator: their sums.
        errors: their errors.
        parameters: how samples are distributed.
        sharing: with other frames; ``None`` for a picture of its own.
    """

    def __init__(
        self,
        pixels: PixelList,
        accumulator: Accumulator,
        errors: PictureError,
        parameters: FilmParameters,
        sharing: Sharing | None = None,
    ) -> None:
        self._pixels, self._accumulator, self._errors = pixels, accumulator, errors
        self._parameters, self._sharing = parameters, sharing

    def pilot_round(self, target: Target) -> Round:
        """The first round for a target: afterwards no pixel has fewer samples than the pilot takes."""
        taken = self._accumulator.taken
        pilot: int | NDArray[np.int32] = pilot_samples(target.samples, self._parameters)
        if self._sharing is not None:
            few = np.where(self._sharing.unchanged, self._parameters.unchanged_pilot, self._parameters.quantum)
            shared = pilot // self._sharing.frames
            shared[self._sharing.unchanged] = 0
            pilot = np.minimum(pilot, np.maximum(shared, few))
        wanted = np.subtract(pilot, taken, dtype=np.int32, casting="unsafe")
        wanted = self._pixels.inside(np.maximum(wanted, 0, out=wanted), target.region)
        size, spent = self._inside(target)
        return Round(target, wanted, int(taken.sum(dtype=np.int64)) - spent + target.samples * size)

    def next_round(self, last: Round) -> Round | None:
        """The samples still wanted after a round, in multiples of ``quantum``; ``None`` when the work is done.

        Without a wanted ``noise``, what remains after the pilot is spent at once in proportion to the error that each
        pixel's neighbours then had. With it, as many as the error calls for, in rounds that at most quadruple a pixel's
        samples.
        """
        target, taken = last.target, self._accumulator.taken
        with DEVICE_LOCK:
            more, whole = self._even(target) if target.noise is None else self._until(target, target.noise)
        if more is None or (target.noise is None and not last.pilot):
            return None
        more = self._pixels.inside(more, target.region)
        quantum = self._parameters.quantum
        more /= quantum
        more += 0.5
        wanted = np.floor(more, out=more).astype(np.int32)
        del more
        wanted *= quantum
        return Round(target, wanted, max(whole, int(taken.sum(dtype=np.int64)) + 1), 0, False) if wanted.any() else None

    def _even(self, target: Target) -> tuple[NDArray[np.float32] | None, int]:
        """How many more samples each pixel gets where the errors are to become alike, and how many all will have."""
        taken, samples = self._accumulator.taken, target.samples
        size, spent = self._inside(target)
        left = samples * size - spent
        whole = int(taken.sum(dtype=np.int64)) + left
        if left < max(self._parameters.least_round * self._parameters.quantum * size, 1):
            return None, whole
        more = self._around(self._left(self._errors.reducible(self._parameters.contrast)))
        if taken.max() > max(int(taken.min()), 0 if self._sharing is None else self._parameters.quantum):
            # Not after a pilot: the samples so far are part of what each pixel is due.
            more *= np.sqrt(taken.astype(np.float32))
            more = self._pixels.inside(more, target.region)
            more *= samples * size / max(float(more.sum(dtype=np.float64)), 1e-30)
            more -= taken
            np.maximum(more, 0.0, out=more)
        more = self._pixels.inside(more, target.region)
        more *= left / max(float(more.sum(dtype=np.float64)), 1e-30)
        self._give_all(more, target, left)
        np.minimum(more, self._parameters.most_share * samples, out=more)
        return more, whole

    def _give_all(self, more: NDArray[np.float32], target: Target, left: int) -> None:
        """Raise ``more``, which adds up to ``left``, to the least share of the samples, and lower the rest for it.

        Where the pilot met nothing, the error seems to be 0: rare events would never be found, however many
        samples there are.
        """
        due: float | NDArray[np.float64] = self._parameters.least_share * target.samples
        if self._sharing is not None:
            due = np.where(self._sharing.unchanged, 0.0, due / self._sharing.frames)
        least = np.subtract(due, self._accumulator.taken, dtype=np.float32, casting="unsafe")
        if least.max(initial=0.0) <= 0.0:
            return
        least = self._pixels.inside(np.maximum(least, 0.0, out=least), target.region)
        raised = float(np.maximum(least - more, 0.0).sum(dtype=np.float64))
        more *= max(1.0 - raised / left, 0.0)
        np.maximum(more, least, out=more)

    def _until(self, target: Target, noise: float) -> tuple[NDArray[np.float32], int]:
        """How many more samples each pixel gets for a wanted noise, and how many all will have as far as is known."""
        taken = self._accumulator.taken
        # The error falls with the square root of the number of samples. A pixel that stands out is not done.
        errors = self._left(self._errors.own())
        irradiance, rest = self._errors.shared_variance()
        # More samples of a pixel do not reduce the shared errors: beyond some point they are of no use.
        left = np.maximum(noise**2 - rest - irradiance, self._parameters.least_noise**2 * noise**2)
        more = self._around(errors)
        np.maximum(errors, more, out=more)
        del errors
        np.square(more, out=more)
        more /= np.asarray(left, np.float32)
        more *= taken
        np.minimum(more, target.samples, out=more)
        more -= taken
        np.maximum(more, 0.0, out=more)
        whole = int(taken.sum(dtype=np.int64)) + int(more.sum(dtype=np.float64))
        np.minimum(more, 3.0 * taken, out=more)
        return more, whole

    def _inside(self, target: Target) -> tuple[int, int]:
        """How many pixels of the list lie in a target's region, and how many samples they have."""
        taken = self._accumulator.taken
        if target.region is None:
            return taken.size, int(taken.sum(dtype=np.int64))
        inside = self._pixels.inside(np.ones(taken.size, np.uint8), target.region) > 0
        return int(inside.sum()), int(taken.sum(dtype=np.int64, where=inside))

    def _left(self, errors: NDArray[np.float32]) -> NDArray[np.float32]:
        """What is left of the pixels' errors where several frames share the samples, shape (n,)."""
        if self._sharing is None:
            return errors
        return (errors / np.sqrt(self._sharing.frames)).astype(np.float32)

    def _around(self, errors: NDArray[np.float32]) -> NDArray[np.float32]:
        return self._pixels.around(errors, self._parameters.neighbourhood)

"""Values between keys."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lightdepth.directions import euler_rotation, rotation_to_euler

Interpolation = Literal["linear", "smooth", "step"]


@dataclass(frozen=True, eq=False)
class Keys:
    """A value that changes over time. Before the first key it is that of the first, after the last that of the last.

    Attributes:
        frames: of the keys, strictly increasing, shape (n,), float64.
        values: at the keys, shape (n, k), float64; XYZ Euler angles in degrees where ``turns``.
        interpolation: ``step`` keeps a value until the next key; ``linear`` goes straight; ``smooth`` begins and ends at
            rest, passes the keys in between without a jolt, and goes beyond none of them: monotone cubic pieces (F. N.
            Fritsch and R. E. Carlson, 1980), and the same for rotations.
        turns: the values are rotations; each way from key to key is the shortest.
    """

    frames: NDArray[np.float64]
    values: NDArray[np.float64]
    interpolation: Interpolation = "linear"
    turns: bool = False

    def at(self, frame: float) -> NDArray[np.float64]:
        """The value at a frame, whole or in between, shape (k,), float64; at a key, exactly that of the key."""
        before = int(np.searchsorted(self.frames, frame, side="right")) - 1
        if before < 0:
            return self.values[0]
        if self.interpolation == "step" or before == len(self.frames) - 1 or self.frames[before] == frame:
            return self.values[before]
        if np.array_equal(self.values[before], self.values[before + 1]):  # Not but for the last digit.
            return self.values[before]
        smooth = self.interpolation == "smooth"
        # What most scenes need not wait for.
        from scipy.interpolate import PchipInterpolator
        from scipy.spatial.transform import Rotation, Slerp

        from lightdepth.scene.animation.turning import turned_smoothly

        if self.turns:
            rotations = Rotation.from_matrix(np.stack([euler_rotation(angles) for angles in self.values]))
            spline = partial(turned_smoothly, self.frames, rotations) if smooth else Slerp(self.frames, rotations)
            return rotation_to_euler(spline(frame).as_matrix())
        time = self._eased(frame, before) if smooth else frame
        if smooth and len(self.frames) > 2:
            return np.asarray(PchipInterpolator(self.frames, self.values)(time))
        share = (time - self.frames[before]) / (self.frames[before + 1] - self.frames[before])
        return (1.0 - share) * self.values[before] + share * self.values[before + 1]

    def _eased(self, frame: float, before: int) -> float:
        """The frame at which an even motion is where this one is: slower in the first and the last interval."""
        begin, end = self.frames[before], self.frames[before + 1]
        u = (frame - begin) / (end - begin)
        first, last = before == 0, before == len(self.frames) - 2
        if first and last:
            u = u * u * (3.0 - 2.0 * u)
        elif first:  # At rest at the key's begin, in step with the next interval at its end.
            u = u * u * (2.0 - u)
        elif last:
            u = 1.0 - (1.0 - u) ** 2 * (1.0 + u)
        return float(begin + u * (end - begin))

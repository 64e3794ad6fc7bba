"""The constants that were tuned, and why each has its value: a benchmark varies them without patching modules.

They are part of a scene's settings (``[render.parameters]`` in its file), and so of every digest of a scene: sums,
checkpoints, frames and cached places of different parameters are never taken for each other. The others are arguments of
the functions that they belong to, and no part of the scene: ``CaptureParameters``, ``MirrorBallParameters``,
``CalibrationParameters``, ``DistancesParameters`` and ``ReconstructionParameters`` of what comes before the scene file,
``QuickstartParameters``, by which a first scene is guessed, and ``ChecksParameters``, by which a scene is checked.
"""

from __future__ import annotations

from pydantic.dataclasses import dataclass

from lightdepth.parameters.balance import BalanceParameters
from lightdepth.parameters.calibration import CalibrationParameters
from lightdepth.parameters.capture import CaptureParameters
from lightdepth.parameters.checks import ChecksParameters
from lightdepth.parameters.denoising import DenoisingParameters
from lightdepth.parameters.distances import DistancesParameters
from lightdepth.parameters.film import FilmParameters
from lightdepth.parameters.lighting import LightingParameters
from lightdepth.parameters.mirror_ball import MirrorBallParameters
from lightdepth.parameters.motion_blur import MotionBlurParameters
from lightdepth.parameters.place import PlaceParameters
from lightdepth.parameters.quickstart import QuickstartParameters
from lightdepth.parameters.ranges import CHECKED
from lightdepth.parameters.reconstruction import ReconstructionParameters
from lightdepth.parameters.recovery import RecoveryParameters
from lightdepth.parameters.reuse import ReuseParameters
from lightdepth.parameters.transport import TransportParameters

__all__ = [
    "BalanceParameters",
    "CalibrationParameters",
    "CaptureParameters",
    "ChecksParameters",
    "DenoisingParameters",
    "DistancesParameters",
    "FilmParameters",
    "LightingParameters",
    "MirrorBallParameters",
    "MotionBlurParameters",
    "Parameters",
    "PlaceParameters",
    "QuickstartParameters",
    "ReconstructionParameters",
    "RecoveryParameters",
    "ReuseParameters",
    "TransportParameters",
]


@dataclass(frozen=True, config=CHECKED)
class Parameters:
    """One object for each room; vary them by :func:`dataclasses.replace`, which checks them.

    Attributes:
        place: of what the place is taken to be.
        balance: of comparing photographs and plates.
        lighting: of recovering suns, clipped sources and gloss.
        recovery: of recovering albedo and irradiance.
        transport: of following paths.
        film: of taking samples, and of the layers other than light.
        denoising: of removing what is left of the noise.
        motion_blur: of the instants of a frame.
        reuse: of frames that share samples.

    Raises:
        pydantic.ValidationError: a number is out of its range; so do those of the rooms.
    """

    place: PlaceParameters = PlaceParameters()
    balance: BalanceParameters = BalanceParameters()
    lighting: LightingParameters = LightingParameters()
    recovery: RecoveryParameters = RecoveryParameters()
    transport: TransportParameters = TransportParameters()
    film: FilmParameters = FilmParameters()
    denoising: DenoisingParameters = DenoisingParameters()
    motion_blur: MotionBlurParameters = MotionBlurParameters()
    reuse: ReuseParameters = ReuseParameters()

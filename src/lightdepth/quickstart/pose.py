"""How the panorama was taken: level and heading from straight edges, else from its metadata, else taken as level."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lightdepth.calibration.line_detection import detect_arcs
from lightdepth.calibration.room_frame import RoomFrame, find_room_frame
from lightdepth.directions import FloatArray, rotation_to_euler
from lightdepth.errors import InputError
from lightdepth.images.panorama_image import PanoramaImage
from lightdepth.parameters.calibration import DEFAULT as CALIBRATION
from lightdepth.parameters.calibration import CalibrationParameters
from lightdepth.parameters.quickstart import DEFAULT, QuickstartParameters


@dataclass(frozen=True)
class GuessedPose:
    """A panorama's pose.

    Attributes:
        rotation: light space to world, shape (3, 3).
        height: of the capture point above the floor, metres.
        rotation_words: where the rotation comes from.
        height_words: where the height comes from.
        frame: the room's directions, where they were found and are used.
    """

    rotation: FloatArray
    height: float
    rotation_words: str
    height_words: str
    frame: RoomFrame | None

    @property
    def rotation_degrees(self) -> tuple[float, float, float]:
        """The rotation as XYZ Euler angles."""
        x, y, z = (round(float(angle), 3) + 0.0 for angle in rotation_to_euler(self.rotation))
        return x, y, z


def guess_pose(
    image: PanoramaImage,
    camera_height: float | None = None,
    tuned: QuickstartParameters = DEFAULT,
    edges: CalibrationParameters = CALIBRATION,
) -> GuessedPose:
    """Find or guess a panorama's pose; the world's origin is on the floor under the camera.

    Args:
        image: the panorama, its radiance finite and not negative.
        camera_height: of the lens above the floor, metres, where it is known.
        tuned: how it is guessed.
        edges: how straight edges and a room's directions are found.
    """
    height = tuned.camera_height if camera_height is None else camera_height
    height_words = (
        f"guess: the lens {tuned.camera_height:g} m above the floor; all sizes scale with it, so measure it"
        if camera_height is None
        else "as given"
    )
    frame: RoomFrame | None = None
    try:
        frame = find_room_frame(detect_arcs(image.radiance, tuned=edges), tuned=edges)
        doubt = f"straight edges give no sure level (confidence {frame.confidence:.2f} of 1)"
    except InputError:
        doubt = "there are too few straight edges to find the level"
    if frame is not None and frame.confidence >= tuned.sure_directions:
        words = f"found by {len(frame.arcs)} straight edges; confidence {frame.confidence:.2f} of 1"
        return GuessedPose(frame.rotation, height, words, height_words, frame)
    if image.rotation is not None:
        return GuessedPose(image.rotation, height, "as the picture's metadata (GPano) says", height_words, None)
    return GuessedPose(np.eye(3), height, f"guess: taken as level; {doubt}", height_words, None)

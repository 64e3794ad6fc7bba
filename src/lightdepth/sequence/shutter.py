"""The shutter of a sequence's frames: what of the scene a frame sees while it is open."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from lightdepth.api import DRAFT_SAMPLES, find_camera
from lightdepth.kernel.start import Device, start
from lightdepth.scene.animation.sequence import SequenceTable
from lightdepth.scene.model import CameraView, Scene
from lightdepth.sequence.film_motion import needed_instants
from lightdepth.sequence.fingerprint import frame_seed
from lightdepth.sequence.motion_blur import MotionBlur
from lightdepth.session.session import Job


class Shutter:
    """Finds the instants of frames.

    Args:
        sequence: says how long it is open.
        job: of the frames.
        device: ``auto``, ``cpu`` or ``cuda``.
        scene_at: the scene, of a frame's number, at an instant near it.
    """

    def __init__(
        self, sequence: SequenceTable, job: Job, device: Device, scene_at: Callable[[int, float], Scene]
    ) -> None:
        self._sequence, self._job, self._device, self._scene_at = sequence, job, device, scene_at

    def motion(self, number: int, scene: Scene) -> tuple[tuple[float, int] | None, list[tuple[Scene, CameraView]]]:
        """The shutter, and the scene where it opens and closes: what moves in between begins or ends elsewhere.

        Args:
            number: of the frame.
            scene: at the frame.
        """
        most = self._most_instants(scene)
        if most == 1:
            return None, []
        shutter = self._sequence.shutter
        scenes = [self._scene_at(number, number + side * shutter) for side in (-0.5, 0.5)]
        return (shutter, most), [(each, find_camera(each, self._job.camera)) for each in scenes]

    def blurred(self, number: int, scene: Scene, job: Job) -> MotionBlur:
        """The frame at as many instants as its motion needs; one that does not move has a single one.

        Args:
            number: of the frame.
            scene: at the frame.
            job: with the seed of the frame.
        """
        instants = self._sequence.opened(number, self._instants(number, scene))
        return MotionBlur([self._scene_at(number, instant) for instant in instants], job)

    def _instants(self, number: int, scene: Scene) -> int:
        _, motion = self.motion(number, scene)
        if not motion:
            return 1
        view = find_camera(scene, self._job.camera)
        (opened, opened_view), (closed, closed_view) = motion
        start(self._device)
        views = opened_view, view, closed_view
        return needed_instants((opened, scene, closed), views, self._most_instants(scene))

    def _most_instants(self, scene: Scene) -> int:
        """No more than a pixel has samples."""
        job = self._job
        samples = job.samples or (DRAFT_SAMPLES if job.draft else scene.render.samples)
        return min(self._sequence.instants, samples) if self._sequence.shutter > 0.0 else 1


def frame_job(job: Job, scene: Scene, number: int) -> Job:
    """The job of a frame: its seed is made of the sequence's and its number."""
    return replace(job, seed=frame_seed(scene.render.seed if job.seed is None else job.seed, number))

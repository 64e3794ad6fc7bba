"""The samples of frames in files of their own, from which frames that share them are made."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from lightdepth.api import find_camera
from lightdepth.errors import InputError
from lightdepth.files import exists
from lightdepth.film.frame import NUMBER
from lightdepth.kernel.start import Device
from lightdepth.scene.frames import SceneFrames
from lightdepth.scene.identity import digest, scene_digest
from lightdepth.scene.model import Scene
from lightdepth.sequence.fingerprint import FINGERPRINT, State
from lightdepth.sequence.rendering import SequenceJob, SequenceRendering
from lightdepth.session.displays import Display
from lightdepth.session.events import Event
from lightdepth.session.session import Job

if TYPE_CHECKING:
    from lightdepth.film.frame import Frame
    from lightdepth.sequence.temporal_reuse import SampledFrame

FOLDER = "samples"
"""Beside the frames, where their samples are."""
NEEDED = ("depth", "normal", "albedo", "object_id", "support", "variance", "samples")
"""Layers of other frames that a frame needs."""
PIXELS_KEPT = 1 << 22
"""Of all frames together that are kept in memory."""


class SampledFrames(SequenceRendering):
    """Renders the samples of frames that share them, and reads them.

    Args:
        frames: the scene.
        wanted: the frames that are to be made of them, and how.
        reach: how many frames before and after a frame share its samples.
        device: ``auto``, ``cpu`` or ``cuda``.
        report: is given every event.
    """

    def __init__(
        self, frames: SceneFrames, wanted: SequenceJob, reach: int, device: Device, report: Callable[[Event], None]
    ) -> None:
        job = replace(wanted.job, denoise=False, sharing=1)
        super().__init__(frames, replace(wanted, job=job, layers=None, structure="multipart"), device, report)
        self._reach = reach
        self._scenes: dict[int, str] = {}
        self._read: OrderedDict[int, SampledFrame] = OrderedDict()

    def around(self, number: int) -> list[int]:
        """The frames that share their samples with a frame, itself among them, in order; those of the sequence alone."""
        first, last = self._frames.sequence.frames
        return list(range(max(number - self._reach, first), min(number + self._reach, last) + 1))

    def file(self, number: int) -> Path:  # noqa: D102
        frame = super().file(number)
        return frame.parent / FOLDER / f"{frame.stem}.npz"

    def missing(self, numbers: Sequence[int]) -> list[int]:
        """Those of some frames whose samples are not there as they would be rendered now."""
        return [number for number in numbers if not self._is_there(number)]

    def fingerprint(self, numbers: Sequence[int]) -> str:
        """Digest of all that decides the samples of some frames."""
        return digest([self._print(number) for number in numbers], self._reach)

    def sampled(self, number: int) -> SampledFrame:
        """The samples of a frame, which are there, with the layers that other frames need.

        Raises:
            InputError: they cannot be read.
        """
        from lightdepth.sequence.temporal_reuse import SampledFrame

        if number not in self._read:
            scene = self._scene(number)
            view, tuned = find_camera(scene, self._wanted.job.camera), scene.render.parameters
            self._read[number] = SampledFrame(
                self.frame(number, NEEDED), view, self._scene_digest(number), tuned.film.dark, tuned.reuse
            )
            width, height = view.resolution
            while len(self._read) * width * height > PIXELS_KEPT and len(self._read) > 1:
                self._read.popitem(last=False)
        self._read.move_to_end(number)
        return self._read[number]

    def frame(self, number: int, layers: Collection[str] | None = None) -> Frame:
        """A frame as its own samples give it, with all layers or some.

        Raises:
            InputError: it cannot be read.
        """
        from lightdepth.film.frame_file import load_frame

        view = find_camera(self._scene(number), self._wanted.job.camera)
        return load_frame(self.file(number), view.topology, layers)

    def _scene_digest(self, number: int) -> str:
        if number not in self._scenes:
            self._scenes[number] = scene_digest(self._scene(number))
        return self._scenes[number]

    def _part_files(self, number: int) -> list[Path]:
        return []

    def _job(self, scene: Scene, number: int) -> Job:
        """Where something moves, a frame may have to do with its own samples: they are then not spent elsewhere."""
        around = self.around(number)
        at_rest = len({self._scene_digest(each) for each in around}) == 1
        first, last = self._frames.sequence.frames
        # A point that comes into the picture, or that leaves it, is seen on one side alone.
        shared = min(self._reach, last - first) + 1
        return replace(super()._job(scene, number), sharing=shared if at_rest else 1)

    def _state(self, number: int) -> State:
        from lightdepth.film.frame_file import saved_facts

        file = self.file(number)
        if not exists(file):
            return State.MISSING
        try:
            found = saved_facts(file).get(FINGERPRINT)
        except InputError:
            return State.DAMAGED if exists(file) else State.MISSING
        return State.CURRENT if found == self._print(number) else State.OUTDATED

    def _display(self, number: int, file: Path) -> Display:
        self._read.pop(number, None)
        return _SamplesFile(file, {FINGERPRINT: self._print(number), NUMBER: str(number)})


class _SamplesFile:
    """Writes a finished frame as it is in memory."""

    layers: Collection[str] | None = None

    def __init__(self, file: Path, facts: dict[str, str]) -> None:
        self.file: Path | None = file
        self._path, self._facts = file, facts

    def show(self, frame: Frame, finished: bool) -> None:
        from lightdepth.film.frame_file import save_frame

        if finished:
            frame.metadata |= self._facts
            save_frame(self._path, frame)

"""Rendering the frames of a sequence that are not there yet."""

from __future__ import annotations

import contextlib
import re
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

from lightdepth.api import find_camera
from lightdepth.errors import InputError
from lightdepth.film.frame import NUMBER
from lightdepth.film.layers import Structure
from lightdepth.images.look import Look
from lightdepth.images.tonemapping import auto_exposure
from lightdepth.kernel.start import Device
from lightdepth.scene.frames import SceneFrames
from lightdepth.scene.model import Scene
from lightdepth.sequence.claims import EXPIRY, claim_beside, clear, now, take
from lightdepth.sequence.fingerprint import FINGERPRINT, State, fingerprint, state_of
from lightdepth.sequence.numbering import FrameFiles
from lightdepth.sequence.shutter import Shutter, frame_job
from lightdepth.session.displays import Display
from lightdepth.session.events import Caution, Done, Event, FrameState, Progress, SequenceProgress
from lightdepth.session.session import Job, Session

if TYPE_CHECKING:
    from lightdepth.film.frame import Frame

PATIENCE = 0.5
"""Seconds between two looks at frames that other processes hold."""

_NUMBERS = re.compile(r"[\d.]+")


@dataclass(frozen=True)
class SequenceJob:
    """Which frames to render, how, and where to.

    Attributes:
        numbers: of the frames, in order.
        files: their files.
        job: as for a still; a frame's seed is made of this one and its number.
        layers: to write beside the picture; ``None`` for all.
        exposure: stops by which the PNGs are lighter than the panorama's brightness asks for.
        force: render also what is there.
        structure: of the files; see :func:`~lightdepth.film.layers.write_frame`.
        look: of the PNGs; ``None`` is our own tone curve.
        expiry: seconds after which a frame that a process has claimed, and of which nothing is heard, is free again.
    """

    numbers: Sequence[int]
    files: FrameFiles
    job: Job = Job()  # noqa: RUF009 - it is immutable
    layers: Collection[str] | None = None
    exposure: float = 0.0
    force: bool = False
    structure: Structure = "multipart"
    look: Look | None = None
    expiry: float = EXPIRY


class SequenceRendering:
    """Renders frames one after the other; what their place needs is prepared once.

    Any number of processes, on machines that share the folder of the output, may do the same at the same time: each frame
    is rendered by one of them, and comes out the same whoever renders it.

    Args:
        frames: the scene.
        wanted: which frames, and how.
        device: ``auto``, ``cpu`` or ``cuda``.
        report: is given every event.
    """

    def __init__(
        self, frames: SceneFrames, wanted: SequenceJob, device: Device, report: Callable[[Event], None]
    ) -> None:
        self._frames, self._wanted, self._device, self._report = frames, wanted, device, report
        self._shutter = Shutter(frames.sequence, wanted.job, device, self._scene)
        self._rate = frames.sequence.rate
        self._prints: dict[int, str] = {}
        self._cautions: set[str] = set()
        self._exposure: float | None = None
        self._total, self._done, self._elsewhere = len(wanted.numbers), 0, 0
        self._began, self._done_before = 0.0, 0
        self._begun: float | None = None

    def states(self) -> dict[int, State]:
        """What is on disk of every frame.

        Raises:
            InputError: the scene, or a file that it names, is wrong.
        """
        return {number: self._state(number) for number in self._wanted.numbers}

    def run(self, stopping: Callable[[], bool], numbers: Sequence[int] | None = None) -> bool:
        """Render what is missing or outdated, until it is there.

        Args:
            stopping: whether to stop after the frame that is being rendered.
            numbers: of the frames; those that are wanted by default.

        Returns:
            Whether every frame is there.

        Raises:
            InputError, SetupError: as for a still; the message names the frame.
        """
        numbers = self._wanted.numbers if numbers is None else numbers
        folder = self.file(numbers[0]).parent
        _make_folder(folder)
        if self._begun is None:
            self._begun = now(folder)
        pending = self._pending(numbers)
        self._total = len(numbers)
        self._done = self._done_before = self._total - len(pending)
        self._began = time.monotonic()
        self._tell(None)
        while pending and not stopping():
            taken = False
            self._elsewhere = 0
            for number in list(pending):
                if stopping():
                    break
                file = self.file(number)
                claim = take(claim_beside(file), self._wanted.expiry)
                if claim is None:
                    self._elsewhere += 1
                    continue
                with claim:
                    state = "delivered"
                    if not self._is_there(number):
                        for each in (file, *self._part_files(number)):
                            _remove_unfinished(each, self._wanted.expiry)
                        if not self._render(number, file, stopping):
                            break
                        state = "rendered"
                taken = True
                pending.remove(number)
                self._done += 1
                self._report(FrameState(number, str(file), state))
                self._tell(None)
            if not taken and pending:
                self._tell(None)
                time.sleep(PATIENCE)
        return not pending

    def _pending(self, numbers: Sequence[int]) -> list[int]:
        if self._wanted.force:
            return [number for number in numbers if not self._is_there(number)]
        states = {number: self._state(number) for number in numbers}
        for number, state in states.items():
            if state is State.CURRENT:
                clear(claim_beside(self.file(number)))  # Of a process that was killed when the frame was there.
            self._report(FrameState(number, str(self.file(number)), state))
        return [number for number, state in states.items() if state is not State.CURRENT]

    def file(self, number: int) -> Path:
        """The file of a frame."""
        return self._wanted.files.file(number)

    def _state(self, number: int) -> State:
        file = self.file(number)
        if not all(each.exists() for each in (file, *self._part_files(number))):
            return State.MISSING
        return state_of(file, self._print(number))

    def _part_files(self, number: int) -> list[Path]:
        """Files of views or faces beside that of a frame."""
        from lightdepth.film.layers import part_path

        parts = find_camera(self._scene(number), self._wanted.job.camera).topology.parts
        return [part_path(self.file(number), name) for name in parts]

    def _is_there(self, number: int) -> bool:
        """Whether a frame is there; with ``force``, whether it was made since this process began."""
        if self._state(number) is not State.CURRENT:
            return False
        return not self._wanted.force or self.file(number).stat().st_mtime > (self._begun or 0.0)

    def _print(self, number: int) -> str:
        if number not in self._prints:
            scene = self._scene(number)
            self._prints[number] = fingerprint(
                scene,
                find_camera(scene, self._wanted.job.camera),
                self._job(scene, number),
                self._wanted.layers,
                self._rate,
                self._wanted.structure,
                *self._shutter.motion(number, scene),
            )
        return self._prints[number]

    def _scene(self, number: int, instant: float | None = None) -> Scene:
        with _naming(number):
            return self._frames.scene(number if instant is None else instant)

    def _job(self, scene: Scene, number: int) -> Job:
        return frame_job(self._wanted.job, scene, number)

    def _display(self, number: int, file: Path) -> Display:
        """What writes a frame's files."""
        facts = {FINGERPRINT: self._print(number), NUMBER: str(number)}
        return _FrameDisplay(file, facts, self._rate, self._shown_at() + self._wanted.exposure, self._wanted)

    def _render(self, number: int, file: Path, stopping: Callable[[], bool]) -> bool:
        """Render a frame; whether it is there, and not left because the work is ``stopping``."""
        self._tell(number)
        scene = self._scene(number)
        display = self._display(number, file)
        blurred = self._shutter.blurred(number, scene, self._job(scene, number))
        with _naming(number):
            if blurred.moves:
                blurred.render([display], self._device, lambda event: self._of_frame(number, event))
                return True
            session = Session(scene, self._device)
            session.display(display)
            session.on(lambda event: self._of_frame(number, event))
            session.run(self._job(scene, number))
        return True

    def _shown_at(self) -> float:
        """Stops for the PNGs, alike for all frames: where the panorama's scale changes, the picture is to change."""
        if self._exposure is None:
            self._exposure = auto_exposure(self._scene(self._frames.sequence.first).panorama.radiance)
        return self._exposure

    def _of_frame(self, number: int, event: Event) -> None:
        """Pass on an event of a frame; each warning once, and the frame's end is not that of the work."""
        if isinstance(event, Done):
            return
        if isinstance(event, Caution):
            kind = _NUMBERS.sub("", event.message)
            if kind in self._cautions:
                return
            self._cautions.add(kind)
            event = Caution(f"frame {number}: {event.message}")
        self._report(event)
        if isinstance(event, Progress):
            self._tell(number, event.fraction)

    def _tell(self, frame: int | None, share: float = 0.0) -> None:
        total, left, made = self._work(share)
        seconds = time.monotonic() - self._began
        remaining = 0.0 if left <= 0.0 else round(seconds / made * left, 1) if made > 0.0 else None
        fraction = round(1.0 - left / total, 5)
        self._report(SequenceProgress(frame, self._total, self._done, self._elsewhere, fraction, remaining))

    def _work(self, share: float) -> tuple[float, float, float]:
        """The work of all frames, what is left of it, and what was done since the beginning, in frames.

        Args:
            share: of the one at work that is done.
        """
        return self._total, self._total - self._done - share, self._done - self._done_before + share


class _FrameDisplay:
    """A frame of a sequence as files: the PNG first, so that where the EXR file is, all is."""

    def __init__(
        self,
        file: Path,
        facts: dict[str, str],
        rate: Fraction,
        exposure: float,
        wanted: SequenceJob,
    ) -> None:
        self.file: Path | None = file
        self.layers = wanted.layers
        self._path, self._facts, self._rate, self._exposure = file, facts, rate, exposure
        self._structure, self._look = wanted.structure, wanted.look

    def show(self, frame: Frame, finished: bool) -> None:
        from lightdepth.film.layers import write_frame, write_picture

        if finished:
            frame.metadata |= self._facts
            write_picture(self._path.with_suffix(".png"), frame, self._exposure, look=self._look)
            write_frame(self._path, frame, self.layers, self._rate, self._structure)


@contextlib.contextmanager
def _naming(number: int) -> Iterator[None]:
    """Errors in here name the frame."""
    try:
        yield
    except InputError as error:
        raise InputError(f"frame {number}: {error}") from error


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be created ({error.strerror})") from error


def _remove_unfinished(file: Path, age: float) -> None:
    """Remove what a killed process left of a frame: temporary files that nobody has written to for some time."""
    for path in file.parent.iterdir():
        if path.name.startswith(f".{file.stem}.") and path.suffix in (file.suffix, ".png"):
            with contextlib.suppress(OSError):
                if now(file.parent) - path.stat().st_mtime > age:
                    path.unlink()

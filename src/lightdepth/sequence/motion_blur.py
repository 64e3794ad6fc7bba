"""A frame with motion blur: rendered at several instants while the shutter is open, and their mean."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from lightdepth.api import find_camera
from lightdepth.kernel.start import Device
from lightdepth.packages import require_package
from lightdepth.scene.identity import scene_digest, view_digest
from lightdepth.scene.model import Scene
from lightdepth.sequence.fingerprint import frame_seed
from lightdepth.session.displays import Display
from lightdepth.session.events import Done, Event, Picture, Progress, Stage
from lightdepth.session.session import Job, Session

if TYPE_CHECKING:
    from lightdepth.film.frame import Frame
    from lightdepth.film.shutter import ShutterMean


@dataclass(frozen=True)
class Instant:
    """Instants that are alike.

    Attributes:
        scene: as it is then.
        share: of the time that the shutter is open.
    """

    scene: Scene
    share: float


class MotionBlur:
    """A frame that is the mean of several instants.

    Args:
        scenes: at the instants, in order, which divide the time evenly.
        job: of the frame; its samples and its noise are those of the whole. Its unfinished pictures are means of the
            instants so far.
    """

    def __init__(self, scenes: Sequence[Scene], job: Job) -> None:
        self._job = job
        self._session: Session | None = None
        self._cancelled = False
        found: dict[str, Instant] = {}
        for scene in scenes:
            key = f"{scene_digest(scene)} {view_digest(find_camera(scene, job.camera))}"
            known = found.get(key, Instant(scene, 0.0))
            found[key] = replace(known, share=known.share + 1.0 / len(scenes))
        self.instants = list(found.values())

    @property
    def moves(self) -> bool:
        """Whether anything moves while the shutter is open."""
        return len(self.instants) > 1

    def cancel(self) -> None:
        """Stop soon; the mean of the instants that were rendered is shown. For any thread."""
        self._cancelled = True
        session = self._session
        if session is not None:
            session.cancel()

    def render(self, displays: Sequence[Display], device: Device, report: Callable[[Event], None]) -> Done:
        """Render all instants and show the frame.

        Args:
            displays: show it.
            device: ``auto``, ``cpu`` or ``cuda``.
            report: is given the events, with the progress of the whole.

        Returns:
            How it ended, the last event.

        Raises:
            InputError, SetupError: as for a still.
        """
        from lightdepth.film.shutter import ShutterMean

        if self._job.denoise:  # Before the work, not after it.
            require_package("mitsuba_oidn", "denoise")
        mean = ShutterMean(middle=len(self.instants) // 2)
        wanted = [display.layers for display in displays]
        layers = None if self._job.denoise or None in wanted else {name for each in wanted for name in each or ()}
        done, shown = 0.0, time.monotonic()
        for number, instant in enumerate(self.instants):
            if self._cancelled:
                break
            self._session = Session(instant.scene, device)
            self._session.display(_Collecting(mean, instant.share, layers))
            self._session.on(_part_of_all(report, done, instant.share))
            self._session.run(self._part(number, instant), lambda: self._cancelled)
            done += instant.share
            pause = self._job.preview_seconds
            if pause is not None and not mean.is_empty and time.monotonic() - shown > pause:
                self._show(mean.frame(), displays, report, finished=False)
                shown = time.monotonic()
        if mean.is_empty:
            return _ended(Done(None, interrupted=True), report)
        frame = mean.frame()
        frame.metadata["instants"] = str(len(self.instants))
        if self._job.seed is not None:
            frame.metadata["seed"] = str(self._job.seed)
        if self._job.denoise:
            from lightdepth.film.denoising import denoise

            report(Stage("denoising"))
            frame = denoise(frame, self.instants[0].scene.render.parameters.denoising)
        from lightdepth.film.layers import picture_exposure

        report(Stage("writing"))
        file = self._show(frame, displays, report, finished=True)
        exposure, error = round(picture_exposure(frame), 3), round(float(frame.metadata["error"]), 5)
        return _ended(Done(file, self._cancelled, exposure, error, self._job.denoise), report)

    def _show(
        self, frame: Frame, displays: Sequence[Display], report: Callable[[Event], None], finished: bool
    ) -> str | None:
        for display in displays:
            display.show(frame, finished)
        file = next((str(display.file) for display in displays if display.file is not None), None)
        report(Picture(file, finished))
        return file

    def _part(self, number: int, instant: Instant) -> Job:
        """The job of an instant: its share of the samples; more noise, of which the mean leaves as much as is wanted."""
        job, settings = self._job, instant.scene.render
        samples = job.samples or settings.samples
        noise = job.noise or settings.noise
        seed = settings.seed if job.seed is None else job.seed
        if noise is not None:
            noise /= math.sqrt(sum(each.share**2 for each in self.instants))
        return replace(
            job,
            samples=max(round(samples * instant.share), 1),
            noise=noise,
            seed=frame_seed(seed, number),
            denoise=False,
            preview_seconds=None,
        )


class _Collecting:
    """Takes the finished frame of an instant into the mean."""

    file: Path | None = None

    def __init__(self, mean: ShutterMean, share: float, layers: Collection[str] | None) -> None:
        self.layers = layers
        self._mean, self._share = mean, share

    def show(self, frame: Frame, finished: bool) -> None:
        if finished:
            self._mean.add(frame, self._share)


def _part_of_all(report: Callable[[Event], None], done: float, share: float) -> Callable[[Event], None]:
    """Passes on the events of an instant, its progress as a part of the whole."""

    def passed(event: Event) -> None:
        if isinstance(event, Progress):
            report(replace(event, fraction=round(done + share * event.fraction, 5)))
        elif not isinstance(event, Picture | Done):
            report(event)

    return passed


def _ended(event: Done, report: Callable[[Event], None]) -> Done:
    report(event)
    return event

"""The life of a rendering: start, events, pause, reset, more samples, cancel."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lightdepth.api import DEFAULT_METHOD, begin_rendering, find_camera, forget_prepared
from lightdepth.cancellation import Cancelled, cancellable, raise_if_cancelled
from lightdepth.errors import InputError, LightdepthError
from lightdepth.film.checkpoint import remove_checkpoint, write_checkpoint
from lightdepth.film.checkpoint import resume as resume_from
from lightdepth.film.sums import PixelSums, Share
from lightdepth.kernel.start import Device
from lightdepth.packages import require_package
from lightdepth.scene.model import Scene
from lightdepth.session.displays import Display
from lightdepth.session.events import Caution, Done, Event, Failure, Picture, Preparing, Progress, Stage
from lightdepth.work import watched

if TYPE_CHECKING:
    from lightdepth.film.frame import Frame
    from lightdepth.film.rendering import Progress as Step
    from lightdepth.film.rendering import Rendering

CHECKPOINT_SECONDS = 30.0
"""Most work that a killed process loses."""
LOGGER = logging.getLogger(__name__)


@dataclass(frozen=True)
class Job:
    """What is to be rendered of a scene, and how.

    Attributes:
        camera: name of the camera; the scene's first by default.
        samples: samples per pixel; the scene's own setting by default.
        noise: relative error at which a pixel is done; the scene's own setting by default.
        method: name of the method.
        seed: of the random numbers; the scene's own setting by default.
        draft: a quick look.
        denoise: denoise the finished picture.
        region: columns and rows (left, top, right, bottom) that are finished before the rest is begun.
        share: the part of the work to do.
        sums: where to save the sums of the samples; there is no picture then.
        merged: sums to make the picture of, without taking samples.
        checkpoint: where to keep a checkpoint while rendering; it is removed when all is done.
        checkpoint_seconds: between two of them, at least.
        resume: go on from ``checkpoint`` where it exists.
        preview_seconds: between two unfinished pictures, at least; ``None`` shows none.
        cache: use and fill the cache of prepared places on disk.
        sharing: frames of a sequence that will share the samples of matte support; ``None`` for pictures of their own.
    """

    camera: str | None = None
    samples: int | None = None
    noise: float | None = None
    method: str = DEFAULT_METHOD
    seed: int | None = None
    draft: bool = False
    denoise: bool = False
    region: tuple[int, int, int, int] | None = None
    share: Share = Share()  # noqa: RUF009 - it is immutable
    sums: Path | None = None
    merged: PixelSums | None = None
    checkpoint: Path | None = None
    checkpoint_seconds: float = CHECKPOINT_SECONDS
    resume: bool = False
    preview_seconds: float | None = None
    cache: bool = True
    sharing: int | None = None


_GOES_ON: dict[str, Any] = dict.fromkeys(("samples", "noise", "denoise", "region", "preview_seconds"))
"""What may change from one job to the next without another picture to sample."""


class Session:
    """Renders one scene at a time, here or in a thread of its own, and reports events.

    The methods may be called from any thread. Listeners and displays are called from the one that renders: there, all but
    those that wait for its end may be called.

    Args:
        scene: what to render.
        device: ``auto``, ``cpu`` or ``cuda``.
        keep: keep what was rendered and prepared, so that :meth:`set_samples` can continue from there; else the memory is
            freed before the finished picture is denoised and shown.
    """

    def __init__(self, scene: Scene, device: Device = "auto", keep: bool = True) -> None:
        self._scene, self._device, self._keep = scene, device, keep
        self._listeners: list[Callable[[Event], None]] = []
        self._displays: list[Display] = []
        self._control = threading.RLock()
        """Held while a thread is ended or begun, so that there is one at most; the thread itself never waits for it."""
        self._changed = threading.Condition()
        self._cancelled, self._paused, self._discarded = False, False, False
        self._sampled_job: Job | None = None
        self._idle = True
        self._job = Job()
        self._rendering: Rendering | None = None
        self._thread: threading.Thread | None = None

    # -- Listeners and displays ---------------------------------------------------------------------------------

    def on(self, listener: Callable[[Event], None]) -> None:
        """Report every event to ``listener``."""
        self._listeners.append(listener)

    def display(self, display: Display) -> None:
        """Show the pictures on ``display``."""
        self._displays.append(display)

    def _report(self, event: Event) -> None:
        if isinstance(event, Stage):
            LOGGER.info("stage=%s camera=%s", event.stage, self._job.camera)
        for listener in self._listeners:
            listener(event)

    # -- Control ------------------------------------------------------------------------------------------------

    @property
    def running(self) -> bool:
        """Whether a thread of the session is at work, or paused."""
        return self._thread is not None and self._thread.is_alive()

    def start(self, job: Job) -> None:
        """Begin to render in a thread; one that is at work is cancelled first.

        Samples that a job of the same picture took count, also where the next one asks for more of them, for another
        region first, or for a denoised picture.

        Errors are reported as a :class:`~lightdepth.session.events.Failure`.

        Raises:
            InputError: a listener or a display of this session calls it.
        """
        self._must_not_be_inside()
        with self._control:
            self._end_thread()
            if replace(job, **_GOES_ON) != replace(self._job, **_GOES_ON):
                self._rendering = None
            self._job = job
            self._begin_thread()

    def pause(self) -> None:
        """Stop after the current pass, until :meth:`resume`."""
        with self._changed:
            self._paused = True

    def resume(self) -> None:
        """Continue after :meth:`pause`."""
        with self._changed:
            self._paused = False
            self._changed.notify_all()

    def cancel(self) -> None:
        """Stop soon, also during preparation; an unfinished picture is shown as it is."""
        with self._changed:
            self._cancelled = True
            self._changed.notify_all()

    def reset(self, scene: Scene) -> None:
        """Cancel the rendering and begin the same with a changed scene.

        Raises:
            InputError: a listener or a display of this session calls it.
        """
        self._must_not_be_inside()
        with self._control:
            self._end_thread()
            self._scene, self._rendering = scene, None
            self._begin_thread()

    def set_samples(self, samples: int) -> None:
        """Change how many samples per pixel are wanted; those already taken count.

        Raises:
            InputError: ``samples`` is out of range.
        """
        if samples < 1:
            raise InputError(f"samples = {samples}: at least 1 is needed")
        with self._changed:
            self._job = replace(self._job, samples=samples)
            if not self._idle:
                return
        with self._control:
            self.wait()
            if self._idle:  # Else another thread has begun it meanwhile.
                self._begin_thread()

    def wait(self, seconds: float | None = None) -> bool:
        """Wait until the thread has ended, or for some time; whether it has.

        Raises:
            InputError: a listener or a display of this session calls it.
        """
        self._must_not_be_inside()
        if self._thread is not None:
            self._thread.join(seconds)
        return not self.running

    def _must_not_be_inside(self) -> None:
        if self._thread is threading.current_thread():
            raise InputError("a session cannot wait for its own end: start, reset or wait from another thread")

    def _begin_thread(self) -> None:
        self._cancelled = self._paused = self._idle = False
        self._thread = threading.Thread(target=self._in_thread, name="lightdepth session", daemon=True)
        self._thread.start()

    def _end_thread(self) -> None:
        """Cancel the rendering, without a picture of it."""
        if self.running:
            self._discarded = True
            self.cancel()
            self.resume()
            self.wait()
        self._discarded = False

    def _in_thread(self) -> None:
        try:
            self._render()
            while self._is_wanted():
                self._render()
        except LightdepthError as error:
            self._report(Failure(str(error)))
        except Exception as error:
            LOGGER.exception("a session failed")
            self._report(Failure(f"internal error: {type(error).__name__}: {error}"))
        finally:
            self._idle = True

    def _is_wanted(self) -> bool:
        """Whether other samples have been asked for since the last ones were taken; if not, the thread is done."""
        with self._changed:
            self._idle = self._cancelled or self._sampled_job is self._job
            return not self._idle

    # -- The work -----------------------------------------------------------------------------------------------

    def run(self, job: Job, cancelled: Callable[[], bool] | None = None) -> Done:
        """Render in this thread until all is done, or until :meth:`cancel`.

        Args:
            job: what to render.
            cancelled: whether it is no longer wanted, asked now and then; :meth:`cancel` alone by default.

        Returns:
            How it ended, the last event.

        Raises:
            InputError, SetupError: as :func:`lightdepth.render` raises them, or a file cannot be written.
        """
        with self._control:
            self._end_thread()
        self._job, self._rendering, self._paused = job, None, False
        self._cancelled = False if cancelled is None else cancelled()
        return self._render()

    def _render(self) -> Done:
        job = self._job
        if job.denoise:  # Before the work, not after it.
            require_package("mitsuba_oidn", "denoise")
        try:
            rendering = self._rendering or self._prepared(job)
        except Cancelled:
            return self._done(Done(None, interrupted=True))
        if job.merged is None:
            interrupted = not self._sampled(rendering)
        else:
            interrupted, self._sampled_job = False, job
        if self._discarded:
            return Done(None, interrupted=True)
        self._rendering = rendering if self._keep else None
        if job.sums is not None:
            return self._saved(rendering, job, job.sums, interrupted)
        wanted = [display.layers for display in self._displays]
        frame = rendering.frame(_auxiliary(wanted, job.denoise), finish=not self._keep)
        del rendering
        if not self._keep:
            forget_prepared()  # To write a large picture takes memory as well.
        if job.denoise:
            from lightdepth.film.denoising import denoise

            self._report(Stage("denoising"))
            frame = denoise(frame, self._scene.render.parameters.denoising)
        from lightdepth.film.layers import picture_exposure

        file = self._show(frame, finished=True)
        if job.checkpoint is not None and not interrupted:
            remove_checkpoint(job.checkpoint)
        error = round(float(frame.metadata["error"]), 5)
        return self._done(Done(file, interrupted, round(picture_exposure(frame), 3), error, job.denoise))

    def _done(self, event: Done) -> Done:
        if not self._discarded:
            self._report(event)
        return event

    def _prepared(self, job: Job) -> Rendering:
        """A rendering that has just begun, or goes on from its checkpoint."""
        find_camera(self._scene, job.camera)  # A mistyped name is refused before anything is said to be prepared.
        self._report(Stage("preparing"))
        began = time.monotonic()
        with cancellable(lambda: self._cancelled), watched(lambda done: self._report(Preparing(round(done, 4)))):
            rendering = begin_rendering(
                self._scene,
                job.camera,
                job.method,
                job.seed,
                self._device,
                lambda message: self._report(Caution(message)),
                job.draft,
                job.share,
                job.cache,
                job.sharing,
            )
            raise_if_cancelled()
        LOGGER.info("prepared seconds=%.2f pixels=%d", time.monotonic() - began, len(rendering.pixels))
        if job.merged is not None:
            rendering.adopt(job.merged)
        if job.checkpoint is not None and job.checkpoint.exists():
            if job.resume:
                resume_from(job.checkpoint, rendering)
                LOGGER.info("resumed checkpoint=%s", job.checkpoint)
            else:
                self._report(
                    Caution(f"{job.checkpoint}: of an earlier rendering, is replaced; --resume would go on from it")
                )
        return rendering

    def _sampled(self, rendering: Rendering) -> bool:
        """Take the samples; whether all were taken."""
        self._report(Stage("rendering"))
        began = shown = kept = now = time.monotonic()
        regions = [None] if self._job.region is None else [self._job.region, None]
        while regions:
            job = self._job
            for step in rendering.run(*rendering.target(job.samples, job.noise), regions[0]):
                self._report(_progress(step))
                lasted, now = time.monotonic() - now, time.monotonic()
                if job.preview_seconds is not None and not self._cancelled and now - shown > job.preview_seconds:
                    self._show(rendering.frame(auxiliary=False), finished=False)
                    shown = time.monotonic()
                # What the next pass would take counts: a process that is killed in it loses that as well.
                due = now + lasted - kept > job.checkpoint_seconds
                if job.checkpoint is not None and due and step.fraction < 1.0:
                    kept = self._keep_checkpoint(rendering, job.checkpoint)
                with self._changed:
                    self._changed.wait_for(lambda: self._cancelled or not self._paused)
                    if self._cancelled and step.fraction < 1.0:
                        break
                    if self._job is not job:
                        break
            else:
                regions.pop(0)
                self._sampled_job = job
                continue
            if self._cancelled:
                if self._job.checkpoint is not None and not self._discarded:
                    self._keep_checkpoint(rendering, self._job.checkpoint)
                return False
        if self._job.checkpoint is not None and now - began > self._job.checkpoint_seconds:
            self._keep_checkpoint(rendering, self._job.checkpoint)  # To denoise and write may take long as well.
        return True

    def _keep_checkpoint(self, rendering: Rendering, path: Path) -> float:
        """Write a checkpoint, which the picture can do without; the time when it was there."""
        began = time.monotonic()
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_checkpoint(path, rendering)
            LOGGER.info("checkpoint=%s seconds=%.2f", path, time.monotonic() - began)
        except (InputError, OSError) as error:
            self._report(Caution(f"no checkpoint: {error}"))
        return began

    def _saved(self, rendering: Rendering, job: Job, path: Path, interrupted: bool) -> Done:
        """The sums in a file; an interrupted share would not be one, and has its checkpoint."""
        if interrupted:
            return self._done(Done(None, interrupted))
        self._report(Stage("writing"))
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{path}: cannot be written ({error.strerror})") from error
        rendering.sums().save(path)
        if job.checkpoint is not None:
            remove_checkpoint(job.checkpoint)
        return self._done(Done(str(path)))

    def _show(self, frame: Frame, finished: bool) -> str | None:
        """Show a picture on all displays; the first file that it is in."""
        if finished:
            self._report(Stage("writing"))
        for display in self._displays:
            display.show(frame, finished)
        file = next((str(display.file) for display in self._displays if display.file is not None), None)
        self._report(Picture(file, finished))
        return file


def _auxiliary(wanted: list[Collection[str] | None], denoise: bool) -> bool:
    """Whether object ids, depth, normals and albedo are needed."""
    from lightdepth.film.layers import AUXILIARY

    return denoise or any(layers is None or not AUXILIARY.isdisjoint(layers) for layers in wanted)


def _progress(step: Step) -> Progress:
    return Progress(round(step.fraction, 4), round(step.samples, 2), round(step.error, 5), round(step.seconds_left, 1))

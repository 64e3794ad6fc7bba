"""Steady frames: each made of its own samples and of those of the frames around it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from lightdepth.errors import InputError
from lightdepth.film.layers import FILE_LAYOUT
from lightdepth.kernel.start import Device, start
from lightdepth.packages import require_package
from lightdepth.scene.frames import SceneFrames
from lightdepth.scene.identity import digest
from lightdepth.sequence.rendering import SequenceJob, SequenceRendering
from lightdepth.sequence.samples import SampledFrames
from lightdepth.session.events import Event, FrameState, Picture, SequenceProgress, Stage


class SteadyRendering(SequenceRendering):
    """Renders the frames of a sequence that share the samples of matte support with their neighbours in time.

    The samples of each frame are rendered once, with its own seed, into a file of their own. A frame is a function of
    those around it, so that it comes out the same whoever renders which of them.

    Args:
        frames: the scene.
        wanted: which frames, and how.
        reach: how many frames before and after a frame share their samples with it.
        device: ``auto``, ``cpu`` or ``cuda``.
        report: is given every event.

    Raises:
        InputError: it is a draft, which has no layers to find surfaces again by.
    """

    def __init__(
        self, frames: SceneFrames, wanted: SequenceJob, reach: int, device: Device, report: Callable[[Event], None]
    ) -> None:
        if wanted.job.draft:
            raise InputError("--steady: not with --draft, which renders no depth to find surfaces by")
        super().__init__(frames, wanted, device, report)
        self._samples = SampledFrames(frames, wanted, reach, device, self._of_samples)
        self._at: int | None = None
        self._needed, self._missing, self._made = 1, 0, 0

    def _print(self, number: int) -> str:
        if number not in self._prints:
            wanted = self._wanted
            layers = None if wanted.layers is None else sorted(wanted.layers)
            self._prints[number] = digest(
                self._samples.fingerprint(self._samples.around(number)),
                wanted.job.denoise,
                layers,
                wanted.structure,
                FILE_LAYOUT,
            )
        return self._prints[number]

    def _render(self, number: int, file: Path, stopping: Callable[[], bool]) -> bool:
        if self._wanted.job.denoise:  # Before the work, not after it.
            require_package("mitsuba_oidn", "denoise")
        self._at = number
        self._tell(number)
        if not self._samples.run(stopping, self._samples.around(number)):
            return False
        start(self._device)
        from lightdepth.sequence.temporal_reuse import reuse

        around = self._samples.around(number)
        before = (self._samples.sampled(each) for each in reversed(around) if each < number)
        after = (self._samples.sampled(each) for each in around if each > number)
        frame = reuse(self._samples.frame(number), self._samples.sampled(number), (before, after))
        frame.metadata["steady_frames"] = str(len(around))
        if self._wanted.job.denoise:
            from lightdepth.film.denoising import denoise

            self._report(Stage("denoising"))
            frame = denoise(frame, self._scene(number).render.parameters.denoising)
        self._report(Stage("writing"))
        self._display(number, file).show(frame, finished=True)
        self._report(Picture(str(file), finished=True))
        return True

    def _pending(self, numbers: Sequence[int]) -> list[int]:
        pending = super()._pending(numbers)
        needed = sorted({each for number in pending for each in self._samples.around(number)})
        self._needed = max(len(needed), 1)
        self._missing, self._made = len(self._samples.missing(needed)), 0
        return pending

    def _work(self, share: float) -> tuple[float, float, float]:
        """Nearly all of it are the samples, and the first frame needs those of several."""
        made = self._made + share
        return self._needed, max(self._missing - made, 0.0), made

    def _of_samples(self, event: Event) -> None:
        """Pass on an event of the samples' rendering; how far it is counts for the frame that needs them."""
        if isinstance(event, FrameState):
            self._made += event.state in ("rendered", "delivered")
        elif isinstance(event, SequenceProgress):
            self._tell(self._at, max(event.fraction * event.total - event.done, 0.0))
        elif not isinstance(event, Picture):
            self._report(event)

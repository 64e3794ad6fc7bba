"""`lightdepth render --frames`: the frames of a scene that moves."""

from __future__ import annotations

import signal
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import typer
from rich.progress import BarColumn, TextColumn

from lightdepth.cli.reporting import EventReporter, own_command
from lightdepth.errors import InputError, LightdepthError

if TYPE_CHECKING:
    from collections.abc import Collection

    from lightdepth.cli.render import Interruption
    from lightdepth.film.layers import Structure
    from lightdepth.images.look import Look
    from lightdepth.kernel.start import Device
    from lightdepth.scene.frames import SceneFrames
    from lightdepth.sequence.rendering import SequenceJob, SequenceRendering
    from lightdepth.session.events import Event, SequenceProgress
    from lightdepth.session.session import Job

UNFINISHED = 1
"""Exit status of ``--verify`` where frames are missing or not what would be rendered now."""
DIGITS = 4
WORDS = {
    "missing": "missing",
    "outdated": "made from another scene, other settings or files, or by another version",
    "damaged": "incomplete or damaged",
    "current": "as they would be rendered now",
}


@dataclass(frozen=True)
class Shot:
    """What `lightdepth render --frames` asks for.

    Attributes:
        scene: the scene file.
        frames: which frames, as the option has them.
        job: as for a still.
        look: of the PNGs.
        output: the pattern of the files; made of the names of scene and camera by default.
        step: of each range, take every ``step``-th frame.
        layers: to write beside the picture; ``None`` for all.
        exposure: stops by which the PNGs are lighter.
        repair: replace impossible radiance of the panorama.
        device: ``auto``, ``cpu`` or ``cuda``.
        force: render also what is there.
        structure: of the files.
        verify: only say what is there.
        progress: how it is reported.
        steady: frames before and after each one that share their samples with it; ``None`` for frames of their own.
    """

    scene: Path
    frames: str
    job: Job
    look: Look
    output: Path | None = None
    step: int = 1
    layers: Collection[str] | None = None
    exposure: float = 0.0
    repair: bool = False
    device: Device = "auto"
    force: bool = False
    structure: Structure = "multipart"
    verify: bool = False
    progress: str = "bar"
    steady: int | None = None


def render_sequence(shot: Shot, interruption: Interruption) -> None:
    """Render the frames of a sequence that are not there, or say what is there.

    Args:
        shot: which frames, and how.
        interruption: whether Ctrl-C was pressed.

    Raises:
        InputError, SetupError: as for a still.
        typer.Exit: it was interrupted, or ``verify`` finds that something is missing.
    """
    from lightdepth.api import find_camera
    from lightdepth.scene.frames import SceneFrames
    from lightdepth.sequence.numbering import FrameFiles, parsed_frames
    from lightdepth.sequence.rendering import SequenceJob, SequenceRendering
    from lightdepth.sequence.steady import SteadyRendering

    moving, job = SceneFrames(shot.scene, shot.repair), shot.job
    numbers = parsed_frames(shot.frames, shot.step, moving.sequence)
    loaded = moving.scene(numbers[0])
    find_camera(loaded, job.camera)
    name = job.camera or next(iter(loaded.cameras))
    files = FrameFiles(shot.output or Path(f"{shot.scene.stem}-{name}.{'#' * DIGITS}.exr"))
    wanted = SequenceJob(numbers, files, job, shot.layers, shot.exposure, shot.force, shot.structure, shot.look)
    with _Reporter(shot.progress, wanted) as reporter:
        rendering = (
            SequenceRendering(moving, wanted, shot.device, reporter.report)
            if shot.steady is None
            else SteadyRendering(moving, wanted, shot.steady, shot.device, reporter.report)
        )
        reporter.begin()
        if shot.verify:
            _verify(rendering, wanted, reporter)
        else:
            _render(rendering, moving, wanted, reporter, interruption)


def _verify(rendering: SequenceRendering, wanted: SequenceJob, reporter: _Reporter) -> None:
    from lightdepth.sequence.fingerprint import State
    from lightdepth.session.events import Done, FrameState

    states = rendering.states()
    for number, state in states.items():
        reporter.report(FrameState(number, str(wanted.files.file(number)), state))
    unfinished = any(state is not State.CURRENT for state in states.values())
    reporter.report(Done(str(wanted.files.pattern), interrupted=unfinished))
    reporter.print_states()
    if unfinished:
        raise typer.Exit(UNFINISHED)


def _render(
    rendering: SequenceRendering,
    moving: SceneFrames,
    wanted: SequenceJob,
    reporter: _Reporter,
    interruption: Interruption,
) -> None:
    from lightdepth.cli.render import INTERRUPTED
    from lightdepth.session.events import Done, Failure

    try:
        _refuse_errors(moving, wanted)
        interruption.wait = True
        reporter.interruption = interruption
        with _terminable(interruption):
            complete = rendering.run(lambda: interruption.asked)
    except LightdepthError as error:
        reporter.report(Failure(str(error)))
        raise
    except (KeyboardInterrupt, RuntimeError):
        if not interruption.dropped:
            raise
        complete = False
    reporter.report(Done(str(wanted.files.pattern), interrupted=not complete))
    reporter.end(complete)
    if not complete:
        raise typer.Exit(INTERRUPTED)


@contextmanager
def _terminable(interruption: Interruption) -> Iterator[None]:
    """Let a polite kill, as farms send it, drop the frame and give back its claim, as the second Ctrl-C does."""
    before = signal.signal(signal.SIGTERM, interruption.drop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _refuse_errors(moving: SceneFrames, wanted: SequenceJob) -> None:
    """Find at the start what would stop the work at one of its frames.

    Raises:
        InputError: there is such a thing; a line for each.
    """
    from lightdepth.checks import Severity, frames_problems

    first, last = wanted.numbers[0], wanted.numbers[-1]
    found = [
        f"{moving.path}: {problem.message}"
        for problem in frames_problems(moving)
        if problem.severity is Severity.ERROR
        and (not problem.frames or any(first <= frame <= last for frame in problem.frames))
    ]
    if found:
        raise InputError("\n".join(found))


class _Reporter(EventReporter):
    """Reports the rendering of a sequence."""

    def __init__(self, kind: str, wanted: SequenceJob) -> None:
        columns = TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[facts]}")
        super().__init__(kind, "frames", columns)
        self._wanted = wanted
        self._frames: dict[str, list[int]] = defaultdict(list)
        self._told = False
        self.interruption: Interruption | None = None

    def _show(self, event: Event) -> None:
        from lightdepth.session.events import FrameState, SequenceProgress

        if isinstance(event, FrameState):
            self._frames[event.state].append(event.frame)
        elif isinstance(event, SequenceProgress):
            self._progress(event)

    def _progress(self, event: SequenceProgress) -> None:
        if self.interruption is not None and self.interruption.asked and not self._told:
            self._told = True
            self._console.print("finishing this frame; Ctrl-C again drops it", style="yellow")
        at = "" if event.frame is None else f"frame {event.frame}, "
        others = f", {event.elsewhere} elsewhere" if event.elsewhere else ""
        left = "" if event.seconds_left is None else f", {_span(event.seconds_left)} left"
        facts = f"{at}{event.done} of {event.total} done{others}{left}"
        self._advance("frames", event.fraction, facts)

    def print_states(self) -> None:
        """Say what is on disk."""
        from lightdepth.numbered_files import told_frames

        if self._kind == "json":
            return
        for state, words in WORDS.items():
            if numbers := self._frames[state]:
                count = f"{len(numbers)} of {len(self._wanted.numbers)}"
                self._console.print(f"{count} {words}: {told_frames(numbers)}", markup=False)

    def end(self, complete: bool) -> None:
        """Say what was done, and how to go on."""
        from lightdepth.numbered_files import told_frames

        if self._bar is not None:
            self._bar.stop()
        if self._kind != "json":
            made, total = self._frames["rendered"], len(self._wanted.numbers)
            parts = [f"rendered {len(made)} of {total} frames" + (f" ({told_frames(made)})" if made else "")]
            if kept := self._frames["current"]:
                parts.append(f"{len(kept)} were there")
            if others := self._frames["delivered"]:
                parts.append(f"{len(others)} came from other processes")
            self._console.print(f"{', '.join(parts)}: {self._wanted.files.pattern}", markup=False)
        if not complete:
            self._console.print(
                f"interrupted; the same command continues: {own_command()}", style="yellow", markup=False
            )


def _span(seconds: float) -> str:
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{seconds:02}" if hours else f"{minutes}:{seconds:02}"

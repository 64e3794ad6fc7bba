"""`lightdepth render`: a scene file to pictures."""

from __future__ import annotations

import math
import signal
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeRemainingColumn

from lightdepth.cli.options import (
    Denoise,
    Device,
    Exposure,
    ExrStructure,
    Ocio,
    OcioDisplay,
    OcioView,
    Progress,
    Repair,
    SceneFile,
)
from lightdepth.cli.reporting import EventReporter, own_command
from lightdepth.errors import InputError
from lightdepth.files import exists

if TYPE_CHECKING:
    from lightdepth.session.events import Done, Event
    from lightdepth.session.session import Job, Session

INTERRUPTED = 130
"""Exit status after Ctrl-C, as shells have it."""


def render(
    scene: SceneFile,
    camera: Annotated[str | None, typer.Option(help="Name of the camera; the first by default.")] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="The EXR file to write, shot.####.exr of a sequence; a PNG is beside it."),
    ] = None,
    frames: Annotated[
        str | None, typer.Option(help=r"Frames of the scene's \[sequence] to render, as 1-240 or 7,10-20.")
    ] = None,
    step: Annotated[int, typer.Option(min=1, help="Render only every N-th of --frames.")] = 1,
    force: Annotated[bool, typer.Option("--force", help="Render the --frames again that are up to date, too.")] = False,
    verify: Annotated[
        bool, typer.Option("--verify", help="Only report which --frames are missing or outdated.")
    ] = False,
    steady: Annotated[
        int | None, typer.Option(min=1, help="Each of the --frames shares samples with this many before and after it.")
    ] = None,
    samples: Annotated[int | None, typer.Option(min=1, help="Samples per influenced pixel.")] = None,
    noise: Annotated[
        float | None, typer.Option(min=1e-6, help="Stop where the estimated relative error is below this.")
    ] = None,
    seed: Annotated[int | None, typer.Option(min=0, max=2**32 - 1, help="Seed of the random numbers.")] = None,
    method: Annotated[str, typer.Option(help="difference | envpath | directional")] = "difference",
    device: Device = "auto",
    denoise: Denoise = False,
    draft: Annotated[
        bool, typer.Option("--draft", help="A quick look: one sample, light known roughly, no layers.")
    ] = False,
    exposure: Exposure = 0.0,
    ocio: Ocio = None,
    display: OcioDisplay = None,
    view: OcioView = None,
    layers: Annotated[
        str | None,
        typer.Option(help="Layers to write beside the picture, comma-separated; 'all' (the default) or 'none'."),
    ] = None,
    exr: ExrStructure = "multipart",
    no_cache: Annotated[
        bool, typer.Option("--no-cache", help="Neither use nor fill the cache of prepared places.")
    ] = False,
    repair: Repair = False,
    progress: Progress = "bar",
    region: Annotated[
        str | None, typer.Option(help="Finish this region first: left,top,right,bottom in pixels.")
    ] = None,
    share: Annotated[
        str | None, typer.Option(help="Render one share of the samples, as 2/4; writes sums for `lightdepth merge`.")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on from the checkpoint beside the output.")] = False,
    checkpoint_seconds: Annotated[
        float | None, typer.Option(min=0.0, help="Seconds between two checkpoints; 30 by default.")
    ] = None,
    preview_seconds: Annotated[
        float | None, typer.Option(min=0.1, help="Seconds after which the unfinished picture is written again.")
    ] = None,
) -> None:
    """Render new objects into the photographed place.

    Writes the linear HDR picture with its layers as OpenEXR, and a tone-mapped PNG beside it. Ctrl-C writes what has
    been rendered so far. A long rendering keeps a checkpoint beside the output, from which `--resume` goes on.

    With `--frames`, the frames that are missing or outdated are rendered; the same command may run several times at once,
    here and on other machines.

    Example: lightdepth render examples/lounge/scene.toml --camera view -o out/view.exr --samples 64
    """
    from lightdepth.api import load_scene
    from lightdepth.cli.sequence import Shot, render_sequence
    from lightdepth.film.checkpoint import checkpoint_beside
    from lightdepth.film.sums import Share
    from lightdepth.images.look import chosen_look
    from lightdepth.packages import require_package
    from lightdepth.session.displays import ExrDisplay, PngDisplay
    from lightdepth.session.session import CHECKPOINT_SECONDS, Job, Session

    if denoise:  # Not first found out when all is rendered.
        require_package("mitsuba_oidn", "denoise")
    chosen = chosen_layers(layers or ("none" if draft else "all"))
    look = chosen_look(None, ocio, display, view)
    part = Share() if share is None else Share.parse(share)
    if frames is not None:
        still = {
            "--share": share is not None,
            "--resume": resume,
            "--region": region is not None,
            "--preview-seconds": preview_seconds is not None,
            "--checkpoint-seconds": checkpoint_seconds is not None,
        }
        if given := [option for option, used in still.items() if used]:
            raise InputError(f"{', '.join(given)}: only for a still, not with --frames")
        job = Job(camera, samples, noise, method, seed, draft, denoise, cache=not no_cache)
        shot = Shot(
            scene,
            frames,
            job,
            look,
            output,
            step,
            chosen,
            exposure,
            repair,
            device,
            force,
            exr,
            verify,
            progress,
            steady,
        )
        with Interruption() as interruption:
            render_sequence(shot, interruption)
        return
    if force or verify or step != 1 or steady is not None:
        raise InputError("--force, --verify, --step and --steady go with --frames")
    if output is not None and "#" in output.name:
        raise InputError(f"-o {output}: numbered files are for a sequence; give --frames")
    with Interruption() as interruption:
        try:
            loaded = load_scene(scene, repair)
            name = camera or next(iter(loaded.cameras))
            target = output or Path(f"{scene.stem}-{name}{'.exr' if share is None else '.sums'}")
            files = [target] if share is not None else [target, target.with_suffix(".png")]
            check_output(target, files, ".exr" if share is None else ".sums")
            job = Job(
                camera=name,
                samples=samples,
                noise=noise,
                method=method,
                seed=seed,
                draft=draft,
                denoise=denoise,
                region=None if region is None else parsed_region(region),
                share=part,
                sums=None if share is None else target,
                checkpoint=checkpoint_beside(target),
                checkpoint_seconds=CHECKPOINT_SECONDS if checkpoint_seconds is None else checkpoint_seconds,
                resume=resume,
                preview_seconds=preview_seconds,
                cache=not no_cache,
            )
            session = Session(loaded, device, keep=False)
            if share is None:
                session.display(ExrDisplay(target, chosen, exr))
                session.display(PngDisplay(files[1], exposure, look))
            with Reporter(progress, files, exposure, own_command("--resume")) as reporter:
                run(session, job, reporter, interruption)
        except (KeyboardInterrupt, RuntimeError):
            if not interruption.dropped:
                raise
            when = (
                "again; the picture was not finished" if interruption.wait else "while preparing; nothing was written"
            )
            Console(stderr=True).print(f"interrupted {when}", style="yellow")
            raise typer.Exit(INTERRUPTED) from None


def chosen_layers(layers: str) -> list[str] | None:
    """Names of layers out of the option ``--layers``; ``None`` for all.

    Raises:
        InputError: one of them is unknown.
    """
    from lightdepth.film.layers import LAYERS

    chosen = {"all": None, "none": []}.get(layers, [layer.strip() for layer in layers.split(",")])
    unknown = [layer for layer in chosen or [] if layer not in LAYERS]
    if unknown:
        raise InputError(f"--layers: '{unknown[0]}' is unknown; allowed are all, none, {', '.join(LAYERS)}")
    return chosen


def parsed_region(text: str) -> tuple[int, int, int, int]:
    """The option ``--region``.

    Raises:
        InputError: it is not four whole numbers.
    """
    numbers = [part.strip() for part in text.split(",")]
    if len(numbers) != 4 or not all(number.isascii() and number.isdigit() for number in numbers):
        raise InputError(f"--region {text}: write it as left,top,right,bottom, in pixels")
    left, top, right, bottom = map(int, numbers)
    return left, top, right, bottom


def run(session: Session, job: Job, reporter: Reporter, interruption: Interruption) -> None:
    """Run a session to its end; Ctrl-C ends it early, with the picture so far.

    Raises:
        InputError, SetupError: as :meth:`lightdepth.session.session.Session.run` raises them.
        typer.Exit: it was interrupted.
    """
    from lightdepth.errors import LightdepthError
    from lightdepth.session.events import Failure, Stage

    def watch(event: Event) -> None:
        if isinstance(event, Stage) and event.stage == "rendering":
            interruption.wait = True
        if interruption.asked:
            session.cancel()

    session.on(reporter.report)
    session.on(watch)
    reporter.begin()
    try:
        done = session.run(job)
    except LightdepthError as error:
        reporter.report(Failure(str(error)))
        raise
    if done.interrupted:
        raise typer.Exit(INTERRUPTED)


def check_output(target: Path, files: list[Path], suffix: str) -> None:
    """Refuse what cannot be written before any time is spent; nothing is made yet.

    Args:
        target: the option ``-o``.
        files: what will be written.
        suffix: what ``target`` must end with.

    Raises:
        InputError: a file cannot be written.
    """
    from lightdepth.images.writing import check_writable

    if target.suffix.lower() != suffix:
        raise InputError(f"-o {target}: '{target.suffix}' is not allowed; the output is an {suffix} file")
    folder = next(parent for parent in target.absolute().parents if exists(parent))
    for file in files:
        check_writable(file if folder == target.absolute().parent or not folder.is_dir() else folder / file.name)


class Interruption:
    """Ctrl-C: raises ``KeyboardInterrupt``, or with ``wait`` is noted first, so that the picture can be written.

    The second one always raises. What is raised may arrive as a ``RuntimeError``, for Dr.Jit wraps what passes through a
    loop that it traces; ``dropped`` tells.
    """

    def __init__(self) -> None:
        self.asked, self.wait, self.dropped = False, False, False

    def __enter__(self) -> Interruption:
        self._before = signal.signal(signal.SIGINT, self._note)
        return self

    def __exit__(self, *_: object) -> None:
        signal.signal(signal.SIGINT, self._before)

    def _note(self, *_: object) -> None:
        if self.asked or not self.wait:
            self.drop()
        self.asked = True

    def drop(self, *_: object) -> None:
        """Give up at once."""
        self.dropped = True
        raise KeyboardInterrupt


class Reporter(EventReporter):
    """Reports the rendering of one picture.

    Args:
        kind: ``bar``, ``json`` or ``none``.
        files: what is written.
        exposure: stops by which the PNG is lighter than by itself.
        continuing: the command that goes on from a checkpoint; none where no checkpoint is kept.
    """

    def __init__(self, kind: str, files: list[Path], exposure: float = 0.0, continuing: str = "") -> None:
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.percentage:>3.0f}%  {task.fields[facts]}"),
            TimeRemainingColumn(),
        )
        super().__init__(kind, files[0].stem, columns)
        self._files, self._exposure, self._continuing = files, exposure, continuing

    def _show(self, event: Event) -> None:
        from lightdepth.film.checkpoint import checkpoint_beside
        from lightdepth.session.events import Done, Preparing, Progress, Stage

        name = self._files[0].stem
        if isinstance(event, Done) and self._kind != "json":
            self._console.print(self._ending(event), markup=False)
            if event.interrupted and self._continuing and exists(checkpoint_beside(self._files[0])):
                self._console.print(f"this command continues: {self._continuing}", style="yellow", markup=False)
            elif advice := self._advice(event):
                self._console.print(advice, style="yellow", markup=False)
        elif self._kind != "bar":
            return
        elif isinstance(event, Stage):
            if event.stage == "preparing":
                self._console.print(f"preparing {name} ...")
            elif event.stage != "rendering" and self._bar is not None:
                self._bar.stop()
        elif isinstance(event, Preparing):
            self._advance(f"preparing {name}", event.fraction)
        elif isinstance(event, Progress):
            facts = f"{event.samples:.0f} samples, error {100 * event.error:.1f} %"
            if self._bar is None:
                facts += f", {event.seconds_left:.0f} s left"
            self._advance(name, event.fraction, facts)

    def _advice(self, done: Done) -> str:
        """What to do about a picture with a large error."""
        from lightdepth.parameters.checks import DEFAULT

        wanted = DEFAULT.visible_error_denoised if done.denoised else DEFAULT.visible_error
        if done.error is None or done.error <= wanted:
            return ""
        factor = math.ceil((done.error / wanted) ** 2)
        also = "" if done.denoised else "; or --denoise"
        return (
            f"the estimated error is {100 * done.error:.1f} %: noise is visible. About {factor} times the --samples "
            f"bring it to {100 * wanted:g} %, --noise {wanted:g} takes as many as are needed{also}"
        )

    def _ending(self, done: Done) -> str:
        written = " and ".join(map(str, self._files))
        if not done.interrupted:
            shown = "" if done.exposure is None else f" (exposure {done.exposure + self._exposure:+.2f} stops)"
            return f"wrote {written}{shown}"
        if done.file is not None:
            return f"interrupted; what was rendered so far is in {written}"
        return "interrupted; nothing was written"

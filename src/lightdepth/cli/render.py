"""`lightdepth render`: a scene file to pictures."""

from __future__ import annotations

import json
import signal
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from lightdepth.errors import InputError

if TYPE_CHECKING:
    from lightdepth.film.frame import Frame
    from lightdepth.film.rendering import Progress as Step
    from lightdepth.film.rendering import Rendering

INTERRUPTED = 130
"""Exit status after Ctrl-C, as shells have it."""


def render(
    scene: Annotated[Path, typer.Argument(help="The scene file (TOML).")],
    camera: Annotated[str | None, typer.Option(help="Name of the camera; the first by default.")] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="The EXR file to write; a PNG is written beside it.")
    ] = None,
    samples: Annotated[int | None, typer.Option(min=1, help="Samples per influenced pixel.")] = None,
    noise: Annotated[
        float | None, typer.Option(min=1e-6, help="Stop where the estimated relative error is below this.")
    ] = None,
    seed: Annotated[int | None, typer.Option(min=0, max=2**32 - 1, help="Seed of the random numbers.")] = None,
    method: Annotated[str, typer.Option(help="difference | envpath | directional")] = "difference",
    device: Annotated[Literal["auto", "cpu", "cuda"], typer.Option(help="Where to compute.")] = "auto",
    denoise: Annotated[bool, typer.Option("--denoise", help="Denoise the change and the new objects only.")] = False,
    draft: Annotated[
        bool, typer.Option("--draft", help="A quick look: one sample, light known roughly, no layers.")
    ] = False,
    exposure: Annotated[
        float, typer.Option(help="Stops by which the PNG is lighter than the panorama's own brightness asks for.")
    ] = 0.0,
    layers: Annotated[
        str | None,
        typer.Option(help="Layers to write beside the picture, comma-separated; 'all' (the default) or 'none'."),
    ] = None,
    repair: Annotated[bool, typer.Option("--repair", help="Replace NaN, infinite and negative radiance.")] = False,
    progress: Annotated[Literal["bar", "json", "none"], typer.Option(help="How progress is told.")] = "bar",
    preview_seconds: Annotated[
        float | None, typer.Option(min=0.1, help="Write the unfinished picture every so many seconds.")
    ] = None,
) -> None:
    """Render new objects into the photographed place.

    Writes the linear HDR picture with its layers as OpenEXR, and a tone-mapped PNG beside it. Ctrl-C writes what has
    been rendered so far.

    Example: lightdepth render examples/lounge/scene.toml --camera view -o out/view.exr --samples 64
    """
    from lightdepth.api import begin_rendering, forget_prepared, load_scene
    from lightdepth.film.layers import AUXILIARY, LAYERS, picture_exposure
    from lightdepth.packages import require_package

    if denoise:  # Not first found out when all is rendered.
        require_package("mitsuba_oidn", "denoise")
    layers = layers or ("none" if draft else "all")
    chosen = {"all": None, "none": []}.get(layers, [layer.strip() for layer in layers.split(",")])
    unknown = [layer for layer in chosen or [] if layer not in LAYERS]
    if unknown:
        raise InputError(f"--layers: '{unknown[0]}' is unknown; allowed are all, none, {', '.join(LAYERS)}")
    with _Interruption() as interruption:
        try:
            loaded = load_scene(scene, repair)
            name = camera or next(iter(loaded.cameras))
            target = output or Path(f"{scene.stem}-{name}.exr")
            _check_output(target)
            teller = _Teller(progress, target)
            teller.say("preparing")
            begin = partial(begin_rendering, loaded, name, method, seed, device, teller.warn, draft)
            show = partial(_show, teller, target, exposure)
            auxiliary = denoise or chosen is None or not AUXILIARY.isdisjoint(chosen)

            def complete(rendering: Rendering, watch: Callable[[Step], bool]) -> Frame:
                return rendering.complete(samples, noise, watch, auxiliary)

            frame, panoramic = _rendered(begin, complete, teller, interruption, show, preview_seconds)
            interrupted = interruption.asked
            forget_prepared()  # To write a large picture takes memory as well.
            if denoise:
                from lightdepth.film.denoising import denoise as denoised

                frame = denoised(frame, panoramic)
            _write(target, frame, panoramic, chosen, exposure)
            shown_at = picture_exposure(frame) + exposure
        except KeyboardInterrupt:
            when = (
                "again; the picture was not finished" if interruption.wait else "while preparing; nothing was written"
            )
            Console(stderr=True).print(f"interrupted {when}", style="yellow")
            raise typer.Exit(INTERRUPTED) from None
    teller.done(interrupted, shown_at)
    if interrupted:
        raise typer.Exit(INTERRUPTED)


def _rendered(
    begin: Callable[[], Rendering],
    complete: Callable[[Rendering, Callable[[Step], bool]], Frame],
    teller: _Teller,
    interruption: _Interruption,
    show: Callable[[Rendering], None],
    seconds: float | None,
) -> tuple[Frame, bool]:
    """The frame, finished or interrupted, and whether it is panoramic; what it was rendered with is free again.

    Args:
        begin: begins to render.
        complete: takes all samples, telling of each pass.
        teller: told how far the rendering is.
        interruption: ends it from here on.
        show: shows the unfinished picture.
        seconds: between two times of that; ``None`` for never.
    """
    rendering = begin()
    interruption.wait = True
    shown = time.monotonic()

    def watch(step: Step) -> bool:
        nonlocal shown
        teller.tell(step)
        if seconds is not None and not interruption.asked and time.monotonic() - shown > seconds:
            show(rendering)
            shown = time.monotonic()
        return interruption.asked

    with teller:
        return complete(rendering, watch), rendering.panoramic


def _show(teller: _Teller, target: Path, exposure: float, rendering: Rendering) -> None:
    """Write the unfinished picture, and say so."""
    _write(target, rendering.frame(auxiliary=False), rendering.panoramic, [], exposure)
    teller.event({"event": "preview", "file": str(target)})


def _check_output(target: Path) -> None:
    """Refuse what cannot be written before any time is spent; nothing is made yet."""
    from lightdepth.images.writing import check_writable

    if target.suffix.lower() != ".exr":
        raise InputError(f"-o {target}: '{target.suffix}' is not allowed; the output is an .exr file")
    folder = next(parent for parent in target.absolute().parents if parent.exists())
    for file in (target, target.with_suffix(".png")):
        check_writable(file if folder == target.absolute().parent or not folder.is_dir() else folder / file.name)


def _write(target: Path, frame: Frame, panoramic: bool, layers: list[str] | None, exposure: float) -> None:
    from lightdepth.film.layers import picture_exposure, write_frame, write_picture

    try:
        target.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"-o {target}: cannot be written ({error.strerror})") from error
    write_frame(target, frame, latlong=panoramic, layers=layers)
    write_picture(target.with_suffix(".png"), frame, picture_exposure(frame) + exposure)


class _Interruption:
    """Ctrl-C: raises ``KeyboardInterrupt``, or with ``wait`` is noted first, so that the picture can be written.

    The second one always raises.
    """

    def __init__(self) -> None:
        self.asked, self.wait = False, False

    def __enter__(self) -> _Interruption:
        self._before = signal.signal(signal.SIGINT, self._note)
        return self

    def __exit__(self, *_: object) -> None:
        signal.signal(signal.SIGINT, self._before)

    def _note(self, *_: object) -> None:
        if self.asked or not self.wait:
            raise KeyboardInterrupt
        self.asked = True


class _Teller:
    """Tells progress as a bar for persons, as a JSON object a line for programs, or not at all."""

    def __init__(self, kind: str, target: Path) -> None:
        self._kind, self._target = kind, target
        self._console = Console(stderr=True, highlight=False, soft_wrap=True)
        self._bar: Progress | None = None
        if kind == "bar":
            columns = (
                TextColumn("{task.description}"),
                BarColumn(),
                TextColumn("{task.percentage:>3.0f}%  {task.fields[facts]}"),
                TimeRemainingColumn(),
            )
            self._bar = Progress(*columns, console=self._console, transient=False)
            self._task = self._bar.add_task(target.stem, total=1.0, facts="")

    def __enter__(self) -> _Teller:
        if self._bar is not None:
            self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def say(self, stage: str) -> None:
        if self._kind == "json":
            self.event({"event": stage})
        elif self._kind == "bar":
            self._console.print(f"{stage} {self._target.stem} ...")

    def warn(self, message: str) -> None:
        self._console.print(f"warning: {message}", style="yellow", markup=False)

    def tell(self, step: Step) -> None:
        self.event(
            {
                "event": "progress",
                "fraction": round(step.fraction, 4),
                "samples": round(step.samples, 2),
                "error": round(step.error, 5),
                "seconds_left": round(step.seconds_left, 1),
            }
        )
        if self._bar is not None:
            facts = f"{step.samples:.0f} samples, error {100 * step.error:.1f} %"
            self._bar.update(self._task, completed=step.fraction, facts=facts)

    def event(self, event: dict[str, object]) -> None:
        if self._kind == "json":
            sys.stdout.write(json.dumps(event) + "\n")
            sys.stdout.flush()

    def done(self, interrupted: bool, exposure: float) -> None:
        event = "interrupted" if interrupted else "done"
        self.event({"event": event, "file": str(self._target), "exposure": round(exposure, 3)})
        if self._kind != "json":
            prefix = "interrupted; what was rendered so far is in" if interrupted else "wrote"
            picture = self._target.with_suffix(".png")
            self._console.print(f"{prefix} {self._target} and {picture} (exposure {exposure:+.2f} stops)")

"""`lightdepth deliver`: rendered frames to what domes, headsets, players and browsers show."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Annotated, Literal

import typer
from rich.console import Console
from rich.progress import Progress

from lightdepth.cli.options import Exposure, Ocio, OcioDisplay, OcioView
from lightdepth.errors import InputError

MOST_RATE = 1000


def deliver(
    frames: Annotated[Path, typer.Argument(help="The EXR files, as shot.####.exr, or one file.")],
    kind: Annotated[
        Literal["dome-master", "360", "360-stereo", "vr180", "video", "stills"],
        typer.Option("--as", help="What to make of them."),
    ],
    output: Annotated[
        Path,
        typer.Option("-o", "--output", help="The video; Name.png of a dome master; still.jpg or still.####.jpg."),
    ],
    numbers: Annotated[
        str | None, typer.Option("--frames", help="Which of the frames, as 1-240 or 7,10-20; all by default.")
    ] = None,
    step: Annotated[int, typer.Option(min=1, help="Take only every N-th of the frames.")] = 1,
    exposure: Exposure = 0.0,
    look: Annotated[
        str | None,
        typer.Option(
            help="Tone curve instead of --ocio: agx-like | filmic | linear; the first where $OCIO is not set."
        ),
    ] = None,
    ocio: Ocio = None,
    display: OcioDisplay = None,
    view: OcioView = None,
    codec: Annotated[str, typer.Option(help="Of a video: h264 | hevc | av1 | prores")] = "h264",
    quality: Annotated[
        int | None, typer.Option(min=0, max=63, help="Of a video, lower is better; by default visually lossless.")
    ] = None,
    fps: Annotated[
        str | None, typer.Option(help="Frames per second, as 24 or 24000/1001, where the frames do not state them.")
    ] = None,
    audio: Annotated[Path | None, typer.Option(help="A sound file, for the video or beside the dome master.")] = None,
    bits: Annotated[Literal["8", "16"], typer.Option(help="Bits a channel of a dome master.")] = "16",
) -> None:
    """Deliver rendered frames.

    `dome-master` writes numbered pictures and a description, `360`, `360-stereo` and `vr180` videos that headsets and
    players know as spherical, `video` a flat one, `stills` JPEG or PNG, panoramas with metadata for viewers. All frames are
    graded alike. What is written appears whole or not at all.

    Example: lightdepth deliver out/shot/shot.####.exr --as 360 -o out/shot.mp4 --codec hevc
    """
    from lightdepth.delivery.arrangement import arrangement
    from lightdepth.delivery.dome_master import DomeMaster, write_dome_master
    from lightdepth.delivery.frames import find_frames
    from lightdepth.delivery.grading import grade
    from lightdepth.delivery.movie import Movie, write_movie
    from lightdepth.delivery.stills import write_stills
    from lightdepth.images.look import chosen_look
    from lightdepth.packages import require_package

    moving = kind not in ("stills", "dome-master")
    if moving:  # Not first found out when all is graded.
        require_package("av", "video")
    if audio is not None and kind == "stills":
        raise InputError("--audio goes with videos and dome masters, not with stills")
    chosen = chosen_look(look, ocio, display, view)
    found = find_frames(frames, numbers, step)
    arranged = arrangement(kind, found)
    count = len(found.files)
    rate = found.rate if fps is None else _rate(fps)
    if rate is None and (moving or (kind == "dome-master" and count > 1)):
        also = "" if count > 1 else ", or deliver one picture --as stills"
        raise InputError(f"{frames}: the frames do not state their frame rate; give --fps{also}")
    graded = grade(found, chosen, exposure)
    console = Console(stderr=True, highlight=False, soft_wrap=True)
    with Progress(console=console, transient=True) as bar:
        task = bar.add_task(output.stem, total=len(found.files))

        def progress() -> None:
            bar.advance(task)

        if kind == "dome-master":
            dome = DomeMaster(output, rate, 8 if bits == "8" else 16, audio)
            written = write_dome_master(dome, found, arranged, graded, progress)
        elif kind == "stills":
            written = write_stills(output, found, arranged, graded, progress)
        elif rate is not None:
            movie = Movie(output, rate, codec, quality, audio)
            written = write_movie(movie, found, arranged, graded, progress)
    what = "1 frame" if count == 1 else f"{count} frames"
    shown = f"{written[0]}" if len(written) == 1 else f"{written[0]} ... {written[-1]}"
    console.print(f"wrote {shown} ({what}, {chosen}, exposure {graded.stops:+.2f} stops)", markup=False)


def _rate(text: str) -> Fraction:
    """Frames per second of the option ``--fps``."""
    from lightdepth.scene.animation.sequence import exact_rate

    try:
        rate = Fraction(text) if "/" in text else exact_rate(float(text))
    except (ValueError, ZeroDivisionError, OverflowError):
        raise InputError(f"--fps {text[:40]}: write it as 24, 29.97 or 24000/1001") from None
    if not 0 < rate <= MOST_RATE:
        raise InputError(f"--fps {text[:40]}: must be above 0, and at most {MOST_RATE}")
    return rate

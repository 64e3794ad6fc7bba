"""Dask: chunks of frames as tasks of a scheduler that is running.

A task is the command of its chunk, in a process of its own: the worker goes on answering its scheduler while a frame is
rendered, and a task that Dask runs a second time, because its worker was lost, finds the frames that are there.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Generator
from concurrent.futures import CancelledError
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lightdepth.errors import InputError, warn
from lightdepth.farm.shot import Shot
from lightdepth.packages import optional_package

CONNECT_SECONDS = 10
"""How long a scheduler may take to answer."""
PROGRAM = "from lightdepth.cli.app import main; main()"
LAST_LINES = 10
"""Of what a failed command wrote, that are reported."""


@dataclass(frozen=True)
class ChunkEnd:
    """How a chunk ended.

    Attributes:
        frames: as ``--frames`` has them.
        failure: why they are not all there; ``None`` where they are.
    """

    frames: str
    failure: str | None = None


def run_on_dask(shot: Shot, scheduler: str) -> Generator[ChunkEnd]:
    """Submit a shot and wait for it. Where the iterator is closed early, chunks that no worker has begun are withdrawn.

    Args:
        shot: what to render.
        scheduler: address of the scheduler, as ``tcp://host:8786``, or the file that it writes (``--scheduler-file``).

    Yields:
        Each chunk as it ends, in whatever order.

    Raises:
        SetupError: the package ``distributed`` is missing.
        InputError: no scheduler answers.
    """
    distributed = optional_package("distributed", "farm")
    with closing(_connected(distributed, scheduler)) as client:
        _look_at_workers(client)
        commands = [tuple(shot.arguments(str(shot.scene), frames, str(shot.files.pattern))) for frames in shot.chunks]
        # With keys of their own, or a shot would be given the results of another one with the same frames.
        futures = client.map(render_chunk, commands, pure=False)
        pending = dict(zip(futures, shot.chunks, strict=True))
        del futures
        try:
            for future in distributed.as_completed(list(pending), loop=client.loop):
                yield ChunkEnd(pending.pop(future), _failure(future))
                future.release()  # What is done need not be done again when its worker goes.
        finally:
            client.cancel(list(pending))


def render_chunk(arguments: tuple[str, ...]) -> str | None:
    """Run ``lightdepth`` with some arguments, on the machine of a worker.

    Returns:
        What it wrote last where it failed, a few lines; ``None`` where all frames are there.
    """
    ended = subprocess.run([sys.executable, "-c", PROGRAM, *arguments], capture_output=True, text=True, check=False)
    if ended.returncode == 0:
        return None
    lines = ended.stderr.strip().splitlines()[-LAST_LINES:]
    return "\n".join(lines) or f"it ended with status {ended.returncode}"


def _connected(distributed: Any, scheduler: str) -> Any:
    by_file = "://" not in scheduler and Path(scheduler).is_file()
    where = {"scheduler_file": scheduler} if by_file else {"address": scheduler}
    try:
        return distributed.Client(**where, timeout=CONNECT_SECONDS, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise InputError(
            f"--scheduler {scheduler}: no Dask scheduler answers there; give its address, as tcp://host:8786, or the file "
            "that it writes"
        ) from error


def _look_at_workers(client: Any) -> None:
    workers = client.scheduler_info(n_workers=-1)["workers"]
    if not workers:
        warn("the Dask scheduler has no workers yet; the frames wait until there are some")
    if most := max((worker["nthreads"] for worker in workers.values()), default=1) - 1:
        warn(
            f"a Dask worker has {most + 1} threads and renders as many chunks at a time, each on all cores of its machine; "
            "start workers with --nthreads 1"
        )


def _failure(future: Any) -> str | None:
    """Why a chunk's frames are not all there."""
    try:
        failure: str | None = future.result()
    except CancelledError:
        return "it was cancelled"
    except Exception as error:  # Of the scheduler, such as KilledWorker, or of a worker without lightdepth.
        return f"{type(error).__name__}: {error}"
    return failure

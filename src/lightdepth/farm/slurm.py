"""Slurm: a script for ``sbatch`` whose array has a task for each chunk of frames."""

from __future__ import annotations

import shlex
from pathlib import Path

from lightdepth.farm.shot import Shot
from lightdepth.images.writing import whole_file


def write_script(path: Path, shot: Shot) -> None:
    """Write the script.

    Args:
        path: where to.
        shot: what to render.

    Raises:
        InputError: it cannot be written.
    """
    chunks = shot.chunks
    # Quoted by hand, for the shell is to put the chunk in.
    command = shlex.join(["lightdepth", *shot.arguments(str(shot.scene), "CHUNK", str(shot.files.pattern))])
    command = command.replace("--frames CHUNK ", '--frames "${chunks[SLURM_ARRAY_TASK_ID]}" ')
    script = f"""#!/bin/bash
#SBATCH --job-name={shlex.quote("lightdepth-" + shot.scene.stem)}
#SBATCH --array=0-{len(chunks) - 1}
#SBATCH --requeue
# A task that is run again renders what is missing of its frames. Add what your cluster asks for, or give it to sbatch:
# --partition, --time, --cpus-per-task, --mem.
set -euo pipefail
chunks=({shlex.join(chunks)})
exec {command}
"""
    with whole_file(path) as temporary:
        temporary.write_text(script, encoding="utf-8")

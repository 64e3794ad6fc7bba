"""Go the way of docs/tutorial/mirror-ball.md with photographs of a chrome ball in a virtual room, and keep the pictures.

Run it from the repository's root with the package installed: python docs/tutorial/make_ball_pictures.py

The photographs, the commands' output and the files stay in out/mirror-ball.
"""

from __future__ import annotations

import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
from PIL import Image

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(ROOT))

from tests.support import mirror_ball as ball  # noqa: E402

from lightdepth.images.exr import ExrPart, write_exr  # noqa: E402

WORK = ROOT / "out/mirror-ball"
WIDTH, FOV, SAMPLES = 560, 8.0, 64


def main() -> None:
    """Photograph the ball from two sides, then run the tutorial's commands."""
    shutil.rmtree(WORK, ignore_errors=True)
    WORK.mkdir(parents=True)
    for number, position in enumerate((ball.FIRST, ball.SECOND), start=1):
        light = ball.photograph(ball.camera(position, WIDTH, FOV), SAMPLES, seed=number).mean.astype(np.float32)
        channels = {name: light[..., index] for index, name in enumerate("RGB")}
        write_exr(WORK / f"ball-{number}.exr", [ExrPart(channels, "", {})])
    options = f"--fov {FOV:g} --reflectance {ball.REFLECTANCE} --width 512"
    run(f"capture mirror-ball ball-1.exr -o one.exr {options} --picture outline.png")
    run(f"capture mirror-ball ball-1.exr ball-2.exr -o two.exr {options} --picture outlines.png")
    keep("outlines.png", "ball-outlines")
    keep("one.png", "ball-one")
    keep("two.png", "ball-two")


def run(command: str) -> None:
    """Call lightdepth in the tutorial's folder and show what it prints."""
    words = command.split()
    print("$ lightdepth", shlex.join(words), flush=True)
    code = "from lightdepth.cli.app import main; main()"
    subprocess.run([sys.executable, "-c", code, *words], cwd=WORK, check=True)


def keep(file: str, name: str) -> None:
    """A picture of the commands as a small JPEG for the tutorial."""
    Image.open(WORK / file).convert("RGB").save(HERE / f"{name}.jpg", quality=85, optimize=True)


if __name__ == "__main__":
    main()

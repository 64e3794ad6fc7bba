"""Make the README's animation from the frames of `make demo-shot`, there and back.

make demo-shot
python docs/pictures/make_from_demo_shot.py out/demo-shot
"""

from __future__ import annotations

import sys
from pathlib import Path

from PIL import Image

HERE = Path(__file__).parent
SIZE = (560, 315)
MILLISECONDS = 42
"""Of a frame: 24 of them are a second."""


def main() -> None:
    """Write the animation beside this file."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/demo-shot")
    frames = [
        Image.open(file).convert("RGB").resize(SIZE, Image.Resampling.LANCZOS)
        for file in sorted(folder.glob("shot.*.png"))
    ]
    first, *others = frames + frames[-2:0:-1]
    first.save(
        HERE / "demo-shot.webp",
        save_all=True,
        append_images=others,
        duration=MILLISECONDS,
        loop=0,
        quality=70,
        method=6,
    )


if __name__ == "__main__":
    main()

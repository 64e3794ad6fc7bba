"""The viewport's preview: what the renderer makes of a view, coarse while something moves and refined while nothing does.

The scene is exported on the main thread, when Blender draws the viewport; a thread of the preview's own asks the renderer
and reads its pictures. It does not use Blender.
"""

import contextlib
import math
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from . import exr
from .evaluation import unexpected
from .images import from_rec709
from .process import RendererError
from .worker import Busy, render

COARSE = 4
"""Pixels of the viewport along the side of one of the first picture's."""
REST_SECONDS = 0.15
"""Without a change, after which the scene is exported again; and, while changes go on, as many times the export's time."""
SHARE_OF_EXPORTS = 0.4
"""Of the time, that exports may take while something is moved."""
PATIENCE = 60.0
"""Seconds that a picture that is given up has to stop; nobody waits for it but the next one, which needs its place."""
PICTURE_SECONDS = 0.5
"""Between two pictures of a refinement."""


@dataclass(frozen=True)
class View:
    """What a viewport looks at.

    Attributes:
        size: of the region in pixels.
        pose: where its camera is, rows of the matrix.
        fov: horizontal, degrees.
        shift: of the lens, in shares of the width.
    """

    size: tuple[int, int]
    pose: tuple[tuple[float, ...], ...]
    fov: float
    shift: tuple[float, float]

    def size_of(self, pixel: int) -> tuple[int, int]:
        """Width and height of a picture with pixels of some size."""
        return max(self.size[0] // pixel, 1), max(self.size[1] // pixel, 1)


def view_of(region, region_data) -> View | None:
    """A viewport's view, in perspective or through a camera; ``None`` where it is orthographic."""
    window, to_world = region_data.window_matrix, region_data.view_matrix.inverted()
    if not region_data.is_perspective or window[3][3] != 0.0:
        return None
    pose = tuple(tuple(round(value, 6) for value in row) for row in to_world)
    fov = 2.0 * math.degrees(math.atan(1.0 / window[0][0]))
    shift = 0.5 * window[0][2], 0.5 * window[1][2] * window[0][0] / window[1][1]
    return View((region.width, region.height), pose, fov, shift)


@dataclass(frozen=True)
class Stage:
    """A picture to ask for.

    Attributes:
        request: to the renderer, without its output.
        text: of the scene file.
        scene: the scene file.
    """

    request: dict[str, Any]
    text: str
    scene: Path


@dataclass(frozen=True)
class Picture:
    """A picture of a view.

    Attributes:
        number: of the wish that it belongs to.
        pixels: linear, in Blender's working space, premultiplied, the first row at the bottom; (height, width, 4).
    """

    number: int
    pixels: np.ndarray


class Preview:
    """A thread that asks the renderer for what is wanted last.

    Attributes:
        picture: the newest, or ``None``.
        status: what is being done, or what went wrong.
        news: whether either has changed since somebody looked.
    """

    def __init__(self) -> None:
        self.picture: Picture | None = None
        self.status, self.news = "", False
        self._wanted: tuple[int, str, list[Stage]] | None = None
        self._number, self._done, self._ended = 0, 0, False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._run, name="lightdepth preview", daemon=True)
        self._thread.start()

    def want(self, command: str, stages: list[Stage]) -> None:
        """Ask for pictures, one after the other; what was asked for before is given up.

        Args:
            command: the path of the renderer's command.
            stages: the pictures.
        """
        with self._changed:
            self._number += 1
            self._wanted = (self._number, command, stages)
            self._changed.notify_all()

    def tell(self, status: str) -> None:
        """Change what is said."""
        if status != self.status:
            self.status, self.news = status, True

    def end(self) -> None:
        """Ask for nothing any more."""
        with self._changed:
            self._ended = True
            self._changed.notify_all()

    @property
    def is_asked(self) -> bool:
        """Whether there is something to do for the thread."""
        return self._done != self._number

    def _is_given_up(self, number: int) -> bool:
        return self._ended or number != self._number

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._ended or self.is_asked)
                if self._ended:
                    return
                number, command, stages = self._wanted
            try:
                finished = all(self._render(number, command, stage) for stage in stages)
                if finished or self._is_given_up(number):
                    self._done = number
                else:  # a rendering took the renderer: go on after it
                    time.sleep(REST_SECONDS)
                if finished:
                    self.tell("")
            except (RendererError, exr.ExrError, OSError) as error:
                self._done = number
                if not self._is_given_up(number):
                    self.tell(str(error))
            except Exception as error:
                self._done = number
                self.tell(unexpected(error))

    def _render(self, number: int, command: str, stage: Stage) -> bool:
        """Ask for one picture; whether it was finished."""
        with Busy(lambda: self._is_given_up(number), preview=True) as busy:
            if not busy.mine or self._is_given_up(number):
                return False
            stage.scene.write_text(stage.text, encoding="utf-8")
            output = stage.scene.with_name("preview.exr")
            request = {
                "scene": str(stage.scene),
                "output": str(output),
                "camera": "view",
                "layers": [],
                **stage.request,
            }
            finished = False
            with contextlib.closing(render(command, request, busy.is_cancelled, lambda _: None, PATIENCE)) as events:
                for event in events:
                    if event["event"] == "done":
                        finished = not event.get("interrupted")
                    elif event["event"] == "picture" and not self._is_given_up(number):
                        self.picture, self.news = Picture(number, _pixels(output)), True
                    elif not self._is_given_up(number):
                        self.tell(_said(event) or self.status)
            return finished


def _pixels(file: Path) -> np.ndarray:
    beauty = exr.read(file)["beauty"]
    return np.ascontiguousarray(from_rec709(np.stack([beauty[name] for name in "RGBA"], axis=-1)[::-1]), np.float32)


def _said(event: dict[str, Any]) -> str:
    if event["event"] == "preparing":
        return f"Preparing the place, {100.0 * float(event.get('fraction', 0.0)):.0f} %"
    if event["event"] == "progress":
        return f"{event.get('samples', 0):g} samples"
    return ""

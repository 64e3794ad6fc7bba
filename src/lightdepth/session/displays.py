"""Displays: what shows a session's picture, unfinished and finished."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from lightdepth.errors import InputError

if TYPE_CHECKING:
    from lightdepth.film.frame import Frame
    from lightdepth.film.layers import Structure
    from lightdepth.images.look import Look


class Display(Protocol):
    """Something that shows pictures.

    Attributes:
        file: where they lie, for a display that is a file.
        layers: names of the layers beyond the picture that it wants of the finished one; ``None`` for all.
    """

    file: Path | None
    layers: Collection[str] | None

    def show(self, frame: Frame, finished: bool) -> None:
        """Show a picture.

        Args:
            frame: the picture; object ids, depth, normals and albedo may be missing before it is ``finished``.
            finished: whether it is the last one.

        Raises:
            InputError: it cannot be shown.
        """


class ExrDisplay:
    """The picture and its layers as OpenEXR; before it is finished, the picture alone.

    Args:
        file: where to write; its folder is made.
        layers: layers to write beside the finished picture; ``None`` for all.
        structure: of the file; see :func:`~lightdepth.film.layers.write_frame`.
    """

    def __init__(self, file: Path, layers: Collection[str] | None = None, structure: Structure = "multipart") -> None:
        self.file: Path | None = file
        self._structure = structure
        self.layers = layers

    def show(self, frame: Frame, finished: bool) -> None:
        """See :class:`Display`."""
        from lightdepth.film.layers import write_frame

        assert self.file is not None
        _make_folder(self.file)
        write_frame(self.file, frame, layers=self.layers if finished else [], structure=self._structure)


class PngDisplay:
    """The picture for the screen as PNG.

    Args:
        file: where to write; its folder is made.
        exposure: stops by which it is brighter than by the panorama's own exposure.
        look: instead of our own tone curve.
    """

    def __init__(self, file: Path, exposure: float = 0.0, look: Look | None = None) -> None:
        self.file: Path | None = file
        self.layers: Collection[str] | None = ()
        self._exposure, self._look = exposure, look

    def show(self, frame: Frame, finished: bool) -> None:
        """See :class:`Display`."""
        from lightdepth.film.layers import picture_exposure, write_picture

        assert self.file is not None
        _make_folder(self.file)
        write_picture(self.file, frame, picture_exposure(frame) + self._exposure, look=self._look)


class MemoryDisplay:
    """Keeps the last picture in memory.

    Args:
        layers: layers that are wanted of the finished picture; none by default, ``None`` for all.

    Attributes:
        frame: the last picture; ``None`` before the first.
        finished: whether it is the last one.
        shown: how many pictures there have been.
    """

    def __init__(self, layers: Collection[str] | None = ()) -> None:
        self.file: Path | None = None
        self.layers = layers
        self.frame: Frame | None = None
        self.finished, self.shown = False, 0

    def show(self, frame: Frame, finished: bool) -> None:
        """See :class:`Display`."""
        self.frame, self.finished = frame, finished
        self.shown += 1


def _make_folder(file: Path) -> None:
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{file}: cannot be written ({error.strerror})") from error

"""An open USD file: its stage, its axes and unit, its time line, and the files that it names."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Ar, Sdf, Tf, Usd, UsdGeom, UsdUtils

from lightdepth.errors import InputError
from lightdepth.scene.meshes.part import Note

TIMELINE = "timeline"
"""What the one animation of a USD file is called."""
LAYERS = (".usd", ".usda", ".usdc", ".usdz", ".sdf")
LONGEST_MESSAGE = 200
_PLACE = re.compile(r":(\d+):\d+: ")
_Y_UP_TO_Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1.0, 0], [0, 1.0, 0, 0], [0, 0, 0, 1.0]])


class UsdFile:
    """A USD file, composed of all its layers.

    Args:
        path: the file.
        note: called with what is guessed or left out.

    Attributes:
        path: the file.
        note: as above.
        stage: its stage.
        to_scene: from the stage's space to z up and metres, shape (4, 4), float64.

    Raises:
        InputError: the file, or a layer that it names, cannot be read.
    """

    def __init__(self, path: Path, note: Note) -> None:
        self.path, self.note = path, note
        with self.reporting():
            self.stage = Usd.Stage.Open(str(path))
            self.stage.Reload()  # Layers that are still in memory may have changed on disk.
            _, _, unresolved = UsdUtils.ComputeAllDependencies(Sdf.AssetPath(str(path)))
            self.to_scene = self._axes_and_unit()
            self._first, self._last = self._range()
        if absent := sorted(name for name in unresolved if name.lower().endswith(LAYERS)):
            raise InputError(f"{path}: refers to the layer {absent[0]}, which does not exist or cannot be read")

    @contextmanager
    def reporting(self) -> Iterator[None]:
        """What USD reports in here becomes errors and notes in place of lines on standard error."""
        delegate = UsdUtils.CoalescingDiagnosticDelegate()
        try:
            yield
        except (RuntimeError, UnicodeDecodeError, TypeError) as error:
            # Of USD, or what it says of a damaged file is no text, or a value is of a type that is unknown to it.
            place = next(iter(_PLACE.findall(_text(error))), None)
            where = "it is damaged, or something else" if place is None else f"line {place} is not what can stand there"
            raise InputError(f"{self.path}: is not a readable USD file: {where}") from error
        finally:
            reports = delegate.TakeUncoalescedDiagnostics()
            del delegate
        for report in reports:
            if isinstance(report, Tf.Warning):
                self.note(f"USD reports: {_text(report)[:LONGEST_MESSAGE]}")

    def time(self, animation: str | None, seconds: float, loop: bool) -> Usd.TimeCode:
        """The time code at a time of the animation.

        Args:
            animation: ``TIMELINE``, or ``None`` for the first time code.
            seconds: since that; before and after the time line it is held.
            loop: begin again where the time line ends.

        Raises:
            InputError: there is no such animation.
        """
        if animation is None:
            if self._last > self._first:
                self.note("its animation is left out; the pose is that of its first time code")
            return self._code(0.0)
        if animation != TIMELINE:
            raise InputError(
                f"{self.path}: has no animation '{animation[:100]}'; a USD file has one, its time line, which is called "
                f"'{TIMELINE}'"
            )
        if not self._last > self._first:
            raise InputError(f"{self.path}: has no animation; nothing in it changes with time")
        rate = self.stage.GetTimeCodesPerSecond()
        codes = seconds * (rate if rate > 0.0 else 24.0)
        return self._code(codes % (self._last - self._first) if loop else codes)

    def _code(self, codes: float) -> Usd.TimeCode:
        if self._last < self._first:
            return Usd.TimeCode.Default()
        return Usd.TimeCode(self._first + min(max(codes, 0.0), self._last - self._first))

    def content(self, asset: Sdf.AssetPath) -> tuple[str, bytes]:
        """Name and bytes of a file that this one names, which may lie in a package.

        Raises:
            InputError: it does not exist.
        """
        found = asset.resolvedPath
        opened = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(found)) if found else None
        if opened is None:
            raise InputError(f"{self.path}: refers to the image {asset.path[:LONGEST_MESSAGE]}, which does not exist")
        with opened:
            return found, bytes(opened.GetBuffer())

    def _axes_and_unit(self) -> NDArray[np.float64]:
        guessed = []
        if not self.stage.HasAuthoredMetadata(UsdGeom.Tokens.upAxis):
            guessed.append("upAxis (Y)")
        if not UsdGeom.StageHasAuthoredMetersPerUnit(self.stage):
            guessed.append("metersPerUnit (0.01)")
        if guessed:
            self.note(f"does not say its {' and '.join(guessed)}; in brackets USD's default, which is taken")
        unit = UsdGeom.GetStageMetersPerUnit(self.stage)
        if not (np.isfinite(unit) and unit > 0.0):
            raise InputError(f"{self.path}: metersPerUnit = {unit:g}; it must be larger than 0")
        scale = np.diag([unit, unit, unit, 1.0])
        return scale if UsdGeom.GetStageUpAxis(self.stage) == UsdGeom.Tokens.z else scale @ _Y_UP_TO_Z_UP

    def _range(self) -> tuple[float, float]:
        """The first and the last time code; (0, -1) where nothing changes with time."""
        ends: list[float] = []
        for prim in Usd.PrimRange.Stage(self.stage, Usd.TraverseInstanceProxies()):
            for attribute in prim.GetAuthoredAttributes():
                if attribute.ValueMightBeTimeVarying() and (samples := attribute.GetTimeSamples()):
                    ends += samples[0], samples[-1]
        if not ends:
            return 0.0, -1.0
        if self.stage.HasAuthoredTimeCodeRange() and self.stage.GetEndTimeCode() > self.stage.GetStartTimeCode():
            return self.stage.GetStartTimeCode(), self.stage.GetEndTimeCode()
        return min(ends), max(ends)


def _text(report: Tf.Warning | Exception) -> str:
    """What USD says, in one line."""
    try:
        said = str(report) if isinstance(report, Exception) else str(report.commentary)
    except UnicodeDecodeError:  # It quotes what a damaged file holds.
        return "it is damaged"
    return " ".join(said.split())

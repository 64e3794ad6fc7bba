"""``[sequence]``: which frames there are, and how fast they follow each other."""

from __future__ import annotations

from fractions import Fraction
from typing import Annotated

from pydantic import Field, model_validator

from lightdepth.scene.values import Number, Table, Whole

LONGEST = 1_000_000
"""Frames of one sequence; more are a slip of the pen."""
FrameNumber = Annotated[Whole, Field(ge=0, le=LONGEST)]


class SequenceTable(Table):
    """``[sequence]``.

    Attributes:
        frames: the first and the last frame.
        fps: frames per second; 23.976, 29.97 and 59.94 mean 24000/1001, 30000/1001 and 60000/1001.
        shutter: share of a frame's time during which the shutter is open, around the frame; 0 is sharp.
        instants: at which what moves is rendered while the shutter is open, at most.
    """

    frames: tuple[FrameNumber, FrameNumber]
    fps: Annotated[Number, Field(gt=0.0, le=1000.0)] = 24.0
    shutter: Annotated[Number, Field(ge=0.0, le=1.0)] = 0.0
    instants: Annotated[Whole, Field(ge=2, le=1024)] = 32

    @model_validator(mode="after")
    def _forward(self) -> SequenceTable:
        if self.frames[0] > self.frames[1]:
            raise ValueError(f"frames = [first, last]: {self.frames[0]} comes after {self.frames[1]}")
        return self

    @property
    def first(self) -> int:
        """The first frame."""
        return self.frames[0]

    @property
    def last(self) -> int:
        """The last frame."""
        return self.frames[1]

    def opened(self, frame: float, instants: int) -> list[float]:
        """The middles of as many equal parts of the time in which the shutter is open around a frame, as frames."""
        return [frame + self.shutter * ((i + 0.5) / instants - 0.5) for i in range(instants)]

    @property
    def rate(self) -> Fraction:
        """Frames per second, exactly."""
        return exact_rate(self.fps)


def exact_rate(fps: float) -> Fraction:
    """Frames per second that are written in decimals, exactly: 23.976 means 24000/1001."""
    whole = round(fps)
    ntsc = Fraction(whole * 1000, 1001)
    if fps != whole and abs(fps - float(ntsc)) < 0.006:
        return ntsc
    return Fraction(fps).limit_denominator(1001)

"""The tuned constants of making a place's surfaces from a panorama, clicks, depth or points."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field
from pydantic.dataclasses import dataclass

from lightdepth.parameters.ranges import CHECKED, Depth, NotNegative, Positive, Share

Angle = Annotated[Positive, Field(lt=90.0)]
"""Degrees between 0 and 90."""


@dataclass(frozen=True, config=CHECKED)
class ClickParameters:
    """How exactly clicks must fit together, for ``lightdepth reconstruct layout``.

    Attributes:
        horizon: degrees below the horizon at which a click on the floor lies at least, and above it one on the ceiling.
        ceiling_corner: degrees of azimuth that a ceiling corner may be clicked beside its floor corner.
        steepest_slope: degrees from the horizontal that a sloped ceiling may have.
        thinnest_slope: least width of the triangle of a slope's clicks, as a share of its length.
        lamp_beside: degrees of azimuth that a lamp's middle may be beside the point that it hangs from.
        lamp_nearest: metres from the capture point that a lamp's surface must keep.
        lamp_subdivisions: times that an icosahedron is subdivided for a round lamp.
    """

    horizon: Angle = 0.5
    ceiling_corner: Angle = 5.0
    steepest_slope: Angle = 80.0
    thinnest_slope: Share = 0.02
    lamp_beside: Angle = 5.0
    lamp_nearest: NotNegative = 0.05
    lamp_subdivisions: Annotated[Depth, Field(le=6)] = 2


@dataclass(frozen=True, config=CHECKED)
class ReconstructionParameters:
    """One object for each step; vary them by :func:`dataclasses.replace`, which checks them.

    Attributes:
        clicks: of fitting clicks together.
    """

    clicks: ClickParameters = ClickParameters()


DEFAULT = ReconstructionParameters()
"""What places are reconstructed with."""

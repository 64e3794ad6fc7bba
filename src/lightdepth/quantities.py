"""How large numbers with a unit may be, wherever they are read. The renderer computes in single precision.

Its squares, and sums of these over a picture, must stay below 3.4e38. What is larger than this is a mistake.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

FARTHEST = 1e15
"""Metres; coordinates beyond are damage."""
BRIGHTEST = 1e15
"""Radiance, in any panorama's unit. The sun is 1e9 times as bright as a sunlit wall's shadow."""
MOST_TURNED = 1e9
"""Degrees, beyond which double precision has few of their fractions left."""

Coordinate = Annotated[float, Field(ge=-FARTHEST, le=FARTHEST)]
"""Metres along an axis."""
Length = Annotated[float, Field(gt=0.0, le=FARTHEST)]
"""Metres."""
Degrees = Annotated[float, Field(ge=-MOST_TURNED, le=MOST_TURNED)]
"""Any angle."""
Coordinates = tuple[Coordinate, Coordinate, Coordinate]
"""A point or a vector, metres."""
Angles = tuple[Degrees, Degrees, Degrees]
"""XYZ Euler angles."""
Coefficient = Annotated[float, Field(ge=-1e15, le=1e15)]
"""Of a polynomial."""
FilmOffset = tuple[Annotated[float, Field(ge=-1000.0, le=1000.0)], Annotated[float, Field(ge=-1000.0, le=1000.0)]]
"""Shares of a picture's width and height."""

"""The report of a mirror ball: plain numbers for a file, from which the tables for a person are made."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np

from lightdepth.capture.mirror_ball.grey_ball import GreyBall
from lightdepth.capture.mirror_ball.registration import Registration
from lightdepth.capture.mirror_ball.unwrapping import Ball, Unwrapped
from lightdepth.capture.shoot import Shoot
from lightdepth.directions import FloatArray, pixel_directions, pixel_solid_angles
from lightdepth.parameters.mirror_ball import DEFAULT, MirrorBallParameters

ZONES = (0.0, 45.0, 90.0, 120.0, 150.0, 165.0, 180.0)
"""Degrees from the direction toward the first camera."""


def ball_report(
    shoot: Shoot,
    balls: Sequence[Ball],
    registered: Sequence[Registration],
    unwrapped: Unwrapped,
    reflectance: FloatArray,
    assumed: bool,
    parallax: bool,
    grey: GreyBall | None,
    tuned: MirrorBallParameters = DEFAULT,
) -> dict[str, Any]:
    """Numbers about a panorama from a mirror ball.

    Args:
        shoot: where the photographs come from.
        balls: in them, the first one's camera gives the panorama's axes.
        registered: of all but the first.
        unwrapped: the panorama.
        reflectance: that was divided out, shape (3,).
        assumed: nobody stated it.
        parallax: whether the place's surfaces were used.
        grey: what a grey ball said, ``None`` where there is none.
        tuned: what is worth a warning.
    """
    height, width = unwrapped.covered.shape
    solid = np.repeat(pixel_solid_angles(height, width)[:, None], width, axis=1) / (4.0 * np.pi)
    angle = np.degrees(np.arccos(np.clip(-pixel_directions(height, width) @ balls[0].view.axis, -1.0, 1.0)))
    zones = []
    for low, high in itertools.pairwise(ZONES):
        inside = (angle >= low) & (angle < high)
        shown = unwrapped.degrees_per_pixel[inside & unwrapped.covered]
        zones.append(
            {
                "from": low,
                "to": high,
                "covered": float((solid * unwrapped.covered)[inside].sum() / max(solid[inside].sum(), 1e-12)),
                "degrees_per_pixel": float(np.median(shown)) if shown.size else None,
            }
        )
    photographs, warnings = [], list(shoot.warnings)
    for index, ball in enumerate(balls):
        found = registered[index - 1] if index else None
        circle = ball.view.circle()
        inside_circle = circle.inside(ball.view.height, ball.view.width)
        stops = float(np.log2(ball.gain).mean())
        photographs.append(
            {
                "name": ball.name,
                "exposures": shoot.photographs[index],
                "circle": {"x": circle.x, "y": circle.y, "radius": circle.radius},
                "distance_radii": ball.view.distance,
                "focal_length_pixels": ball.view.focal_length,
                "turn_degrees": 0.0 if found is None else found.turn,
                "rotation": ball.rotation.tolist(),
                "gain": ball.gain.tolist(),
                "gain_stops": stops,
                "clipped_share": float(ball.clipped[inside_circle].mean()),
                "disagreement": None if found is None else found.disagreement,
            }
        )
        if abs(stops) > tuned.large_gain:
            warnings.append(f"{ball.name}: its exposure differs by {stops:+.2f} stops from the first photograph's")
    figures: dict[str, Any] = {
        "size": [width, height],
        "response": shoot.response_source,
        "reflectance": reflectance.tolist(),
        "assumed": assumed,
        "parallax": parallax,
        "covered": float((solid * unwrapped.covered).sum()),
        "clipped": float((solid * unwrapped.clipped).sum()),
        "zones": zones,
        "photographs": photographs,
        "warnings": warnings,
    }
    if grey is not None:
        figures["grey_ball"] = {
            "disagreement": grey.disagreement,
            "sources": [
                {
                    "pixel": [round(x, 2) for x in source.pixel],
                    "direction": source.direction.tolist(),
                    "angular_radius": source.angular_radius,
                    **{
                        name: [float(f"{value:.5g}") for value in getattr(source, name)]
                        for name in ("radiance", "irradiance", "clipped_irradiance", "gain", "uncertainty")
                    },
                }
                for source in grey.sources
            ],
        }
    elif figures["clipped"] > 0.0:
        warnings.append(
            "parts of the panorama are clipped, which are lower bounds: add shorter exposures, or photograph a grey ball "
            "beside the mirror ball (--grey-circle)"
        )
    return figures

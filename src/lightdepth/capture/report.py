"""The reports of the capture commands: plain numbers for a file, tables for a person."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightdepth.capture.dual_fisheye import DualStitched
from lightdepth.capture.lens import Lens
from lightdepth.capture.merging import Merged
from lightdepth.capture.photometry import half_diagonals
from lightdepth.capture.project import ControlPoint, angle_between
from lightdepth.capture.shoot import Shoot
from lightdepth.capture.stitching import Stitched
from lightdepth.directions import pixel_solid_angles
from lightdepth.images.writing import whole_file
from lightdepth.parameters.capture import DEFAULT, CaptureParameters


def merge_report(merged: Merged, photographs: list[str], amounts: list[float], response_source: str) -> dict[str, Any]:
    """Numbers about a merged bracket."""
    values = merged.radiance[merged.seen & (merged.radiance > 0.0).all(axis=2)].mean(axis=-1)
    low, high = np.percentile(values, [0.1, 100.0]) if values.size else (1.0, 1.0)
    return {
        "photographs": photographs,
        "exposure_range_stops": float(np.log2(max(amounts) / min(amounts))),
        "response": response_source,
        "size": [merged.radiance.shape[1], merged.radiance.shape[0]],
        "circle": None
        if merged.circle is None
        else {"x": merged.circle.x, "y": merged.circle.y, "radius": merged.circle.radius},
        "clipped_in_every_exposure": int(merged.clipped.sum()),
        "clipped_share": float(merged.clipped.sum() / max(int(merged.seen.sum()), 1)),
        "black_in_every_exposure": int(merged.black.sum()),
        "black_share": float(merged.black.sum() / max(int(merged.seen.sum()), 1)),
        "ghost_share": merged.ghosts,
        "orders_of_magnitude": float(np.log10(high / low)),
    }


def stitch_report(shoot: Shoot, stitched: Stitched, tuned: CaptureParameters = DEFAULT) -> dict[str, Any]:
    """Numbers about a panorama: control points, coverage, exposure differences, lens."""
    errors = control_point_errors(stitched.lenses, stitched.control_points)
    height, width = stitched.panorama.covered.shape
    solid_angle = pixel_solid_angles(height, width)[:, None] / (4.0 * np.pi)
    uncovered = ~stitched.panorama.covered
    lens = stitched.lenses[0]
    seen = shoot.orientations[0].seen
    rows, columns = np.nonzero(seen)
    edge = half_diagonals(lens, columns.astype(float) + 0.5, rows.astype(float) + 0.5)
    images = []
    for index, orientation in enumerate(shoot.orientations):
        own = np.array([index in point.images for point in stitched.control_points], dtype=bool)
        pose = stitched.lenses[index]
        gain = stitched.photometry.gains[index]
        images.append(
            {
                "name": orientation.name,
                "photographs": shoot.photographs[index],
                "yaw": pose.yaw,
                "pitch": pose.pitch,
                "roll": pose.roll,
                "control_points": int(own.sum()),
                "control_point_error_degrees": float(np.median(errors[own])) if own.any() else None,
                "unreliable_share": float(
                    (~orientation.reliable & orientation.seen).sum() / max(orientation.seen.sum(), 1)
                ),
                "exposure_correction_stops": float(np.log2(gain).mean()),
                "colour_correction": (gain / np.exp(np.log(gain).mean())).tolist(),
            }
        )
    return {
        "size": [width, height],
        "response": shoot.response_source,
        "control_points": {
            "found": stitched.matched,
            "kept": len(stitched.control_points),
            "median_error_degrees": _percentile(errors, 50),
            "p95_error_degrees": _percentile(errors, 95),
            "largest_error_degrees": _percentile(errors, 100),
        },
        "coverage": {
            "share": float(1.0 - (uncovered * solid_angle).sum()),
            "uncovered_above": float((uncovered * solid_angle)[: height // 2].sum()),
            "uncovered_below": float((uncovered * solid_angle)[height // 2 :].sum()),
        },
        "exposure": {
            "disagreement_before": stitched.photometry.disagreement_before,
            "disagreement": stitched.photometry.disagreement,
            "light_at_edge": float(stitched.photometry.falloff(edge.max(keepdims=True, initial=0.0))[0]),
        },
        "lens": {
            "projection": lens.projection,
            "fov": lens.fov,
            "distortion": list(lens.distortion),
            "shift": list(lens.shift),
        },
        "images": images,
        "warnings": warnings_of(shoot, stitched, tuned),
    }


def dual_report(shoot: Shoot, stitched: DualStitched) -> dict[str, Any]:
    """Figures of a panorama from two circles."""
    covered = stitched.panorama.covered
    height, width = covered.shape
    share = float((covered.mean(axis=1) * pixel_solid_angles(height, width)).sum() * width / (4.0 * np.pi))
    first, second = stitched.lenses
    relative = first.with_rotation(first.rotation.T @ second.rotation)
    return {
        "size": [width, height],
        "response": shoot.response_source,
        "circles": [vars(circle) for circle in stitched.circles],
        "lens": {"projection": first.projection, "fov": stitched.fov, "distortion": list(first.distortion)},
        "second": {"yaw": relative.yaw, "pitch": relative.pitch, "roll": relative.roll},
        "agreement": stitched.agreement,
        "exposure": {
            "disagreement_before": stitched.photometry.disagreement_before,
            "disagreement": stitched.photometry.disagreement,
            "gains": stitched.photometry.gains.tolist(),
        },
        "covered": share,
        "warnings": [*shoot.warnings, *stitched.warnings],
    }


def warnings_of(shoot: Shoot, stitched: Stitched, tuned: CaptureParameters = DEFAULT) -> list[str]:
    """What the user should look at."""
    found = list(shoot.warnings)
    names = [orientation.name for orientation in shoot.orientations]
    if len(stitched.unconnected) == len(names):
        found.append("no control points were found: every image keeps the rig's pose, and the lens is as stated")
    else:
        for index in stitched.unconnected:
            found.append(f"{names[index]}: no control points with the others; it keeps the rig's pose")
    errors = control_point_errors(stitched.lenses, stitched.control_points)
    wrong = int((errors > tuned.wrong_point).sum())
    if wrong:
        first, second = stitched.control_points[int(errors.argmax())].images
        found.append(
            f"{names[first]}, {names[second]}: a control point is off by {errors.max():.1f} degrees ({wrong} of "
            f"{errors.size} by more than {tuned.wrong_point:g}): look for doubled edges where these images meet; wrong "
            "matches, things that moved, and a camera that did not turn about its lens do this"
        )
    for index, gain in enumerate(stitched.photometry.gains):
        stops = float(np.log2(gain).mean())
        if abs(stops) > tuned.large_gain:
            found.append(
                f"{shoot.orientations[index].name}: its exposure differs by {stops:+.2f} stops from the others'"
            )
    return found


def control_point_errors(lenses: list[Lens], points: list[ControlPoint]) -> NDArray[np.float64]:
    """Angle in degrees between the two directions of each control point, shape (points,)."""
    return np.array([angle_between(lenses, point, offset=0.0) for point in points], dtype=np.float64)


def write_report(path: Path, report: dict[str, Any]) -> None:
    """Write a report as JSON; the file appears whole or not at all.

    Raises:
        InputError: the file cannot be written.
    """
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps(report, indent=2) + "\n")


def _percentile(values: NDArray[np.float64], percent: float) -> float | None:
    return float(np.percentile(values, percent)) if values.size else None

"""The picture by which a person judges a reconstruction: the surfaces' edges drawn over the panorama."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.directions import pixel_directions
from lightdepth.images.tonemapping import auto_exposure, tone_map
from lightdepth.kernel.raycasting import Hits
from lightdepth.parameters.reconstruction import DEFAULT, ReviewParameters
from lightdepth.reconstruction.coverage import view
from lightdepth.reconstruction.pose import Pose
from lightdepth.scene.model import RealSurface, Role

Picture = NDArray[np.uint8]

SUPPORT = np.array([60.0, 220.0, 90.0])
ENVIRONMENT = np.array([255.0, 170.0, 50.0])
SHELL = np.array([230.0, 70.0, 220.0])
NOTHING = np.array([70.0, 130.0, 255.0])


def draw_check_picture(
    radiance: NDArray[np.float32] | None,
    surfaces: Sequence[RealSurface],
    pose: Pose,
    tuned: ReviewParameters = DEFAULT.review,
) -> Picture:
    """Draw what the capture point sees of the surfaces over the panorama.

    Support is tinted green, the shell violet, sky and holes blue; edges are lines, green around support and orange
    elsewhere; names stand in the middle of what is seen of a surface.

    Args:
        radiance: the panorama, linear RGB, shape (height, 2 height, 3); without it the surfaces are shaded grey.
        surfaces: world, metres.
        pose: of the panorama.
        tuned: which edges are drawn.

    Returns:
        sRGB, shape (h, 2 h, 3), between 512 and 2048 pixels wide.
    """
    width = 1024 if radiance is None else int(np.clip(radiance.shape[1], 512, 2048))
    height = width // 2
    hits = view(surfaces, pose, 2 * height)  # Two rays across a pixel make smooth lines.
    surface = hits.mesh.reshape(2 * height, 2 * width)
    edge = _edges(hits, pose, surface, tuned)
    if radiance is None:
        shade = np.abs(
            np.einsum("ij,ij->i", hits.normal, pose.to_world(pixel_directions(2 * height, 2 * width).reshape(-1, 3)))
        )
        base = _halved(np.repeat(60.0 + 150.0 * shade.reshape(surface.shape)[:, :, None], 3, axis=2))
    else:
        method = cv2.INTER_AREA if radiance.shape[1] > width else cv2.INTER_LINEAR
        resized = np.maximum(cv2.resize(radiance, (width, height), interpolation=method), 0.0)
        base = tone_map(resized, auto_exposure(resized) - 0.5).astype(np.float64)

    colours = np.array([_colour(s) for s in surfaces] + [NOTHING])
    tints = np.array([_tint(s) for s in surfaces] + [0.3])
    tint = _halved((tints[surface])[:, :, None])
    picture = base * (1.0 - tint) + tint * _halved(colours[surface])
    cover = _halved(edge.astype(np.float64)[:, :, None])
    # Around support the line is green on either side.
    support = np.array([s.role is Role.SUPPORT for s in surfaces] + [False])[surface].astype(np.uint8)
    green = _halved(cv2.dilate(support, np.ones((5, 5)))[:, :, None].astype(np.float64)) > 0.0
    result = picture * (1.0 - cover) + cover * np.where(green, SUPPORT, ENVIRONMENT)
    pixels = np.clip(np.rint(result), 0, 255).astype(np.uint8)
    for index, named in enumerate(surfaces):
        _write_name(pixels, named, surface[::2, ::2] == index)
    return pixels


def _colour(surface: RealSurface) -> NDArray[np.float64]:
    if surface.name == "shell":
        return SHELL
    return SUPPORT if surface.role is Role.SUPPORT else ENVIRONMENT


def _tint(surface: RealSurface) -> float:
    return 0.35 if surface.name == "shell" else 0.22 if surface.role is Role.SUPPORT else 0.0


def _edges(hits: Hits, pose: Pose, surface: NDArray[np.int32], tuned: ReviewParameters) -> NDArray[np.bool_]:
    """Pixels where another surface begins, the same one bends, or its distance jumps, within a few pixels.

    These few make lines that can be seen, and find corners that a reconstruction has rounded.
    """
    height, width = surface.shape
    few = 2 + height // 512
    sharpest = np.cos(np.radians(tuned.sharpest_bend))
    directions = pose.to_world(pixel_directions(height, width))
    normal = hits.normal.reshape(height, width, 3).astype(np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        reciprocal = 1.0 / hits.distance.reshape(height, width).astype(np.float64)
        # On the plane of this pixel, what the reciprocal distance is in another direction w: (n . w) / (n . p).
        slope = normal * (reciprocal / np.einsum("ijk,ijk->ij", normal, directions))[:, :, None]
        edge = np.zeros(surface.shape, dtype=bool)
        for axis in (0, 1):
            following = np.roll(surface, -few, axis)
            bend = np.einsum("ijk,ijk->ij", normal, np.roll(normal, -few, axis)) < sharpest
            predicted = np.einsum("ijk,ijk->ij", slope, np.roll(directions, -few, axis))
            there = np.roll(reciprocal, -few, axis)
            jump = np.abs(there - predicted) > tuned.jump * np.maximum(there, reciprocal)
            found = (surface != following) | ((surface >= 0) & (bend | jump))
            if axis == 0:
                found[-few:] = False
            edge |= np.roll(found, few // 2, axis)  # On the edge, not before it.
    # Roughness gives scattered pixels, edges give lines.
    _, labels, boxes, _ = cv2.connectedComponentsWithStats(edge.astype(np.uint8), connectivity=8)
    length = np.maximum(boxes[:, cv2.CC_STAT_WIDTH], boxes[:, cv2.CC_STAT_HEIGHT])
    return edge & (length >= tuned.shortest_edge * height)[labels]


def _halved(image: NDArray[np.float64]) -> NDArray[np.float64]:
    """Means of 2 x 2 pixels, shape (h / 2, w / 2, channels)."""
    return image.reshape(image.shape[0] // 2, 2, image.shape[1] // 2, 2, -1).mean(axis=(1, 3))


def _write_name(pixels: Picture, surface: RealSurface, visible: NDArray[np.bool_]) -> None:
    """Write a surface's name where most of it is seen."""
    distance = cv2.distanceTransform(np.pad(visible.astype(np.uint8), 1), cv2.DIST_L2, 3)[1:-1, 1:-1]
    if distance.max() < 6:
        return
    row, column = np.unravel_index(int(np.argmax(distance)), distance.shape)
    size = 0.5 * pixels.shape[1] / 1024
    (across, high), _ = cv2.getTextSize(surface.name, cv2.FONT_HERSHEY_SIMPLEX, size, 1)
    at = (int(np.clip(column - across // 2, 2, pixels.shape[1] - across - 2)), int(row + high // 2))
    colour = tuple(int(c) for c in _colour(surface))
    for pen, thickness in (((20, 20, 20), 4), (colour, 1)):
        cv2.putText(pixels, surface.name, at, cv2.FONT_HERSHEY_SIMPLEX, size, pen, thickness, cv2.LINE_AA)

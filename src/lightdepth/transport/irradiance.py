"""The irradiance that the place had before insertion, at points of its surfaces.

Equation: docs/theory.md, eq. (5): ``E(p) = integral of M(q(p, w)) cos dw``. Per colour channel and without bias it
takes the part of the paper's scale factor ``ES`` (eq. 7 and 8).
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightdepth.kernel.tracing import leave
from lightdepth.transport.place import SHADOW_RAY_END, Place

BATCH = 64
"""Samples of each of the two techniques that a point gets at a time."""
FEWEST_BATCHES, MOST_BATCHES = 4, 48
LANES = 1 << 21


def estimate_irradiance(
    place: Place,
    points: NDArray[np.float32],
    normals: NDArray[np.float32],
    generator: np.random.Generator,
    error: float = 0.005,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Irradiance at points by multiple importance sampling of the map and of the cosine lobe.

    Args:
        place: the place before insertion.
        points: shape (n, 3), world, metres.
        normals: unit, on the side that receives, shape (n, 3), world.
        generator: source of randomness.
        error: relative standard error at which a point is done; noisy points get more samples up to a bound.

    Returns:
        ``(irradiance, relative standard error of its luminance)``, shapes (n, 3) and (n,), float32.
    """
    total = np.zeros((len(points), 3))
    squares = np.zeros(len(points))
    batches = np.zeros(len(points), np.int64)
    pending = np.arange(len(points))
    while len(pending):
        # Later rounds take as much again as all before, so that few rounds suffice.
        rounds = max(FEWEST_BATCHES, int(batches[pending[0]]))
        place.draw_lights(generator)
        for _ in range(rounds):
            for chunk in np.array_split(pending, max(1, -(-len(pending) * BATCH // LANES))):
                value = _batch(place, points[chunk], normals[chunk], generator)
                total[chunk] += value
                squares[chunk] += value.mean(axis=1) ** 2
                batches[chunk] += 1
        mean = total[pending].mean(axis=1) / batches[pending]
        variance = np.maximum(squares[pending] / batches[pending] - mean**2, 0.0) / (batches[pending] - 1)
        undecided = np.sqrt(variance) > error * mean
        pending = pending[undecided & (batches[pending] < MOST_BATCHES)]
    mean = total.mean(axis=1) / batches
    variance = np.maximum(squares / batches - mean**2, 0.0) / (batches - 1)
    relative = np.sqrt(variance) / np.maximum(mean, 1e-30)
    return (total / batches[:, None]).astype(np.float32), np.where(mean > 0, relative, 0.0).astype(np.float32)


def _batch(
    place: Place, points: NDArray[np.float32], normals: NDArray[np.float32], generator: np.random.Generator
) -> NDArray[np.float64]:
    """One estimate for each point, shape (n, 3)."""
    count = len(points)
    lane = dr.arange(mi.UInt32, count * BATCH)
    owner, number = lane // BATCH, mi.Float(lane % BATCH)
    point = dr.gather(mi.Point3f, mi.Float(points.reshape(-1)), owner)
    normal = dr.gather(mi.Vector3f, mi.Float(normals.reshape(-1)), owner)
    shifts = mi.Float(generator.random(3 * count, dtype=np.float32))
    shift = dr.gather(mi.Point3f, shifts, owner)

    # Light sampling.
    light = place.light((number + shift.x) / BATCH, mi.Bool(True))
    direction, distance, pdf_light = place.toward(light, point)
    cosine = dr.dot(normal, direction)
    useful = (cosine > 0.0) & (pdf_light > 0.0)
    if not place.infinite and place.surfaces.has_real:
        ray = leave(point, normal, direction, distance * SHADOW_RAY_END)
        useful &= ~place.surfaces.real.ray_test(ray, coherent=False, active=useful)
    weight = pdf_light / (pdf_light + cosine * dr.inv_pi)
    value = dr.select(useful, light.radiance * (cosine * weight / pdf_light), 0.0)

    # Cosine sampling, by a lattice of the golden ratio's kind that is shifted at every point.
    u = dr.fma(number, 1.0 / BATCH, shift.y)
    v = dr.fma(number, 0.6180339887, shift.z)
    local = mi.warp.square_to_cosine_hemisphere(mi.Point2f(u - dr.floor(u), v - dr.floor(v)))
    direction = mi.Frame3f(normal).to_world(local)
    hit = place.surfaces.first_real(leave(point, normal, direction), mi.Bool(True))
    radiance, pdf_light = place.seen(hit, direction, hit.distance, mi.Bool(True))
    cosine = dr.maximum(local.z, 1e-6)
    value += radiance * (cosine / (pdf_light + cosine * dr.inv_pi))
    sums = [dr.block_sum(channel, BATCH).numpy() for channel in (value.x, value.y, value.z)]
    return np.stack(sums, axis=1).astype(np.float64) / BATCH

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

SAMPLES = 1024
"""Samples of each of the two techniques that a point gets. They are stratified, in two halves: on a hotel room with
small lamps 64 gave 5 % error, 256 1.9 %, 1024 0.7 %."""
LANES = 1 << 21


def estimate_irradiance(
    place: Place,
    points: NDArray[np.float32],
    normals: NDArray[np.float32],
    generator: np.random.Generator,
    samples: int = SAMPLES,
) -> tuple[NDArray[np.float32], float]:
    """Irradiance at points by multiple importance sampling of the map and of the cosine lobe.

    Args:
        place: the place before insertion.
        points: shape (n, 3), world, metres.
        normals: unit, on the side that receives, shape (n, 3), world.
        generator: source of randomness.
        samples: of each technique at each point, an even number.

    Returns:
        Irradiance, shape (n, 3), float32, and its relative standard error, that of the typical point.
    """
    half = samples // 2
    results = np.zeros((2, len(points), 3))
    for result in results:
        place.draw_lights(generator)
        for chunk in np.array_split(np.arange(len(points)), max(1, -(-len(points) * half // LANES))):
            result[chunk] = _estimate(place, points[chunk], normals[chunk], generator, half)
    mean = results.mean(axis=0)
    difference = (results[0] - results[1]).mean(axis=1) / np.maximum(results.sum(axis=0).mean(axis=1), 1e-30)
    # By the median, since points that are all but dark have any relative error.
    return mean.astype(np.float32), 1.4826 * float(np.median(np.abs(difference)))


def _estimate(
    place: Place,
    points: NDArray[np.float32],
    normals: NDArray[np.float32],
    generator: np.random.Generator,
    samples: int,
) -> NDArray[np.float64]:
    """One estimate for each point, shape (n, 3)."""
    count = len(points)
    lane = dr.arange(mi.UInt32, count * samples)
    owner, number = lane // samples, mi.Float(lane % samples)
    point = dr.gather(mi.Point3f, mi.Float(points.reshape(-1)), owner)
    normal = dr.gather(mi.Vector3f, mi.Float(normals.reshape(-1)), owner)
    shifts = mi.Float(generator.random(3 * count, dtype=np.float32))
    shift = dr.gather(mi.Point3f, shifts, owner)

    # Light sampling.
    light = place.light((number + shift.x) / samples, mi.Bool(True))
    direction, distance, pdf_light = place.toward(light, point)
    cosine = dr.dot(normal, direction)
    useful = (cosine > 0.0) & (pdf_light > 0.0)
    if not place.infinite and place.surfaces.has_real:
        ray = leave(point, normal, direction, distance * SHADOW_RAY_END)
        useful &= ~place.surfaces.real.ray_test(ray, coherent=False, active=useful)
    weight = pdf_light / (pdf_light + cosine * dr.inv_pi)
    value = dr.select(useful, light.radiance * (cosine * weight / pdf_light), 0.0)

    # Cosine sampling, by a lattice of the golden ratio's kind that is shifted at every point.
    u = dr.fma(number, 1.0 / samples, shift.y)
    v = dr.fma(number, 0.6180339887, shift.z)
    local = mi.warp.square_to_cosine_hemisphere(mi.Point2f(u - dr.floor(u), v - dr.floor(v)))
    direction = mi.Frame3f(normal).to_world(local)
    hit = place.surfaces.first_real(leave(point, normal, direction), mi.Bool(True))
    radiance, pdf_light = place.seen(hit, direction, hit.distance, mi.Bool(True))
    cosine = dr.maximum(local.z, 1e-6)
    value += radiance * (cosine / (pdf_light + cosine * dr.inv_pi))
    sums = [dr.block_sum(channel, samples).numpy() for channel in (value.x, value.y, value.z)]
    return np.stack(sums, axis=1).astype(np.float64) / samples

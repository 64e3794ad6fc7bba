"""Radiance along single rays, by Mitsuba's own path tracer."""

import mitsuba as mi
import numpy as np


def radiance(shapes, origins, directions, **settings):
    """Mean radiance along rays, shape (n, 3), in a constant environment."""
    return radiance_and_error(shapes, origins, directions, **settings)[0]


def radiance_and_error(shapes, origins, directions, *, environment=1.0, samples=256, depth=12, more=None):
    """The same, and its standard error, shape (n, 3)."""
    constant = {"type": "constant", "radiance": {"type": "rgb", "value": [environment] * 3}}
    scene = mi.load_dict(
        {
            "type": "scene",
            **({"environment": constant} if environment > 0.0 else {}),
            **(more or {}),
            **{f"shape{i}": shape for i, shape in enumerate(shapes)},
        },
        optimize=False,
    )
    integrator = mi.load_dict({"type": "path", "max_depth": depth, "rr_depth": 1000})
    origins, directions = np.broadcast_arrays(np.atleast_2d(origins), np.atleast_2d(directions))
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    o, d = (np.repeat(v, samples, axis=0).T.astype(np.float32) for v in (origins, directions))
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(7, o.shape[1])
    found = integrator.sample(scene, sampler, mi.RayDifferential3f(mi.Ray3f(mi.Point3f(o), mi.Vector3f(d))))[0]
    found = np.array(found, dtype=np.float64).T.reshape(len(origins), samples, 3)
    return found.mean(axis=1), found.std(axis=1) / np.sqrt(samples)

"""Rays against Mitsuba's scenes, on every device.

The place and the new objects are scenes of their own, which a path traces side by side. On the CPU that is one kernel. On
a GPU, OptiX traces a single scene in a kernel: there every intersection is evaluated at once, and loops that trace run
one kernel after the other.

The module is imported after ``kernel.start``; nothing else calls Mitsuba's ray tracing.
"""

from __future__ import annotations

from typing import Literal

import drjit as dr
import mitsuba as mi

ONE_SCENE_A_KERNEL = str(mi.variant()).startswith("cuda")
"""Whether kernels can hold the intersections of a single scene only."""


def loop_mode() -> Literal["evaluated", "symbolic"]:
    """How Dr.Jit is to run loops that trace rays, for ``dr.hint``."""
    return "evaluated" if ONE_SCENE_A_KERNEL else "symbolic"


def first_hit(
    scene: mi.Scene, ray: mi.Ray3f, active: mi.Bool | bool = True, coherent: bool = False
) -> mi.PreliminaryIntersection3f:
    """The first surface along rays.

    Args:
        scene: what is traced.
        ray: world, metres.
        active: which are traced; the others meet nothing.
        coherent: whether neighbouring rays run alike.
    """
    found = scene.ray_intersect_preliminary(ray, coherent=coherent, active=active)
    if ONE_SCENE_A_KERNEL:
        dr.eval(found)
    return found


def first_interaction(scene: mi.Scene, ray: mi.Ray3f, active: mi.Bool) -> mi.SurfaceInteraction3f:
    """The first surface along rays with all that materials ask of it; as for :func:`first_hit`."""
    return first_hit(scene, ray, active).compute_surface_interaction(ray, mi.RayFlags.All, active)


def meets(scene: mi.Scene, ray: mi.Ray3f, active: mi.Bool) -> mi.Bool:
    """Which rays meet any surface before they end; as for :func:`first_hit`."""
    met = scene.ray_test(ray, coherent=False, active=active)
    if ONE_SCENE_A_KERNEL:
        dr.eval(met)
    return met

"""The reflectance of real surfaces, from their photographed radiance and their recovered irradiance.

Equation: docs/theory.md, eq. (6): ``rho(p) = pi M(p) / E(p)``, at every shaded point with M at full resolution.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from lightdepth.parameters.place import DEFAULT, PlaceParameters
from lightdepth.place.place import Place
from lightdepth.place.traced_surfaces import RealHit, TracedSurfaces


def recovered_reflectance(
    place: Place, surfaces: TracedSurfaces, hit: RealHit, direction: mi.Vector3f, active: mi.Bool
) -> tuple[mi.Color3f, mi.Color3f]:
    """:func:`reflectance` at points of real surfaces, 0 where they are not ``active``; environment keeps its lobe alone.

    Args:
        place: what was photographed.
        surfaces: the same surfaces with their irradiance.
        hit: the points.
        direction: of view toward them, unit, world.
        active: lanes to evaluate.
    """
    radiance = place.photograph.surface_radiance(hit, direction, active)
    mirrored = place.photograph.mirrored(hit, direction, active)
    if place.plate is not None:
        radiance, mirrored = place.plate.over(radiance, mirrored, hit, direction, active)
    rho, specular_scale = reflectance(
        radiance,
        surfaces.irradiance(hit, active),
        mirrored,
        surfaces.typical_albedo(hit, active),
        place.parameters,
    )
    return rho & active & surfaces.receives(hit), specular_scale & active


def reflectance(
    radiance: mi.Color3f,
    irradiance: mi.Color3f,
    mirrored: mi.Color3f,
    typical_albedo: mi.Color3f,
    tuned: PlaceParameters = DEFAULT,
) -> tuple[mi.Color3f, mi.Color3f]:
    """Recovered albedo ``rho`` and the factor on the specular lobe, per channel (theory, eq. 6).

    A ratio a little above 1 is noise of the photograph or the geometry and is clamped; one above ``tuned.glowing`` in any
    channel means that the surface glows by itself, or that the geometry is wrong: it scatters nothing. Where the lobe
    mirrors something that the photograph does not show there, it is scaled down, so that the surface stays diffuse.

    Args:
        radiance: M at points of support.
        irradiance: E there.
        mirrored: S there, 0 without gloss.
        typical_albedo: of the diffuse part of the surface, 0 without gloss.
        tuned: what glows, and how much may be mirrored.
    """
    diffuse = typical_albedo * irradiance * (tuned.least_diffuse * dr.inv_pi)
    allowed = dr.minimum(mirrored, dr.maximum(radiance - diffuse, tuned.always_mirrored * radiance))
    ratio = dr.pi * dr.maximum(radiance - allowed, 0.0) / dr.maximum(irradiance, 1e-20)
    glowing = dr.max(ratio) > tuned.glowing
    specular_scale = allowed / dr.maximum(mirrored, 1e-20)
    return dr.select(glowing, 0.0, dr.minimum(ratio, 1.0)), dr.select(glowing, 0.0, specular_scale)

"""Does the photograph show what declared gloss would mirror?"""

from __future__ import annotations

from dataclasses import replace

from lightdepth.checks.problem import Problem, Severity
from lightdepth.kernel.start import start
from lightdepth.parameters.checks import DEFAULT, ChecksParameters
from lightdepth.scene.model import Scene


def gloss_problems(scene: Scene, tuned: ChecksParameters = DEFAULT) -> list[Problem]:
    """Find gloss that would mirror more than the photograph shows, so that it is scaled down.

    Args:
        scene: the scene.
        tuned: how much must be left of a lobe.
    """
    shiny = [surface for surface in scene.real if surface.gloss is not None]
    if not shiny or not scene.panorama.radiance.size:
        return []
    start()
    from lightdepth.lighting.sun_mask import with_masks
    from lightdepth.place.place import Place
    from lightdepth.place.real_surfaces import merge_real_surfaces
    from lightdepth.place.traced_surfaces import TracedSurfaces
    from lightdepth.recovery.gains import solve_gains
    from lightdepth.recovery.specular import fitted_glosses

    surfaces = merge_real_surfaces(scene.real)

    def place() -> Place:
        traced = TracedSurfaces(replace(surfaces, vertices=surfaces.rest))
        rooms = scene.render.parameters
        gains = solve_gains(scene.panoramas, traced, rooms.balance, rooms.place).gains
        return Place(scene.panoramas, traced, declared=with_masks(scene), gains=gains, parameters=rooms.place)

    fitted = fitted_glosses(scene, surfaces, place, scene.render.parameters.recovery)
    scales = dict(zip(surfaces.glosses, (gloss.scale for gloss in fitted), strict=True))
    problems = []
    for surface in shiny:
        scale = scales[surface.gloss] if surface.gloss is not None else 1.0
        if scale < 1.0:
            severity = Severity.WARNING if scale < tuned.least_lobe else Severity.HINT
            problems.append(
                Problem(
                    severity,
                    f'[[real]] "{surface.name}": its gloss would mirror more than the photograph shows; '
                    f"only {100.0 * scale:.0f} % of the lobe is used. "
                    "Lower specular, or correct the model of its surroundings",
                )
            )
    return problems

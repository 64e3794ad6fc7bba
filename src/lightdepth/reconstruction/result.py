"""A finished reconstruction: closed, measured, written, and reported."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightdepth.images.png import write_png
from lightdepth.images.writing import check_writable
from lightdepth.parameters.reconstruction import DEFAULT, ReviewParameters
from lightdepth.reconstruction.check_picture import draw_check_picture
from lightdepth.reconstruction.coverage import Coverage, enclosing_shell, measure_coverage
from lightdepth.reconstruction.floor import Plane
from lightdepth.reconstruction.posed_panorama import PosedPanorama
from lightdepth.reconstruction.scene_file import mesh_path, with_surfaces, write_meshes, write_scene
from lightdepth.scene.meshes.geometry import face_areas
from lightdepth.scene.model import RealSurface


@dataclass(frozen=True)
class Reconstruction:
    """Surfaces that every direction from the capture point meets, but for declared sky.

    Attributes:
        surfaces: world, metres; with the shell, where one was needed.
        before: coverage without the shell.
        after: coverage with it.
        floor: the floor plane that was found in measurements, or ``None``.
    """

    surfaces: list[RealSurface]
    before: Coverage
    after: Coverage
    floor: Plane | None = None

    def as_dict(self, folder: Path) -> dict[str, Any]:
        """The report, for JSON: lengths in metres, shares of the sphere of directions in [0, 1], angles in degrees."""
        report: dict[str, Any] = {
            "surfaces": [
                {
                    "name": surface.name,
                    "role": surface.role.value,
                    "mesh": str(mesh_path(surface, folder)),
                    "faces": len(surface.mesh.faces),
                    "area": float(face_areas(surface.mesh.vertices, surface.mesh.faces).sum()),
                }
                for surface in self.surfaces
            ],
            "coverage_without_shell": self.before.as_dict(),
            "coverage": self.after.as_dict(),
        }
        if self.floor is not None:
            report["floor"] = {
                "height": float(self.floor.offset),
                "tilt": self.floor.tilt,
                "normal": [float(x) for x in self.floor.normal],
            }
        return report


def closed(
    surfaces: Sequence[RealSurface],
    panorama: PosedPanorama,
    sky: NDArray[np.bool_] | bool,
    floor: Plane | None = None,
    *,
    open_from_elsewhere: bool = False,
    tuned: ReviewParameters = DEFAULT.review,
) -> Reconstruction:
    """Measure what the surfaces cover, and close what they leave open with an enclosing shell.

    Args:
        surfaces: of the place.
        panorama: with its pose.
        sky: what is declared sky: a mask of shape (height, 2 height), everything that meets nothing, or nothing.
        floor: for the report.
        open_from_elsewhere: the surfaces have gaps that the capture point does not see; where nothing is sky, these are
            closed as well.
        tuned: how coverage is measured, and where the shell stands.
    """
    surfaces = list(surfaces)
    before = after = measure_coverage(surfaces, panorama.pose, sky, tuned)
    no_sky = not np.any(sky)
    if no_sky and (before.open > 0.0 or open_from_elsewhere):
        surfaces.append(enclosing_shell(surfaces, panorama.pose, tuned))
        after = measure_coverage(surfaces, panorama.pose, sky, tuned)
    return Reconstruction(surfaces, before, after, floor)


def save(
    reconstruction: Reconstruction,
    panorama: PosedPanorama,
    folder: Path,
    scene: Path | None,
    picture: Path | None,
    tuned: ReviewParameters = DEFAULT.review,
) -> None:
    """Write the meshes, the scene file's entries and the check picture; nothing, where one of them cannot be made.

    Args:
        reconstruction: what to write.
        panorama: that it was made for.
        folder: of the meshes; it is made where it is missing.
        scene: the scene file to put the ``[[real]]`` tables into, or to begin.
        picture: the PNG file of the check picture.
        tuned: which poses are the same, and which edges are drawn.

    Raises:
        InputError: a file cannot be written, or the scene file is wrong.
    """
    for path in (scene, picture):
        if path is not None:
            check_writable(path)
    content = (
        None
        if scene is None
        else with_surfaces(scene, panorama, reconstruction.surfaces, folder, reconstruction.after.sky > 0.0, tuned)
    )
    drawn = (
        None
        if picture is None
        else draw_check_picture(panorama.radiance, reconstruction.surfaces, panorama.pose, tuned)
    )
    write_meshes(reconstruction.surfaces, folder)
    if picture is not None and drawn is not None:
        write_png(picture, drawn)
    if scene is not None and content is not None:
        write_scene(scene, content)

"""Small places with known light, for the tests of the transport."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
import trimesh
from numpy.typing import NDArray

from lightdepth.api import begin_rendering
from lightdepth.cameras import Cubemap, DomeStereo, Equirectangular, Fisheye, OmnidirectionalStereo, Perspective
from lightdepth.directions import euler_rotation, pixel_directions
from lightdepth.film.frame import Frame
from lightdepth.scene.materials import Diffuse, Material
from lightdepth.scene.model import (
    AnalyticShape,
    CameraView,
    Gloss,
    Mesh,
    Panorama,
    RealSurface,
    RenderSettings,
    Role,
    Scene,
    SyntheticObject,
    SyntheticPart,
)

LOW, HIGH = np.array([-2.0, -2.5, 0.0]), np.array([2.5, 3.0, 2.6])
CAPTURE = np.array([0.2, -0.3, 1.4])
STEREO = OmnidirectionalStereo(
    type="ods", width=32, interocular_distance=0.3, convergence_distance=1.9, nadir_merge=(30.0, 80.0)
)
"""Eyes so far apart that a mistake shows."""


def box_mesh(low: NDArray = LOW, high: NDArray = HIGH) -> Mesh:
    """A box whose faces point inward."""
    box = trimesh.creation.box(bounds=[low, high])
    return Mesh(np.asarray(box.vertices, np.float32), np.asarray(box.faces[:, ::-1], np.int32))


def box_depth(directions: NDArray, origin: NDArray = CAPTURE, low: NDArray = LOW, high: NDArray = HIGH) -> NDArray:
    """Distance to the inside of a box along unit directions of shape (..., 3)."""
    with np.errstate(divide="ignore"):
        exits = np.where(directions > 0, (high - origin) / directions, (low - origin) / directions)
    return exits.min(axis=-1)


def ball(material: Material, center: Sequence[float] = (0.3, 1.2, 0.4), radius: float = 0.4) -> SyntheticObject:
    """A ball in the room."""
    to_world = np.diag([radius, radius, radius, 1.0])
    to_world[:3, 3] = center
    return SyntheticObject("ball", (SyntheticPart(AnalyticShape("sphere", to_world), material),))


def room(
    radiance: NDArray | float = 1.0,
    objects: Sequence[SyntheticObject] = (),
    role: Role = Role.SUPPORT,
    gloss: Gloss | None = None,
    rotation: Sequence[float] = (3.0, -2.0, 40.0),
    width: int = 64,
    **settings: object,
) -> Scene:
    """A closed box photographed as ``radiance`` (constant, or an image), with six cameras in two places.

    The irradiance of its support is known to 4 % at each vertex unless ``settings`` ask for more: most of a test's time
    goes into that.
    """
    image = np.asarray(radiance, np.float32)
    if image.ndim < 3:
        image = np.broadcast_to(image, (width // 2, width, 3)).copy()
    turn = euler_rotation(rotation)
    away = CAPTURE + [-0.8, -0.6, -0.2]
    cameras = {
        "pano": CameraView(Equirectangular(type="equirectangular", width=image.shape[1]), CAPTURE, turn),
        "dome": CameraView(Fisheye(type="fisheye", width=48, fov=200), away, euler_rotation([20.0, 0.0, 0.0])),
        "view": CameraView(
            Perspective(type="perspective", width=48, height=32, fov=80), away, euler_rotation([-15, 0, -15])
        ),
        "stereo": CameraView(STEREO, away, np.eye(3)),
        "stereo dome": CameraView(
            DomeStereo(type="dome_stereo", width=24, fov=220, tilt=40, interocular_distance=0.3), away, np.eye(3)
        ),
        "cubemap": CameraView(Cubemap(type="cubemap", width=48), away, euler_rotation([0.0, 0.0, 35.0])),
    }
    return Scene(
        Panorama(image, CAPTURE, turn),
        (RealSurface("room", box_mesh(), role, gloss),),
        tuple(objects),
        cameras,
        RenderSettings(**{"irradiance_samples": 64, **settings}),  # type: ignore[arg-type]
    )


@lru_cache(maxsize=8)
def _with_film(scene: Scene, **film: float) -> Scene:
    """The scene with other parameters of the film: the same object each time, whose contents are hashed once."""
    parameters = scene.render.parameters
    parameters = replace(parameters, film=replace(parameters.film, **film))
    return replace(scene, render=replace(scene.render, parameters=parameters))


def picture(scene: Scene, camera: str, samples: int, seed: int) -> Frame:
    """One of many pictures: without object ids, depth, normals, albedo and the estimate of the errors that pixels share.

    Each of these takes as long as many samples.
    """
    scene = _with_film(scene, worth_shared=0.0)
    return begin_rendering(scene, camera, seed=seed).complete(samples, auxiliary=False)


def one_pass(
    scene: Scene, camera: str, seed: int, samples: int = 16, method: str = "difference", training: int = 1 << 12
) -> Frame:
    """The first of two equal rounds of a picture, which is one pass. Many small ones take no longer than a large one.

    Args:
        scene: what is seen.
        camera: its name.
        seed: of the random numbers.
        samples: a pixel, up to the 16 of a first round.
        method: of light transport.
        training: paths for the radiance cache, which take longer than these pictures; the fewer, the more its cells err.
    """
    scene = _with_film(scene, first_training_paths=training, fewest_training_paths=training)
    rendering = begin_rendering(scene, camera, method=method, seed=seed)
    next(rendering.run(2 * samples))
    return rendering.frame(auxiliary=False)


def with_floor_alone_as_support(scene: Scene) -> Scene:
    """The same room with walls and ceiling declared environment."""
    surface = scene.real[0]
    mesh = surface.mesh
    on_floor = (mesh.vertices[mesh.faces][:, :, 2] == LOW[2]).all(axis=1)
    floor = RealSurface("floor", Mesh(mesh.vertices, mesh.faces[on_floor]), Role.SUPPORT, surface.gloss)
    walls = RealSurface("walls", Mesh(mesh.vertices, mesh.faces[~on_floor]), Role.ENVIRONMENT)
    return replace(scene, real=(floor, walls))


def lamp_image(width: int = 256) -> NDArray[np.float32]:
    """A smooth room with a small bright lamp and a window, no closed form."""
    directions = pixel_directions(width // 2, width)
    image = 0.3 + 0.2 * directions @ np.array([[0.5, 0.2, 0.1], [0.1, 0.6, 0.2], [0.4, 0.3, 0.2]])
    image[directions @ [0.3, 0.4, 0.866] > 0.995] = [400.0, 300.0, 200.0]
    image[directions @ [-0.8, 0.5, 0.33] > 0.96] = [8.0, 9.0, 12.0]
    return image.astype(np.float32)


WHITE = Diffuse(type="diffuse", color=(1.0, 1.0, 1.0))
GREY = Diffuse(type="diffuse", color=(0.5, 0.4, 0.3))

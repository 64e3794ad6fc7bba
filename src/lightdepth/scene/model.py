"""The validated scene: plain, immutable data, with everything in world space, metres."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lightdepth.cameras import Equirectangular, Viewpoint
from lightdepth.parameters import Parameters
from lightdepth.scene.materials import Material


class Role(StrEnum):
    """What a real surface does in the augmented scene (paper, section 5.1)."""

    ENVIRONMENT = "environment"
    SUPPORT = "support"


@dataclass(frozen=True)
class Mesh:
    """Triangles.

    Attributes:
        vertices: shape (n, 3), float32, world, metres; of a file that is not placed yet float64.
        faces: shape (m, 3), int32, counter-clockwise seen from outside.
        normals: shading normals, shape (n, 3), float32, unit, world; ``None`` means flat faces.
        texture_coordinates: shape (n, 2), float32, or ``None``; v grows upward in the image.
        colors: linear vertex colours, shape (n, 3), float32, not negative, or ``None``.
        rest: environment texture coordinates (paper, section 5.8): where on the real place each vertex takes its
            colour from, shape (n, 3), of the type of ``vertices``, world, metres; ``None`` means from where it is.
    """

    vertices: NDArray[np.floating]
    faces: NDArray[np.int32]
    normals: NDArray[np.float32] | None = None
    texture_coordinates: NDArray[np.float32] | None = None
    colors: NDArray[np.float32] | None = None
    rest: NDArray[np.floating] | None = None


@dataclass(frozen=True)
class AnalyticShape:
    """A shape that is traced exactly: one of Mitsuba's, as it is named there.

    Attributes:
        kind: sphere | cube | rectangle | disk | cylinder, of unit size as Mitsuba defines it.
        to_world: shape (4, 4), float64.
    """

    kind: str
    to_world: NDArray[np.float64]


@dataclass(frozen=True)
class Gloss:
    """Specular lobe on a real surface.

    Attributes:
        roughness: of the GGX distribution, in [0, 1].
        specular: level in [0, 1]; 0.5 is a reflectance of 4 % at normal incidence.
        scale: share of the lobe that the photograph leaves room for, in [0, 1]; see :mod:`lightdepth.recovery.specular`.
        albedo: typical diffuse albedo of the surface beneath the lobe, linear RGB; found by the same module.
    """

    roughness: float
    specular: float
    scale: float = 1.0
    albedo: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class RealSurface:
    """A surface that exists in the photograph.

    Attributes:
        name: for messages.
        mesh: in world space.
        role: what it does in the augmented scene.
        gloss: specular lobe; environment with one mirrors the new objects and does not change otherwise.
        opening: a window pane, through which a declared sun shines in; what the photograph shows of it stays.
        removed: it is in the photograph, and is to leave the picture, with its light, its shadow and its reflections.
    """

    name: str
    mesh: Mesh
    role: Role
    gloss: Gloss | None = None
    opening: bool = False
    removed: bool = False


@dataclass(frozen=True)
class Light:
    """A light of the real place that the photograph lacks; each kind adds what it is.

    Attributes:
        name: for messages.
    """

    name: str


@dataclass(frozen=True)
class SunLight(Light):
    """A sun that shines into the place and that the photograph does not show.

    Attributes:
        direction: toward the sun, unit, world, shape (3,), float64.
        diameter: degrees.
        irradiance: on a surface that faces the sun, shape (3,), float64, in the panorama's unit times steradian.
        mask: share of it that passes curtains and bars that are not modelled, shape (h, w) or (h, w, 3), float32; row 0 is
            the top. ``None`` lets all pass.
        mask_extent: left, bottom, right and top of the mask in the plane across the direction, metres, along the axes of
            :func:`lightdepth.scene.lights.frame.sun_axes`; nothing passes beyond it.
        recover_mask: the mask is the pattern that the photograph shows of the sun's patch, recovered when the place is
            prepared.
    """

    direction: NDArray[np.float64]
    diameter: float
    irradiance: NDArray[np.float64]
    mask: NDArray[np.float32] | None = None
    mask_extent: tuple[float, float, float, float] | None = None
    recover_mask: bool = False


@dataclass(frozen=True)
class SyntheticPart:
    """Geometry with one material.

    Attributes:
        geometry: in world space, or what stands at ``places``, a mesh then.
        material: of all of it.
        places: a matrix for each place where the geometry stands, from its coordinates to the world, shape (k, 4, 4),
            float64, of determinants above 0; ``None`` where it stands once, in world space.
        material_name: of the material in its mesh file; ``None`` where it has none, or the scene file states the material.
    """

    geometry: Mesh | AnalyticShape
    material: Material
    places: NDArray[np.float64] | None = None
    material_name: str | None = None


@dataclass(frozen=True)
class SyntheticObject:
    """A new object; a glTF file may give it several parts.

    Attributes:
        name: of it.
        parts: of it.
        visible_to_camera: whether cameras see it by themselves, and not only in mirrors and through glass.
    """

    name: str
    parts: tuple[SyntheticPart, ...]
    visible_to_camera: bool = True


@dataclass(frozen=True)
class Panorama:
    """The photograph.

    Attributes:
        radiance: linear Rec.709, shape (height, 2 height, 3), float32, finite and not negative, scale applied.
        position: capture point, shape (3,), float64, world, metres.
        rotation: light space to world, shape (3, 3), float64.
        depth: distances from the capture point in metres where the user gave them, shape (h, 2 h), float32, positive,
            inf for sky; else ``None``. Its size may differ from that of ``radiance``.
        sky: what no real mesh covers is declared sky: infinitely far on purpose. Else it is a hole, and an error. In
            ``depth``, inf declares it.
        path: the file it came from, for messages.
        unclipped: ``radiance`` with the true radiance of sources that were clipped, the same shape, for light; the plate is
            ``radiance`` in any case. ``None`` where they are the same.
        plate: a retouched version, the same shape, that is the picture where ``radiance`` is the light: what cameras see,
            and what the surfaces' albedo is recovered from. ``None`` where they are the same.
        mask: share to which each pixel counts, shape (height, 2 height), float32, in [0, 1]: 0 where someone walked, say.
            ``None`` counts all.
        balanced: whether its radiance is in the unit of the first photograph's; else the gain of each channel that makes
            it so is solved from what both see.
        repairs: what was wrong with its radiance and was replaced, a message for each kind.
        notes: what of its file makes pictures wrong in places, a sentence each.
    """

    radiance: NDArray[np.float32]
    position: NDArray[np.float64]
    rotation: NDArray[np.float64]
    depth: NDArray[np.float32] | None = None
    sky: bool = False
    path: Path | None = None
    unclipped: NDArray[np.float32] | None = None
    plate: NDArray[np.float32] | None = None
    mask: NDArray[np.float32] | None = None
    balanced: bool = True
    repairs: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def viewpoint(self) -> Viewpoint:
        """The camera whose pixels are those of the photograph."""
        camera = Equirectangular(type="equirectangular", width=self.radiance.shape[1])
        return Viewpoint(camera, self.position, self.rotation)

    @property
    def light_radiance(self) -> NDArray[np.float32]:
        """Radiance of the panorama as light: ``unclipped`` where there is one."""
        return self.radiance if self.unclipped is None else self.unclipped

    @property
    def shown_radiance(self) -> NDArray[np.float32]:
        """Radiance of the panorama as picture: ``plate`` where there is one."""
        return self.radiance if self.plate is None else self.plate


@dataclass(frozen=True, eq=False)
class Plate:
    """A photograph by an ordinary camera, which is the picture where the panoramas are the light.

    Attributes:
        radiance: linear Rec.709, shape (height, width, 3), float32, finite, with the distortion of its lens; what is
            negative is noise.
        camera: name of the perspective camera that took it, of its size.
        gain: of each channel, what the plate shows over what the panoramas show of the same surface; ``None`` is solved.
        path: the file it came from, for messages.
    """

    radiance: NDArray[np.float32]
    camera: str
    gain: tuple[float, float, float] | None = None
    path: Path | None = None


@dataclass(frozen=True)
class RenderSettings:
    """The ``[render]`` table.

    Attributes:
        samples: samples per pixel; with ``noise``, the largest number of them.
        noise: estimated relative error at which a pixel is done; ``None`` takes all samples everywhere.
        max_bounces: longest path, in scattering events.
        seed: seed of the random numbers.
        clamp_indirect: largest radiance that one indirect sample may bring; ``None`` (unbiased) clamps nothing.
        irradiance_samples: samples of each of two techniques at each point of support whose irradiance is recovered.
        draft: a quick look, without what takes longer to prepare than it takes to look.
        parameters: the tuned constants.
    """

    samples: int = 64
    noise: float | None = None
    max_bounces: int = 8
    seed: int = 0
    clamp_indirect: float | None = None
    irradiance_samples: int = 1024
    draft: bool = False
    parameters: Parameters = Parameters()  # noqa: RUF009 - it is immutable


CameraView = Viewpoint
"""The cameras of a scene."""


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything that a rendering needs.

    Attributes:
        panorama: the photograph, the first where there are several.
        real: what stands in it.
        synthetic: what is new.
        cameras: by name.
        render: settings.
        path: the scene file, where it comes from one.
        lights: those that the photographs lack.
        further: photographs of the same place from elsewhere.
        plate: the picture of one of the cameras, in place of what the panoramas show it.
    """

    panorama: Panorama
    real: tuple[RealSurface, ...] = ()
    synthetic: tuple[SyntheticObject, ...] = ()
    cameras: Mapping[str, CameraView] = field(default_factory=dict)
    render: RenderSettings = field(default_factory=RenderSettings)
    path: Path | None = None
    lights: tuple[Light, ...] = ()
    further: tuple[Panorama, ...] = ()
    plate: Plate | None = None

    @property
    def panoramas(self) -> tuple[Panorama, ...]:
        """All photographs, the first one first."""
        return (self.panorama, *self.further)

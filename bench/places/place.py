"""A virtual place: its surfaces and lights, where it is photographed from, and what is put into it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.places.objects import Color, Point, rgb
from bench.places.sun import Sun, sun_disc
from lightdepth.cameras import Equirectangular, Perspective
from lightdepth.directions import euler_rotation, look_at_rotation
from lightdepth.scene.model import (
    AnalyticShape,
    CameraView,
    Gloss,
    Mesh,
    Panorama,
    RealSurface,
    Role,
    Scene,
    SyntheticObject,
)


@dataclass(frozen=True)
class Finish:
    """What a real surface looks like that is not of one matte colour: Mitsuba's ``principled``.

    Attributes:
        albedo: along the mesh's texture coordinates, linear, shape (h, w, 3), float32.
        gloss: its specular lobe; ``None`` for none.
    """

    albedo: NDArray[np.float32]
    gloss: Gloss | None = None

    def mitsuba(self) -> dict[str, Any]:
        """The BSDF as Mitsuba's dictionary; Mitsuba must have been started."""
        import mitsuba as mi

        texture = {"type": "bitmap", "bitmap": mi.Bitmap(self.albedo), "raw": True, "filter_type": "nearest"}
        if self.gloss is None:
            return {"type": "diffuse", "reflectance": texture}
        # From outside alone: a two-sided one would also be seen from below.
        specular = {"roughness": self.gloss.roughness, "specular": self.gloss.specular}
        return {"type": "principled", "base_color": texture, **specular}


@dataclass(frozen=True)
class Part:
    """A real surface: Lambertian, or a lamp.

    Attributes:
        name: unique in its place.
        mesh: world, metres.
        color: albedo per channel; black for lamps.
        radiance: what it emits per channel; ``None`` for all but lamps.
        role: what the user declares it.
        opening: a window pane that sends its own radiance and lets the sun in.
        finish: texture and gloss, in place of ``color``.
    """

    name: str
    mesh: Mesh
    color: Color = (0.0, 0.0, 0.0)
    radiance: Color | None = None
    role: Role = Role.SUPPORT
    opening: bool = False
    finish: Finish | None = None


@dataclass(frozen=True)
class Place:
    """A place to photograph, to put objects into, and to path-trace with and without them.

    Attributes:
        name: identifies it in results.
        parts: the real surfaces as they are.
        objects: what is inserted.
        position: capture point, world, metres.
        rotation: light space to world, XYZ Euler, degrees.
        view: a camera about one metre away from the capture point.
        sky: what lies outside, as entries of a Mitsuba scene dictionary; seen at infinity.
        outside_sun: shines in through the openings, where the capture point does not see it.
        modelled: the surfaces as the user modelled them, where these are wrong on purpose; else ``None``.
        capture_error: what the user's capture point is off by, metres.
    """

    name: str
    parts: tuple[Part, ...]
    objects: tuple[SyntheticObject, ...]
    position: Point
    rotation: Point
    view: Perspective
    sky: Sky | None = None
    outside_sun: Sun | None = None
    modelled: tuple[Part, ...] | None = None
    capture_error: Point = (0.0, 0.0, 0.0)

    def mitsuba_scene(self, objects: bool) -> dict[str, Any]:
        """The place for stock Mitsuba, for ``mi.load_dict(..., optimize=False)``; Mitsuba must have been started.

        Args:
            objects: with the synthetic objects, whose keys then start with ``synthetic``, or without.
        """
        from lightdepth.kernel.shapes import mesh_shape

        entries: dict[str, Any] = {"type": "scene"}
        for index, part in enumerate(self.parts):
            bsdf = {"type": "diffuse", "reflectance": rgb(part.color)} if part.finish is None else part.finish.mitsuba()
            plugins: dict[str, Any] = {"bsdf": bsdf}
            if part.radiance is not None:
                plugins["emitter"] = {"type": "area", "radiance": rgb(part.radiance)}
            entries[f"real_{index}"] = mesh_shape(part.mesh, **loaded(plugins))
        if self.sky is not None:
            entries |= self.sky.mitsuba()
        if self.outside_sun is not None:
            entries |= self.outside_sun.mitsuba()
        if objects:
            entries |= mitsuba_objects(self.objects)
        return entries

    def camera(self, name: str, width: int) -> CameraView:
        """The camera ``panorama`` (at the capture point) or ``view``, scaled to a width in pixels; posed in world."""
        if name == "panorama":
            panorama = Equirectangular(type="equirectangular", width=width)
            return CameraView(panorama, np.asarray(self.position), euler_rotation(self.rotation))
        position = np.asarray(self.view.position)
        size = {"width": width, "height": width * self.view.height // self.view.width}
        rotation = look_at_rotation(position, self.view.look_at)
        return CameraView(self.view.model_copy(update=size), position, rotation)

    def scene(self, panorama_width: int, panorama_samples: int = 512, view_width: int | None = None) -> Scene:
        """What a user of lightdepth would have of the place: its photograph, its meshes, its sun, the objects.

        Args:
            panorama_width: pixels of the photograph, and of the camera ``panorama``.
            panorama_samples: camera rays a pixel of the photograph, which is path-traced.
            view_width: pixels of the camera ``view``; its own width by default.
        """
        from bench.truth import photograph

        real = self.parts if self.modelled is None else self.modelled
        return Scene(
            panorama=Panorama(
                radiance=photograph(self, panorama_width, panorama_samples).mean.astype(np.float32),
                position=np.asarray(self.position) + np.asarray(self.capture_error),
                rotation=euler_rotation(self.rotation),
                sky=self.sky is not None,
            ),
            real=tuple(RealSurface(part.name, part.mesh, part.role, opening=part.opening) for part in real),
            synthetic=self.objects,
            cameras={
                "panorama": self.camera("panorama", panorama_width),
                "view": self.camera("view", view_width or self.view.width),
            },
            lights=() if self.outside_sun is None else (self.outside_sun.declared(),),
        )

    def sun(self) -> Sun:
        """The sun that the capture point does not see: what a recovery of it must find.

        Raises:
            ValueError: there is none.
        """
        if self.outside_sun is None:
            raise ValueError(f"{self.name} has no sun outside")
        return self.outside_sun

    def lights_apart(self) -> tuple[Place, ...]:
        """Places whose light adds up to this one's: one with all that the place itself sends, one with the sun alone.

        A pane both glows and lets the sun through, which no one surface of Mitsuba's ``path`` does. As it reflects
        nothing, it is a lamp in the first place and a hole in the second, and the sum is exact.
        """
        if self.outside_sun is None:
            return (self,)
        dark = tuple(replace(part, radiance=None) for part in self.parts if not part.opening)
        return replace(self, outside_sun=None), replace(self, parts=dark)

    def with_support(self, names: tuple[str, ...]) -> Place:
        """The place with only these parts as support."""

        def declared(part: Part) -> Part:
            return replace(part, role=Role.SUPPORT if part.name in names else Role.ENVIRONMENT)

        return replace(self, parts=tuple(map(declared, self.parts)))

    def empty(self) -> Place:
        """The place without objects."""
        return replace(self, objects=())


@dataclass(frozen=True)
class Sky:
    """A sky that brightens toward the horizon, ground below it, and a sun.

    Attributes:
        zenith: radiance straight up.
        horizon: radiance at the horizon.
        ground: radiance below the horizon.
        sun_direction: toward the sun, world.
        sun_radiance: of the sun's disk.
        sun_diameter: degrees.
        sun_distance: metres; from a few thousand, its light would differ by two thousandths from one end of a court to the
            other.
    """

    zenith: Color
    horizon: Color
    ground: Color
    sun_direction: Point
    sun_radiance: Color
    sun_diameter: float
    sun_distance: float = 1e5

    def mitsuba(self) -> dict[str, Any]:
        """The sky as an environment map and the sun as a far, glowing disk."""
        import mitsuba as mi

        height = 256
        elevation = np.cos(np.pi * np.arange(height) / (height - 1))
        share = np.clip(elevation, 0.0, 1.0)[:, None] ** 0.5
        rows = share * np.asarray(self.zenith) + (1.0 - share) * np.asarray(self.horizon)
        rows = np.where(elevation[:, None] < 0.0, np.asarray(self.ground), rows)
        image = np.repeat(rows[:, None, :], 2 * height, axis=1).astype(np.float32)
        return {
            "sky": {
                "type": "envmap",
                "bitmap": mi.Bitmap(image),
                "to_world": mi.ScalarTransform4f().rotate([1.0, 0.0, 0.0], 90.0),
            },
            **sun_disc(self.sun_direction, self.sun_radiance, self.sun_diameter, self.sun_distance),
        }


def mitsuba_objects(objects: tuple[SyntheticObject, ...]) -> dict[str, Any]:
    """Synthetic objects as entries of a Mitsuba scene dictionary, with keys ``synthetic_0``, ``synthetic_1``, ..."""
    import mitsuba as mi

    from lightdepth.kernel.shapes import mesh_shape

    entries: dict[str, Any] = {}
    for part in (part for item in objects for part in item.parts):
        name = f"synthetic_{len(entries)}"
        plugins = part.material.plugins()
        if isinstance(part.geometry, AnalyticShape):
            to_world = mi.ScalarTransform4f(part.geometry.to_world)
            entries[name] = {"type": part.geometry.kind, "to_world": to_world, **plugins}
        else:
            entries[name] = mesh_shape(part.geometry, **loaded(plugins))
            entries[name].set_id(name)
    return entries


def loaded(plugins: dict[str, Any]) -> dict[str, Any]:
    """Plugin dictionaries as Mitsuba objects, under the same keys."""
    import mitsuba as mi

    return {key: mi.load_dict(plugin) for key, plugin in plugins.items()}

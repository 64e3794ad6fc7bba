"""The scene as Blender renders it, written as a scene file and its meshes: for F12 and for the command line alike."""

import io
import itertools
import math
import os
import shlex
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any

import bpy
import numpy as np
from bpy_extras.io_utils import ExportHelper
from mathutils import Matrix

from . import (
    cameras,
    clippedlamps,
    gltf,
    graph,
    images,
    lights,
    materials,
    meshes,
    panorama,
    photographs,
    roles,
    suns,
    toml,
)
from .evaluation import EvaluationError, unexpected, with_render_depsgraph
from .groups import File, Group, Look, Source, Together, flat, have_area, placements
from .meshfolder import Made, MeshFolder, digest_of
from .motion import ANIMATION, Instance, Motion, SetFrame, gathered, instances, observed, shutter_of
from .picking import capture_pose
from .properties import show_lines

WITH_SURFACE = {"MESH", "CURVE", "SURFACE", "FONT", "META"}
"""Objects with surfaces. Blender's dependency graph gives those of curves, texts and balls once more as meshes."""
WITHOUT_LOOK = {"EMPTY", "CAMERA", "ARMATURE", "LATTICE", "SPEAKER", "LIGHT_PROBE"}
FAR = 100.0
"""Metres: the scene file's origin is the multiple of this that is nearest to the capture point, as single precision
gets coarse far from the origin."""
INSTANCED_FROM = 32
"""Instances of one object by one instancer, from which on they are one object with one number."""
_RAYS = {
    "visible_camera": "camera",
    "visible_diffuse": "diffuse",
    "visible_glossy": "glossy",
    "visible_transmission": "transmission",
    "visible_shadow": "shadow",
}


class ExportError(Exception):
    """Something without which there is no scene to render."""


@dataclass(frozen=True)
class Carried:
    """A synthetic object of the scene file.

    Attributes:
        name: in the scene file.
        source: what it is in Blender.
        materials: names of its parts' materials, in their order; empty for a part that has none.
    """

    name: str
    source: Source
    materials: tuple[str, ...] = ()

    def matte_names(self) -> dict[str, str]:
        """The materials' names by those that the renderer's mattes have, which go by the object."""
        return {f"{self.name}.{name}": name for name in self.materials if name}


@dataclass
class Exported:
    """A scene that was written.

    Attributes:
        path: the scene file.
        camera: name of the active camera in it, or ``None`` where there is none.
        notes: what is not supported, one sentence each.
        objects: the file's synthetic objects, in its order.
        frame: number of the frame with motion blur; ``None`` where there is none.
        document: the file's tables.
        origin: of the file in Blender's world, shape (3,).
    """

    path: Path
    camera: str | None
    notes: list[str]
    objects: list[Carried]
    frame: int | None
    document: dict[str, Any]
    origin: np.ndarray

    def text(self) -> str:
        """The scene file's text."""
        head = ""
        if self.origin.any():
            head = "# Its origin is at {:g}, {:g}, {:g} of Blender's world.\n".format(*self.origin)
        return head + toml.dumps(self.document)

    def seen(self, table: dict[str, Any]) -> str:
        """Its text with a single camera, ``view``.

        Args:
            table: of the camera, in Blender's world.
        """
        table = table | {"position": [float(a - b) for a, b in zip(table["position"], self.origin, strict=True)]}
        views = {name: kept for name, kept in self.document["camera"].items() if self.is_plates(name)} | {"view": table}
        return replace(self, document=self.document | {"camera": views}).text()

    def is_plates(self, camera: str) -> bool:
        """Whether a camera has the plate."""
        return self.document.get("plate", {}).get("camera") == camera


@dataclass
class _Writer:
    """The tables of the file while the objects are gone through."""

    depsgraph: bpy.types.Depsgraph
    folder: Path
    files: MeshFolder
    origin: np.ndarray
    motion: Motion | None = None
    real: list[dict[str, Any]] = field(default_factory=list)
    synthetic: list[dict[str, Any]] = field(default_factory=list)
    objects: list[Carried] = field(default_factory=list)
    notes: dict[str, None] = field(default_factory=dict)
    names: set[str] = field(default_factory=set)
    looks: dict[tuple, Look | None] = field(default_factory=dict)
    groups: dict[Any, Group] = field(default_factory=dict)
    surfaces: dict[int, materials.Surface] = field(default_factory=dict)
    written: dict[tuple, File] = field(default_factory=dict)
    bounds: list[np.ndarray] = field(default_factory=list)
    seen: set[int] = field(default_factory=set)
    counts: defaultdict[str, int] = field(default_factory=lambda: defaultdict(int))

    @cached_property
    def real_lights(self) -> "_RealLights":
        """Those that are marked real."""
        return _RealLights(self.folder, self.origin, self.depsgraph.scene_eval.lightdepth)

    @cached_property
    def in_layer(self) -> set[str]:
        """Names of the view layer's objects, which Blender would search one by one for each."""
        return {item.name for item in self.depsgraph.view_layer.objects}

    def note(self, *sentences: str) -> None:
        self.notes |= dict.fromkeys(sentences)

    def unique(self, name: str) -> str:
        """A name that no other table has."""
        candidate = name
        while candidate in self.names:
            self.counts[name] += 1
            candidate = f"{name} {self.counts[name]}"
        self.names.add(candidate)
        return candidate

    def relative(self, path: Path) -> str:
        return Path(os.path.relpath(path, self.folder)).as_posix()

    def local(self, to_world: Matrix) -> Matrix:
        """A matrix relative to the scene file's origin."""
        return Matrix.Translation(-self.origin) @ to_world

    def stands_apart(self, item) -> bool:
        """Whether each instance of an object is looked at by itself."""
        return self.motion is not None or item.type != "MESH" or item.lightdepth.role in roles.REAL

    def add(
        self, item, to_world: np.ndarray, by_instancing: bool, instance: Instance, together: Together | None
    ) -> None:
        """Add what an evaluated object, an instance of one, or instances together are to the renderer.

        Args:
            item: the object.
            to_world: its matrix, or that of the first instance, shape (4, 4); it may be changed.
            by_instancing: whether another object makes it.
            instance: which it is.
            together: the instances that are alike, where they do not stand apart.
        """
        if item.type == "LIGHT":
            self._note_light_linking(item)
            if item.lightdepth.real_light:
                self.real_lights.add(item, to_world)
            else:
                self._add_lamp(item, self.local(Matrix(to_world.tolist())))
        elif item.type == "MESH":
            if item.as_pointer() not in self.seen:
                self.seen.add(item.as_pointer())
                self._note_light_linking(item)
                self._note_settings(item)
            if item.lightdepth.role in roles.REAL:
                self._add_real(item, Matrix(to_world.tolist()))
            else:
                self._add_synthetic(item, to_world, by_instancing, instance, together)
        elif item.type not in WITHOUT_LOOK | WITH_SURFACE and not by_instancing:
            self.note(f"Object '{item.name}': {item.type.replace('_', ' ').lower()} objects are not supported")

    def _add_lamp(self, item, to_world: Matrix) -> None:
        name = self.unique(item.name)
        tables, said = lights.emitters(name, item.data, to_world)
        for table in tables[1:]:
            self.names.add(table["name"])
        if not item.visible_camera:
            tables = [table | {"visible_to_camera": False} for table in tables]
        self._append_tables(tables, _source(item))
        self.note(*said)

    def _append_tables(self, tables: list[dict[str, Any]], source: Source, worn: tuple[str, ...] = ()) -> None:
        self.synthetic += tables
        self.objects += [Carried(table["name"], source, worn) for table in tables]

    def _note_light_linking(self, item) -> None:
        linking = getattr(item, "light_linking", None)
        if linking is not None and (linking.receiver_collection or linking.blocker_collection):
            self.note(f"Object '{item.name}': its light and shadow linking are not supported")

    def _note_settings(self, item) -> None:
        if any(
            system.settings.type == "HAIR" and system.settings.render_type == "PATH" for system in item.particle_systems
        ):
            self.note(f"Object '{item.name}': its hair is not supported")
        if item.lightdepth.role in roles.REAL:
            return
        unseen = [what for name, what in _RAYS.items() if not getattr(item, name)]
        if unseen:
            self.note(f"Object '{item.name}': its ray visibility is not supported; {', '.join(unseen)} rays meet it")
        if item.is_shadow_catcher:
            self.note(f"Object '{item.name}': is not a shadow catcher here; give real surfaces the role support")
        original, layer = item.original, self.depsgraph.view_layer
        if original.name in self.in_layer:
            if original.holdout_get(view_layer=layer):
                self.note(f"Object '{item.name}': holdout is not supported; it is rendered as it looks")
            if original.indirect_only_get(view_layer=layer):
                self.note(f"Object '{item.name}': indirect only is not supported; the camera sees it")

    def _add_real(self, item, to_world) -> None:
        mesh = item.to_mesh()
        try:
            if mesh is None or not mesh.polygons:
                return
            name = self.unique(item.name)
            data, bounds = meshes.real_data(mesh, to_world, self.origin)
            path = self.files.path / self.files.write(name, ".ply", data)
            self.bounds.append(bounds)
        finally:
            item.to_mesh_clear()
        settings = item.lightdepth
        table = {"name": name, "mesh": self.relative(path), "role": settings.role.lower()}
        opening = settings.opening and settings.role == roles.ENVIRONMENT
        if opening:
            table["opening"] = True
        if settings.removed:
            table["removed"] = True
        if settings.use_gloss and settings.role in roles.REAL and not opening:
            table["gloss"] = {"roughness": settings.roughness, "specular": settings.specular}
        self.real.append(table)

    def _add_synthetic(self, item, to_world, by_instancing: bool, instance: Instance, together) -> None:
        override = self.depsgraph.view_layer_eval.material_override
        worn = [override or slot.material for slot in item.material_slots]
        # Evaluated data is shared by what looks the same: linked duplicates and instances.
        key = (item.data.as_pointer(), tuple(0 if material is None else material.as_pointer() for material in worn))
        if key not in self.looks:
            self.looks[key] = self._look(item, worn, override, instance)
        if self.looks[key] is None:  # it has no faces
            return
        # What an instancer makes is gathered; objects stay by themselves.
        place = (key, *instance[:2]) if by_instancing and together is None else len(self.groups)
        if place not in self.groups:
            self.groups[place] = Group(_source(item), key, by_instancing, together=together, origin=self.origin)
        group = self.groups[place]
        if together is None:
            to_world[:3, 3] -= self.origin
            group.singles.append(to_world)
            if self.motion is not None:
                group.ways.append(self.motion.ways(instance, to_world, item))

    def _look(self, item, worn, override, instance: Instance) -> Look | None:
        mesh = item.to_mesh()
        try:
            triangles = None if mesh is None else meshes.triangles_of(mesh)
            if triangles is None:
                return None
            worn = worn or [override or material for material in mesh.materials] or [override]
        finally:
            item.to_mesh_clear()
        names = ["" if material is None else material.name for material in worn]
        look = Look(item.name, triangles, names, [self._surface(material) for material in worn])
        if self.motion is not None:
            look.shapes, alike = self.motion.deformed(instance, triangles)
            if not alike:
                self.note(
                    f"Object '{item.name}': its mesh changes faces while the shutter is open; only its motion is blurred"
                )
        return look

    def _surface(self, material) -> materials.Surface:
        pointer = 0 if material is None else material.as_pointer()
        if pointer not in self.surfaces:
            evaluated = material
            if material is not None and not material.is_evaluated:
                evaluated = material.evaluated_get(self.depsgraph)
            self.surfaces[pointer], said = materials.surface_of(evaluated)
            self.note(*said)
        return self.surfaces[pointer]

    def write_synthetic(self, closed: bool) -> None:
        """Write the meshes of the new objects, each content once, and their tables.

        Args:
            closed: whether what stands beyond all real surfaces is outside the place, and not under the open sky.
        """
        groups = [g for g in self.groups.values() if any(each.visible for each in self.looks[g.key].surfaces)]
        if not groups:
            return
        places = [group.places() for group in groups]
        ends = np.cumsum([len(some) for some in places])
        bounds = self._bounds(groups, places)
        low, high = np.min([b[0] for b in self.bounds], axis=0), np.max([b[1] for b in self.bounds], axis=0)
        outside = closed & ((bounds[:, 1] < low) | (bounds[:, 0] > high)).any(axis=1)
        nearest = self._nearest(bounds)
        # What nothing is to be noted of is passed by without a look.
        firsts = ends - [len(some) for some in places]
        noted = np.logical_or.reduceat(outside | (nearest < self._clipping[1]) | (nearest > self._clipping[2]), firsts)
        single = [
            group.together is None or len(some) < INSTANCED_FROM for group, some in zip(groups, places, strict=True)
        ]
        apart = [some for some, one in zip(places, single, strict=True) if one]
        stand = iter(placements(np.concatenate(apart)) if apart else [])
        for group, some, first, is_noted, one in zip(
            groups, places, firsts.tolist(), noted.tolist(), single, strict=True
        ):
            placed = list(itertools.islice(stand, len(some))) if one else []
            if is_noted:
                here = slice(first, first + len(some))
                inside = ~outside[here]
                self._note_outside(group, outside[here])
                self._note_clipping(group, some[inside], nearest[here][inside])
                some = some[inside]
                placed = list(itertools.compress(placed, inside))
                group.ways = list(itertools.compress(group.ways, inside))
            if len(some):
                self._write_group(group, some, placed)

    def _bounds(self, groups: list[Group], places: list[np.ndarray]) -> np.ndarray:
        """Bounds of all places of all groups, shape (k, 2, 3); those of one mesh are computed at once."""
        alike: dict[tuple, list[int]] = defaultdict(list)
        for number, group in enumerate(groups):
            alike[group.key].append(number)
        found: list[Any] = [None] * len(groups)
        for key, numbers in alike.items():
            together, first = self.looks[key].bounds(np.concatenate([places[number] for number in numbers])), 0
            for number in numbers:
                found[number] = together[first : first + len(places[number])]
                first += len(places[number])
        return np.concatenate(found)

    @cached_property
    def _clipping(self) -> tuple[np.ndarray, float, float, str]:
        """Where the camera is, its clipping distances and its name."""
        camera = self.depsgraph.scene_eval.camera
        if camera is None or camera.type != "CAMERA":
            return np.zeros(3), 0.0, math.inf, ""
        camera = camera.evaluated_get(self.depsgraph)
        eye = np.array(camera.matrix_world.translation) - self.origin
        return eye, camera.data.clip_start, camera.data.clip_end, camera.name

    def _nearest(self, bounds: np.ndarray) -> np.ndarray:
        """Distances from the camera to bounds, shape (k,)."""
        eye = self._clipping[0]
        beside = np.maximum(np.maximum(bounds[:, 0] - eye, eye - bounds[:, 1]), 0.0)
        return np.sqrt((beside**2).sum(axis=1))

    def _note_outside(self, group: Group, outside: np.ndarray) -> None:
        if outside.any():
            count = f"{outside.sum()} of its instances are" if outside.sum() < len(outside) else "is"
            self.note(f"Object '{group.source.name}': {count} outside the place are left out")

    def _note_clipping(self, group: Group, places: np.ndarray, nearest: np.ndarray) -> None:
        """Cameras of Blender see nothing nearer or farther than their clipping says."""
        eye, start, end, camera = self._clipping
        triangles = self.looks[group.key].triangles
        for place in places[nearest < start]:
            points = triangles.positions @ place[:3, :3].T + place[:3, 3] - eye
            if (np.linalg.norm(points, axis=1) < start).any():
                self.note(f"Camera '{camera}': its clip start does not cut object '{group.source.name}'")
                break
        if (nearest > end).any():
            self.note(f"Camera '{camera}': its clip end does not cut object '{group.source.name}'")

    def _write_group(self, group: Group, places: np.ndarray, placed: list[dict[str, Any] | None]) -> None:
        """Write what stands at places; as position, rotation and scale where these are given and stand still."""
        look = self.looks[group.key]
        if group.instanced and len(places) >= INSTANCED_FROM and group.ways:
            self._append(group, self._write(look, places, group.ways))
            return
        if not placed:
            self._write_instances(group, look, places)
            return
        for place, way, placement in zip(places, group.ways or [None] * len(places), placed, strict=True):
            stands = placement if way is None else self.motion.placement(way)
            if stands is None:
                self._append(group, self._write(look, place[None], [way]))
                continue
            self._append(group, self._shared(group, look), stands)

    def _write_instances(self, group: Group, look: Look, places: np.ndarray) -> None:
        lying = flat(places)
        if lying.any():  # by itself: it has an area, but no volume
            remaining = places[lying][have_area(places[lying])]
            if len(remaining):
                self._append(group, self._write(look, remaining))
        if not lying.all():
            stream = io.BytesIO()
            np.save(stream, places[~lying, :3].astype("<f4"))
            path = self.files.path / self.files.write(f"{look.name} places", ".npy", stream.getvalue())
            self._append(group, self._shared(group, look), {"instances": self.relative(path)})

    def _shared(self, group: Group, look: Look) -> File:
        """The file of a mesh as it is, written once."""
        if group.key not in self.written:
            self.written[group.key] = self._write(look)
        return self.written[group.key]

    def _append(self, group: Group, file: File, placement: Mapping[str, Any] = MappingProxyType({})) -> None:
        if file.table:
            table = {"name": self.unique(group.source.name), **file.table, **placement}
            self._append_tables([table], group.source, file.materials)

    def _write(
        self,
        look: Look,
        places: np.ndarray | None = None,
        ways: list[list[np.ndarray] | None] | None = None,
    ) -> File:
        """Write a mesh file, or find the one with the same content.

        Args:
            look: the mesh.
            places: where it stands, shape (k, 4, 4); ``None`` for as it is.
            ways: of each place while the shutter is open, or ``None``.
        """
        moves = ways is not None and any(way is not None for way in ways)
        key = look.digest
        if places is not None:
            key = digest_of(look.digest, places, ways if moves else None)
        made = self.files.found(key)
        if made is None:
            triangles = look.triangles if places is None else meshes.repeated(look.triangles, places)
            made = self._made(look, triangles, self._at_times(look, places, ways) if moves or look.shapes else [])
            self.files.keep(key, made)
        self.note(*made.notes)
        if not made.files:
            return File({}, ())
        table = {"mesh": self.relative(self.files.path / made.files[0])}
        return File(table | ({"animation": ANIMATION} if moves or look.shapes else {}), made.materials)

    def _at_times(
        self, look: Look, places: np.ndarray | None, ways: list[list[np.ndarray] | None] | None
    ) -> list[meshes.Triangles]:
        """The mesh at the shutter's times; arguments as for ``_write``."""
        count = len(self.motion.shutter.times)
        shapes = look.shapes or [look.triangles] * count
        if places is None:
            return shapes
        ways = [[place] * count if way is None else way for place, way in zip(places, ways, strict=True)]
        return [
            meshes.repeated(shape, np.array(then)) for shape, then in zip(shapes, zip(*ways, strict=True), strict=True)
        ]

    def _made(self, look: Look, triangles: meshes.Triangles, at_times: list[meshes.Triangles]) -> Made:
        folder = images.ImageFolder(self.files)
        writer = gltf.Writer(folder, self.motion.shutter.seconds if at_times else ())
        slots = np.clip(triangles.slots, 0, len(look.surfaces) - 1)
        for slot, (surface, name) in enumerate(zip(look.surfaces, look.slots, strict=True)):
            writer.add(triangles, np.nonzero(slots == slot)[0], surface, name, at_times)
        if writer.is_empty:
            return Made((), tuple(writer.notes))
        file = self.files.write(look.name, ".glb", writer.data())
        return Made((file, *folder.names), tuple(writer.notes), tuple(writer.materials))


def _source(item) -> Source:
    outermost = item
    while outermost.parent is not None:
        outermost = outermost.parent
    return Source(item.name, outermost.name, item.pass_index)


def require_panorama(scene) -> None:
    """Refuse a scene without a photograph.

    Raises:
        ExportError: there is no panorama, or it has no capture point.
    """
    if scene.lightdepth.image is None:
        raise ExportError("There is no panorama: load one in the sidebar of the 3D viewport, tab lightdepth")
    if not panorama.has_capture_point(scene):
        raise ExportError(
            "The panorama has no capture point, or it was deleted: choose an empty in the sidebar of the 3D viewport, "
            "tab lightdepth, or load the panorama again"
        )


EyeOf = Callable[[Any], cameras.Eye]
"""One of the views of a camera, as it is evaluated."""


def _camera_tables(
    depsgraph,
    origin: np.ndarray,
    every_camera: bool,
    eye_of: EyeOf | None,
    posed: bool = False,
    with_active: bool = True,
) -> tuple[dict[str, dict[str, Any]], list[str]]:
    """All cameras that are supported, or the active one, which must be, and the one with the plate; and notes."""
    tables, notes = {}, []
    scene = depsgraph.scene_eval
    plates = photographs.plate_camera(scene)
    for item in scene.objects:
        active = with_active and scene.camera is not None and item.name == scene.camera.name
        has_plate = plates is not None and item.name == plates.name
        if item.type != "CAMERA" or not (every_camera or active or has_plate):
            continue
        evaluated = item.evaluated_get(depsgraph)
        eye = eye_of(evaluated) if active and eye_of is not None else None
        try:
            table, said = cameras.camera_table(evaluated, scene, eye, posed)
            if "position" in table:
                table["position"] = [float(a - b) for a, b in zip(table["position"], origin, strict=True)]
            tables[item.name] = table
        except cameras.CameraError as error:
            if active:
                raise ExportError(str(error)) from error
            said = [f"{error} (this camera is left out)"]
        notes += said
    return tables, notes


def _render_table(settings) -> dict[str, Any]:
    table = {"samples": settings.samples, "max_bounces": settings.max_bounces, "seed": settings.seed}
    return table | ({"noise": settings.noise} if settings.use_noise else {})


def scene_lights(depsgraph, folder: Path, origin: np.ndarray) -> tuple[list[dict[str, Any]], list[str]]:
    """The ``[[light]]`` tables of a scene: suns and lamps that are marked real.

    Args:
        depsgraph: the evaluated scene.
        folder: of the scene file.
        origin: of the scene file in Blender's world, shape (3,).

    Returns:
        The tables, and notes on what is not supported.
    """
    found = _RealLights(folder, origin, depsgraph.scene_eval.lightdepth)
    for item, to_world, _, _ in instances(depsgraph, numbered=False):
        if item.type == "LIGHT" and item.lightdepth.real_light:
            found.add(item, to_world)
    return found.tables, found.notes


@dataclass
class _RealLights:
    """Tables of suns and lamps that are marked real.

    Attributes:
        folder: of the scene file.
        origin: of the scene file in Blender's world, shape (3,).
        settings: of the scene.
        tables: one for each light.
        notes: what of them is not supported.
    """

    folder: Path
    origin: np.ndarray
    settings: Any
    tables: list[dict[str, Any]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def add(self, item, to_world: np.ndarray) -> None:
        """Add an evaluated lamp with its matrix."""
        names = {table["name"] for table in self.tables}
        name = next(name for name in _numbered(item.name) if name not in names)
        matrix = Matrix(to_world.tolist())
        if item.data.type == "SUN":
            table, said = suns.sun_table(name, item, matrix, self.folder, self.origin)
        elif item.data.type == "POINT":
            table, said = clippedlamps.clipped_table(name, item, matrix, self.settings)
        else:
            table, said = None, [f"Light '{name}': only suns and point lamps can be marked real, and it is left out"]
        self.notes += said
        if table is not None:
            self.tables.append(table)


def _numbered(name: str) -> Iterator[str]:
    yield name
    yield from (f"{name} {index}" for index in itertools.count(1))


def _origin(scene) -> np.ndarray:
    """The scene file's origin in Blender's world, shape (3,): near the capture point, and zero if that is near."""
    return np.round(np.array(capture_pose(scene.lightdepth).translation) / FAR) * FAR + 0.0


def export_scene(
    depsgraph: bpy.types.Depsgraph,
    path: Path,
    folder: MeshFolder | None = None,
    every_camera: bool = True,
    eye_of: EyeOf | None = None,
    set_frame: SetFrame | None = None,
    with_cameras: bool = True,
) -> Exported:
    """Write the scene of a depsgraph. Nothing of Blender's data is changed.

    Args:
        depsgraph: the evaluated scene.
        path: the scene file to write.
        folder: where meshes and images go; by default beside the scene file.
        every_camera: write all supported cameras, not the active one alone.
        eye_of: of the active camera, where it is one of several.
        set_frame: evaluates the scene at another time, for motion blur; ``None`` writes it as it stands.
        with_cameras: write cameras other than that of the plate.

    Raises:
        ExportError: there is no panorama, no real surface, or the active camera is not supported.
        OSError: a file cannot be written.
    """
    scene = depsgraph.scene_eval
    require_panorama(scene)
    folder = folder or MeshFolder(path.with_name(f"{path.stem}_meshes"))
    folder.begin()
    origin = _origin(scene)
    moves, said = _motion(depsgraph, origin, every_camera, eye_of, set_frame)
    scene = depsgraph.scene_eval
    writer = _Writer(depsgraph, path.parent, folder, origin, moves)
    writer.note(*said)
    try:
        document: dict[str, Any] = {
            "panorama": photographs.panorama_tables(scene, writer.relative, folder, writer.local)
        }
        plate, said = photographs.plate_table(scene, writer.relative, folder)
    except photographs.PhotographError as error:
        raise ExportError(str(error)) from error
    writer.note(*said)
    if moves is not None:
        document["sequence"] = moves.shutter.table()
    try:
        for found in gathered(depsgraph, writer.stands_apart, numbered=moves is not None):
            writer.add(*found)
        if not writer.real:
            raise ExportError(
                "No real surface is modelled: add a room or a floor, and give it the role support or environment"
            )
        writer.write_synthetic(closed=not scene.lightdepth.sky)
    finally:
        graph.forget_pictures()
    tables, said = _camera_tables(depsgraph, origin, every_camera and with_cameras, eye_of, with_active=with_cameras)
    writer.note(*said)
    if moves is not None:
        tables = {name: moves.with_keys(name, table) for name, table in tables.items()}
    writer.note(*writer.real_lights.notes)
    document |= {
        "light": writer.real_lights.tables,
        "real": writer.real,
        "synthetic": writer.synthetic,
        "camera": tables,
    }
    if (
        plate is not None and plate["camera"] in tables and eye_of is None
    ):  # the eyes of stereo stand beside the plate's
        document["plate"] = plate
    document["render"] = _render_table(scene.lightdepth)
    active = scene.camera.name if scene.camera is not None and scene.camera.name in tables else None
    frame = None if moves is None else moves.shutter.frame
    exported = Exported(path, active, list(writer.notes), writer.objects, frame, document, origin)
    temporary = path.with_name(f".{path.name}.part")
    temporary.write_text(exported.text(), encoding="utf-8")
    os.replace(temporary, path)
    return exported


def _motion(
    depsgraph, origin: np.ndarray, every_camera: bool, eye_of: EyeOf | None, set_frame: SetFrame | None
) -> tuple[Motion | None, list[str]]:
    """What moves while the shutter is open, ``None`` where there is no motion blur; and notes."""
    scene = depsgraph.scene_eval
    if set_frame is None or scene.lightdepth.draft:  # a single sample a pixel is of one time
        return None, []
    shutter, notes = shutter_of(scene)
    if shutter is None:
        return None, notes

    def tables() -> dict[str, dict[str, Any]]:
        return _camera_tables(depsgraph, origin, every_camera, eye_of, posed=True)[0]

    return observed(depsgraph, set_frame, shutter, origin, tables), notes


def options(settings) -> dict[str, Any]:
    """What a request to render says beside the scene file, which has no place for it."""
    return {"method": settings.method.lower(), "draft": settings.draft, "denoise": settings.denoise}


def _as_arguments(settings) -> list[str]:
    """The same for the command ``lightdepth render``."""
    asked = options(settings)
    return ["--method", asked.pop("method"), *(f"--{name}" for name, on in asked.items() if on)]


class ExportScene(bpy.types.Operator, ExportHelper):
    """Write a scene file that the command line renders to the same pixels"""

    bl_idname = "lightdepth.export_scene"
    bl_label = "Export Scene"

    filename_ext = ".toml"
    filter_glob: bpy.props.StringProperty(default="*.toml", options={"HIDDEN"})

    def execute(self, context):
        """Export, say what is not supported, and tell the command."""
        settings = context.scene.lightdepth
        path = Path(bpy.path.abspath(self.filepath))
        try:
            require_panorama(context.scene)
            exported = with_render_depsgraph(
                context, lambda depsgraph, set_frame: export_scene(depsgraph, path, set_frame=set_frame)
            )
        except (ExportError, EvaluationError, OSError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        except Exception as error:
            self.report({"ERROR"}, unexpected(error))
            return {"CANCELLED"}
        show_lines(settings.export_notes, exported.notes)
        for note in exported.notes:
            self.report({"WARNING"}, note)
        camera = ["--camera", exported.camera] if exported.camera else []
        output = (
            ["-o", "OUT.exr"] if exported.frame is None else ["--frames", str(exported.frame), "-o", "OUT.####.exr"]
        )
        command = shlex.join(["lightdepth", "render", str(path), *camera, *_as_arguments(settings), *output])
        self.report({"INFO"}, f"Written. Render it with: {command}")
        return {"FINISHED"}


classes = (ExportScene,)

"""The scene as Blender renders it, written as a scene file and its meshes: for F12 and for the command line alike."""

import itertools
import math
import os
import shlex
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from bpy_extras.io_utils import ExportHelper
from mathutils import Matrix

from . import cameras, gltf, graph, images, lights, materials, meshes, panorama, roles, suns, toml
from .evaluation import EvaluationError, unexpected, with_render_depsgraph
from .meshfolder import Made, MeshFolder, digest_of
from .picking import capture_pose
from .properties import show_lines

WITH_SURFACE = {"MESH", "CURVE", "SURFACE", "FONT", "META"}
"""Objects with surfaces. Blender's dependency graph gives those of curves, texts and balls once more as meshes."""
WITHOUT_LOOK = {"EMPTY", "CAMERA", "ARMATURE", "LATTICE", "SPEAKER", "LIGHT_PROBE"}
FAR = 100.0
"""Metres: the scene file's origin is the multiple of this that is nearest to the capture point, as single precision
gets coarse far from the origin."""
MERGED_FROM = 32
"""Instances of one object by one instancer, from which on they are one mesh with one object number."""
MERGED_TRIANGLES = 20_000_000
"""Most triangles of such a mesh; more instances than that stay apart and share a file."""
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
class Source:
    """The object of Blender that one of the scene file comes from.

    Attributes:
        name: of the object.
        asset: name of the outermost of its parents, or its own.
        pass_index: of the object.
    """

    name: str
    asset: str
    pass_index: int


@dataclass(frozen=True)
class Carried:
    """A synthetic object of the scene file.

    Attributes:
        name: in the scene file.
        source: what it is in Blender.
    """

    name: str
    source: Source


@dataclass
class Exported:
    """A scene that was written.

    Attributes:
        path: the scene file.
        camera: name of the active camera in it, or ``None`` where there is none.
        notes: what could not be carried, one sentence each.
        objects: the file's synthetic objects, in its order.
    """

    path: Path
    camera: str | None
    notes: list[str]
    objects: list[Carried]


@dataclass
class _Group:
    """Places where one mesh with the same materials stands, each as its own object or all made by one instancer."""

    source: Source
    key: tuple
    instanced: bool
    places: list[np.ndarray] = field(default_factory=list)


@dataclass
class _Look:
    """A mesh and the surfaces of its slots."""

    name: str
    triangles: meshes.Triangles
    slots: list[str]
    surfaces: list[materials.Surface]

    @cached_property
    def digest(self) -> bytes:
        """Of all that its file is made of."""
        return digest_of(self.triangles, self.slots, self.surfaces)

    def bounds(self, place: np.ndarray) -> np.ndarray:
        """Smallest and largest coordinates of its vertices at a place, shape (2, 3)."""
        points = self.triangles.positions @ place[:3, :3].T + place[:3, 3]
        return np.array([points.min(axis=0), points.max(axis=0)])


@dataclass
class _Writer:
    """The tables of the file while the objects are gone through."""

    depsgraph: bpy.types.Depsgraph
    folder: Path
    files: MeshFolder
    origin: np.ndarray
    real: list[dict[str, Any]] = field(default_factory=list)
    synthetic: list[dict[str, Any]] = field(default_factory=list)
    objects: list[Carried] = field(default_factory=list)
    notes: dict[str, None] = field(default_factory=dict)
    names: set[str] = field(default_factory=set)
    looks: dict[tuple, _Look | None] = field(default_factory=dict)
    groups: dict[tuple, _Group] = field(default_factory=dict)
    surfaces: dict[int, materials.Surface] = field(default_factory=dict)
    written: dict[tuple, str] = field(default_factory=dict)
    bounds: list[np.ndarray] = field(default_factory=list)
    seen: set[int] = field(default_factory=set)
    counts: defaultdict[str, int] = field(default_factory=lambda: defaultdict(int))

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

    def add(self, item, to_world: Matrix, by_instancing: bool, instancer: str) -> None:
        """Add what an evaluated object, or an instance of one, is to the renderer."""
        if item.type == "LIGHT":
            self._note_light_linking(item)
            if not item.lightdepth.real_light:
                self._add_lamp(item, self.local(to_world))
        elif item.type == "MESH":
            if item.as_pointer() not in self.seen:
                self.seen.add(item.as_pointer())
                self._note_light_linking(item)
                self._note_settings(item)
            if item.lightdepth.role in roles.REAL:
                self._add_real(item, to_world)
            else:
                self._add_synthetic(item, to_world, by_instancing, instancer)
        elif item.type not in WITHOUT_LOOK | WITH_SURFACE and not by_instancing:
            self.note(f"Object '{item.name}': {item.type.replace('_', ' ').lower()} objects are not carried")

    def _add_lamp(self, item, to_world: Matrix) -> None:
        name = self.unique(item.name)
        tables, said = lights.emitters(name, item.data, to_world)
        for table in tables[1:]:
            self.names.add(table["name"])
        camera = self.depsgraph.scene_eval.camera
        if tables and not item.visible_camera and camera is not None and item.data.type != "SUN":
            place = np.array(to_world.translation) + self.origin
            if cameras.sees(camera.evaluated_get(self.depsgraph), self.depsgraph.scene_eval, place):
                said.append(f"Light '{item.name}': the camera sees it shine; in Cycles it is not seen by cameras")
        self._append_tables(tables, _source(item))
        self.note(*said)

    def _append_tables(self, tables: list[dict[str, Any]], source: Source) -> None:
        self.synthetic += tables
        self.objects += [Carried(table["name"], source) for table in tables]

    def _note_light_linking(self, item) -> None:
        linking = getattr(item, "light_linking", None)
        if linking is not None and (linking.receiver_collection or linking.blocker_collection):
            self.note(f"Object '{item.name}': its light and shadow linking are not carried")

    def _note_settings(self, item) -> None:
        if any(
            system.settings.type == "HAIR" and system.settings.render_type == "PATH" for system in item.particle_systems
        ):
            self.note(f"Object '{item.name}': its hair is not carried")
        if item.lightdepth.role in roles.REAL:
            return
        unseen = [what for name, what in _RAYS.items() if not getattr(item, name)]
        if unseen:
            self.note(f"Object '{item.name}': its ray visibility is not carried; {', '.join(unseen)} rays meet it")
        if item.is_shadow_catcher:
            self.note(f"Object '{item.name}': is no shadow catcher here; give real surfaces the role support")
        original, layer = item.original, self.depsgraph.view_layer
        if original.name in layer.objects:
            if original.holdout_get(view_layer=layer):
                self.note(f"Object '{item.name}': holdout is not carried; it is rendered as it looks")
            if original.indirect_only_get(view_layer=layer):
                self.note(f"Object '{item.name}': indirect only is not carried; the camera sees it")

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
        if settings.use_gloss and settings.role in roles.REAL and not opening:
            table["gloss"] = {"roughness": settings.roughness, "specular": settings.specular}
        self.real.append(table)

    def _add_synthetic(self, item, to_world, by_instancing: bool, instancer: str) -> None:
        override = self.depsgraph.view_layer_eval.material_override
        worn = [override or slot.material for slot in item.material_slots]
        # Evaluated data is shared by what looks the same: linked duplicates and instances.
        key = (item.data.as_pointer(), tuple(0 if material is None else material.as_pointer() for material in worn))
        if key not in self.looks:
            self.looks[key] = self._look(item, worn, override)
        if self.looks[key] is None:
            return
        # What an instancer makes is gathered; objects stay by themselves.
        place = (key, item.name, instancer) if by_instancing else (key, item.name, "", len(self.groups))
        if place not in self.groups:
            self.groups[place] = _Group(_source(item), key, by_instancing)
        matrix = np.array(to_world, np.float64)
        matrix[:3, 3] -= self.origin
        self.groups[place].places.append(matrix)

    def _look(self, item, worn, override) -> _Look | None:
        mesh = item.to_mesh()
        try:
            triangles = None if mesh is None else meshes.triangles_of(mesh)
            if triangles is None:
                return None
            worn = worn or [override or material for material in mesh.materials] or [override]
        finally:
            item.to_mesh_clear()
        names = ["" if material is None else material.name for material in worn]
        return _Look(item.name, triangles, names, [self._surface(material) for material in worn])

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
        low, high = np.min([b[0] for b in self.bounds], axis=0), np.max([b[1] for b in self.bounds], axis=0)
        for group in self.groups.values():
            look = self.looks[group.key]
            if not any(surface.visible for surface in look.surfaces):
                continue
            bounds = np.array([look.bounds(place) for place in group.places])
            outside = closed & ((bounds[:, 1] < low) | (bounds[:, 0] > high)).any(axis=1)
            if outside.any():
                count = f"{outside.sum()} of its instances are" if outside.sum() < len(outside) else "is"
                self.note(f"Object '{group.source.name}': {count} outside the place and left out")
            places = [place for place, out in zip(group.places, outside, strict=True) if not out]
            self._note_clipping(group, look, bounds[~outside])
            if places:
                self._write_group(group, look, places)

    def _note_clipping(self, group: _Group, look: _Look, bounds: np.ndarray) -> None:
        """Cameras of Blender see nothing nearer or farther than their clipping says."""
        camera = self.depsgraph.scene_eval.camera
        if camera is None or camera.type != "CAMERA" or not len(bounds):
            return
        camera = camera.evaluated_get(self.depsgraph)
        eye = np.array(camera.matrix_world.translation) - self.origin
        nearest = np.linalg.norm(np.maximum(np.maximum(bounds[:, 0] - eye, eye - bounds[:, 1]), 0.0), axis=1)
        if (nearest < camera.data.clip_start).any():
            for place in (group.places[i] for i in np.nonzero(nearest < camera.data.clip_start)[0]):
                points = look.triangles.positions @ place[:3, :3].T + place[:3, 3] - eye
                if (np.linalg.norm(points, axis=1) < camera.data.clip_start).any():
                    self.note(f"Camera '{camera.name}': its clip start does not cut object '{group.source.name}'")
                    break
        if (nearest > camera.data.clip_end).any():
            self.note(f"Camera '{camera.name}': its clip end does not cut object '{group.source.name}'")

    def _write_group(self, group: _Group, look: _Look, places: list[np.ndarray]) -> None:
        count = len(look.triangles.vertices) * len(places)
        if group.instanced and len(places) >= MERGED_FROM and count <= MERGED_TRIANGLES:
            file = self._write(look, np.array(places))
            tables = [{"name": self.unique(group.source.name), "mesh": file}] if file else []
            self._append_tables(tables, group.source)
            return
        for place in places:
            placement = _placement(Matrix(place.tolist()))
            if placement is not None:
                if group.key not in self.written:
                    self.written[group.key] = self._write(look)
                file = self.written[group.key]
            else:
                file = self._write(look, place[None])
            if file:
                table = {"name": self.unique(group.source.name), "mesh": file, **(placement or {})}
                self._append_tables([table], group.source)

    def _write(self, look: _Look, places: np.ndarray | None = None) -> str:
        """Write a mesh file, or find the one with the same content; returns its relative path, empty without faces.

        Args:
            look: the mesh.
            places: where it stands, shape (k, 4, 4); ``None`` for as it is.
        """
        key = look.digest if places is None else digest_of(look.digest, places)
        made = self.files.found(key)
        if made is None:
            made = self._made(look, look.triangles if places is None else meshes.repeated(look.triangles, places))
            self.files.keep(key, made)
        self.note(*made.notes)
        return self.relative(self.files.path / made.files[0]) if made.files else ""

    def _made(self, look: _Look, triangles: meshes.Triangles) -> Made:
        folder = images.ImageFolder(self.files)
        writer = gltf.Writer(folder)
        slots = np.clip(triangles.slots, 0, len(look.surfaces) - 1)
        for slot, (surface, name) in enumerate(zip(look.surfaces, look.slots, strict=True)):
            writer.add(triangles, np.nonzero(slots == slot)[0], surface, name)
        if writer.is_empty:
            return Made((), tuple(writer.notes))
        file = self.files.write(look.name, ".glb", writer.data())
        return Made((file, *folder.names), tuple(writer.notes))


def _source(item) -> Source:
    outermost = item
    while outermost.parent is not None:
        outermost = outermost.parent
    return Source(item.name, outermost.name, item.pass_index)


def _placement(to_world: Matrix) -> dict[str, list[float]] | None:
    """A matrix as position, rotation and scale, or ``None`` where it shears or flattens."""
    position, rotation, scale = to_world.decompose()
    again = Matrix.LocRotScale(position, rotation, scale)
    size = max(abs(value) for row in to_world.to_3x3() for value in row)
    apart = max(abs(again[i][j] - to_world[i][j]) for i in range(3) for j in range(3))
    if apart > 1e-5 * size or min(abs(value) for value in scale) == 0.0:
        return None
    return {
        "position": list(position),
        "rotation": [math.degrees(angle) for angle in rotation.to_euler("XYZ")],
        "scale": list(scale),
    }


def _instances(depsgraph) -> Iterator[tuple[Any, Matrix, bool, str]]:
    for instance in depsgraph.object_instances:
        if instance.show_self:
            parent = instance.parent.name if instance.is_instance and instance.parent is not None else ""
            yield instance.object, instance.matrix_world.copy(), instance.is_instance, parent


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


def _panorama_table(scene, writer: _Writer) -> dict[str, Any]:
    settings = scene.lightdepth
    capture = capture_pose(settings)
    return {
        "image": writer.relative(panorama.file_of(settings.image, writer.files)),
        "position": list(writer.local(capture).translation),
        "rotation": [math.degrees(angle) for angle in capture.to_euler("XYZ")],
        "scale": settings.scale,
        "sky": settings.sky,
    }


def _camera_tables(scene, writer: _Writer, every_camera: bool, eye: cameras.Eye | None) -> dict[str, Any]:
    """All cameras that can be carried, or the active one alone; that one must be."""
    tables = {}
    for item in scene.objects:
        active = scene.camera is not None and item.name == scene.camera.name
        if item.type != "CAMERA" or not (every_camera or active):
            continue
        evaluated = item.evaluated_get(writer.depsgraph)
        try:
            table, said = cameras.camera_table(evaluated, scene, eye if active else None)
            if "position" in table:
                table["position"] = [float(a - b) for a, b in zip(table["position"], writer.origin, strict=True)]
            tables[item.name] = table
        except cameras.CameraError as error:
            if active:
                raise ExportError(str(error)) from error
            said = [f"{error} (this camera is left out)"]
        writer.note(*said)
    return tables


def _render_table(settings) -> dict[str, Any]:
    table = {"samples": settings.samples, "max_bounces": settings.max_bounces, "seed": settings.seed}
    return table | ({"noise": settings.noise} if settings.use_noise else {})


def scene_lights(depsgraph, folder: Path, origin: np.ndarray) -> tuple[list[dict[str, Any]], list[str]]:
    """The ``[[light]]`` tables of a scene: suns that are marked real, and clipped sources.

    Args:
        depsgraph: the evaluated scene.
        folder: of the scene file.
        origin: of the scene file in Blender's world, shape (3,).

    Returns:
        The tables, and notes on what cannot be carried.
    """
    tables, notes, names = [], [], set()
    for item, to_world, _, _ in _instances(depsgraph):
        if item.type == "LIGHT" and item.lightdepth.real_light:
            name = next(name for name in _numbered(item.name) if name not in names)
            table, said = suns.sun_table(name, item, to_world, folder, origin)
            notes += said
            if table is not None:
                names.add(name)
                tables.append(table)
    return tables + suns.clipped_tables(depsgraph.scene_eval.lightdepth), notes


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
    eye: cameras.Eye | None = None,
) -> Exported:
    """Write the scene of a depsgraph that was made for rendering. Nothing of Blender's data is changed.

    Args:
        depsgraph: the evaluated scene.
        path: the scene file to write.
        folder: where meshes and images go; by default beside the scene file.
        every_camera: write all cameras that can be carried, not the active one alone.
        eye: of the active camera, where it is one of several.

    Raises:
        ExportError: there is no panorama, no real surface, or the active camera cannot be carried.
        OSError: a file cannot be written.
    """
    scene = depsgraph.scene_eval
    require_panorama(scene)
    folder = folder or MeshFolder(path.with_name(f"{path.stem}_meshes"))
    folder.begin()
    writer = _Writer(depsgraph, path.parent, folder, _origin(scene))
    document: dict[str, Any] = {"panorama": _panorama_table(scene, writer)}
    try:
        for item, to_world, by_instancing, instancer in _instances(depsgraph):
            writer.add(item, to_world, by_instancing, instancer)
        if not writer.real:
            raise ExportError(
                "No real surface is modelled: add a room or a floor, and give it the role support or environment"
            )
        writer.write_synthetic(closed=not scene.lightdepth.sky)
    finally:
        graph.forget_pictures()
    if scene.render.use_motion_blur:
        writer.note("Motion blur is not carried")
    layer = depsgraph.view_layer_eval
    if layer.use_pass_cryptomatte_material:
        writer.note(f"View layer '{layer.name}': Cryptomatte has objects and assets; materials are not carried")
    tables = _camera_tables(scene, writer, every_camera, eye)
    light_tables, said = scene_lights(depsgraph, writer.folder, writer.origin)
    writer.note(*said)
    document |= {"light": light_tables, "real": writer.real, "synthetic": writer.synthetic, "camera": tables}
    document["render"] = _render_table(scene.lightdepth)
    temporary = path.with_name(f".{path.name}.part")
    head = ""
    if writer.origin.any():
        head = "# Its origin is at {:g}, {:g}, {:g} of Blender's world.\n".format(*writer.origin)
    temporary.write_text(head + toml.dumps(document), encoding="utf-8")
    os.replace(temporary, path)
    active = scene.camera.name if scene.camera is not None and scene.camera.name in tables else None
    return Exported(path, active, list(writer.notes), writer.objects)


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
        """Export, say what could not be carried, and tell the command."""
        settings = context.scene.lightdepth
        path = Path(bpy.path.abspath(self.filepath))
        try:
            require_panorama(context.scene)
            exported = with_render_depsgraph(context, lambda depsgraph: export_scene(depsgraph, path))
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
        command = shlex.join(["lightdepth", "render", str(path), *camera, *_as_arguments(settings), "-o", "OUT.exr"])
        self.report({"INFO"}, f"Written. Render it with: {command}")
        return {"FINISHED"}


classes = (ExportScene,)

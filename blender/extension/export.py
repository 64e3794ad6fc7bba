"""The scene as Blender renders it, written as a scene file and its meshes: for F12 and for the command line alike."""

import math
import os
import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bpy
from bpy_extras.io_utils import ExportHelper
from mathutils import Matrix

from . import cameras, lights, materials, meshes, panorama, roles, toml
from .evaluation import EvaluationError, with_render_depsgraph
from .picking import capture_pose
from .properties import show_lines

WITH_SURFACE = {"MESH", "CURVE", "SURFACE", "FONT", "META"}
"""Objects with surfaces. Blender's dependency graph gives those of curves, texts and balls once more as meshes."""
WITHOUT_LOOK = {"EMPTY", "CAMERA", "ARMATURE", "LATTICE", "SPEAKER", "LIGHT_PROBE"}


class ExportError(Exception):
    """Something without which there is no scene to render."""


@dataclass
class Exported:
    """A scene that was written.

    Attributes:
        path: the scene file.
        camera: name of the active camera in it, or ``None`` where there is none.
        notes: what could not be carried, one sentence each.
    """

    path: Path
    camera: str | None
    notes: list[str]


@dataclass
class _Writer:
    """The tables of the file while the objects are gone through."""

    depsgraph: bpy.types.Depsgraph
    folder: Path
    mesh_folder: Path
    real: list[dict[str, Any]] = field(default_factory=list)
    synthetic: list[dict[str, Any]] = field(default_factory=list)
    notes: dict[str, None] = field(default_factory=dict)
    written: dict[tuple, str] = field(default_factory=dict)
    names: set[str] = field(default_factory=set)
    taken: list[tuple[Path, bpy.types.Mesh]] = field(default_factory=list)

    def note(self, *sentences: str) -> None:
        self.notes |= dict.fromkeys(sentences)

    def unique(self, name: str) -> str:
        """A name that no other table has."""
        candidate, number = name, 0
        while candidate in self.names:
            number += 1
            candidate = f"{name} {number}"
        self.names.add(candidate)
        return candidate

    def new_file(self, name: str, suffix: str) -> Path:
        self.mesh_folder.mkdir(parents=True, exist_ok=True)
        plain = re.sub(r"[^\w.-]+", "_", name) or "mesh"
        return self.mesh_folder / f"{plain}{suffix}"

    def relative(self, path: Path) -> str:
        return Path(os.path.relpath(path, self.folder)).as_posix()

    def add(self, item, to_world: Matrix, by_instancing: bool) -> None:
        """Add what an evaluated object, or an instance of one, is to the renderer."""
        self._note_light_linking(item)
        if item.type == "LIGHT":
            tables, said = lights.emitters(self.unique(item.name), item.data, to_world)
            self.synthetic += tables
            self.note(*said)
        elif item.type == "MESH":
            self._note_settings(item)
            if item.lightdepth.role in roles.REAL:
                self._add_real(item, to_world)
            else:
                self._add_synthetic(item, to_world)
        elif item.type not in WITHOUT_LOOK | WITH_SURFACE and not by_instancing:
            self.note(f"Object '{item.name}': {item.type.replace('_', ' ').lower()} objects are not carried")

    def _note_light_linking(self, item) -> None:
        linking = getattr(item, "light_linking", None)
        if linking is not None and (linking.receiver_collection or linking.blocker_collection):
            self.note(f"Object '{item.name}': its light and shadow linking are not carried")

    def _note_settings(self, item) -> None:
        if any(
            system.settings.type == "HAIR" and system.settings.render_type == "PATH" for system in item.particle_systems
        ):
            self.note(f"Object '{item.name}': its hair is not carried")
        if not (item.visible_camera and item.visible_shadow) or item.is_holdout or item.is_shadow_catcher:
            self.note(f"Object '{item.name}': its ray visibility, holdout and shadow catcher are not carried")

    def _add_real(self, item, to_world) -> None:
        mesh = item.to_mesh()
        try:
            if mesh is None or not mesh.polygons:
                return
            name = self.unique(item.name)
            path = self.new_file(name, ".ply")
            meshes.write_real(path, mesh, to_world)
        finally:
            item.to_mesh_clear()
        settings = item.lightdepth
        table = {"name": name, "mesh": self.relative(path), "role": settings.role.lower()}
        if settings.use_gloss and settings.role == roles.SUPPORT:
            table["gloss"] = {"roughness": settings.roughness, "specular": settings.specular}
        self.real.append(table)

    def _add_synthetic(self, item, to_world) -> None:
        placement = _placement(to_world)
        # Evaluated data is shared by what looks the same: linked duplicates and instances.
        key = (
            item.data.as_pointer(),
            tuple(slot.material.name if slot.material else "" for slot in item.material_slots),
        )
        if placement is None:
            key += tuple(value for row in to_world for value in row)
        if key not in self.written:
            self.written[key] = self._take_synthetic(item, to_world if placement is None else None)
        if self.written[key]:
            self.synthetic.append({"name": self.unique(item.name), "mesh": self.written[key], **(placement or {})})

    def _take_synthetic(self, item, baked: Matrix | None) -> str:
        """Keep the surfaces of an evaluated object for :meth:`write_synthetic`; returns the file's relative path."""
        mesh = bpy.data.meshes.new_from_object(item)  # given a depsgraph, 4.2 crashes on texts and curves
        if not mesh.polygons:
            bpy.data.meshes.remove(mesh)
            return ""
        if baked is not None:
            mesh.transform(baked)
            if baked.determinant() < 0.0:
                mesh.flip_normals()
        path = self.new_file(f"{item.name}_{len(self.written)}", ".glb")
        self.taken.append((path, mesh))
        return self.relative(path)

    def write_synthetic(self) -> None:
        """Write what was taken; not while Blender goes through its objects, as its exporter changes the scenes."""
        for path, mesh in self.taken:
            self.note(*materials.write_synthetic(path, mesh, self.depsgraph))

    def release(self) -> None:
        """Take the meshes out of Blender's data again."""
        for _, mesh in self.taken:
            bpy.data.meshes.remove(mesh)


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


def _instances(depsgraph) -> Iterator[tuple[Any, Matrix, bool]]:
    for instance in depsgraph.object_instances:
        if instance.show_self:
            yield instance.object, instance.matrix_world.copy(), instance.is_instance


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
        "image": writer.relative(panorama.file_of(settings.image, writer.mesh_folder)),
        "position": list(capture.translation),
        "rotation": [math.degrees(angle) for angle in capture.to_euler("XYZ")],
        "scale": settings.scale,
        "sky": settings.sky,
    }


def _camera_tables(scene, writer: _Writer) -> dict[str, Any]:
    """All cameras that can be carried; the active one must be."""
    tables = {}
    for item in scene.objects:
        if item.type != "CAMERA":
            continue
        evaluated = item.evaluated_get(writer.depsgraph)
        try:
            tables[item.name], said = cameras.camera_table(evaluated, scene)
        except cameras.CameraError as error:
            if item.name == scene.camera.name:
                raise ExportError(str(error)) from error
            said = [f"{error} (this camera is left out)"]
        writer.note(*said)
    return tables


def _render_table(settings) -> dict[str, Any]:
    table = {"samples": settings.samples, "max_bounces": settings.max_bounces, "seed": settings.seed}
    return table | ({"noise": settings.noise} if settings.use_noise else {})


def export_scene(depsgraph: bpy.types.Depsgraph, path: Path) -> Exported:
    """Write the scene of a depsgraph that was made for rendering.

    Args:
        depsgraph: the evaluated scene.
        path: the scene file to write; meshes go into a folder beside it.

    Raises:
        ExportError: there is no panorama, no real surface, or the active camera cannot be carried.
        OSError: a file cannot be written.
    """
    scene = depsgraph.scene_eval
    require_panorama(scene)
    writer = _Writer(depsgraph, path.parent, path.with_name(f"{path.stem}_meshes"))
    document: dict[str, Any] = {"panorama": _panorama_table(scene, writer)}
    try:
        for item, to_world, by_instancing in _instances(depsgraph):
            writer.add(item, to_world, by_instancing)
        writer.write_synthetic()
    finally:
        writer.release()
    if not writer.real:
        raise ExportError(
            "No real surface is modelled: add a room or a floor, and give it the role support or environment"
        )
    if scene.render.use_motion_blur:
        writer.note("Motion blur is not carried")
    tables = _camera_tables(scene, writer)
    document |= {"real": writer.real, "synthetic": writer.synthetic, "camera": tables}
    document["render"] = _render_table(scene.lightdepth)
    temporary = path.with_name(f".{path.name}.part")
    temporary.write_text(toml.dumps(document), encoding="utf-8")
    os.replace(temporary, path)
    active = scene.camera.name if scene.camera is not None and scene.camera.name in tables else None
    return Exported(path, active, list(writer.notes))


def options(settings) -> list[str]:
    """Options of ``lightdepth render`` that a scene file has no place for."""
    switches = {"--draft": settings.draft, "--denoise": settings.denoise}
    return ["--method", settings.method.lower(), *(switch for switch, on in switches.items() if on)]


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
        show_lines(settings.export_notes, exported.notes)
        for note in exported.notes:
            self.report({"WARNING"}, note)
        camera = ["--camera", exported.camera] if exported.camera else []
        command = shlex.join(["lightdepth", "render", str(path), *camera, *options(settings), "-o", "OUT.exr"])
        self.report({"INFO"}, f"Written. Render it with: {command}")
        return {"FINISHED"}


classes = (ExportScene,)

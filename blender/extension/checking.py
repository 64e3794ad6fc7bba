"""Holes in the modelled place, found by ``lightdepth check`` and shown in red."""

from pathlib import Path
from typing import ClassVar

import bpy
from mathutils.bvhtree import BVHTree

from . import picking, roles
from .asking import Asks
from .evaluation import with_render_depsgraph
from .export import export_scene
from .process import Question
from .properties import show_lines

HOLES_NAME = "Holes"
RED = (0.9, 0.05, 0.05, 1.0)
CELLS = 64
"""Rows of cells on the sphere of directions; there are twice as many columns."""


class Check(Asks, bpy.types.Operator):
    """Look for directions from the capture point that hit no modelled surface"""

    bl_idname = "lightdepth.check"
    bl_label = "Check for Holes"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        """There is a panorama with a capture point."""
        settings = context.scene.lightdepth
        return settings.image is not None and settings.capture is not None

    def arguments(self, context, folder: Path):
        """Those of ``lightdepth check`` for the exported scene; the holes are looked for in the same evaluation."""
        settings, path = context.scene.lightdepth, folder / "scene.toml"

        def look(depsgraph, _):
            export_scene(depsgraph, path)
            return [] if settings.sky else hole_cells(depsgraph, settings)

        self._cells = with_render_depsgraph(context, look)
        return ["check", str(path), "--json"]

    def take(self, context, question: Question):
        """Show what was found."""
        settings = context.scene.lightdepth
        settings.coverage, problems = question.json(_findings)
        show_lines(settings.check_notes, problems)
        show_holes(context, self._cells)
        for problem in problems:
            self.report({"WARNING"}, problem)


def _findings(found: dict) -> tuple[float, list[str]]:
    """The share of directions that meet a surface or declared sky, -1 without geometry, and what else is said."""
    coverage = found["coverage"]
    problems = [f"{problem['severity']}: {problem['message']}" for problem in found["problems"]]
    return float(coverage["share"] + coverage["sky"]) if coverage else -1.0, problems


def hole_cells(depsgraph, settings) -> list[tuple[int, int]]:
    """Columns and rows of the cells of directions whose middle meets no real surface from the capture point."""
    vertices, triangles = [], []
    for instance in depsgraph.object_instances:
        item = instance.object
        if item.type == "MESH" and instance.show_self and item.lightdepth.role in roles.REAL:
            mesh = item.to_mesh()
            mesh.calc_loop_triangles()
            start = len(vertices)
            vertices += [instance.matrix_world @ vertex.co for vertex in mesh.vertices]
            triangles += [[start + corner for corner in triangle.vertices] for triangle in mesh.loop_triangles]
            item.to_mesh_clear()
    surfaces = BVHTree.FromPolygons(vertices, triangles, all_triangles=True)
    pose = picking.capture_pose(settings)
    origin, turn = pose.translation, pose.to_3x3()
    return [
        (column, row)
        for row in range(CELLS)
        for column in range(2 * CELLS)
        if surfaces.ray_cast(
            origin, turn @ picking.panorama_direction((column + 0.5) / (2 * CELLS), (row + 0.5) / CELLS)
        )[0]
        is None
    ]


def show_holes(context, cells) -> None:
    """Lay red patches around the capture point, over the directions of holes; never rendered.

    Args:
        context: Blender's.
        cells: ``(column, row)`` of each hole.
    """
    old = context.scene.objects.get(HOLES_NAME)
    if old is not None:
        mesh = old.data
        bpy.data.objects.remove(old)
        bpy.data.meshes.remove(mesh)
    if not cells:
        return
    vertices, faces = [], []
    for column, row in cells:
        faces.append(range(len(vertices), len(vertices) + 4))
        for across, down in ((0, 0), (0, 1), (1, 1), (1, 0)):
            vertices.append(picking.panorama_direction((column + across) / (2 * CELLS), (row + down) / CELLS))
    mesh = bpy.data.meshes.new(HOLES_NAME)
    mesh.from_pydata([tuple(vertex) for vertex in vertices], [], [tuple(face) for face in faces])
    mesh.materials.append(_red())
    patches = bpy.data.objects.new(HOLES_NAME, mesh)
    patches.color = RED
    patches.hide_render = patches.hide_select = True
    patches.matrix_world = picking.capture_pose(context.scene.lightdepth)
    context.scene.collection.objects.link(patches)


def _red() -> bpy.types.Material:
    material = bpy.data.materials.get(HOLES_NAME) or bpy.data.materials.new(HOLES_NAME)
    material.diffuse_color = RED
    if hasattr(material, "use_nodes"):  # deprecated since Blender 5.0, which always has nodes
        material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    shader, output = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
    shader.inputs["Color"].default_value = RED
    material.node_tree.links.new(shader.outputs[0], output.inputs["Surface"])
    return material


classes = (Check,)

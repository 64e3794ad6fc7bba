"""Holes in the modelled place, found by ``lightdepth check`` and shown in red."""

import tempfile
from pathlib import Path
from typing import ClassVar

import bpy

from . import picking
from .evaluation import with_render_depsgraph
from .export import ExportError, export_scene
from .preferences import renderer_command
from .process import RendererError, run_json
from .properties import show_lines

HOLES_NAME = "Holes"
RED = (0.9, 0.05, 0.05, 1.0)
CELLS = 64
"""Rows of cells on the sphere of directions; there are twice as many columns."""


class Check(bpy.types.Operator):
    """Look for directions from the capture point that hit no modelled surface"""

    bl_idname = "lightdepth.check"
    bl_label = "Check for Holes"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        """There is a panorama with a capture point."""
        settings = context.scene.lightdepth
        return settings.image is not None and settings.capture is not None

    def execute(self, context):
        """Export the scene, run ``lightdepth check`` and show what it found."""
        settings = context.scene.lightdepth
        try:
            with tempfile.TemporaryDirectory(prefix="lightdepth-") as folder:
                path = Path(folder) / "scene.toml"
                with_render_depsgraph(context, lambda depsgraph: export_scene(depsgraph, path))
                found = run_json(renderer_command(), ["check", str(path), "--json"])
            coverage = float(found["coverage"])
            holes = [(float(u), float(v)) for u, v in found["holes"]]
        except (RendererError, ExportError, OSError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        except (KeyError, TypeError, ValueError) as error:
            self.report(
                {"ERROR"}, f"The renderer's answer lacks the coverage ({error}); is it of the extension's version?"
            )
            return {"CANCELLED"}
        settings.coverage = coverage
        show_lines(settings.check_notes, found.get("messages", []))
        show_holes(context, holes)
        return {"FINISHED"}


def show_holes(context, holes) -> None:
    """Lay red patches around the capture point, over the directions of holes; never rendered.

    Args:
        context: Blender's.
        holes: ``(u, v)`` on the panorama, each in [0, 1].
    """
    old = context.scene.objects.get(HOLES_NAME)
    if old is not None:
        mesh = old.data
        bpy.data.objects.remove(old)
        bpy.data.meshes.remove(mesh)
    if not holes:
        return
    cells = sorted({(int(u * 2 * CELLS) % (2 * CELLS), min(int(v * CELLS), CELLS - 1)) for u, v in holes})
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
    material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    shader, output = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
    shader.inputs["Color"].default_value = RED
    material.node_tree.links.new(shader.outputs[0], output.inputs["Surface"])
    return material


classes = (Check,)

"""The render engine: F12 and Ctrl-F12 by the renderer's own process, shown while it works."""

import tempfile
import time
from pathlib import Path

import bpy
import numpy as np

from . import evaluation, exr, passes
from .asking import renderer_command
from .cameras import CameraError, resolution
from .export import Exported, ExportError, export_scene, options
from .process import RendererError, Rendering
from .properties import show_lines

PREVIEW_SECONDS = 2
PATIENCE_AFTER_INTERRUPT = 10.0
"""Seconds that an interrupted renderer has to write what it rendered."""


class LightdepthEngine(bpy.types.RenderEngine):
    """Renders through the command ``lightdepth render``."""

    bl_idname = evaluation.ENGINE
    bl_label = "lightdepth"
    bl_use_preview = False
    bl_use_eevee_viewport = True
    bl_use_shading_nodes_custom = False

    def update_render_passes(self, scene=None, renderlayer=None):
        """Tell the compositor which passes there are."""
        for name, (_, channels, kind) in passes.PASSES.items():
            self.register_pass(scene, renderlayer, name, len(channels), channels, kind)

    def render(self, depsgraph):
        """Render one view layer of one frame."""
        if evaluation.take_over(depsgraph):
            return
        try:
            with tempfile.TemporaryDirectory(prefix="lightdepth-") as folder:
                self._render(depsgraph, Path(folder))
        except (RendererError, ExportError, CameraError, exr.ExrError, OSError) as error:
            self.report({"ERROR"}, str(error))
            self.error_set(str(error))

    def _render(self, depsgraph, folder: Path) -> None:
        scene = depsgraph.scene_eval
        if scene.render.use_border:
            raise ExportError("The render region is not carried: switch it off, the whole picture is rendered")
        if scene.render.use_multiview:
            raise ExportError("Stereoscopy is not carried: switch it off in the output properties")
        command = renderer_command()
        self.update_stats("", "Exporting the scene")

        def export() -> Exported:
            exported = export_scene(depsgraph, folder / "scene.toml")
            show_lines(depsgraph.scene.lightdepth.export_notes, exported.notes)
            return exported

        exported: Exported | None = evaluation.on_main_thread(export, self.test_break)
        if exported is None:
            return
        for note in exported.notes:
            self.report({"WARNING"}, note)
        if exported.camera is None:
            raise ExportError("The scene has no active camera")
        picture = folder / "picture.exr"
        arguments = ["render", str(exported.path), "--camera", exported.camera, "-o", str(picture)]
        arguments += [*options(scene.lightdepth), "--progress", "json", "--preview-seconds", str(PREVIEW_SECONDS)]
        self.update_stats("", "Starting the renderer")
        with Rendering(command, arguments) as rendering:
            self._follow(rendering, picture, resolution(scene), depsgraph.view_layer_eval.name)

    def _follow(self, rendering: Rendering, picture: Path, size: tuple[int, int], layer: str) -> None:
        """Show the renderer's progress until it ends or the person has waited enough."""
        interrupted = None
        shown = False
        try:
            for event in rendering.events():
                if interrupted is None and self.test_break():
                    rendering.interrupt()
                    interrupted = time.monotonic()
                if interrupted is not None and time.monotonic() - interrupted > PATIENCE_AFTER_INTERRUPT:
                    return
                if event is None:
                    continue
                if event["event"] == "progress":
                    self.update_progress(min(max(float(event.get("fraction", 0.0)), 0.0), 1.0))
                    self.update_stats("", _status(event))
                elif event["event"] == "picture":
                    self._show(picture, size, layer)
                    shown = True
        except RendererError:
            if interrupted is None:  # one that was interrupted before it could render has nothing to tell
                raise
        if interrupted is None and not shown:
            raise RendererError("The renderer ended without a picture and without saying why")

    def _show(self, picture: Path, size: tuple[int, int], layer: str) -> None:
        """Put the file's parts into Blender's passes."""
        pixels = passes.from_parts(exr.read(picture))
        width, height = size
        if pixels["Combined"].shape[:2] != (height, width):
            found = pixels["Combined"].shape
            raise RendererError(f"The renderer made {found[1]} x {found[0]} pixels instead of {width} x {height}")
        for name, (_, channels, _) in passes.PASSES.items():
            if name in pixels:
                self.add_pass(name, len(channels), channels, layer=layer)
        result = self.begin_result(0, 0, width, height, layer=layer)
        for target in result.layers[0].passes:
            if target.name in pixels:
                # Blender's pictures begin at the bottom.
                values = np.ascontiguousarray(pixels[target.name][::-1], np.float32)
                target.rect.foreach_set(values.ravel())
        self.end_result(result)


def _status(event: dict) -> str:
    """What the render window's header says."""
    words = []
    if "samples" in event:
        words.append(f"{event['samples']} samples")
    if isinstance(event.get("error"), (int, float)):
        words.append(f"error {100.0 * event['error']:.1f} %")
    if isinstance(event.get("seconds_left"), (int, float)):
        words.append(f"{event['seconds_left']:.0f} s left")
    return ", ".join(words)


classes = (LightdepthEngine,)

"""The render engine: F12, Ctrl-F12 and the viewport by the renderer's own process, shown while it works."""

import contextlib
import functools
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from . import cameras, evaluation, exr, meshfolder, passes
from .asking import renderer_command
from .export import Exported, ExportError, EyeOf, export_scene, options
from .process import RendererError
from .properties import show_lines
from .viewport import Viewport
from .worker import Busy, render

PREVIEW_SECONDS = 2


class LightdepthEngine(bpy.types.RenderEngine):
    """Renders through the process ``lightdepth serve``, which stays for the next frame."""

    bl_idname = evaluation.ENGINE
    bl_label = "lightdepth"
    bl_use_preview = False
    bl_use_eevee_viewport = True
    bl_use_shading_nodes_custom = False
    bl_use_spherical_stereo = True

    _viewport: Viewport | None = None

    def view_update(self, context, depsgraph):
        """Take note that something has changed."""
        self._shown_viewport().scene_changed()

    def view_draw(self, context, depsgraph):
        """Draw the viewport."""
        self._shown_viewport().draw(self, context, depsgraph)

    def _shown_viewport(self) -> Viewport:
        if self._viewport is None:
            self._viewport = Viewport()
        return self._viewport

    def update_render_passes(self, scene=None, renderlayer=None):
        """Tell the compositor which passes there are."""
        self.register_pass(scene, renderlayer, "Combined", 4, "RGBA", "COLOR")
        for name, (_, channels, kind) in passes.PASSES.items():
            self.register_pass(scene, renderlayer, name, len(channels), channels, kind)
        if renderlayer.use_pass_object_index:
            self.register_pass(scene, renderlayer, passes.INDEX, 1, "X", "VALUE")
        if renderlayer.use_pass_material_index:
            self.register_pass(scene, renderlayer, passes.MATERIAL_INDEX, 1, "X", "VALUE")
        for name in _matte_passes(renderlayer):
            self.register_pass(scene, renderlayer, name, 4, "RGBA", "COLOR")

    def render(self, depsgraph):
        """Render one view layer of one frame.

        Whatever goes wrong is reported as an error: Blender then writes no picture and stops an animation.
        """
        if evaluation.take_over(depsgraph, self):
            return
        try:
            with tempfile.TemporaryDirectory(prefix="lightdepth-") as folder:
                self._render(depsgraph, Path(folder))
        except (RendererError, ExportError, cameras.CameraError, exr.ExrError, OSError) as error:
            self._fail(str(error))
        except Exception as error:
            self._fail(evaluation.unexpected(error))

    def _warn(self, message: str) -> None:
        self.report({"WARNING"}, message)

    def _fail(self, why: str) -> None:
        self.report({"ERROR"}, why)
        self.error_set(why)

    def _render(self, depsgraph, folder: Path) -> None:
        command = renderer_command()
        stop = _Stop(self.test_break)
        for eye_of, tops in self._eyes(depsgraph):
            self._render_eye(depsgraph, folder, command, stop, eye_of, tops)
            if stop.asked:
                return

    def _eyes(self, depsgraph) -> list[tuple[EyeOf | None, dict[str, int]]]:
        """What is rendered one after the other: an eye, and from which row on its picture has which views."""
        scene = depsgraph.scene_eval
        if not scene.render.use_multiview or scene.camera is None:
            return [(None, {"": 0})]
        camera = scene.camera.evaluated_get(depsgraph)
        stereo = scene.render.views_format == "STEREO_3D"
        views = [view.name for view in (scene.render.stereo_views if stereo else scene.render.views) if view.use]
        if camera.data.type == "PANO" and self.use_spherical_stereo(camera):
            if not set(views) <= {"left", "right"}:
                raise ExportError(f"Spherical stereo has the views left and right; there are {', '.join(views)}")
            tops = {"left": 0, "right": cameras.resolution(scene)[1]}
            return [(self._both_eyes, {view: tops[view] for view in views})]
        return [(functools.partial(self._eye, view), {view: 0}) for view in views]

    def _both_eyes(self, camera) -> cameras.Eye:
        matrix = self.camera_model_matrix(camera, use_spherical_stereo=True).copy()
        return cameras.Eye(matrix, 0.0, spherical=True)

    def _eye(self, view: str, camera) -> cameras.Eye:
        self.active_view_set(view)
        return cameras.Eye(self.camera_model_matrix(camera).copy(), self.camera_shift_x(camera))

    def _render_eye(
        self,
        depsgraph,
        folder: Path,
        command: str,
        stop: "_Stop",
        eye_of: EyeOf | None,
        tops: dict[str, int],
    ) -> None:
        self.update_stats("", "Exporting the scene")
        files = meshfolder.of_session()
        exported = export_scene(
            depsgraph,
            files.path.with_name("scene.toml"),
            files,
            every_camera=False,
            eye_of=eye_of,
            set_frame=self.frame_set,
        )
        scene = depsgraph.scene_eval
        if exported.camera is None:
            raise ExportError("The scene has no active camera")
        original = depsgraph.scene  # whose settings only the main thread may change
        evaluation.on_main_thread(lambda: show_lines(original.lightdepth.export_notes, exported.notes), self.test_break)
        if stop():
            return
        for note in exported.notes:
            self._warn(note)
        picture = folder / "picture.exr"
        request = {
            "scene": str(exported.path),
            "camera": exported.camera,
            "output": str(picture),
            "preview_seconds": PREVIEW_SECONDS,
            "layers": _layers(depsgraph),
            **options(scene.lightdepth),
        }
        if exported.frame is not None:
            request["frame"] = exported.frame
        self.update_stats("", "Starting the renderer")
        view = _View(depsgraph, exported, tops)
        with Busy(stop) as busy:
            if busy.mine:
                with contextlib.closing(render(command, request, stop, self._warn)) as events:
                    self._follow(events, stop, picture, view)

    def _follow(self, events: Iterator[dict[str, Any]], stop: "_Stop", picture: Path, view: "_View") -> None:
        """Show the renderer's progress until it ends or the person has waited enough."""
        shown = False
        try:
            for event in events:
                if event["event"] == "progress":
                    self.update_progress(min(max(float(event.get("fraction", 0.0)), 0.0), 1.0))
                    self.update_stats("", _status(event))
                elif event["event"] == "stage":
                    self.update_stats("", str(event.get("stage")).capitalize())
                elif event["event"] == "warning":
                    self._warn(str(event.get("message")))
                elif event["event"] == "picture":
                    self._show(picture, view)
                    shown = True
        except RendererError:
            if not stop.asked:  # one that was stopped before it could render has nothing to tell
                raise
        if not stop.asked and not shown:
            raise RendererError("The renderer exited without a picture or an error message")

    def _show(self, picture: Path, view: "_View") -> None:
        """Put the file's parts into Blender's passes."""
        parts = exr.read(picture)
        for name, top in view.tops.items():
            self._show_view(view.passes(parts, top), view, name)

    def _show_view(self, pixels: dict[str, np.ndarray], view: "_View", name_of_view: str) -> None:
        for name, (_, channels, _) in passes.PASSES.items():
            if name in pixels:
                self.add_pass(name, len(channels), channels, layer=view.layer)
        for name in (passes.INDEX, passes.MATERIAL_INDEX):
            if name in pixels:
                self.add_pass(name, 1, "X", layer=view.layer)
        for name in view.matte_passes:
            self.add_pass(name, 4, "RGBA", layer=view.layer)
        height, width = pixels["Combined"].shape[:2]
        result = self.begin_result(0, 0, width, height, layer=view.layer, view=name_of_view)
        for target in result.layers[0].passes:
            if target.name in pixels:
                # Blender's pictures begin at the bottom.
                values = np.ascontiguousarray(pixels[target.name][::-1], np.float32)
                target.rect.foreach_set(values.ravel())
        self.end_result(result)
        whole = self.get_result()
        for key, value in view.facts.items():
            whole.stamp_data_add_field(key, value)


class _Stop:
    """Whether the person wants to stop; once asked for, it stays so."""

    def __init__(self, test):
        self._test = test
        self.asked = False

    def __call__(self) -> bool:
        self.asked = self.asked or self._test()
        return self.asked


class _View:
    """How the renderer's picture becomes that of one view layer."""

    def __init__(self, depsgraph, exported: Exported, tops: dict[str, int]):
        scene = depsgraph.scene_eval
        camera = scene.camera.evaluated_get(depsgraph)
        self.tops = tops
        self.layer = depsgraph.view_layer_eval.name
        self._cut = cameras.cut(camera, scene)
        self._circle = cameras.circle(camera)
        self._transparent = scene.render.film_transparent
        layer = depsgraph.view_layer_eval
        self._indices = None
        if layer.use_pass_object_index:
            self._indices = [each.source.pass_index for each in exported.objects]
        self._material_indices = None
        if layer.use_pass_material_index and not scene.lightdepth.draft:
            index_of = {material.name: material.pass_index for material in bpy.data.materials}
            self._material_indices = {
                name: index_of.get(material, 0)
                for each in exported.objects
                for name, material in each.matte_names().items()
            }
        self.matte_passes = [] if scene.lightdepth.draft else _matte_passes(layer)
        self._names = {
            "CryptoObject": {each.name: each.source.name for each in exported.objects},
            "CryptoMaterial": {
                name: material for each in exported.objects for name, material in each.matte_names().items()
            },
            "CryptoAsset": {each.name: each.source.asset for each in exported.objects},
        }
        self.facts: dict[str, str] = {}
        for name in {name[:-2] for name in self.matte_passes}:
            self.facts |= passes.matte_facts(f"{self.layer}.{name}", self._names[name])

    def passes(self, parts: dict[str, dict[str, np.ndarray]], first: int) -> dict[str, np.ndarray]:
        """Pixels by pass name, see :func:`.passes.from_parts`, of the view that begins at a row."""
        pixels = passes.from_parts(parts)
        if self._circle is not None:
            passes.keep_circle(pixels, self._circle)
        if self._transparent:
            passes.make_transparent(pixels)
        if self._indices is not None and "Object ID" in pixels:
            pixels[passes.INDEX] = passes.indices(pixels["Object ID"], self._indices)
        if self._material_indices is not None:
            pixels[passes.MATERIAL_INDEX] = passes.material_indices(parts["beauty"], self._material_indices)
        for layer in {name[:-2] for name in self.matte_passes}:
            count = sum(name[:-2] == layer for name in self.matte_passes)
            pixels |= passes.mattes(parts["beauty"], layer, self._names[layer], count)
        left, top, width, height = self._cut
        top += first
        found = pixels["Combined"].shape
        if found[0] < top + height or found[1] < left + width:
            raise RendererError(f"The renderer made {found[1]} x {found[0]} pixels, too few for {width} x {height}")
        return {name: values[top : top + height, left : left + width] for name, values in pixels.items()}


def _matte_passes(layer) -> list[str]:
    """Names of the Cryptomatte passes that a view layer wants, two ranks each."""
    count = (layer.pass_cryptomatte_depth + 1) // 2
    wanted = [name for name, setting in passes.MATTES.items() if getattr(layer, f"use_pass_cryptomatte_{setting}")]
    return [f"{name}{index:02}" for name in wanted for index in range(count)]


def _layers(depsgraph) -> list[str]:
    """Layers of the renderer's picture that Blender's passes are made of."""
    scene = depsgraph.scene_eval
    if not scene.lightdepth.draft:
        layer = depsgraph.view_layer_eval
        mattes = ["cryptomatte"] if _matte_passes(layer) or layer.use_pass_material_index else []
        return [part for part, _, _ in passes.PASSES.values()] + mattes
    return ["plate", "coverage"] if scene.render.film_transparent else []


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

"""The viewport that shows the renderer's pictures: what is exported when, and how it is drawn."""

import time
import weakref
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import bpy
import gpu
from gpu_extras.presets import draw_texture_2d
from mathutils import Matrix

from . import cameras, meshfolder
from .asking import renderer_command
from .evaluation import unexpected
from .export import Exported, ExportError, export_scene, options
from .preview import COARSE, PICTURE_SECONDS, REST_SECONDS, SHARE_OF_EXPORTS, Picture, Preview, Stage, View, view_of
from .process import RendererError

LOOK_SECONDS = 0.05
"""Between two looks whether a viewport has something new to draw."""
ORTHOGRAPHIC = "An orthographic view has no picture: switch to perspective (numpad 5)"


class Viewport:
    """One viewport in the shading mode *Rendered*. All of it is for the main thread."""

    def __init__(self) -> None:
        self._preview = Preview()
        self._exported: Exported | None = None
        self._changed, self._changed_at = True, 0.0
        self._exported_at, self._export_seconds = 0.0, 0.0
        self._asked: tuple[Any, ...] | None = None
        self._drawn: Picture | None = None
        self._texture: gpu.types.GPUTexture | None = None
        _live.add(self)

    def __del__(self) -> None:
        self.end()

    def end(self) -> None:
        """Ask the renderer for nothing any more."""
        self._preview.end()

    def scene_changed(self) -> None:
        """Something of Blender's data has changed."""
        self._changed, self._changed_at = True, time.monotonic()

    def wants_to_draw(self) -> bool:
        """Whether there is something new to draw, or to export while drawing."""
        return self._preview.news or (self._changed and self._may_export())

    def _may_export(self) -> bool:
        now = time.monotonic()
        rested = now - self._changed_at > REST_SECONDS
        return not bpy.app.is_job_running("RENDER") and (
            rested or now - self._exported_at > max(REST_SECONDS, self._export_seconds / SHARE_OF_EXPORTS)
        )

    def draw(self, engine: bpy.types.RenderEngine, context, depsgraph) -> None:
        """Draw the newest picture, and ask for another one where something has changed."""
        view = view_of(context.region, context.region_data)
        if view is None:
            self._preview.tell(ORTHOGRAPHIC)
        else:
            if self._changed and self._may_export():
                self._export(depsgraph)
            if self._exported is not None:
                self._ask(engine, depsgraph.scene_eval, view, _lens(context, depsgraph))
            self._draw_picture(engine, context)
        self._preview.news = False
        engine.update_stats("", self._preview.status)

    def _export(self, depsgraph) -> None:
        self._changed, self._exported = False, None
        began = time.monotonic()
        try:
            files = meshfolder.of_session("preview")
            path = files.path.with_name("preview.toml")
            self._exported = export_scene(depsgraph, path, files, with_cameras=False)
        except (ExportError, OSError) as error:
            self._preview.tell(str(error))
        except Exception as error:
            self._preview.tell(unexpected(error))
        self._exported_at = time.monotonic()
        self._export_seconds = self._exported_at - began

    def _ask(self, engine, scene, view: View, lens: Mapping[str, float]) -> None:
        """Ask for the coarse and the fine picture, unless they are asked for already."""
        try:
            command = renderer_command()
        except RendererError as error:
            self._preview.tell(str(error))
            return
        method = options(scene.lightdepth)["method"]
        stages = [
            self._stage(view, lens, COARSE, {"method": method, "draft": True}),
            self._stage(
                view,
                lens,
                max(engine.get_preview_pixel_size(scene), 1),
                {"method": method, "draft": scene.lightdepth.draft, "preview_seconds": PICTURE_SECONDS},
            ),
        ]
        asked = (command, *((stage.text, tuple(stage.request.items())) for stage in stages))
        if asked != self._asked:
            self._asked = asked
            self._preview.want(command, stages)

    def _stage(self, view: View, lens: Mapping[str, float], pixel: int, request: dict[str, Any]) -> Stage:
        width, height = view.size_of(pixel)
        table = {"type": "perspective", "width": width, "height": height, "fov": view.fov}
        table |= {"shift": list(view.shift), **cameras.pose(Matrix(view.pose)), **lens}
        return Stage(request, self._exported.seen(table), Path(self._exported.path))

    def _draw_picture(self, engine, context) -> None:
        picture = self._preview.picture
        if picture is None:
            return
        if picture is not self._drawn:
            height, width = picture.pixels.shape[:2]
            data = gpu.types.Buffer("FLOAT", picture.pixels.size, picture.pixels.ravel())
            self._texture = gpu.types.GPUTexture((width, height), format="RGBA32F", data=data)
            self._drawn = picture
        engine.bind_display_space_shader(context.scene)
        draw_texture_2d(self._texture, (0, 0), context.region.width, context.region.height)
        engine.unbind_display_space_shader()


def _lens(context, depsgraph) -> Mapping[str, float]:
    """Depth of field of the camera that a viewport looks through, if it does."""
    space = context.space_data
    camera = space.camera if space.use_local_camera else depsgraph.scene_eval.camera
    if context.region_data.view_perspective != "CAMERA" or camera is None or camera.type != "CAMERA":
        return {}
    return cameras.depth_of_field(camera.evaluated_get(depsgraph)) if camera.data.type == "PERSP" else {}


_live: weakref.WeakSet[Viewport] = weakref.WeakSet()


def _look() -> float:
    """Let Blender draw the viewports where one has something new."""
    if any(viewport.wants_to_draw() for viewport in _live):
        for window in bpy.context.window_manager.windows:
            for area in window.screen.areas:
                if area.type == "VIEW_3D" and area.spaces.active.shading.type == "RENDERED":
                    area.tag_redraw()
    return LOOK_SECONDS


def register() -> None:
    """Begin to look for what is new."""
    bpy.app.timers.register(_look, persistent=True)


def unregister() -> None:
    """Stop looking, and end what is asked for."""
    if bpy.app.timers.is_registered(_look):
        bpy.app.timers.unregister(_look)
    for viewport in list(_live):
        viewport.end()

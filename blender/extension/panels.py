"""The panels: a tab in the viewport's sidebar, the object's and the render's properties, the panoramic lens."""

import textwrap
from typing import ClassVar

import bpy

from . import calibration, cameraimport, checking, export, modelling, panorama, reallights, rest, roles, viewpoints
from .cameras import PROJECTIONS, panoramic
from .evaluation import ENGINE
from .passes import MATTES

LETTER = 6.5
"""Width of a letter of the user interface's font, pixels at scale 1, rather too much than too little."""


class Sidebar:
    """Base of the panels in the viewport's sidebar."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "lightdepth"


class ImageSidebar:
    """Base of the panels in the image editor's sidebar."""

    bl_space_type = "IMAGE_EDITOR"
    bl_region_type = "UI"
    bl_category = "lightdepth"


class PanoramaPanel(Sidebar, bpy.types.Panel):
    """The photograph and where it was taken."""

    bl_idname = "LIGHTDEPTH_PT_panorama"
    bl_label = "Panorama"

    def draw(self, context):
        layout, settings = self.layout, context.scene.lightdepth
        layout.use_property_split = True
        layout.operator(panorama.LoadPanorama.bl_idname, icon="FILE_FOLDER")
        if settings.image is None:
            return
        layout.prop(settings, "image")
        layout.prop(settings, "capture")
        layout.prop(settings, "scale")
        if settings.capture is not None:
            layout.prop(settings.capture, "location")
            layout.prop(settings.capture, "rotation_euler")
        layout.operator(panorama.ViewFromCapture.bl_idname, icon="HIDE_OFF")


def draw_calibration(layout, context) -> None:
    """The calibration's buttons and its result; used in the viewport and in the image editor."""
    settings = context.scene.lightdepth
    layout.use_property_split = True
    layout.operator(calibration.ClickCorners.bl_idname, icon="RESTRICT_SELECT_OFF")
    layout.label(text=f"{len(settings.corners)} of {calibration.CORNERS} corners")
    layout.prop(settings, "known")
    layout.prop(settings, "known_length")
    layout.operator(calibration.Calibrate.bl_idname, icon="ORIENTATION_GIMBAL")
    if settings.residual >= 0.0:
        layout.label(text=f"Residual {settings.residual:.2f} degrees", icon="CHECKMARK")
    draw_notes(layout, settings.calibration_notes, context)


class CalibrationPanel(Sidebar, bpy.types.Panel):
    """Calibration in the viewport."""

    bl_idname = "LIGHTDEPTH_PT_calibration"
    bl_label = "Calibrate"

    def draw(self, context):
        draw_calibration(self.layout, context)


class ImageCalibrationPanel(ImageSidebar, bpy.types.Panel):
    """Calibration in the image editor."""

    bl_idname = "LIGHTDEPTH_PT_image_calibration"
    bl_label = "Calibrate"

    def draw(self, context):
        draw_calibration(self.layout, context)


class PlacePanel(Sidebar, bpy.types.Panel):
    """Modelling the place."""

    bl_idname = "LIGHTDEPTH_PT_place"
    bl_label = "Place"

    def draw(self, context):
        layout, settings = self.layout, context.scene.lightdepth
        column = layout.column(align=True)
        column.operator(modelling.AddRoom.bl_idname, icon="MOD_BUILD")
        column.operator(modelling.AddBox.bl_idname, icon="MESH_CUBE")
        column.operator(modelling.AddTop.bl_idname, icon="MESH_PLANE")
        column = layout.column(align=True)
        column.label(text="Role of what is selected")
        item = context.object if context.object and context.object.type in export.WITH_SURFACE else None
        for role, name, _, icon, _ in roles.ITEMS:
            active = item is not None and item.select_get() and item.lightdepth.role == role
            column.operator(roles.SetRole.bl_idname, text=name, icon=icon, depress=active).role = role
        layout.operator(roles.ShowRoles.bl_idname, icon="COLOR")
        column = layout.column(align=True)
        column.operator(rest.StoreRest.bl_idname, icon="PINNED")
        column.operator(rest.ClearRest.bl_idname, icon="UNPINNED")
        layout.prop(settings, "sky")
        layout.operator(checking.Check.bl_idname, icon="VIEWZOOM")
        if settings.coverage >= 0.0:
            icon = "CHECKMARK" if settings.coverage >= 1.0 else "ERROR"
            layout.label(text=f"Coverage {100.0 * settings.coverage:.2f} %", icon=icon)
        draw_notes(layout, settings.check_notes, context)


class LightPanel(Sidebar, bpy.types.Panel):
    """Light of the real place that the photograph lacks."""

    bl_idname = "LIGHTDEPTH_PT_light"
    bl_label = "Missing Light"

    def draw(self, context):
        layout, settings = self.layout, context.scene.lightdepth
        layout.use_property_split = True
        column = layout.column(align=True)
        column.operator(reallights.RecoverSun.bl_idname, icon="LIGHT_SUN")
        column.operator(reallights.RecoverClipped.bl_idname, icon="LIGHT")
        for item in context.scene.objects:
            if item.type == "LIGHT" and item.lightdepth.real_light:
                row = layout.row(align=True)
                row.prop(item, "name", text="", icon="LIGHT_SUN" if item.data.type == "SUN" else "LIGHT_POINT")
                row.prop(item.data, "energy", text="")
                row.prop(item.data, "color", text="")
                row.prop(item, "hide_render", text="")
        column = layout.column(align=True)
        column.operator(reallights.ImportLights.bl_idname, icon="IMPORT")
        column.operator(reallights.WriteLights.bl_idname, icon="EXPORT")
        draw_notes(layout, settings.light_notes, context)


class ShootingPanel(Sidebar, bpy.types.Panel):
    """Cameras, and the ways to a picture: F12 and the command line."""

    bl_idname = "LIGHTDEPTH_PT_shooting"
    bl_label = "Render"

    def draw(self, context):
        layout, settings = self.layout, context.scene.lightdepth
        layout.use_property_split = True
        layout.prop(context.scene.render, "engine")
        if context.scene.render.engine != ENGINE:
            layout.label(text="F12 uses another renderer", icon="ERROR")
        column = layout.column(align=True)
        column.label(text="New camera at the capture point")
        for kind, name, _, icon, _ in viewpoints.ITEMS:
            column.operator(viewpoints.AddCamera.bl_idname, text=name, icon=icon).kind = kind
        layout.operator(cameraimport.ImportCameras.bl_idname, icon="IMPORT")
        layout.prop(context.scene, "camera")
        layout.operator("render.render", text="Render Image", icon="RENDER_STILL")
        layout.operator(export.ExportScene.bl_idname, icon="EXPORT")
        if len(settings.export_notes):
            layout.label(text="Not as in Blender:")
        draw_notes(layout, settings.export_notes, context)


SEVERITIES = {"error": "CANCEL", "warning": "ERROR"}
"""Icons of lines that begin with such a word."""


def draw_notes(layout, lines, context) -> None:
    """Whole sentences that a collection keeps, see :func:`draw_texts`."""
    draw_texts(layout, [line.text for line in lines], context)


def draw_texts(layout, texts, context) -> None:
    """Whole sentences, broken into lines that fit: Blender would cut the middle out of them."""
    letters = int((context.region.width - 70) / (LETTER * context.preferences.system.ui_scale))
    for text in texts:
        column = layout.column(align=True)
        icon = SEVERITIES.get(text.partition(":")[0], "INFO")
        for index, part in enumerate(textwrap.wrap(text, max(letters, 20))):
            column.label(text=part, icon="BLANK1" if index else icon)


class ObjectPanel(bpy.types.Panel):
    """The object's role."""

    bl_idname = "LIGHTDEPTH_PT_object"
    bl_label = "lightdepth"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "object"

    @classmethod
    def poll(cls, context):
        """The object has surfaces."""
        return context.object is not None and context.object.type in export.WITH_SURFACE

    def draw(self, context):
        layout, settings = self.layout, context.object.lightdepth
        layout.use_property_split = True
        layout.prop(settings, "role", expand=True)
        if settings.role in roles.REAL:
            layout.prop(settings, "use_gloss")
            column = layout.column()
            column.active = settings.use_gloss
            column.prop(settings, "roughness")
            column.prop(settings, "specular")
            layout.prop(settings, "removed")
        if settings.role == roles.ENVIRONMENT:
            layout.prop(settings, "opening")
        if settings.role in roles.REAL and context.object.type == "MESH":
            stored = panorama.REST in context.object.data.attributes
            layout.label(
                text="Rest positions stored" if stored else "No rest positions", icon="PINNED" if stored else "UNPINNED"
            )


class RealLightPanel(bpy.types.Panel):
    """Whether a sun or a lamp belongs to the photographed place."""

    bl_idname = "LIGHTDEPTH_PT_real_light"
    bl_label = "lightdepth"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "data"

    @classmethod
    def poll(cls, context):
        """The object is a lamp of a kind that can be real."""
        item = context.object
        return item is not None and item.type == "LIGHT" and item.data.type in {"SUN", "POINT"}

    def draw(self, context):
        layout, settings = self.layout, context.object.lightdepth
        layout.use_property_split = True
        layout.prop(settings, "real_light")
        column = layout.column()
        column.active = settings.real_light
        if context.object.data.type == "POINT":
            column.prop(settings, "clipped_diameter")
            return
        column.prop(settings, "recover_mask")
        if not settings.recover_mask:
            column.prop(settings, "mask")
            if settings.mask:
                column.prop(settings, "mask_extent")


class _Rendering:
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    COMPAT_ENGINES: ClassVar = {ENGINE}

    @classmethod
    def poll(cls, context):
        """The engine is lightdepth."""
        return context.engine in cls.COMPAT_ENGINES


class RenderPanel(_Rendering, bpy.types.Panel):
    """Sampling."""

    bl_idname = "LIGHTDEPTH_PT_render"
    bl_label = "Sampling"
    bl_context = "render"

    def draw(self, context):
        layout, settings = self.layout, context.scene.lightdepth
        layout.use_property_split = True
        layout.prop(settings, "draft")
        column = layout.column()
        column.active = not settings.draft
        column.prop(settings, "samples")
        row = column.row(heading="Stop at Noise")
        row.prop(settings, "use_noise", text="")
        noise = row.column()
        noise.active = settings.use_noise
        noise.prop(settings, "noise", text="")
        layout.prop(settings, "max_bounces")
        layout.prop(settings, "seed")
        layout.prop(settings, "method")
        layout.prop(settings, "denoise")


class MotionBlurPanel(_Rendering, bpy.types.Panel):
    """Blender's motion blur, which its own panels show only for its own engines."""

    bl_idname = "LIGHTDEPTH_PT_motion_blur"
    bl_label = "Motion Blur"
    bl_context = "render"

    def draw_header(self, context):
        self.layout.prop(context.scene.render, "use_motion_blur", text="")

    def draw(self, context):
        layout, render = self.layout, context.scene.render
        layout.use_property_split = True
        layout.active = render.use_motion_blur and not context.scene.lightdepth.draft
        layout.prop(render, "motion_blur_position", text="Position")
        layout.prop(render, "motion_blur_shutter")


class ObjectMotionBlurPanel(_Rendering, bpy.types.Panel):
    """Which objects are blurred, and in how many steps: Cycles' settings."""

    bl_idname = "LIGHTDEPTH_PT_object_motion_blur"
    bl_label = "Motion Blur"
    bl_context = "object"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        """The object can be blurred, the engine is lightdepth."""
        item = context.object
        return (
            super().poll(context) and item is not None and item.type in export.WITH_SURFACE and hasattr(item, "cycles")
        )

    def draw_header(self, context):
        self.layout.prop(context.object.cycles, "use_motion_blur", text="")

    def draw(self, context):
        layout, settings = self.layout, context.object.cycles
        layout.use_property_split = True
        layout.active = context.scene.render.use_motion_blur and settings.use_motion_blur
        layout.prop(settings, "motion_steps", text="Steps")
        layout.prop(settings, "use_deform_motion", text="Deformation")


class LayerPanel(_Rendering, bpy.types.Panel):
    """Passes that are made where they are wanted; the others are always there."""

    bl_idname = "LIGHTDEPTH_PT_layer"
    bl_label = "Passes"
    bl_context = "view_layer"

    def draw(self, context):
        layout, layer = self.layout, context.view_layer
        layout.use_property_split, layout.use_property_decorate = True, False
        column = layout.column(heading="Indices", align=True)
        column.prop(layer, "use_pass_object_index", text="Object")
        column.prop(layer, "use_pass_material_index", text="Material")
        column = layout.column(heading="Cryptomatte", align=True)
        column.prop(layer, "use_pass_cryptomatte_object", text="Object")
        column.prop(layer, "use_pass_cryptomatte_material", text="Material")
        column.prop(layer, "use_pass_cryptomatte_asset", text="Asset")
        row = layout.row()
        row.active = any(getattr(layer, f"use_pass_cryptomatte_{setting}") for setting in MATTES.values())
        row.prop(layer, "pass_cryptomatte_depth", text="Levels")


class PanoramicLensPanel(_Rendering, bpy.types.Panel):
    """The panoramic lens, which Cycles' own panel shows only for Cycles."""

    bl_idname = "LIGHTDEPTH_PT_panoramic_lens"
    bl_label = "Panoramic Lens"
    bl_context = "data"

    @classmethod
    def poll(cls, context):
        """The data is a panoramic camera, the engine lightdepth."""
        return super().poll(context) and context.camera is not None and context.camera.type == "PANO"

    def draw(self, context):
        layout, camera = self.layout, context.camera
        settings = panoramic(camera)
        layout.use_property_split = True
        layout.prop(camera.lightdepth, "projection")
        if camera.lightdepth.projection in PROJECTIONS:
            if PROJECTIONS[camera.lightdepth.projection].two_eyes:
                layout.prop(camera.stereo, "interocular_distance")
            return
        layout.prop(settings, "panorama_type")
        if settings.panorama_type == "FISHEYE_EQUIDISTANT":
            layout.prop(settings, "fisheye_fov")
        elif settings.panorama_type == "FISHEYE_EQUISOLID":
            layout.prop(settings, "fisheye_lens")
            layout.prop(settings, "fisheye_fov")
            layout.prop(camera, "sensor_width")


class DistortionPanel(_Rendering, bpy.types.Panel):
    """What a perspective lens distorts."""

    bl_idname = "LIGHTDEPTH_PT_distortion"
    bl_label = "Lens Distortion"
    bl_context = "data"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        """The data is a perspective camera, the engine lightdepth."""
        return super().poll(context) and context.camera is not None and context.camera.type == "PERSP"

    def draw(self, context):
        layout, settings = self.layout, context.camera.lightdepth
        layout.use_property_split = True
        for index, name in enumerate(("k1", "k2")):
            layout.prop(settings, "distortion", index=index, text=name)


classes = (
    PanoramaPanel,
    CalibrationPanel,
    ImageCalibrationPanel,
    PlacePanel,
    LightPanel,
    ShootingPanel,
    ObjectPanel,
    RealLightPanel,
    RenderPanel,
    MotionBlurPanel,
    ObjectMotionBlurPanel,
    LayerPanel,
    PanoramicLensPanel,
    DistortionPanel,
)

_OTHERS = (
    "EEVEE_MATERIAL_PT_context_material",
    "EEVEE_MATERIAL_PT_surface",
    "DATA_PT_EEVEE_light",
    "DATA_PT_EEVEE_light_distance",
)
"""Blender's panels of materials and lamps, which are EEVEE's but serve as well here."""
_NOT_OURS = ("VIEWLAYER_PT_filter", "VIEWLAYER_PT_layer_passes", "RENDER_PT_freestyle")


def _blenders_panels():
    """Blender's own panels that are as useful for this engine."""
    for panel in bpy.types.Panel.__subclasses__():
        engines = getattr(panel, "COMPAT_ENGINES", None)
        useful = engines is not None and ("BLENDER_RENDER" in engines or panel.__name__ in _OTHERS)
        if useful and panel.__name__ not in _NOT_OURS:
            yield panel


def register() -> None:
    """Let Blender's own panels show for this engine."""
    for panel in _blenders_panels():
        panel.COMPAT_ENGINES.add(ENGINE)


def unregister() -> None:
    """Take them back."""
    for panel in bpy.types.Panel.__subclasses__():
        if panel not in classes and ENGINE in getattr(panel, "COMPAT_ENGINES", ()):
            panel.COMPAT_ENGINES.discard(ENGINE)

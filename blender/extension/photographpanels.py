"""The panels of further panoramas and of plates, in the viewport's sidebar and in the image editor's."""

from typing import ClassVar

import bpy

from . import cameras, matching, photographimport, photographs
from .panels import ImageSidebar, Sidebar, draw_texts


def _draw_gain(layout, settings) -> None:
    layout.prop(settings, "use_gain")
    row = layout.row()
    row.active = settings.use_gain
    row.prop(settings, "gain", text="")


def _draw_versions(layout, versions) -> None:
    layout.template_ID(versions, "retouched", open="image.open", text="Retouched")
    layout.template_ID(versions, "mask", open="image.open", text="Mask")


def _draw_clicks(layout, context, owner, index: int) -> None:
    row = layout.row(align=True)
    if is_in_image_editor(context):
        row.operator(matching.ClickSharedPoints.bl_idname, icon="RESTRICT_SELECT_OFF").index = index
    else:
        row.label(text="Click points in an image editor", icon="INFO")
    row.operator(matching.ClearClicks.bl_idname, text="", icon="X").index = index
    layout.label(text=f"{len(owner.points)} shared points")


def is_in_image_editor(context) -> bool:
    """Whether a panel is drawn where pictures are clicked."""
    return context.space_data is not None and context.space_data.type == "IMAGE_EDITOR"


def draw_panoramas(layout, context) -> None:
    """The further panoramas: their images, poses and how they are solved."""
    settings = context.scene.lightdepth
    layout.use_property_split = True
    layout.operator(photographimport.ImportPhotographs.bl_idname, icon="IMPORT")
    if settings.image is None:
        return
    _draw_versions(layout, settings.versions)
    if len(settings.further):
        layout.prop(settings, "shown")
    for index, entry in enumerate(settings.further):
        box = layout.box()
        row = box.row()
        row.label(text=f"Panorama {index + 2}", icon="WORLD")
        row.operator(photographs.RemovePanorama.bl_idname, text="", icon="X").index = index
        box.prop(entry, "image")
        box.prop(entry, "capture")
        box.prop(entry, "scale")
        _draw_gain(box, entry.versions)
        _draw_versions(box, entry.versions)
        _draw_clicks(box, context, entry, index)
        box.prop(entry, "snap")
        row = box.row(align=True)
        solve = row.operator(matching.RelatePanorama.bl_idname, icon="ORIENTATION_GIMBAL")
        solve.index, solve.by_features = index, False
        solve = row.operator(matching.RelatePanorama.bl_idname, text="By Features")
        solve.index, solve.by_features = index, True
        draw_texts(box, entry.report.splitlines(), context)
    layout.operator(photographs.AddPanorama.bl_idname, icon="ADD")


def draw_plate(layout, context) -> None:
    """The active camera's plate, and how the camera is solved."""
    layout.use_property_split = True
    layout.operator(photographs.LoadPlate.bl_idname, icon="FILE_FOLDER")
    camera = context.scene.camera
    if camera is None or camera.type != "CAMERA" or camera.data.type != "PERSP":
        layout.label(text="The scene needs an active camera in perspective", icon="INFO")
        return
    plate = camera.data.lightdepth.plate
    layout.prop(plate, "use")
    if cameras.plate_of(camera) is None:
        return
    _draw_gain(layout, plate)
    _draw_clicks(layout, context, plate, matching.PLATE)
    layout.label(text=f"{len(plate.lines)} edges along axes")
    if is_in_image_editor(context):
        row = layout.row(align=True)
        for axis in "XYZ":
            row.operator(matching.ClickAxisLine.bl_idname, text=f"Edge along {axis}").axis = axis
    layout.prop(plate, "solve_distortion")
    layout.operator(matching.SolvePlate.bl_idname, icon="ORIENTATION_GIMBAL")
    draw_texts(layout, plate.report.splitlines(), context)


class PhotographsPanel(Sidebar, bpy.types.Panel):
    """Further panoramas, in the viewport."""

    bl_idname = "LIGHTDEPTH_PT_photographs"
    bl_label = "More Photographs"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    def draw(self, context):
        draw_panoramas(self.layout, context)


class PlatePanel(Sidebar, bpy.types.Panel):
    """The plate, in the viewport."""

    bl_idname = "LIGHTDEPTH_PT_plate"
    bl_label = "Plate"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    def draw(self, context):
        draw_plate(self.layout, context)


class ImagePhotographsPanel(ImageSidebar, bpy.types.Panel):
    """Further panoramas, in the image editor."""

    bl_idname = "LIGHTDEPTH_PT_image_photographs"
    bl_label = "More Photographs"

    def draw(self, context):
        draw_panoramas(self.layout, context)


class ImagePlatePanel(ImageSidebar, bpy.types.Panel):
    """The plate, in the image editor."""

    bl_idname = "LIGHTDEPTH_PT_image_plate"
    bl_label = "Plate"

    def draw(self, context):
        draw_plate(self.layout, context)


classes = (PhotographsPanel, PlatePanel, ImagePhotographsPanel, ImagePlatePanel)

"""New cameras at the capture point: panorama, dome master, perspective."""

import math
from typing import ClassVar

import bpy
from mathutils import Matrix

from . import panorama
from .cameras import CAMERA_TURN, panoramic
from .picking import capture_pose

ITEMS = (
    ("PANORAMA", "Panorama", "The photograph's own view, in its size", "WORLD", 0),
    ("DOME", "Dome Master", "A fisheye of the upper half of the sphere, as high as the photograph", "MESH_UVSPHERE", 1),
    ("PERSPECTIVE", "Perspective", "An ordinary lens, 1920 x 1080", "CAMERA_DATA", 2),
)
PERSPECTIVE_SIZE = 1920, 1080


class AddCamera(bpy.types.Operator):
    """Add a camera at the capture point, and set the size of the rendered picture"""

    bl_idname = "lightdepth.add_camera"
    bl_label = "Add Camera"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    kind: bpy.props.EnumProperty(name="Kind", items=ITEMS)

    @classmethod
    def poll(cls, context):
        """There is a panorama with a capture point, in object mode."""
        return (
            context.scene.lightdepth.image is not None
            and panorama.has_capture_point(context.scene)
            and context.mode == "OBJECT"
        )

    @classmethod
    def description(cls, context, properties):
        """The kind's own description."""
        return next(item[2] for item in ITEMS if item[0] == properties.kind) + "; at the capture point"

    def execute(self, context):
        """Add the camera and make it the one that renders."""
        scene, settings = context.scene, context.scene.lightdepth
        name = next(item[1] for item in ITEMS if item[0] == self.kind)
        camera = bpy.data.cameras.new(name)
        camera.type = "PERSP" if self.kind == "PERSPECTIVE" else "PANO"
        item = bpy.data.objects.new(name, camera)
        context.collection.objects.link(item)
        pose = capture_pose(settings)
        # The panorama's view is as crooked as the photograph; the others are level and look the same way.
        level = Matrix.LocRotScale(pose.translation, Matrix.Rotation(pose.to_euler("XYZ").z, 3, "Z"), None)
        width, height = settings.image.size
        if self.kind == "PANORAMA":
            panoramic(camera).panorama_type = "EQUIRECTANGULAR"
            toward, size = pose, (width, height)
        elif self.kind == "DOME":
            panoramic(camera).panorama_type, panoramic(camera).fisheye_fov = "FISHEYE_EQUIDISTANT", math.pi
            toward, size = level @ Matrix.Rotation(math.pi / 2, 4, "X"), (height, height)
        else:
            toward, size = level, PERSPECTIVE_SIZE
        item.matrix_world = toward @ CAMERA_TURN.transposed().to_4x4()
        render = scene.render
        render.resolution_x, render.resolution_y = size
        render.pixel_aspect_x = render.pixel_aspect_y = 1.0
        scene.camera = item
        return {"FINISHED"}


classes = (AddCamera,)

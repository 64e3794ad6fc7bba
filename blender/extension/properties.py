"""What a .blend file keeps: the settings of scenes and of objects."""

import math

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from . import panorama, pictures, roles
from .cameras import PROJECTIONS

METHODS = (
    ("difference", "Difference", "Only what the new objects change is sampled; the photograph stays noise-free"),
    ("envpath", "Envpath", "The paper's path tracer, which renders the photograph again"),
    ("directional", "Directional", "The panorama as light from infinitely far away, for comparison"),
)
KNOWN_LENGTHS = (
    ("WIDTH", "Width", "Length of the rectangle's first side, from the first corner to the second"),
    ("LENGTH", "Length", "Length of the rectangle's second side, from the second corner to the third"),
    ("CAMERA", "Camera Height", "Height of the capture point above the floor"),
)


class Line(bpy.types.PropertyGroup):
    """One line of text that a panel shows."""

    text: StringProperty()


class FloorCorner(bpy.types.PropertyGroup):
    """A corner on the floor plane."""

    position: FloatVectorProperty(name="Position", size=2, subtype="XYZ", unit="LENGTH")


class PanoramaPoint(bpy.types.PropertyGroup):
    """A place on the panorama, each coordinate in [0, 1] from the upper left corner."""

    u: FloatProperty(name="u", min=0.0, max=1.0)
    v: FloatProperty(name="v", min=0.0, max=1.0)


class SceneSettings(bpy.types.PropertyGroup):
    """The place and how it is rendered."""

    image: PointerProperty(
        name="Panorama",
        description="Equirectangular HDR image, twice as wide as high",
        type=bpy.types.Image,
        update=lambda self, context: panorama.rebuild(self.id_data),
    )
    capture: PointerProperty(
        name="Capture Point",
        description="Empty at the position from which the panorama was taken, rotated like the camera",
        type=bpy.types.Object,
        poll=lambda self, item: item.type == "EMPTY",
        update=lambda self, context: panorama.rebuild(self.id_data),
    )
    shown_image: PointerProperty(type=bpy.types.Image, description="The panorama that the world shows")
    world: PointerProperty(type=bpy.types.World, description="The world that shows the panorama")
    world_before: PointerProperty(type=bpy.types.World, description="The world that the scene had before")
    projection: PointerProperty(type=bpy.types.Material, description="Shows the panorama on surfaces")
    projection_at_rest: PointerProperty(
        type=bpy.types.Material, description="Shows the panorama on surfaces with rest positions"
    )
    scale: FloatProperty(
        name="Radiance",
        description="Factor on the panorama's radiance",
        default=1.0,
        min=0.0,
        soft_max=10.0,
        update=lambda self, context: panorama.rebuild(self.id_data),
    )
    versions: PointerProperty(type=pictures.Versions)
    further: CollectionProperty(type=pictures.FurtherPanorama, description="Further panoramas of the place")
    shown: IntProperty(
        name="Shown",
        description="The panorama that the viewport shows; 0 is the first",
        min=0,
        update=lambda self, context: panorama.rebuild(self.id_data),
    )
    sky: BoolProperty(
        name="Open to the Sky",
        description="What no modelled surface covers is sky; otherwise it is a hole, which is not rendered",
    )

    corners: CollectionProperty(
        type=PanoramaPoint, description="Corners of a rectangle on the floor, counter-clockwise"
    )
    known: EnumProperty(
        name="Known", description="What was measured in the real place", items=KNOWN_LENGTHS, default="CAMERA"
    )
    known_length: FloatProperty(
        name="Length", description="Its length", default=1.6, min=0.001, soft_max=20.0, unit="LENGTH"
    )
    residual: FloatProperty(
        name="Residual", description="Error of the solved pose, degrees; -1: not solved", default=-1.0
    )
    calibration_notes: CollectionProperty(type=Line)

    coverage: FloatProperty(
        description="Share of directions that hit something or are sky; -1: not checked", default=-1.0
    )
    check_notes: CollectionProperty(type=Line)
    light_notes: CollectionProperty(type=Line)
    export_notes: CollectionProperty(type=Line)

    samples: IntProperty(name="Samples", description="Samples per pixel", default=64, min=1, soft_max=4096)
    use_noise: BoolProperty(name="Stop at Noise", description="Stop as soon as the picture is clean enough")
    noise: FloatProperty(
        name="Noise", description="Estimated relative error to stop at", default=0.02, min=0.0001, max=1.0, precision=4
    )
    max_bounces: IntProperty(
        name="Max Bounces",
        description="Maximum number of times that light is scattered; glass needs many",
        default=8,
        min=1,
        soft_max=64,
    )
    seed: IntProperty(name="Seed", description="The same seed gives the same noise", default=0, min=0)
    method: EnumProperty(name="Method", description="How light is computed", items=METHODS, default="difference")
    draft: BoolProperty(
        name="Draft",
        description="A quick look without passes: one noisy sample for each pixel, shadows of roughly the right strength",
    )
    denoise: BoolProperty(name="Denoise", description="Denoise the change and the new objects; never the photograph")


class OwnSlot(bpy.types.PropertyGroup):
    """A material slot as it was before it showed the panorama."""

    by_object: BoolProperty(description="Whether its material was linked to the object and not to the data")
    material: PointerProperty(type=bpy.types.Material)


class ObjectSettings(bpy.types.PropertyGroup):
    """What an object stands for."""

    role: EnumProperty(
        name="Role",
        description="Role of this object",
        items=roles.ITEMS,
        default=roles.SYNTHETIC,
        update=lambda self, context: roles.show_role(self.id_data),
    )
    own_slots: CollectionProperty(type=OwnSlot, description="The slots while they show the panorama")
    use_gloss: BoolProperty(name="Gloss", description="The real surface also mirrors the new objects")
    roughness: FloatProperty(
        name="Roughness",
        description="0 mirrors sharply, 1 hardly at all",
        default=0.2,
        min=0.0,
        max=1.0,
        subtype="FACTOR",
    )
    specular: FloatProperty(
        name="Specular", description="0.5 mirrors 4 %", default=0.5, min=0.0, max=1.0, subtype="FACTOR"
    )
    removed: BoolProperty(
        name="Removed", description="It is in the photograph and is removed from the picture, with its light and shadow"
    )
    opening: BoolProperty(
        name="Opening",
        description="A window pane: a real sun shines in through it; it looks as the photograph shows it",
    )
    real_light: BoolProperty(
        name="Real",
        description="A sun: it shines into the photographed place, and its patch is in the photograph. A point lamp: it is "
        "in the photograph where the capture point sees it, which clipped it; its strength is what it really sends",
    )
    clipped_diameter: FloatProperty(
        name="Diameter",
        description="Of a disc around its middle, from the capture point, that is as bright as it; 0 for all that clipped "
        "there and is joined",
        min=0.0,
        max=math.radians(30.0),
        subtype="ANGLE",
    )
    recover_mask: BoolProperty(
        name="Mask from Its Patch",
        description="Recover from its patch in the photograph how bars, curtains and trees block this sun",
    )
    mask: StringProperty(
        name="Mask",
        description="Image of the share of sunlight that passes what is not modelled, such as bars, curtains and trees",
        subtype="FILE_PATH",
    )
    mask_extent: FloatVectorProperty(
        name="Extent", description="Left, bottom, right and top of the mask across the sun's direction, metres", size=4
    )
    mask_direction: FloatVectorProperty(description="Toward the sun for which the mask was made", size=3)


class CameraSettings(bpy.types.PropertyGroup):
    """What a camera is to the renderer beyond Blender's own settings."""

    plate: PointerProperty(type=pictures.Plate)

    projection: EnumProperty(
        name="Projection",
        description="Panoramic projections that Blender's own lenses lack",
        items=(
            ("CAMERA", "As Panorama Type", "The lens that Blender has"),
            *((name, each.label, each.description) for name, each in PROJECTIONS.items()),
        ),
    )
    distortion: FloatVectorProperty(
        name="Distortion",
        description="Radial distortion k1 and k2 of a perspective lens, as defined by motion tracking and OpenCV",
        size=2,
        precision=4,
        step=1,
    )


def show_lines(collection, lines) -> None:
    """Replace the lines that a panel shows.

    Args:
        collection: a collection property of :class:`Line`.
        lines: the texts.
    """
    collection.clear()
    for line in lines:
        collection.add().text = line


classes = (
    *pictures.classes,
    Line,
    FloorCorner,
    PanoramaPoint,
    SceneSettings,
    OwnSlot,
    ObjectSettings,
    CameraSettings,
)


def register() -> None:
    """Attach the settings to Blender's scenes, objects and cameras."""
    bpy.types.Camera.lightdepth = PointerProperty(type=CameraSettings)
    bpy.types.Scene.lightdepth = PointerProperty(type=SceneSettings)
    bpy.types.Object.lightdepth = PointerProperty(type=ObjectSettings)


def unregister() -> None:
    """Detach the settings."""
    del bpy.types.Camera.lightdepth
    del bpy.types.Scene.lightdepth
    del bpy.types.Object.lightdepth

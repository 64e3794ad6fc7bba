"""What a .blend file keeps of further panoramas and of plates."""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    PointerProperty,
    StringProperty,
)

from . import panorama

AXES = (
    ("X", "X", "The edge is parallel to the world's x axis"),
    ("Y", "Y", "The edge is parallel to the world's y axis"),
    ("Z", "Z", "The edge is plumb"),
)


def _rebuild(self, _context) -> None:
    panorama.rebuild(self.id_data)


class SharedPoint(bpy.types.PropertyGroup):
    """A point that two pictures show, in shares of their sizes from the upper left corner."""

    first: FloatVectorProperty(name="First Panorama", size=2, min=0.0, max=1.0, precision=5)
    other: FloatVectorProperty(name="Other Picture", size=2, min=0.0, max=1.0, precision=5)


class AxisLine(bpy.types.PropertyGroup):
    """An edge of a plate that is parallel to an axis, in shares of the picture's size."""

    axis: EnumProperty(name="Axis", items=AXES)
    start: FloatVectorProperty(name="Start", description="End toward minus", size=2, min=0.0, max=1.0, precision=5)
    end: FloatVectorProperty(name="End", description="End toward plus", size=2, min=0.0, max=1.0, precision=5)


class _Gain:
    use_gain: BoolProperty(name="Give Gain", description="Otherwise the gain is solved from surfaces that both show")
    gain: FloatVectorProperty(
        name="Gain",
        description="Of exposure and white balance, for each channel",
        size=3,
        default=(1.0, 1.0, 1.0),
        min=1e-6,
        soft_max=10.0,
        precision=4,
    )


class Versions(_Gain, bpy.types.PropertyGroup):
    """What a panorama has beside its image."""

    retouched: PointerProperty(
        name="Retouched",
        description="Retouched version, used as the picture but not as the light",
        type=bpy.types.Image,
    )
    mask: PointerProperty(
        name="Mask", description="White where the panorama counts, black where it does not", type=bpy.types.Image
    )


class FurtherPanorama(bpy.types.PropertyGroup):
    """A further panorama of the place."""

    image: PointerProperty(
        name="Panorama",
        description="Equirectangular HDR image of the same place, twice as wide as high",
        type=bpy.types.Image,
        update=_rebuild,
    )
    capture: PointerProperty(
        name="Capture Point",
        description="Empty at the position from which this panorama was taken, rotated like the camera",
        type=bpy.types.Object,
        poll=lambda self, item: item.type == "EMPTY",
        update=_rebuild,
    )
    scale: FloatProperty(name="Radiance", description="Factor on the panorama's radiance", default=1.0, min=0.0)
    versions: PointerProperty(type=Versions)
    points: CollectionProperty(type=SharedPoint, description="Clicked points that the first panorama shows too")
    snap: BoolProperty(
        name="Snap Clicks",
        description="Move each click on this panorama to where it shows what the first one shows around its click",
    )
    report: StringProperty(description="Lines of the report on its pose")


class Plate(_Gain, bpy.types.PropertyGroup):
    """Whether a camera's background image is its plate, and what was clicked on it."""

    use: BoolProperty(
        name="Background Image Is the Plate",
        description="The camera's background image is its picture; the panoramas stay the light",
    )
    points: CollectionProperty(type=SharedPoint, description="Clicked points that the first panorama shows too")
    lines: CollectionProperty(type=AxisLine)
    solve_distortion: BoolProperty(
        name="Solve Distortion", description="k1 and k2 as well; needs points all over the picture"
    )
    report: StringProperty(description="Lines of the report on the camera")


classes = (SharedPoint, AxisLine, Versions, FurtherPanorama, Plate)

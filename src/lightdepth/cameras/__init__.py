"""The cameras. A new one is a file in this folder and a line in ``CameraSettings``."""

from typing import Annotated

from pydantic import Field

from lightdepth.cameras.camera import Camera
from lightdepth.cameras.cubemap import Cubemap
from lightdepth.cameras.equirectangular import Equirectangular
from lightdepth.cameras.fisheye import Fisheye
from lightdepth.cameras.omnidirectional_stereo import OmnidirectionalStereo
from lightdepth.cameras.perspective import Perspective
from lightdepth.cameras.topology import Topology
from lightdepth.cameras.viewpoint import Viewpoint

CameraSettings = Annotated[
    Equirectangular | Fisheye | Perspective | OmnidirectionalStereo | Cubemap, Field(discriminator="type")
]

__all__ = [
    "Camera",
    "CameraSettings",
    "Cubemap",
    "Equirectangular",
    "Fisheye",
    "OmnidirectionalStereo",
    "Perspective",
    "Topology",
    "Viewpoint",
]

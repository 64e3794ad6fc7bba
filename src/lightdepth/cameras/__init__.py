"""The cameras. A new one is a file in this folder and a line in ``CameraSettings``."""

from typing import Annotated

from pydantic import Field

from lightdepth.cameras.camera import Camera
from lightdepth.cameras.cubemap import Cubemap
from lightdepth.cameras.dome_master import DomeMaster
from lightdepth.cameras.dome_stereo import DomeStereo
from lightdepth.cameras.eac import EquiAngularCubemap
from lightdepth.cameras.equirectangular import Equirectangular
from lightdepth.cameras.fisheye import Fisheye
from lightdepth.cameras.omnidirectional_stereo import OmnidirectionalStereo
from lightdepth.cameras.perspective import Perspective
from lightdepth.cameras.stereo_perspective import StereoPerspective
from lightdepth.cameras.topology import Topology
from lightdepth.cameras.viewpoint import Viewpoint
from lightdepth.cameras.vr180 import VR180

CameraSettings = Annotated[
    Equirectangular
    | Fisheye
    | Perspective
    | OmnidirectionalStereo
    | Cubemap
    | DomeMaster
    | DomeStereo
    | VR180
    | EquiAngularCubemap
    | StereoPerspective,
    Field(discriminator="type"),
]

__all__ = [
    "VR180",
    "Camera",
    "CameraSettings",
    "Cubemap",
    "DomeMaster",
    "DomeStereo",
    "EquiAngularCubemap",
    "Equirectangular",
    "Fisheye",
    "OmnidirectionalStereo",
    "Perspective",
    "StereoPerspective",
    "Topology",
    "Viewpoint",
]

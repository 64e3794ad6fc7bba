"""lightdepth in Blender: the panorama becomes a place, objects are put in, F12 renders.

The renderer itself is a separate program, which this extension runs and imports nothing of.
"""

import bpy

from . import (
    calibration,
    cameraimport,
    checking,
    engine,
    evaluation,
    export,
    matching,
    meshfolder,
    modelling,
    panels,
    panorama,
    photographimport,
    photographpanels,
    photographs,
    preferences,
    process,
    properties,
    reallights,
    rest,
    roles,
    viewpoints,
    viewport,
)

_MODULES = (
    properties,
    preferences,
    panorama,
    roles,
    rest,
    calibration,
    modelling,
    viewpoints,
    export,
    checking,
    reallights,
    cameraimport,
    photographs,
    photographimport,
    matching,
    engine,
    panels,
    photographpanels,
)


def register() -> None:
    """Add everything to Blender."""
    for module in _MODULES:
        for item in module.classes:
            bpy.utils.register_class(item)
    properties.register()
    evaluation.register()
    viewport.register()
    panels.register()


def unregister() -> None:
    """Take everything out of Blender, and end what still renders."""
    viewport.unregister()
    process.end_all()
    meshfolder.remove()
    panels.unregister()
    evaluation.unregister()
    properties.unregister()
    for module in reversed(_MODULES):
        for item in reversed(module.classes):
            bpy.utils.unregister_class(item)

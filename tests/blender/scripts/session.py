"""What every script in Blender begins with: the extension switched on, an empty scene, and a way to answer."""

import json
import os
import sys

import bpy

MODULE = "bl_ext.user_default.lightdepth"


def begin():
    """Switch the extension on, empty the scene, and return its scene."""
    bpy.ops.preferences.addon_enable(module=MODULE)
    bpy.context.preferences.addons[MODULE].preferences.command = os.environ["LIGHTDEPTH_RENDERER"]
    for item in list(bpy.data.objects):
        bpy.data.objects.remove(item)
    return bpy.context.scene


def module(name):
    """One of the extension's modules."""
    return sys.modules[f"{MODULE}.{name}"]


def answer(**found):
    """Tell the test what was found."""
    print("ANSWER " + json.dumps(found), flush=True)


def corners(*points):
    """Clicked floor corners, as an operator takes them."""
    return [{"name": "", "position": point} for point in points]


def refused(operator, **arguments):
    """Call an operator that must refuse; returns what it says."""
    try:
        operator(**arguments)
    except RuntimeError as error:
        return str(error).strip()
    return ""


def pose_from_corners(settings, width):
    """Solve the pose from the clicked corners and the rectangle's width; returns what follows from it."""
    settings.known, settings.known_length = "WIDTH", width
    bpy.ops.lightdepth.calibrate()
    return pose(settings)


def pose(settings):
    """The clicked corners, where the capture point stands, and the residual."""
    bpy.context.view_layer.update()
    return {
        "corners": [[corner.u, corner.v] for corner in settings.corners],
        "matrix": [list(row) for row in settings.capture.matrix_world],
        "residual": settings.residual,
    }


def write_program(path, text):
    """Write a shell script that stands in for the renderer; returns its path as text."""
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)
    return str(path)


def write_panorama(path, height=32, pixels=None):
    """Write a smooth panorama (or given pixels, first row at the top) as OpenEXR; returns its pixels."""
    import numpy as np

    width = 2 * height
    if pixels is None:
        u, v = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
        around = 2 * np.pi * u
        red, green = 0.5 + 0.4 * np.sin(around), 0.5 + 0.4 * np.cos(around) * np.sin(np.pi * v)
        pixels = np.stack([red, green, 1.0 - 0.5 * v, np.ones_like(u)], -1).astype(np.float32)
    image = bpy.data.images.new("made", width, height, float_buffer=True)
    image.pixels.foreach_set(np.ascontiguousarray(pixels[::-1]).ravel())
    scene = bpy.data.scenes.new("writing")
    as_exr(scene, path)
    image.save_render(str(path), scene=scene)  # Image.save() of some versions encodes the colours
    bpy.data.scenes.remove(scene)
    bpy.data.images.remove(image)
    return pixels


def room(folder, height=2.5):
    """A panorama and a room around its capture point, as a person would click them."""
    write_panorama(f"{folder}/panorama.exr")
    bpy.ops.lightdepth.load_panorama(filepath=f"{folder}/panorama.exr")
    bpy.ops.lightdepth.add_room(corners=corners((-2, -2), (2, -2), (2, 3), (-2, 3)), height=height)


def add_camera(scene, resolution=(64, 48), location=(0.0, 0.0, 1.6), rotation=(1.2, 0.0, 0.0)):
    """A camera, made the active one."""
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = location, rotation
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.resolution_x, scene.render.resolution_y = resolution
    scene.render.resolution_percentage = 100
    return camera


def add_lamp(scene, kind="AREA", name="Lamp", location=(0.0, 1.0, 1.5), **settings):
    """A lamp."""
    light = bpy.data.lights.new(name, kind)
    for key, value in settings.items():
        setattr(light, key, value)
    lamp = bpy.data.objects.new(name, light)
    lamp.location = location
    scene.collection.objects.link(lamp)
    return lamp


def as_exr(scene, path, multilayer=False):
    """Let Blender write its renderings as 32-bit OpenEXR."""
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE" if multilayer else "IMAGE"
    settings.file_format = "OPEN_EXR_MULTILAYER" if multilayer else "OPEN_EXR"
    settings.color_depth = "32"
    scene.render.filepath = str(path)


def cycles(scene, samples=1):
    """Let Blender's own path tracer render, without filters and view transforms."""
    scene.render.engine = "CYCLES"
    scene.view_settings.view_transform = "Raw"
    scene.cycles.samples, scene.cycles.use_denoising = samples, False
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BOX", 0.01


def rendered(scene, path):
    """Render and read the picture, shape (height, width, 4), first row at the top."""
    import numpy as np

    as_exr(scene, path)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(path), check_existing=False)
    width, height = image.size
    pixels = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    return pixels.reshape(height, width, 4)[::-1]

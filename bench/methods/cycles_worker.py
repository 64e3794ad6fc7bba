"""Blender Cycles in its two common workflows. Runs in the peers' own environment: ``python cycles_worker.py JOB.json``.

``catcher``: the panorama as world light, the ground as shadow catcher; the catcher pass multiplies the plate, the objects
are laid over it. ``proxy``: the place as emissive geometry with the panorama projected onto it, the ground reflecting,
rendered with and without the objects; the difference is added to the plate.

Imports nothing of lightdepth or of the benchmark: it runs under another Python with other packages.
"""

from __future__ import annotations

import json
import math
import sys
import tempfile
import time
from pathlib import Path

import bpy
import numpy as np
from mathutils import Euler, Matrix

job_path = Path(sys.argv[1])
job = json.loads(job_path.read_text())
arrays = np.load(job_path.with_suffix(".npz"))
folder = Path(tempfile.mkdtemp())


def new_material(name):
    """An empty node material with its output."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    return material, nodes, material.node_tree.links, nodes.new("ShaderNodeOutputMaterial")


def object_material(settings):
    """Matte, polished or glowing."""
    material, nodes, links, output = new_material("object")
    if settings["type"] == "Matte":
        shader = nodes.new("ShaderNodeBsdfDiffuse")
        shader.inputs["Color"].default_value = (*settings["color"], 1.0)
        shader.inputs["Roughness"].default_value = 0.0
    elif settings["type"] == "Polished":
        shader = nodes.new("ShaderNodeBsdfAnisotropic")  # "Glossy BSDF" in the interface.
        shader.distribution = "GGX"
        shader.inputs["Color"].default_value = (*settings["color"], 1.0)
        shader.inputs["Roughness"].default_value = settings["roughness"]
    else:
        shader = nodes.new("ShaderNodeEmission")
        shader.inputs["Color"].default_value = (*settings["radiance"], 1.0)
    links.new(shader.outputs[0], output.inputs["Surface"])
    return material


def matte(color):
    """Lambertian."""
    return object_material({"type": "Matte", "color": color})


def environment_lookup(nodes, links, vector, panorama):
    """Texture node with the panorama's radiance in a world direction."""
    mapping = nodes.new("ShaderNodeMapping")
    mapping.vector_type = "POINT"
    # Blender's centre column looks along +x, lightdepth's along +y of light space.
    light_from_world = (
        Euler([math.radians(angle) for angle in job["capture"]["rotation"]], "XYZ").to_matrix().inverted()
    )
    turned = Matrix.Rotation(math.radians(-90.0), 3, "Z") @ light_from_world
    mapping.inputs["Rotation"].default_value = turned.to_euler("XYZ")
    texture = nodes.new("ShaderNodeTexEnvironment")
    texture.image = panorama
    links.new(vector, mapping.inputs["Vector"])
    links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
    return texture


def projecting_material(panorama):
    """Emission of what the capture point sees in the direction of each shaded point."""
    material, nodes, links, output = new_material("proxy")
    geometry = nodes.new("ShaderNodeNewGeometry")
    subtract = nodes.new("ShaderNodeVectorMath")
    subtract.operation = "SUBTRACT"
    subtract.inputs[1].default_value = job["capture"]["position"]
    links.new(geometry.outputs["Position"], subtract.inputs[0])
    texture = environment_lookup(nodes, links, subtract.outputs[0], panorama)
    emission = nodes.new("ShaderNodeEmission")
    links.new(texture.outputs["Color"], emission.inputs["Color"])
    links.new(emission.outputs[0], output.inputs["Surface"])
    return material


def glowing_material(radiance):
    """Emission that is sampled as a light from its front."""
    material, nodes, links, output = new_material("lamp")
    emission = nodes.new("ShaderNodeEmission")
    emission.inputs["Color"].default_value = (*radiance, 1.0)
    links.new(emission.outputs[0], output.inputs["Surface"])
    material.cycles.emission_sampling = "FRONT"
    return material


def add_mesh(name, vertices, faces, material):
    """A mesh object in the scene."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices.tolist(), [], faces.tolist())
    mesh.materials.append(material)
    thing = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(thing)
    return thing


def add_objects():
    """The synthetic objects."""
    added = []
    for index, item in enumerate(job["objects"]):
        material = object_material(item["material"])
        if item["kind"] == "sphere":
            bpy.ops.mesh.primitive_uv_sphere_add(segments=192, ring_count=96, radius=1.0)
            thing = bpy.context.object
            thing.matrix_world = Matrix(item["to_world"])
            for polygon in thing.data.polygons:
                polygon.use_smooth = True
            thing.data.materials.append(material)
        else:
            thing = add_mesh(
                f"object {index}", arrays[f"object_{index}_vertices"], arrays[f"object_{index}_faces"], material
            )
        added.append(thing)
    return added


def set_up(workflow):
    """A fresh scene; returns the synthetic objects."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.threads_mode = "FIXED"
    scene.render.threads = job["threads"]
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.use_adaptive_sampling = False
    cycles.pixel_filter_type = "BOX"
    cycles.filter_width = 1.0
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    cycles.blur_glossy = 0.0
    cycles.caustics_reflective = cycles.caustics_refractive = True
    cycles.use_light_tree = True
    cycles.denoiser = "OPENIMAGEDENOISE"
    for kind in ("max_bounces", "diffuse_bounces", "glossy_bounces", "transmission_bounces"):
        setattr(cycles, kind, job["max_bounces"])
    panorama = bpy.data.images.load(str(job_path.parent / job["panorama"]))
    projected = bpy.data.images.load(str(job_path.parent / job["panorama_without_lamps"]))
    panorama.colorspace_settings.name = projected.colorspace_settings.name = "Linear Rec.709"

    world = bpy.data.worlds.new("world")
    scene.world = world
    world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    coordinates = nodes.new("ShaderNodeTexCoord")
    texture = environment_lookup(nodes, links, coordinates.outputs["Generated"], panorama)
    links.new(texture.outputs["Color"], nodes["Background"].inputs["Color"])
    world.cycles.sampling_method = "MANUAL"
    world.cycles.sample_map_resolution = 2 * panorama.size[0]

    for index, part in enumerate(job["real"]):
        vertices, faces = arrays[f"real_{index}_vertices"], arrays[f"real_{index}_faces"]
        if workflow == "catcher":
            if part["ground"]:
                add_mesh(part["name"], vertices, faces, matte(part["color"])).is_shadow_catcher = True
        elif part["ground"]:
            add_mesh(part["name"], vertices, faces, matte(part["color"]))
        elif part["radiance"] is not None:
            add_mesh(part["name"], vertices, faces, glowing_material(part["radiance"]))
        else:
            add_mesh(part["name"], vertices, faces, projecting_material(projected))

    settings = job["camera"]
    data = bpy.data.cameras.new("camera")
    camera = bpy.data.objects.new("camera", data)
    scene.collection.objects.link(camera)
    scene.camera = camera
    rotation = np.asarray(settings["rotation"])
    pose = np.eye(4)
    # Columns right, up and backward of Blender's camera from right, forward and up of lightdepth's.
    pose[:3, 0], pose[:3, 1], pose[:3, 2] = rotation[:, 0], rotation[:, 2], -rotation[:, 1]
    pose[:3, 3] = settings["position"]
    camera.matrix_world = Matrix(pose.tolist())
    data.clip_start = 0.01
    if settings["type"] == "equirectangular":
        data.type = "PANO"
        data.panorama_type = "EQUIRECTANGULAR"
    else:
        data.sensor_fit = "HORIZONTAL"
        data.angle_x = math.radians(settings["fov"])
    scene.render.resolution_x, scene.render.resolution_y = settings["width"], settings["height"]
    scene.render.resolution_percentage = 100
    scene.render.image_settings.file_format = "OPEN_EXR_MULTILAYER"
    scene.render.image_settings.color_depth = "32"
    scene.render.film_transparent = True
    bpy.context.view_layer.cycles.use_pass_shadow_catcher = workflow == "catcher"
    return add_objects()


def render(name):
    """Render; returns channels by name and seconds."""
    scene = bpy.context.scene
    scene.render.filepath = str(folder / name)
    began = time.perf_counter()
    bpy.ops.render.render(write_still=True)
    seconds = time.perf_counter() - began
    import OpenEXR

    with OpenEXR.File(str(folder / f"{name}.exr"), separate_channels=True) as file:
        channels = {
            key.split(".", 1)[1]: channel.pixels for part in file.parts for key, channel in part.channels.items()
        }
    return channels, seconds


def color(channels, layer):
    """R, G and B of a pass."""
    return np.stack([channels[f"{layer}.{letter}"] for letter in "RGB"], axis=-1).astype(np.float64)


def run(settings):
    """One entry of the job's renders: composite and seconds."""
    scene = bpy.context.scene
    scene.cycles.samples = settings["samples"]
    scene.cycles.seed = settings["seed"]
    scene.cycles.use_denoising = settings["denoise"]
    plate = arrays["plate"]
    with_objects, seconds = render("with")
    alpha = with_objects["Combined.A"].astype(np.float64)[..., None]
    if settings["workflow"] == "catcher":
        image = plate * color(with_objects, "Shadow Catcher") * (1.0 - alpha) + color(with_objects, "Combined")
        return image, seconds
    for thing in objects:
        thing.hide_render = True
    without, more = render("without")
    for thing in objects:
        thing.hide_render = False
    coverage = arrays["coverage"][..., None]
    lit = color(with_objects, "Combined")
    return plate + (lit - color(without, "Combined")) + coverage * (color(without, "Combined") - plate), seconds + more


current, objects = None, []
for settings in job["renders"]:
    if settings["workflow"] != current:
        current = settings["workflow"]
        objects = set_up(current)
        run({**settings, "samples": 1})  # Loads kernels, textures and the denoiser: what is timed is warm.
    image, seconds = run(settings)
    np.savez(settings["out"], image=image.astype(np.float32), seconds=seconds)

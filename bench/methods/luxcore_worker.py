"""LuxCore with the panorama as environment light and a shadow catcher: ``python luxcore_worker.py JOB.json``.

The ground is the catcher; the result's alpha lays objects and shadows over the plate. Imports nothing of lightdepth or
of the benchmark: it runs under another Python with other packages.
"""

from __future__ import annotations

import json
import os
import sys
import time
from pathlib import Path

import numpy as np
import pyluxcore

SEED_STEP = 1024
"""Between the engine's seeds: each of its threads takes the next number, and no two images may share one."""

job_path = Path(sys.argv[1])
job = json.loads(job_path.read_text())
arrays = np.load(job_path.with_suffix(".npz"))


def sphere(to_world, rings=96, segments=192):
    """A unit sphere's triangles and normals under a transform."""
    theta = np.linspace(0.0, np.pi, rings + 1)[:, None]
    phi = np.linspace(0.0, 2.0 * np.pi, segments + 1)[None, :]
    points = np.stack(
        [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta) + 0.0 * phi], axis=-1
    ).reshape(-1, 3)
    row, column = np.meshgrid(np.arange(rings), np.arange(segments), indexing="ij")
    a = (row * (segments + 1) + column).ravel()
    b = a + segments + 1
    faces = np.concatenate([np.stack([a, b, b + 1], 1), np.stack([a, b + 1, a + 1], 1)])
    matrix = np.asarray(to_world)
    return points @ matrix[:3, :3].T + matrix[:3, 3], faces, points


def numbers(values):
    """A property's list of numbers."""
    return [float(value) for value in values]


def add_mesh(scene, properties, name, vertices, faces, material, normals=None):
    """Define a mesh and the object that shows it."""
    as_tuples = [tuple(map(float, row)) for row in vertices]
    normal_tuples = None if normals is None else [tuple(map(float, row)) for row in normals]
    scene.DefineMesh(
        f"mesh_{name}", as_tuples, [tuple(map(int, row)) for row in faces], normal_tuples, None, None, None
    )
    properties.Set(pyluxcore.Property(f"scene.objects.{name}.shape", f"mesh_{name}"))
    properties.Set(pyluxcore.Property(f"scene.objects.{name}.material", material))


def build():
    """The scene: panorama, ground as catcher, objects, camera."""
    scene = pyluxcore.Scene()
    properties = pyluxcore.Properties()

    def put(key, value):
        properties.Set(pyluxcore.Property(key, value))

    settings = job["camera"]
    rotation, position = np.asarray(settings["rotation"]), np.asarray(settings["position"])
    put("scene.camera.type", "environment" if settings["type"] == "equirectangular" else "perspective")
    put("scene.camera.lookat.orig", numbers(position))
    put("scene.camera.lookat.target", numbers(position + rotation[:, 1]))
    put("scene.camera.up", numbers(rotation[:, 2]))
    put("scene.camera.autofocus.enable", False)
    if settings["type"] != "equirectangular":
        put("scene.camera.fieldofview", settings["fov"])  # Like ours, that of the width.

    # LuxCore's columns start at +x and grow toward +y; lightdepth's centre is +y and they grow toward +x: a mirror.
    put("scene.lights.sky.type", "infinite")
    put("scene.lights.sky.file", str(job_path.parent / job["panorama"]))
    put("scene.lights.sky.gamma", 1.0)
    angle = np.radians(job["capture"]["rotation"][2])
    cos, sin = np.cos(angle), np.sin(angle)
    put("scene.lights.sky.transformation", numbers([sin, -cos, 0, 0, -cos, -sin, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]))

    for index, part in enumerate(job["real"]):
        if part["ground"]:
            put("scene.materials.ground.type", "matte")
            put("scene.materials.ground.kd", numbers(part["color"]))
            put("scene.materials.ground.shadowcatcher.enable", True)
            scene.Parse(properties)
            vertices, faces = arrays[f"real_{index}_vertices"], arrays[f"real_{index}_faces"]
            add_mesh(scene, properties, "ground", vertices, faces, "ground")
    for index, item in enumerate(job["objects"]):
        material, name = item["material"], f"object_{index}"
        if material["type"] == "Matte":
            put(f"scene.materials.{name}.type", "matte")
            put(f"scene.materials.{name}.kd", numbers(material["color"]))
        elif material["type"] == "Polished":
            put(f"scene.textures.{name}.type", "fresnelcolor")
            put(f"scene.textures.{name}.kr", numbers(material["color"]))
            put(f"scene.materials.{name}.type", "metal2")
            put(f"scene.materials.{name}.fresnel", name)
            put(f"scene.materials.{name}.uroughness", material["roughness"] ** 2)
            put(f"scene.materials.{name}.vroughness", material["roughness"] ** 2)
        else:
            put(f"scene.materials.{name}.type", "matte")
            put(f"scene.materials.{name}.kd", [0.0, 0.0, 0.0])
            put(f"scene.materials.{name}.emission", numbers(material["radiance"]))
        if item["kind"] == "sphere":
            vertices, faces, normals = sphere(item["to_world"])
        else:
            vertices, faces, normals = arrays[f"{name}_vertices"], arrays[f"{name}_faces"], None
        add_mesh(scene, properties, name, vertices, faces, name, normals)
    scene.Parse(properties)
    return scene


def run(scene, settings):
    """Render one image; returns the composite and the seconds of rendering."""
    width, height = job["camera"]["width"], job["camera"]["height"]
    properties = pyluxcore.Properties()
    pairs = {
        "renderengine.type": "PATHCPU",
        "sampler.type": "SOBOL",
        "sampler.sobol.adaptive.strength": 0.0,
        "renderengine.seed": SEED_STEP * settings["seed"] + 1,
        "native.threads.count": job["threads"],
        "path.pathdepth.total": job["max_bounces"] + 1,
        "path.pathdepth.diffuse": job["max_bounces"] + 1,
        "path.pathdepth.glossy": job["max_bounces"] + 1,
        "path.pathdepth.specular": job["max_bounces"] + 1,
        "path.clamping.variance.maxvalue": 0.0,
        "path.forceblackbackground.enable": True,
        "film.width": width,
        "film.height": height,
        "film.filter.type": "BOX",
        "film.filter.width": 0.5,
        "batch.haltspp": settings["samples"],
        "film.outputs.0.type": "RGB",
        "film.outputs.0.filename": "rgb.exr",
        "film.outputs.1.type": "ALPHA",
        "film.outputs.1.filename": "alpha.exr",
        "film.imagepipelines.0.0.type": "NOP",
    }
    if settings["denoise"]:
        pairs["film.imagepipelines.0.0.type"] = "INTEL_OIDN"
    for key, value in pairs.items():
        properties.Set(pyluxcore.Property(key, value))
    session = pyluxcore.RenderSession(pyluxcore.RenderConfig(properties, scene))
    began = time.perf_counter()
    session.Start()
    while not session.HasDone():
        time.sleep(0.005)
        session.UpdateStats()
    rgb = np.zeros((height, width, 3), np.float32)
    alpha = np.zeros((height, width), np.float32)
    film = session.GetFilm()
    film.GetOutputFloat(pyluxcore.FilmOutputType.RGB_IMAGEPIPELINE, rgb, 0, True)
    seconds = time.perf_counter() - began
    film.GetOutputFloat(pyluxcore.FilmOutputType.ALPHA, alpha)
    session.Stop()
    rgb, alpha = rgb[::-1].astype(np.float64), alpha[::-1].astype(np.float64)
    return arrays["plate"] * (1.0 - alpha[..., None]) + rgb, seconds


pyluxcore.Init(lambda message: None)
scene = build()
for number, settings in enumerate(job["renders"]):
    if number == 0:
        run(scene, {**settings, "samples": 1})  # What is timed is warm.
    image, seconds = run(scene, settings)
    np.savez(settings["out"], image=image.astype(np.float32), seconds=seconds)
sys.stdout.flush()
os._exit(0)  # The library's own shutdown aborts the interpreter.

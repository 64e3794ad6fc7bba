"""Sample models of the Khronos Group have the bounds and the area that they have in Blender."""

import json
import os
import shutil
import warnings
from pathlib import Path

import numpy as np
import pytest

from lightdepth.errors import InputWarning
from lightdepth.scene.meshes import read_mesh_file
from lightdepth.scene.meshes.geometry import face_areas

FOLDER = Path(os.environ.get("LIGHTDEPTH_GLTF_MODELS", "/usr/share/assimp/models/glTF2"))
"""Where Debian's package `assimp-testmodels` has them."""
MODELS = [
    "2CylinderEngine-glTF-Binary/2CylinderEngine.glb", "draco/2CylinderEngine.gltf", "BoxTextured-glTF/BoxTextured.gltf",
    "BoxTextured-glTF-Binary/BoxTextured.glb", "BoxTextured-glTF-Embedded/BoxTextured.gltf",
    "BoxTextured-glTF-pbrSpecularGlossiness/BoxTextured.gltf", "BoxTexcoords-glTF/boxTexcoords.gltf",
    "ClearCoat-glTF/ClearCoatTest.gltf", "cameras/Cameras.gltf", "simple_skin/simple_skin.gltf",
    "glTF-Sample-Models/AnimatedMorphCube-glTF/AnimatedMorphCube.gltf", "textureTransform/TextureTransformTest.gltf",
    *(f"glTF-Asset-Generator/Mesh_PrimitiveMode/Mesh_PrimitiveMode_{n:02}.gltf" for n in (4, 5, 6, 11, 12, 13, 14, 15)),
]  # fmt: skip

UNCOMPRESSED = {"draco/2CylinderEngine.gltf": "2CylinderEngine-glTF-Binary/2CylinderEngine.glb"}
"""The same model without Draco, whose library the module of Blender 5.3 lacks."""
QUANTISATION = 1e-4
"""What Draco's 14 bits for a coordinate may change."""


def at_rest(folder, name):
    """The file, or a copy without its animations, whose first frame Blender would show."""
    path = FOLDER / name
    if path.suffix == ".glb" or not (document := json.loads(path.read_text())).pop("animations", None):
        return path
    copy = folder / path.parent.name
    shutil.copytree(path.parent, copy)
    (copy / path.name).write_text(json.dumps(document))
    return copy / path.name


def test_bounds_and_areas_are_blenders(blender, tmp_path):
    if not FOLDER.is_dir():
        pytest.skip(f"no sample models in {FOLDER}: Debian's package assimp-testmodels, or LIGHTDEPTH_GLTF_MODELS")
    paths = {name: at_rest(tmp_path, name) for name in MODELS if (FOLDER / name).is_file()}
    assert len(paths) > 10
    found = blender.run("importing", *paths.values())["models"]
    wrong = []
    for name, path in paths.items():
        expected, limit = found[str(path)], 1e-5
        if name in UNCOMPRESSED and "draco_bridge" in expected.get("refused", ""):
            expected, limit = found[str(paths[UNCOMPRESSED[name]])], QUANTISATION
        assert "refused" not in expected, f"{path}: {expected}"
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", InputWarning)
            parts = read_mesh_file(path, with_materials=True)
        vertices = np.concatenate([part.mesh.vertices[np.unique(part.mesh.faces)] for part in parts])
        area = sum(face_areas(part.mesh.vertices, part.mesh.faces).sum() for part in parts)
        bounds, wanted = np.array([vertices.min(0), vertices.max(0)]), np.array([expected["low"], expected["high"]])
        off = np.abs(bounds - wanted).max() / np.ptp(wanted, axis=0).max()
        if off > limit or area != pytest.approx(expected["area"], rel=1e-4):
            wrong.append(f"{path}: {bounds.tolist()}, area {area}; in Blender {expected}")
    assert not wrong, "\n".join(wrong)

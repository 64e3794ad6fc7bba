"""Reads sample models and writes docs/gltf.md: which features of glTF each uses, and what comes of it.

    python docs/gltf/make_table.py /usr/share/assimp/models/glTF2

The models are those of the Khronos Group and of its asset generator that Debian's package `assimp-testmodels` carries, with
some that are damaged on purpose.
"""

import json
import struct
import sys
import warnings
from pathlib import Path

import numpy as np

from lightdepth.errors import InputError, InputWarning
from lightdepth.scene.meshes import read_mesh_file

PAGE = Path(__file__).parents[1] / "gltf.md"
MODES = ("points", "lines", "line loops", "line strips", "triangles", "triangle strips", "triangle fans")
HEAD = """# glTF: features against sample models

What lightdepth makes of the sample models of the Khronos Group (and of its asset generator) that Debian's package
`assimp-testmodels` carries, {count} files; `docs/gltf/make_table.py` writes this page.
[scene-file.md](scene-file.md#gltf) says
which features are supported. Size is that of the bounding box, in metres, z up. The tests compare size and area with what
Blender imports.

| model | uses | triangles | size | notes, or why it is refused |
|---|---|---|---|---|
"""


def document_of(path: Path) -> dict:
    """The JSON of a file; empty where it is none."""
    content = path.read_bytes()
    if content[:4] == b"glTF":
        length = struct.unpack_from("<I", content, 12)[0]
        content = content[20 : 20 + length]
    try:
        found = json.loads(content)
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}


def tables(parent: dict, name: str) -> list[dict]:
    """What of a list are objects; damaged files hold other things."""
    found = parent.get(name)
    return [item for item in found if isinstance(item, dict)] if isinstance(found, list) else []


def features(document: dict) -> list[str]:
    """Which features a file uses, as far as a picture shows them."""
    found = [name for name in document.get("extensionsUsed", []) if isinstance(name, str)]
    primitives = [primitive for mesh in tables(document, "meshes") for primitive in tables(mesh, "primitives")]
    found += sorted({MODES[primitive.get("mode", 4)] for primitive in primitives} - {"triangles"})
    if any("indices" not in primitive for primitive in primitives):
        found.append("no indices")
    if any(primitive.get("targets") for primitive in primitives):
        found.append("morph targets")
    attributes = {name for primitive in primitives for name in primitive.get("attributes") or {}}
    found += [words for name, words in (("COLOR_0", "vertex colours"), ("TANGENT", "tangents")) if name in attributes]
    if any("sparse" in accessor for accessor in tables(document, "accessors")):
        found.append("sparse accessors")
    materials, buffers = tables(document, "materials"), tables(document, "buffers")
    for name, words in (
        ("normalTexture", "normal maps"),
        ("emissiveTexture", "emissive maps"),
        ("doubleSided", "two sides"),
    ):
        if any(material.get(name) for material in materials):
            found.append(words)
    found += sorted({material["alphaMode"].lower() for material in materials if "alphaMode" in material} - {"opaque"})
    found += [
        words
        for name, words in (("skins", "skins"), ("animations", "animations"), ("cameras", "cameras"))
        if document.get(name)
    ]
    if any("uri" not in buffer for buffer in buffers):
        found.append("binary")
    elif any(str(buffer["uri"]).startswith("data:") for buffer in buffers):
        found.append("embedded")
    return found


def row(path: Path, name: str) -> str:
    """One row of the table."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", InputWarning)
        try:
            parts = read_mesh_file(path, with_materials=True)
        except InputError as error:
            triangles, size, notes = "", "", ["refused: " + str(error)]
        else:
            points = np.concatenate([part.mesh.vertices for part in parts])
            triangles = f"{sum(len(part.mesh.faces) for part in parts):,}"
            size = " x ".join(f"{extent:.4g}" for extent in np.ptp(points, axis=0))
            notes = [str(warning.message) for warning in caught]
    said = "; ".join(note.replace(f"{path}: ", "").replace(f"{path.parent}/", "") for note in notes)
    cells = (name, ", ".join(features(document_of(path))), triangles, size, said.replace("|", "\\|").replace("\n", " "))
    return "| " + " | ".join(cells) + " |\n"


def main(folder: Path) -> None:
    """Write the page."""
    files = sorted(path for path in folder.rglob("*") if path.suffix in (".gltf", ".glb"))
    rows = [row(path, str(path.relative_to(folder))) for path in files]
    PAGE.write_text(HEAD.format(count=len(files)) + "".join(rows))


if __name__ == "__main__":
    main(Path(sys.argv[1]))

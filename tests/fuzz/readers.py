"""What reads a mutant, and what its messages may not say."""

import re
from pathlib import Path

from lightdepth.calibration.fspy import fspy_cues, read_fspy
from lightdepth.capture.exposure import read_exposures
from lightdepth.capture.photograph import camera_colours, read_photograph, shared_white_balance, unlike_srgb
from lightdepth.capture.response import load_response
from lightdepth.capture.rig import parse_rig
from lightdepth.capture.shoot import MergeOptions, read_shoot
from lightdepth.errors import InputError
from lightdepth.images.panorama_file import read_panorama
from lightdepth.images.radiance import read_radiance
from lightdepth.images.stmap import read_stmap
from lightdepth.reconstruction.depth_image import read_depth_image
from lightdepth.reconstruction.point_cloud import read_points
from lightdepth.scene.instances import read_instances
from lightdepth.scene.load import read_scene
from lightdepth.scene.materials.image import Content, read_texture
from lightdepth.scene.meshes import read_mesh_file
from lightdepth.toml_file import read_document


def _mesh(path):
    read_mesh_file(path, with_materials=True)


def _texture(path):
    try:
        read_texture(path, Content.COLOUR)
    except ValueError as error:  # Its callers make it an `InputError` of the scene file.
        raise InputError(str(error)) from error


def _depth(path):
    read_depth_image(path, scale=0.001 if path.suffix == ".png" else None)


def _scene(path):
    """All problems of the file as one error."""
    if problems := read_scene(path).problems:
        raise InputError("\n".join(problems))


def _photograph(path):
    """Everything that `capture` asks of one photograph."""
    unlike_srgb([path])
    camera_colours(path)
    shared_white_balance([path])
    read_photograph(path)
    read_exposures([path])


def _bracket(path):
    read_shoot([path.parent], MergeOptions())


def _exposures(path):
    """A table, of photographs that need not be there to be looked up."""
    read_exposures([path.with_name(f"{name}.jpg") for name in "abc"], path)


READERS = {
    "mesh": _mesh,
    "material": lambda path: _mesh(Path(path).with_name("a.obj")),
    "image": lambda path: read_radiance(path),
    "panorama": lambda path: read_panorama(path),
    "texture": _texture,
    "depth": _depth,
    "points": lambda path: read_points(path),
    "instances": lambda path: read_instances(path),
    "scene": _scene,
    "document": lambda path: read_document(path),
    "photograph": _photograph,
    "bracket": _bracket,
    "exposures": _exposures,
    "response": load_response,
    "rig": lambda path: parse_rig(str(path), 7),
    "stmap": read_stmap,
    "fspy": lambda path: fspy_cues(read_fspy(path), (1000, 800)),
}

RAW = re.compile(
    r"\b[A-Z]\w*(Error|Exception|Warning)\b|Traceback|<class|object has no attribute|NoneType|out of range for|"
    r"list index|could not convert|invalid literal|cannot reshape|broadcast|not subscriptable|\[Errno|codec can't|"
    r"unpack requires|buffer is smaller|buffer size must|maximum recursion|dtype\(|\bnp\.|numpy|positional argument|"
    r"not supported between|unhashable|Expecting value|incorrect padding"
)
"""Words of Python and of packages, which mean nothing to a user."""


def raw_words(message, content):
    """Such words in a message, unless the file itself has them."""
    found = RAW.search(message)
    if found is None or found.group(0).encode() in content:
        return None
    return found.group(0)

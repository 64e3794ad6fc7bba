"""Google's Photo Sphere XMP metadata: which part of the sphere an image shows, and how the camera was held."""

from __future__ import annotations

import re
from dataclasses import dataclass
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray

from lightdepth.directions import euler_rotation
from lightdepth.errors import InputError

_ATTRIBUTE = re.compile(rb"""GPano:(\w+)\s*=\s*["']([^"']*)["']""")
_ELEMENT = re.compile(rb"<GPano:(\w+)\s*>([^<]*)</GPano:")


@dataclass(frozen=True)
class PhotoSphere:
    """What the metadata says.

    Attributes:
        full_width: of the whole sphere, pixels of this image.
        full_height: likewise; half of the width.
        left: column of the whole sphere at which the image begins.
        top: row of the whole sphere at which the image begins.
        rotation: light space to a world with z up and y to the north, shape (3, 3); ``None`` where no pose is given.
    """

    full_width: int
    full_height: int
    left: int
    top: int
    rotation: NDArray[np.float64] | None


def read_photo_sphere(xmp: bytes, width: int, height: int, what: str) -> PhotoSphere | None:
    """Read the metadata of an image.

    Args:
        xmp: the XMP packet; what else it holds plays no part.
        width: of the image, pixels.
        height: of the image, pixels.
        what: the file, for messages.

    Returns:
        What it says, or ``None`` where it says nothing about a sphere.

    Raises:
        InputError: another projection, numbers that make no sense, or a camera that was upside down.
    """
    found = {
        name.decode(): value.decode("utf-8", "replace").strip()
        for name, value in _ATTRIBUTE.findall(xmp) + _ELEMENT.findall(xmp)
    }
    if not found:
        return None
    projection = found.get("ProjectionType", "equirectangular")
    if projection != "equirectangular":
        raise InputError(
            f"{what}: its metadata (GPano) says that its projection is '{projection}'; 'equirectangular' is needed"
        )
    values = _numbers(found, what)
    # Cropped images are often saved smaller or larger than the metadata was written for.
    shown = (values.get("CroppedAreaImageWidthPixels", width), values.get("CroppedAreaImageHeightPixels", height))
    factors = (width / max(shown[0], 1.0), height / max(shown[1], 1.0))
    full_width = round(values.get("FullPanoWidthPixels", shown[0]) * factors[0])
    full_height = round(values.get("FullPanoHeightPixels", shown[1]) * factors[1])
    left = round(values.get("CroppedAreaLeftPixels", 0.0) * factors[0])
    top = round(values.get("CroppedAreaTopPixels", 0.0) * factors[1])
    if abs(full_width - 2 * full_height) <= 2:  # Rounded by the camera.
        full_height = -(-full_width // 2)
        full_width = 2 * full_height
    fits = 0 <= left <= full_width - width and 0 <= top <= full_height - height
    if full_width != 2 * full_height or not fits:
        raise InputError(
            f"{what}: its metadata (GPano) places {width} x {height} pixels at column {left}, row {top} of a sphere of "
            f"{full_width} x {full_height}; the sphere must be twice as wide as high and hold the image"
        )
    return PhotoSphere(full_width, full_height, left, top, _rotation(values, what))


def _numbers(found: dict[str, str], what: str) -> dict[str, float]:
    numbers = {}
    for name, text in found.items():
        if not name.endswith(("Pixels", "Degrees")):
            continue
        try:
            numbers[name] = float(text)
        except ValueError:
            raise InputError(f"{what}: GPano:{name} in its metadata is '{text}', which is not a number") from None
    if not np.isfinite(list(numbers.values())).all():
        raise InputError(f"{what}: its metadata (GPano) holds values that are not finite")
    return numbers


def _rotation(values: dict[str, float], what: str) -> NDArray[np.float64] | None:
    """Heading, pitch and roll of the picture's centre; a roll turns the horizon counter-clockwise in the picture."""
    names = ("PoseHeadingDegrees", "PosePitchDegrees", "PoseRollDegrees")
    if not any(name in values for name in names):
        return None
    heading, pitch, roll = (values.get(name, 0.0) for name in names)
    rotation = (
        euler_rotation([0.0, 0.0, -heading]) @ euler_rotation([pitch, 0.0, 0.0]) @ euler_rotation([0.0, roll, 0.0])
    )
    if rotation[2, 2] < 0.0:
        raise InputError(
            f"{what}: its metadata (GPano) says that the picture is upside down (pitch {pitch:g}, roll {roll:g} "
            "degrees); turn it by 180 degrees, or correct the metadata"
        )
    return rotation


def photo_sphere_xmp(width: int, height: int, rotation: NDArray[np.float64] | None, software: str) -> bytes:
    """The metadata of a full sphere, as an XMP packet.

    Args:
        width: of the image, pixels.
        height: likewise.
        rotation: light space to a world with z up and y to the north, shape (3, 3); ``None`` writes no pose.
        software: that made it.
    """
    facts = {
        "ProjectionType": "equirectangular",
        "UsePanoramaViewer": "True",
        "FullPanoWidthPixels": width,
        "FullPanoHeightPixels": height,
        "CroppedAreaImageWidthPixels": width,
        "CroppedAreaImageHeightPixels": height,
        "CroppedAreaLeftPixels": 0,
        "CroppedAreaTopPixels": 0,
        "StitchingSoftware": software,
    }
    if rotation is not None:
        heading, pitch, roll = _angles(rotation)
        facts |= {
            "PoseHeadingDegrees": f"{heading:.4f}",
            "PosePitchDegrees": f"{pitch:.4f}",
            "PoseRollDegrees": f"{roll:.4f}",
        }
    elements = "".join(f"<GPano:{name}>{escape(str(value))}</GPano:{name}>" for name, value in facts.items())
    return (
        '<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?><x:xmpmeta xmlns:x="adobe:ns:meta/">'
        '<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">'
        f'<rdf:Description rdf:about="" xmlns:GPano="http://ns.google.com/photos/1.0/panorama/">{elements}'
        '</rdf:Description></rdf:RDF></x:xmpmeta><?xpacket end="w"?>'
    ).encode()


def _angles(rotation: NDArray[np.float64]) -> tuple[float, float, float]:
    """Heading, pitch and roll in degrees: the inverse of ``_rotation``."""
    forward = rotation[:, 1]
    heading = np.degrees(np.arctan2(forward[0], forward[1])) % 360.0
    pitch = np.degrees(np.arcsin(np.clip(forward[2], -1.0, 1.0)))
    roll = np.degrees(np.arctan2(-rotation[2, 0], rotation[2, 2]))
    return float(heading), float(pitch), float(roll)

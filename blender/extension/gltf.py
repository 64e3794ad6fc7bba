"""Binary glTF of new objects, written from arrays: nothing of Blender's data is changed, so it works while rendering."""

import json
import struct
from collections.abc import Sequence

import numpy as np

from .graph import Lay, Value, resized
from .images import ImageFolder, encoded
from .materials import Surface, reflection_ior
from .meshes import Triangles, coordinates, is_flat
from .motion import ANIMATION

_WRAPS = {"REPEAT": 10497, "EXTEND": 33071, "CLIP": 33071, "MIRROR": 33648}
_FLOAT, _UNSIGNED = 5126, 5125
_NEAREST, _LINEAR = 9728, 9729


class Writer:
    """One file with one mesh, whose primitives are its materials.

    Args:
        images: where pictures go; the file names them beside itself.
        seconds: times at which the vertices' positions are given, if they move.

    Attributes:
        notes: what is not supported.
        materials: names of those that were added, in the order of the file's parts.
    """

    def __init__(self, images: ImageFolder, seconds: Sequence[float] = ()):
        self._images, self._seconds = images, seconds
        self._binary = bytearray()
        self._json: dict = {
            "asset": {"version": "2.0", "generator": "lightdepth for Blender"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": []}],
        }
        self._used: set[str] = set()
        self.notes: list[str] = []
        self.materials: list[str] = []

    @property
    def is_empty(self) -> bool:
        """Whether nothing was added."""
        return not self._json["meshes"][0]["primitives"]

    def add(
        self,
        triangles: Triangles,
        which: np.ndarray,
        surface: Surface,
        name: str,
        at_times: Sequence[Triangles] = (),
    ) -> None:
        """Add the triangles of one material.

        Args:
            triangles: the mesh, in Blender's axes.
            which: numbers of the triangles, shape (k,).
            surface: their material.
            name: of the material, for notes and the renderer's mattes.
            at_times: the mesh at the file's times, with the same faces.
        """
        if not len(which) or not surface.visible:
            return
        lay = self._lay(surface, name)
        columns = [triangles.vertices[which].reshape(-1, 1).astype(np.uint32)]
        loops = triangles.loops[which].reshape(-1)
        normals = None if triangles.normals is None else _y_up(triangles.normals[loops])
        uv = None
        if lay is not None:
            uv = coordinates(triangles, lay, which)
            if uv is None:
                known = f"the UV map '{lay.name}'" if lay.name else "a UV map"
                self.notes.append(
                    f"Material '{name}': a mesh that has it lacks {known}; it gets the colour of its images' corner"
                )
                uv = np.zeros((len(which), 3, 2))
            uv = (uv.reshape(-1, 2) * (1.0, -1.0) + (0.0, 1.0)).astype(np.float32)
        colours = None
        if surface.base.attribute is not None:
            attribute = surface.base.attribute or next(iter(triangles.colours), "")
            if attribute in triangles.colours:
                colours = triangles.colours[attribute][loops]
            else:  # as in Cycles, what a mesh lacks is black
                colours = np.zeros((len(loops), 3), np.float32)
        columns += [column.view(np.uint32) for column in (normals, uv, colours) if column is not None]
        first, corners = _distinct(np.ascontiguousarray(np.concatenate(columns, axis=1)))
        vertices = triangles.vertices[which].reshape(-1)[first]
        positions = _y_up(triangles.positions[vertices])
        attributes = {"POSITION": self._accessor(positions, "VEC3", bounds=True)}
        if normals is not None:
            attributes["NORMAL"] = self._accessor(normals[first], "VEC3")
        if uv is not None:
            attributes["TEXCOORD_0"] = self._accessor(uv[first], "VEC2")
        if colours is not None:
            attributes["COLOR_0"] = self._accessor(colours[first], "VEC3")
        primitive = {"attributes": attributes, "indices": self._accessor(corners.astype("<u4"), "SCALAR")}
        primitive["material"] = self._material(surface, name, lay)
        for other in at_times:
            target = {"POSITION": self._accessor(_y_up(other.positions[vertices]) - positions, "VEC3", bounds=True)}
            if normals is not None and other.normals is not None:
                target["NORMAL"] = self._accessor(_y_up(other.normals[loops[first]]) - normals[first], "VEC3")
            primitive.setdefault("targets", []).append(target)
        self._json["meshes"][0]["primitives"].append(primitive)
        self.materials.append(name)

    def data(self) -> bytes:
        """The file's bytes."""
        if self._seconds:
            self._animate()
        self._json["buffers"] = [{"byteLength": len(self._binary)}]
        if self._used:
            self._json["extensionsUsed"] = sorted(self._used)
        text = json.dumps(self._json, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        head = struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + len(self._binary))
        head += struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(self._binary), b"BIN\0")
        return head + self._binary

    def _animate(self) -> None:
        """From each time's positions to the next: the weight of one goes down while that of the other goes up."""
        times = self._accessor(np.array(self._seconds, "<f4"), "SCALAR", bounds=True)
        weights = self._accessor(np.eye(len(self._seconds), dtype="<f4").ravel(), "SCALAR")
        self._json["animations"] = [
            {
                "name": ANIMATION,
                "samplers": [{"input": times, "output": weights, "interpolation": "LINEAR"}],
                "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}],
            }
        ]

    def _accessor(self, values: np.ndarray, kind: str, bounds: bool = False) -> int:
        start = len(self._binary)
        data = np.ascontiguousarray(values)
        self._binary += data.tobytes()
        views = self._json.setdefault("bufferViews", [])
        views.append({"buffer": 0, "byteOffset": start, "byteLength": data.nbytes})
        component = _FLOAT if data.dtype.kind == "f" else _UNSIGNED
        accessor = {"bufferView": len(views) - 1, "componentType": component, "count": len(data), "type": kind}
        if bounds:
            low, high = (np.atleast_1d(each).tolist() for each in (data.min(axis=0), data.max(axis=0)))
            accessor |= {"min": low, "max": high}
        return self._append("accessors", accessor)

    def _append(self, kind: str, entry: dict) -> int:
        entries = self._json.setdefault(kind, [])
        entries.append(entry)
        return len(entries) - 1

    def _lay(self, surface: Surface, name: str) -> Lay | None:
        """The coordinates that the mesh gets: those of the first image; images that lie otherwise are named."""
        values = {"base colour": surface.base, "normal map": surface.normal, "emission": surface.emission}
        values |= {"roughness": surface.roughness, "metallic": surface.metallic, "opacity": surface.opacity}
        values |= {
            "coat": surface.coat,
            "coat's roughness": surface.coat_roughness,
            "transmission": surface.transmission,
        }
        laid = {what: value.lay for what, value in values.items() if value is not None and value.lay is not None}
        if not laid:
            return None
        first = next(iter(laid.values()))
        for what, lay in laid.items():
            if not _same_coordinates(first, lay):
                self.notes.append(
                    f"Material '{name}': its images use several texture coordinates; its {what} uses those of the first"
                )
        return first

    def _material(self, surface: Surface, name: str, lay: Lay | None) -> int:
        extensions: dict = {}
        body: dict = {}
        opaque = not surface.opacity.is_image and surface.opacity.numbers[0] >= 1.0
        base, opacity = surface.base.as_colour(), surface.opacity.as_number()
        base_part, alpha = base.numbers, opacity.numbers
        if base.is_image or opacity.is_image:
            image = _stacked(base_part, alpha)
            picture = base if base.is_image else opacity
            if base.is_image and opacity.is_image and base.lay != opacity.lay:
                self.notes.append(
                    f"Material '{name}': its opacity image uses the texture coordinates of its base colour"
                )
            codes = np.concatenate([encoded(image[..., :3]), image[..., 3:]], axis=-1)
            body["baseColorTexture"] = self._texture(
                self._images.png(codes if not opaque else codes[..., :3]), picture.lay
            )
        else:
            body["baseColorFactor"] = [*_clipped(base_part), *_clipped(alpha)]
        self._metal(body, surface, name)
        material: dict = {"pbrMetallicRoughness": body}
        if not opaque:
            material["alphaMode"] = "BLEND"
        self._emission(material, extensions, surface)
        if surface.normal is not None:
            texture = self._texture(self._images.png(surface.normal.as_colour().numbers), surface.normal.lay)
            material["normalTexture"] = texture | {"scale": surface.normal_strength}
        self._coat(extensions, surface)
        transmits = surface.transmission.is_image or surface.transmission.numbers[0] > 0.0
        if transmits:
            share = self._share("transmission", surface.transmission)
            extensions["KHR_materials_transmission"] = {"transmissionFactor": 1.0} | share
            extensions["KHR_materials_volume"] = {"thicknessFactor": 1.0}  # in Cycles every surface has an inside
        extensions["KHR_materials_ior"] = {"ior": surface.ior if transmits else reflection_ior(surface)}
        material["extensions"] = extensions
        if name:
            material["name"] = name
        self._used |= extensions.keys()
        return self._append("materials", material)

    def _metal(self, body: dict, surface: Surface, name: str) -> None:
        metallic, roughness = surface.metallic.as_number(), surface.roughness.as_number()
        if not metallic.is_image and not roughness.is_image:
            body |= {"metallicFactor": _clipped(metallic.numbers)[0], "roughnessFactor": _clipped(roughness.numbers)[0]}
            return
        picture = roughness if roughness.is_image else metallic
        if metallic.is_image and roughness.is_image and metallic.lay != roughness.lay:
            self.notes.append(f"Material '{name}': its metallic image uses the texture coordinates of its roughness")
        both = _stacked(roughness.numbers, metallic.numbers)
        image = np.concatenate([np.zeros_like(both[..., :1]), both], axis=-1)
        body["metallicRoughnessTexture"] = self._texture(self._images.png(image), picture.lay)

    def _emission(self, material: dict, extensions: dict, surface: Surface) -> None:
        radiance = np.maximum(surface.emission.as_colour().numbers, 0.0)
        if not radiance.any():
            return
        if surface.emission.is_image:
            strength, material["emissiveFactor"] = 1.0, [1.0, 1.0, 1.0]
            # A picture beside the file may be of high range: the renderer reads that, though glTF does not provide it.
            file = self._images.hdr(radiance) if radiance.max() > 1.0 else self._images.png(encoded(radiance))
            material["emissiveTexture"] = self._texture(file, surface.emission.lay)
        else:
            strength = max(1.0, float(radiance.max()))
            material["emissiveFactor"] = [float(channel) / strength for channel in radiance]
        if strength != 1.0:
            extensions["KHR_materials_emissive_strength"] = {"emissiveStrength": strength}

    def _coat(self, extensions: dict, surface: Surface) -> None:
        if not surface.coat.numbers.any():
            return
        coat = {"clearcoatFactor": 1.0} | self._share("clearcoat", surface.coat)
        roughness = {"clearcoatRoughnessFactor": 1.0} | self._share("clearcoatRoughness", surface.coat_roughness)
        extensions["KHR_materials_clearcoat"] = coat | roughness

    def _share(self, name: str, value: Value) -> dict:
        """``NAMEFactor`` or ``NAMETexture`` of a share."""
        value = value.as_number()
        if value.is_image:
            return {f"{name}Texture": self._texture(self._images.png(value.as_colour().numbers), value.lay)}
        return {f"{name}Factor": _clipped(value.numbers)[0]}

    def _texture(self, file: str, lay: Lay) -> dict:
        sampler = {"wrapS": _WRAPS[lay.extension], "wrapT": _WRAPS[lay.extension]}
        sampler["magFilter"] = _NEAREST if lay.nearest else _LINEAR
        texture = {
            "source": self._append("images", {"uri": file}),
            "sampler": self._append("samplers", sampler),
        }
        info: dict = {"index": self._append("textures", texture)}
        transform = _transform(lay)
        if transform:
            info["extensions"] = {"KHR_texture_transform": transform}
            self._used.add("KHR_texture_transform")
        return info


def _same_coordinates(first: Lay, other: Lay) -> bool:
    if is_flat(first) and is_flat(other):
        return (first.source, first.name) == (other.source, other.name)
    return (first.source, first.name, first.matrix, first.box) == (other.source, other.name, other.matrix, other.box)


def _transform(lay: Lay) -> dict:
    """``KHR_texture_transform`` of a flat lay, for v downward; empty where the mesh's coordinates have it already."""
    matrix = np.array(lay.matrix)
    if not is_flat(lay) or np.allclose(matrix, np.eye(4)[:3] if len(matrix) == 3 else np.eye(4)):
        return {}
    (a, b), (c, d) = matrix[:2, :2]
    scale_u, scale_v = float(np.hypot(a, c)), float(np.hypot(b, d))
    if a * d - b * c < 0.0:
        scale_v = -scale_v
    angle = float(np.arctan2(c, a)) if scale_u else 0.0
    cos, sin = np.cos(angle), np.sin(angle)
    offset = [matrix[0, 3] - sin * scale_v, 1.0 - cos * scale_v - matrix[1, 3]]
    return {
        "scale": [scale_u, scale_v],
        "rotation": angle,
        "offset": [float(number) for number in offset],
    }


def _stacked(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Channels of images or constants side by side, at the size of the larger image."""
    pictures = [array for array in (first, second) if array.ndim == 3]
    height, width = (max(array.shape[axis] for array in pictures) for axis in (0, 1))
    whole = [
        resized(array, height, width) if array.ndim == 3 else np.broadcast_to(array, (height, width, array.shape[-1]))
        for array in (first, second)
    ]
    return np.concatenate(whole, axis=-1)


def _clipped(numbers: np.ndarray) -> list[float]:
    return [float(number) for number in np.clip(numbers, 0.0, 1.0)]


def _y_up(vectors: np.ndarray) -> np.ndarray:
    x, y, z = vectors.T
    return np.ascontiguousarray(np.stack([x, z, -y], axis=1), np.float32)


_PRIMES = np.random.default_rng(20260101).integers(1, 2**63, 64, dtype=np.uint64) | np.uint64(1)


def _distinct(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distinct rows of 32-bit words: the first of each, and for all which of these they are (by 64-bit hashes)."""
    words = rows.astype(np.uint64)
    hashes = np.zeros(len(words), np.uint64)
    for column in range(words.shape[1]):
        hashes = (hashes ^ words[:, column]) * _PRIMES[column]
        hashes ^= hashes >> np.uint64(29)
    _, first, corners = np.unique(hashes, return_index=True, return_inverse=True)
    return first, corners.reshape(-1)

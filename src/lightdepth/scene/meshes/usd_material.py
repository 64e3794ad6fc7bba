"""Materials of USD: UsdPreviewSurface with its textures, as the principled material."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from pxr import Sdf, Usd, UsdShade

from lightdepth.errors import InputError
from lightdepth.images.radiance import READERS, read_radiance
from lightdepth.scene.materials import Principled, Texture, VertexColors
from lightdepth.scene.materials.image import eight_bit
from lightdepth.scene.materials.texture import SRGB_TO_LINEAR, Wrap
from lightdepth.scene.meshes.part import Note
from lightdepth.scene.meshes.usd_file import UsdFile
from lightdepth.scene.meshes.usd_mesh import COLOURS
from lightdepth.scene.model import Mesh

SURFACE, TEXTURE, TRANSFORM = "UsdPreviewSurface", "UsdUVTexture", "UsdTransform2d"
COLOUR_READERS = ("UsdPrimvarReader_float3", "UsdPrimvarReader_color3f", "UsdPrimvarReader_float4")
UV_READER = "UsdPrimvarReader_float2"
TEXTURED = (
    "diffuseColor", "emissiveColor", "specularColor", "metallic", "roughness", "opacity", "normal", "clearcoat",
    "clearcoatRoughness",
)  # fmt: skip
"""Inputs that may have images, that of the base colour first."""
_WRAPS: dict[str, Wrap] = {"repeat": "repeat", "mirror": "mirror", "clamp": "clamp"}
_CHANNELS = {"r": 0, "g": 1, "b": 2, "a": 3, "rgb": 0}
_CODES = np.arange(256) / 255.0
_FLIPPED = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 1.0], [0.0, 0.0, 1.0]])
"""Between v upward and v downward."""
_METAL = 0.36
"""Reflection at normal incidence from which on it is that of a metal."""


@dataclass(frozen=True)
class _Node:
    """What an input is connected to.

    Attributes:
        shader: the node.
        output: name of its output.
    """

    shader: UsdShade.Shader
    output: str

    @property
    def kind(self) -> str:
        return str(self.shader.GetIdAttr().Get())


@dataclass(frozen=True)
class _Pixels:
    """An image: 8-bit codes of red, green, blue and alpha, or linear red, green and blue of high dynamic range."""

    values: NDArray[np.uint8] | NDArray[np.float32]
    coloured: bool


class UsdMaterials:
    """Makes the materials of one file; images are read once.

    Args:
        file: the file.
        note: called with what is left out or taken otherwise.
    """

    def __init__(self, file: UsdFile, note: Note) -> None:
        self._file, self._note = file, note
        self._images: dict[str, _Pixels] = {}
        self._made: dict[tuple[Any, ...], Texture] = {}

    def uv_set(self, material: UsdShade.Material | None) -> str | None:
        """Name of the primvar by which a material's textures are laid; ``None`` where it does not say one."""
        surface = self._surface(material)
        names = [name for each in _textures(surface) if (name := _uv_name(each)) is not None]
        if len(set(names)) > 1:
            self._note(
                f"{surface.GetPath()} has textures on several sets of texture coordinates; all are laid by '{names[0]}'"
            )
        return names[0] if names else None

    def colour_set(self, material: UsdShade.Material | None) -> str | None:
        """Name of the primvar with the colours that a material shows."""
        if material is None:
            return COLOURS
        surface = self._surface(material)
        node = _source(surface, "diffuseColor")
        if not isinstance(node, _Node) or node.kind not in COLOUR_READERS:
            return None
        return _plain(node.shader, "varname", None)

    def principled(self, material: UsdShade.Material | None, mesh: Mesh, time: Usd.TimeCode) -> Principled:
        """The material of a mesh at a time.

        Args:
            material: the file's; ``None`` gives the default one, with the mesh's colours where it has some.
            mesh: which has texture coordinates and colours as far as the file has them.
            time: the time.

        Raises:
            InputError: an image is missing or cannot be read.
        """
        surface = self._surface(material)
        if not surface:
            return Principled() if mesh.colors is None else Principled(base_color=VertexColors())
        reader = _Reader(self, surface, mesh, time)
        self._note_what_is_left_out(reader)
        settings = reader.reflection()
        settings |= {
            "roughness": reader.share("roughness", 0.5),
            "clearcoat": reader.share("clearcoat", 0.0),
            "clearcoat_roughness": reader.share("clearcoatRoughness", 0.01),
            "emission": reader.colour("emissiveColor", (0.0, 0.0, 0.0), np.inf),
            "opacity": reader.opacity(),
            "normal_map": reader.normals(),
        }
        return Principled(**settings)

    def _surface(self, material: UsdShade.Material | None) -> UsdShade.Shader:
        """The preview surface of a material, or an invalid shader."""
        if material is None:
            return UsdShade.Shader()
        shader, *_ = material.ComputeSurfaceSource()
        if not shader or shader.GetIdAttr().Get() != SURFACE:
            self._note(f"the material {material.GetPath()} has no {SURFACE} and becomes the default one")
            return UsdShade.Shader()
        return shader

    def _note_what_is_left_out(self, reader: _Reader) -> None:
        path = reader.surface.GetPath()
        if _source(reader.surface, "displacement") is not None and reader.number("displacement", 0.0) != 0.0:
            self._note(f"{path}: its displacement is left out")
        if reader.mesh.texture_coordinates is None and _textures(reader.surface):
            self._note(f"textures of {path} are left out where a mesh has no texture coordinates to lay them by")

    def texture(
        self, node: _Node, tables: Mapping[int, tuple[float, float]] | None, time: Usd.TimeCode, upper: float, role: str
    ) -> Texture | tuple[float, ...]:
        """Channels of an image, or the numbers that stand for one that is not given.

        Args:
            node: the texture and its output.
            tables: of each channel, factor and offset in place of the file's scale and bias, ``None`` for these.
            time: the time.
            upper: largest value.
            role: the input, for notes.
        """
        shader = node.shader
        channels = (0, 1, 2) if node.output == "rgb" and role not in _ONE else (_CHANNELS[node.output],)
        scale, bias = _four(_plain(shader, "scale", time), 1.0), _four(_plain(shader, "bias", time), 0.0)
        if tables is not None:
            scale = [tables[channel][0] for channel in range(4)]
            bias = [tables[channel][1] for channel in range(4)]
        asset = _plain(shader, "file", time)
        if not isinstance(asset, Sdf.AssetPath) or not asset.path:
            fallback = _four(_plain(shader, "fallback", time), 0.0)
            return tuple(float(np.clip(fallback[c], 0.0, upper)) for c in channels)
        if "<UDIM>" in asset.path:
            raise InputError(f"{self._file.path}: {shader.GetPath()}: images in UDIM tiles are not supported")
        name, pixels = self._pixels(asset)
        space = _plain(shader, "sourceColorSpace", time) or "auto"
        if space not in ("auto", "raw", "sRGB"):
            self._note(f"{shader.GetPath()}: the colour space '{space[:40]}' is taken as auto")
        decoded = space == "sRGB" or (space != "raw" and pixels.coloured)
        wrap, to_uv = self._wrap(shader, time), self._to_uv(shader, time)
        key = (name, channels, *scale, *bias, decoded, wrap, to_uv.tobytes(), upper)
        if key not in self._made:
            planes = [_plane(pixels, channel, decoded, scale[channel], bias[channel], upper) for channel in channels]
            values = np.stack(planes, axis=-1)
            precision = np.float16 if values.max() < 6e4 else np.float32
            self._made[key] = Texture(values.astype(precision), wrap, to_uv=to_uv)
        return self._made[key]

    def _pixels(self, asset: Sdf.AssetPath) -> tuple[str, _Pixels]:
        name, content = self._file.content(asset)
        if name not in self._images:
            try:
                if Path(name.rstrip("]")).suffix.lower() in READERS:
                    self._images[name] = _Pixels(read_radiance(Path(name)), False)
                else:
                    coloured = Image.open(io.BytesIO(content)).mode in ("RGB", "RGBA", "P")
                    self._images[name] = _Pixels(eight_bit(content, "RGBA"), coloured)
            except (OSError, ValueError, InputError) as error:
                raise InputError(f"{self._file.path}: the image {asset.path[:200]} cannot be read: {error}") from error
        return name, self._images[name]

    def _wrap(self, shader: UsdShade.Shader, time: Usd.TimeCode) -> Wrap:
        along = [_plain(shader, f"wrap{axis}", time) or "useMetadata" for axis in "ST"]
        if along[0] != along[1]:
            self._note(f"{shader.GetPath()} is wrapped differently along its axes; both are as wrapS says")
        if along[0] == "black":
            self._note(f"{shader.GetPath()} is black beyond its edges; there it goes on with its edge")
            return "clamp"
        return _WRAPS.get(along[0], "repeat")

    def _to_uv(self, shader: UsdShade.Shader, time: Usd.TimeCode) -> NDArray[np.float64]:
        """Matrix of the transforms of texture coordinates, for v that grows downward."""
        matrix, node = np.eye(3), _source(shader, "st")
        while isinstance(node, _Node) and node.kind == TRANSFORM:
            angle = np.radians(_plain(node.shader, "rotation", time) or 0.0)
            cos, sin = np.cos(angle), np.sin(angle)
            su, sv = _plain(node.shader, "scale", time) or (1.0, 1.0)
            tu, tv = _plain(node.shader, "translation", time) or (0.0, 0.0)
            matrix = matrix @ np.array([[cos * su, -sin * sv, tu], [sin * su, cos * sv, tv], [0.0, 0.0, 1.0]])
            node = _source(node.shader, "in")
        return np.asarray(_FLIPPED @ matrix @ _FLIPPED)


_ONE = frozenset({"metallic", "roughness", "opacity", "clearcoat", "clearcoatRoughness"})
"""Inputs that are one number."""


@dataclass(frozen=True)
class _Reader:
    """The inputs of one preview surface for one mesh."""

    materials: UsdMaterials
    surface: UsdShade.Shader
    mesh: Mesh
    time: Usd.TimeCode

    def number(self, name: str, default: float) -> float:
        """An input that has no texture."""
        value = _plain(self.surface, name, self.time)
        return default if value is None else float(value)

    def colour(self, name: str, default: tuple[float, float, float], upper: float) -> Any:
        """Three numbers, a texture, or the mesh's own colours."""
        node = _source(self.surface, name)
        if isinstance(node, _Node):
            if node.kind in COLOUR_READERS and name == "diffuseColor" and self.mesh.colors is not None:
                return VertexColors()
            return self._connected(node, name, default, upper)
        value = _plain(self.surface, name, self.time)
        return tuple(float(np.clip(each, 0.0, upper)) for each in (default if value is None else value))

    def share(self, name: str, default: float) -> Texture | float:
        """One number from 0 to 1, or a texture."""
        node = _source(self.surface, name)
        if not isinstance(node, _Node):
            return float(np.clip(self.number(name, default), 0.0, 1.0))
        found = self._connected(node, name, default, 1.0)
        if isinstance(found, Texture):
            first = found.pixels.flat[0]
            return float(first) if (found.pixels == first).all() else found
        return float(found[0] if isinstance(found, tuple) else found)

    def reflection(self) -> dict[str, Any]:
        """Colour, metalness and index of refraction."""
        base = self.colour("diffuseColor", (0.18, 0.18, 0.18), 1.0)
        ior = self.number("ior", 1.5)
        if not 1.0 <= ior <= 4.0:
            self._note(f"its ior of {ior:g} is taken as {float(np.clip(ior, 1.0, 4.0)):g}")
        if self.number("useSpecularWorkflow", 0.0) != 1.0:
            return {"base_color": base, "metallic": self.share("metallic", 0.0), "ior": float(np.clip(ior, 1.0, 4.0))}
        specular = self.colour("specularColor", (0.0, 0.0, 0.0), 1.0)
        if isinstance(specular, Texture):
            specular = tuple(specular.pixels.reshape(-1, 3).mean(axis=0, dtype=np.float64).tolist())
            self._note("the mean of its specular colour is used")
        reflection = float(np.mean(specular))
        if reflection > _METAL and isinstance(base, tuple) and max(base) < 0.02:
            return {"base_color": specular, "metallic": 1.0, "ior": 1.5}
        if reflection > _METAL or np.ptp(specular) > 0.02:
            self._note("its specular colour is that of a metal; it reflects here as a dielectric, without colour")
        root = min(reflection, _METAL) ** 0.5
        return {"base_color": base, "metallic": 0.0, "ior": min((1.0 + root) / (1.0 - root), 4.0)}

    def opacity(self) -> Texture | float:
        """Coverage; cut at the threshold where there is one."""
        found, threshold = self.share("opacity", 1.0), self.number("opacityThreshold", 0.0)
        if threshold > 0.0:
            if not isinstance(found, Texture):
                return float(found >= threshold)
            return Texture((found.pixels >= threshold).astype(np.float16), found.wrap, found.nearest, found.to_uv)
        presence = _plain(self.surface, "opacityMode", self.time) == "presence"
        if not presence and (isinstance(found, Texture) or found < 1.0):
            self._note("where it is transparent it reflects nothing here; opacity is taken as coverage")
        return found

    def normals(self) -> Texture | None:
        """Normals in tangent space, encoded in numbers from 0 to 1."""
        node = _source(self.surface, "normal")
        if not isinstance(node, _Node) or node.kind != TEXTURE or self.mesh.texture_coordinates is None:
            if isinstance(node, _Node) and node.kind != TEXTURE:
                self._note(f"its normal comes from a {node.kind}, which is left out")
            return None
        scale, bias = (_four(_plain(node.shader, name, self.time), n) for name, n in (("scale", 1.0), ("bias", 0.0)))
        if scale[:3] == [1.0] * 3 and bias[:3] == [0.0] * 3:  # Many files forget them.
            tables = dict.fromkeys(range(4), (1.0, 0.0))
        else:
            tables = {channel: (0.5 * scale[channel], 0.5 * bias[channel] + 0.5) for channel in range(4)}
        found = self.materials.texture(node, tables, self.time, 1.0, "normal")
        return found if isinstance(found, Texture) and found.pixels.shape[2] == 3 else None

    def _connected(self, node: _Node, name: str, default: Any, upper: float) -> Any:
        if node.kind != TEXTURE or node.output not in _CHANNELS:
            self._note(f"its {name} comes from a {node.kind[:60]}, which is left out")
            return default
        if self.mesh.texture_coordinates is None:
            return default
        found = self.materials.texture(node, None, self.time, upper, name)
        if name not in _ONE and isinstance(found, Texture) and found.pixels.shape[2] == 1:
            return Texture(np.repeat(found.pixels, 3, axis=2), found.wrap, found.nearest, found.to_uv)
        return found * 3 if name not in _ONE and isinstance(found, tuple) and len(found) == 1 else found

    def _note(self, what: str) -> None:
        self.materials._note(f"{self.surface.GetPath()}: {what}")


def _source(shader: UsdShade.Shader, name: str) -> _Node | Usd.Attribute | None:
    """Where the value of an input comes from: a node, or the attribute that holds it; ``None`` where it is not given."""
    found = shader.GetInput(name) if shader else None
    if not found:
        return None
    for attribute in found.GetValueProducingAttributes():
        if UsdShade.Output.IsOutput(attribute):
            return _Node(UsdShade.Shader(attribute.GetPrim()), UsdShade.Output(attribute).GetBaseName())
        return attribute
    return None


def _plain(shader: UsdShade.Shader, name: str, time: Usd.TimeCode | None) -> Any:
    """The value of an input; ``None`` where it is not given, or comes from a node."""
    attribute = _source(shader, name)
    if attribute is None or isinstance(attribute, _Node):
        return None
    return attribute.Get() if time is None else attribute.Get(time)


def _textures(surface: UsdShade.Shader) -> list[_Node]:
    nodes = [_source(surface, name) for name in TEXTURED]
    return [node for node in nodes if isinstance(node, _Node) and node.kind == TEXTURE]


def _uv_name(texture: _Node) -> str | None:
    """The primvar by which a texture is laid."""
    node = _source(texture.shader, "st")
    while isinstance(node, _Node) and node.kind == TRANSFORM:
        node = _source(node.shader, "in")
    if not isinstance(node, _Node) or node.kind != UV_READER:
        return None
    name = _plain(node.shader, "varname", None)
    return None if name is None else str(name)


def _four(value: Any, default: float) -> list[float]:
    return [default] * 4 if value is None else [float(each) for each in value]


def _plane(
    pixels: _Pixels, channel: int, decoded: bool, scale: float, bias: float, upper: float
) -> NDArray[np.floating]:
    """One channel of an image, scaled and moved."""
    if pixels.values.dtype == np.uint8:
        values = SRGB_TO_LINEAR if decoded and channel < 3 else _CODES
        return np.asarray(np.clip(values * scale + bias, 0.0, upper)[pixels.values[:, :, channel]])
    if channel == 3:
        return np.full(pixels.values.shape[:2], np.clip(scale + bias, 0.0, upper))
    return np.asarray(np.clip(pixels.values[:, :, channel] * scale + bias, 0.0, upper))

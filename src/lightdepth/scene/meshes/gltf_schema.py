"""The JSON of glTF 2.0 with the extensions that are read, as checked data."""

from __future__ import annotations

import re
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError
from pydantic.alias_generators import to_camel

Index = Annotated[int, Field(ge=0, lt=2**31)]
Number = Annotated[float, Field(allow_inf_nan=False)]
Name = Annotated[str, BeforeValidator(lambda value: value if isinstance(value, str) else "")]
"""For messages only."""
Triple = tuple[Number, Number, Number]
Quadruple = tuple[Number, Number, Number, Number]
Matrix = Annotated[list[Number], Field(min_length=16, max_length=16)]


class Part(BaseModel):
    """Base: names as in the file, of what else stands there only the extensions are known."""

    model_config = ConfigDict(alias_generator=to_camel, extra="ignore", frozen=True, populate_by_name=True)


class Named(Part):
    """Base of what extensions add under their names."""

    model_config = ConfigDict(alias_generator=None, extra="allow", frozen=True)


class TextureTransform(Part):
    """``KHR_texture_transform``."""

    offset: tuple[Number, Number] = (0.0, 0.0)
    rotation: Number = 0.0
    scale: tuple[Number, Number] = (1.0, 1.0)
    tex_coord: Index | None = None


class InfoExtensions(Named):
    """Extensions of a ``textureInfo``."""

    KHR_texture_transform: TextureTransform = TextureTransform()


class TextureInfo(Part):
    """A texture in its place in a material."""

    index: Index
    tex_coord: Index = 0
    scale: Number = 1.0
    extensions: InfoExtensions = InfoExtensions()

    @property
    def transform(self) -> TextureTransform:
        """How the texture coordinates are changed."""
        return self.extensions.KHR_texture_transform

    @property
    def coordinate_set(self) -> int:
        """Number of the ``TEXCOORD`` attribute that it uses."""
        return self.tex_coord if self.transform.tex_coord is None else self.transform.tex_coord


class MetallicRoughness(Part):
    """``pbrMetallicRoughness``."""

    base_color_factor: Quadruple = (1.0, 1.0, 1.0, 1.0)
    base_color_texture: TextureInfo | None = None
    metallic_factor: Number = 1.0
    roughness_factor: Number = 1.0
    metallic_roughness_texture: TextureInfo | None = None


class SpecularGlossiness(Part):
    """``KHR_materials_pbrSpecularGlossiness``."""

    diffuse_factor: Quadruple = (1.0, 1.0, 1.0, 1.0)
    diffuse_texture: TextureInfo | None = None
    specular_factor: Triple = (1.0, 1.0, 1.0)
    glossiness_factor: Number = 1.0
    specular_glossiness_texture: TextureInfo | None = None


class Clearcoat(Part):
    """``KHR_materials_clearcoat``."""

    clearcoat_factor: Number = 0.0
    clearcoat_texture: TextureInfo | None = None
    clearcoat_roughness_factor: Number = 0.0
    clearcoat_roughness_texture: TextureInfo | None = None
    clearcoat_normal_texture: TextureInfo | None = None


class Transmission(Part):
    """``KHR_materials_transmission``."""

    transmission_factor: Number = 0.0
    transmission_texture: TextureInfo | None = None


class Volume(Part):
    """``KHR_materials_volume``."""

    thickness_factor: Number = 0.0
    attenuation_distance: float | None = None
    attenuation_color: Triple = (1.0, 1.0, 1.0)


class Ior(Part):
    """``KHR_materials_ior``."""

    ior: Number = 1.5


class Specular(Part):
    """``KHR_materials_specular``."""

    specular_factor: Number = 1.0
    specular_texture: TextureInfo | None = None
    specular_color_factor: Triple = (1.0, 1.0, 1.0)
    specular_color_texture: TextureInfo | None = None


class EmissiveStrength(Part):
    """``KHR_materials_emissive_strength``."""

    emissive_strength: Number = 1.0


class MaterialExtensions(Named):
    """Extensions of a material."""

    KHR_materials_pbrSpecularGlossiness: SpecularGlossiness | None = None
    KHR_materials_unlit: dict[str, Any] | None = None
    KHR_materials_clearcoat: Clearcoat = Clearcoat()
    KHR_materials_transmission: Transmission = Transmission()
    KHR_materials_volume: Volume | None = None
    KHR_materials_ior: Ior = Ior()
    KHR_materials_specular: Specular = Specular()
    KHR_materials_emissive_strength: EmissiveStrength = EmissiveStrength()


class MaterialEntry(Part):
    """A material."""

    name: Name = ""
    pbr_metallic_roughness: MetallicRoughness | None = None
    normal_texture: TextureInfo | None = None
    emissive_texture: TextureInfo | None = None
    emissive_factor: Triple = (0.0, 0.0, 0.0)
    alpha_mode: str = "OPAQUE"
    alpha_cutoff: Number = 0.5
    extensions: MaterialExtensions = MaterialExtensions()


class Compression(Part):
    """``EXT_meshopt_compression`` or ``KHR_meshopt_compression`` of a buffer view."""

    buffer: Index
    byte_offset: Index = 0
    byte_length: Index
    byte_stride: Annotated[int, Field(ge=1, le=256)]
    count: Index
    mode: str
    filter: str = "NONE"


class ViewExtensions(Named):
    """Extensions of a buffer view."""

    EXT_meshopt_compression: Compression | None = None
    KHR_meshopt_compression: Compression | None = None


class BufferView(Part):
    """Bytes of a buffer."""

    buffer: Index
    byte_offset: Index = 0
    byte_length: Index
    byte_stride: Annotated[int, Field(ge=0, le=256)] | None = None
    extensions: ViewExtensions = ViewExtensions()

    @property
    def compression(self) -> Compression | None:
        """How its bytes are compressed, if they are."""
        return self.extensions.EXT_meshopt_compression or self.extensions.KHR_meshopt_compression


class Buffer(Part):
    """A file of bytes, or the binary chunk."""

    uri: str | None = None
    byte_length: Index = 0


class SparseIndices(Part):
    """Which elements of an accessor are replaced."""

    buffer_view: Index
    byte_offset: Index = 0
    component_type: int


class SparseValues(Part):
    """What they are replaced by."""

    buffer_view: Index
    byte_offset: Index = 0


class Sparse(Part):
    """Replaced elements of an accessor."""

    count: Index
    indices: SparseIndices
    values: SparseValues


class Accessor(Part):
    """Numbers in a buffer view."""

    buffer_view: Index | None = None
    byte_offset: Index = 0
    component_type: int
    normalized: bool = False
    count: Index
    type: str
    sparse: Sparse | None = None


class Draco(Part):
    """``KHR_draco_mesh_compression`` of a primitive."""

    buffer_view: Index
    attributes: dict[str, Index] = {}


class PrimitiveExtensions(Named):
    """Extensions of a primitive."""

    KHR_draco_mesh_compression: Draco | None = None


class Primitive(Part):
    """Triangles of one material."""

    attributes: dict[str, Index] = {}
    indices: Index | None = None
    material: Index | None = None
    mode: int = 4
    targets: list[dict[str, Index]] = []
    extensions: PrimitiveExtensions = PrimitiveExtensions()


class MeshEntry(Part):
    """Primitives."""

    primitives: list[Primitive] = []
    weights: list[Number] | None = None


class Instancing(Part):
    """``EXT_mesh_gpu_instancing`` of a node."""

    attributes: dict[str, Index] = {}


class Visibility(Part):
    """``KHR_node_visibility`` of a node."""

    visible: bool = True


class NodeExtensions(Named):
    """Extensions of a node."""

    EXT_mesh_gpu_instancing: Instancing | None = None
    KHR_node_visibility: Visibility = Visibility()


class Node(Part):
    """A place in the scene."""

    name: Name = ""
    children: list[Index] = []
    mesh: Index | None = None
    camera: Index | None = None
    skin: Index | None = None
    weights: list[Number] | None = None
    matrix: Matrix | None = None
    translation: Triple = (0.0, 0.0, 0.0)
    rotation: Quadruple = (0.0, 0.0, 0.0, 1.0)
    scale: Triple = (1.0, 1.0, 1.0)
    extensions: NodeExtensions = NodeExtensions()

    @property
    def is_placed_twice(self) -> bool:
        """Whether it states a matrix and its factors."""
        return self.matrix is not None and bool(self.model_fields_set & {"translation", "rotation", "scale"})


class Skin(Part):
    """Joints that move vertices."""

    joints: list[Index]
    inverse_bind_matrices: Index | None = None


class SceneEntry(Part):
    """What is shown together."""

    nodes: list[Index] = []


class ImageEntry(Part):
    """An image."""

    name: Name = ""
    uri: str | None = None
    buffer_view: Index | None = None


class Source(Part):
    """An image in a format that an extension adds."""

    source: Index | None = None


class TextureExtensions(Named):
    """Extensions of a texture."""

    KHR_texture_basisu: Source | None = None
    EXT_texture_webp: Source | None = None
    EXT_texture_avif: Source | None = None
    MSFT_texture_dds: Source | None = None


class TextureEntry(Part):
    """An image with its sampler."""

    source: Index | None = None
    sampler: Index | None = None
    extensions: TextureExtensions = TextureExtensions()


class Sampler(Part):
    """How an image is interpolated and repeated."""

    mag_filter: int | None = None
    wrap_s: int = 10497
    wrap_t: int = 10497


class ChannelTarget(Part):
    """What a channel of an animation moves."""

    node: Index | None = None
    path: str


class Channel(Part):
    """A sampler and what it moves."""

    sampler: Index
    target: ChannelTarget


class AnimationSampler(Part):
    """Times, values, and what is between them."""

    input: Index
    output: Index
    interpolation: str = "LINEAR"


class AnimationEntry(Part):
    """An animation."""

    name: Name = ""
    channels: list[Channel] = []
    samplers: list[AnimationSampler] = []


class PerspectiveEntry(Part):
    """The film of a perspective camera."""

    yfov: Annotated[Number, Field(gt=0.0)]
    aspect_ratio: Annotated[Number, Field(gt=0.0)] | None = None


class CameraEntry(Part):
    """A camera."""

    name: Name = ""
    type: str
    perspective: PerspectiveEntry | None = None


class Asset(Part):
    """Which glTF it is."""

    version: str = "unknown"
    min_version: str = "2.0"


class Header(Part):
    """The whole file."""

    asset: Asset = Asset()
    extensions_used: list[str] = []
    extensions_required: list[str] = []
    scene: Index | None = None
    scenes: list[SceneEntry] = []
    nodes: list[Node] = []
    meshes: list[MeshEntry] = []
    skins: list[Skin] = []
    materials: list[MaterialEntry] = []
    textures: list[TextureEntry] = []
    images: list[ImageEntry] = []
    samplers: list[Sampler] = []
    accessors: list[Accessor] = []
    buffer_views: list[BufferView] = []
    buffers: list[Buffer] = []
    animations: list[Any] = []
    """Checked where one is shown, see :func:`checked_part`."""
    cameras: list[Any] = []
    """Likewise."""


Checked = TypeVar("Checked", bound=Part)


def checked_header(document: Any) -> Header:
    """The JSON as checked data.

    Raises:
        ValueError: something in it is not what glTF allows; the message has the place and what is needed.
    """
    return checked_part(Header, document)


def checked_part(kind: type[Checked], document: Any, within: str = "") -> Checked:
    """A part of the JSON as checked data.

    Args:
        kind: what it must be.
        document: the part.
        within: its place in the file.

    Raises:
        ValueError: as for :func:`checked_header`.
    """
    try:
        return kind.model_validate(document)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        place = "".join(f"[{piece}]" if isinstance(piece, int) else f".{piece}" for piece in first["loc"])
        place = (within + place).lstrip(".")
        message = first["msg"].replace("Input should", "must").replace("Field required", "is missing")
        message = re.sub(r"a valid dictionary( or instance of \w+)?", "an object", message)
        raise ValueError(f"{place or 'its JSON'}: {message[:1].lower() + message[1:]}") from error

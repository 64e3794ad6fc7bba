"""Blender's shader nodes as the one material that the renderer's mesh files have; what it lacks is reported by name."""

from dataclasses import dataclass, field, replace

import bpy
import numpy as np

from .graph import (
    Place,
    UnsupportedError,
    Value,
    combined,
    constant,
    describe,
    missing_images,
    origin,
    own_value,
    value_of,
)
from .images import to_rec709

LOST_INPUTS = {
    "Subsurface Weight": "subsurface scattering",
    "Sheen Weight": "sheen",
    "Anisotropic": "anisotropy",
    "Diffuse Roughness": "the roughness of its diffuse part",
    "Thin Film Thickness": "thin film",
}
"""Inputs of the Principled BSDF that the renderer's material does not have, with what they are."""
WITHOUT_MATERIAL = 0.8
"""Grey of the plastic that Cycles gives to what has no material."""


@dataclass(frozen=True)
class Surface:
    """A metallic-roughness material, linear Rec.709.

    Attributes:
        base: base colour.
        metallic, roughness, coat, coat_roughness, transmission, opacity: shares.
        emission: emitted radiance.
        ior: index of refraction.
        level: the Principled BSDF's specular level, 0.5 is that of the index of refraction.
        normal: a tangent-space normal map as its file holds it, or ``None``.
        normal_strength: factor on the normal map.
        visible: false where light passes as if nothing were there.
        notes: what of the nodes is not supported, one end of a sentence each.
    """

    base: Value = field(default_factory=lambda: constant(*[WITHOUT_MATERIAL] * 3))
    metallic: Value = field(default_factory=lambda: constant(0.0))
    roughness: Value = field(default_factory=lambda: constant(1.0))
    coat: Value = field(default_factory=lambda: constant(0.0))
    coat_roughness: Value = field(default_factory=lambda: constant(0.0))
    transmission: Value = field(default_factory=lambda: constant(0.0))
    opacity: Value = field(default_factory=lambda: constant(1.0))
    emission: Value = field(default_factory=lambda: constant(0.0, 0.0, 0.0))
    ior: float = 1.5
    level: float = 0.0
    normal: Value | None = None
    normal_strength: float = 1.0
    visible: bool = True
    notes: tuple[str, ...] = ()


BLACK = Surface(base=constant(0.0, 0.0, 0.0))
INVISIBLE = Surface(visible=False, opacity=constant(0.0))


def surface_of(material: bpy.types.Material | None) -> tuple[Surface, list[str]]:
    """What an evaluated material is to the renderer.

    Args:
        material: evaluated, or ``None`` for a slot without one.

    Returns:
        The surface, and sentences on what is not supported, with the material's name.
    """
    if material is None:
        return Surface(roughness=constant(0.5), level=0.5), []
    tree = material.node_tree if _uses_nodes(material) else None
    if tree is None:
        return Surface(base=Value(to_rec709(np.array(material.diffuse_color[:3], np.float32)))), []
    output = tree.get_output_node("CYCLES") or tree.get_output_node("ALL")
    if output is None:
        return BLACK, []
    said = missing_images(tree)
    if origin(Place(output.inputs["Surface"])) is None:
        surface = BLACK
        if origin(Place(output.inputs["Volume"])) is not None:
            surface = INVISIBLE
            said.append("its volume is not supported; it has no surface and is left out")
    else:
        surface = _shader(Place(output.inputs["Surface"]))
        if origin(Place(output.inputs["Volume"])) is not None:
            said.append("volume is not supported")
    if origin(Place(output.inputs["Displacement"])) is not None:
        said.append("displacement is not supported")
    said += surface.notes
    return surface, [f"Material '{material.name}': {sentence}" for sentence in dict.fromkeys(said)]


def _uses_nodes(material) -> bool:
    """Whether the nodes count; always so since Blender 5.0, which deprecates the switch."""
    return bpy.app.version >= (5, 0, 0) or material.use_nodes


class _Inputs:
    """The inputs of a shader node, and what is not supported of them."""

    def __init__(self, node, groups):
        self._node, self._groups = node, groups
        self.notes: list[str] = []

    def __contains__(self, name: str) -> bool:
        return name in self._node.inputs

    def value(self, name: str) -> Value:
        """An input, or its own unlinked value where it is not supported."""
        socket = self._node.inputs[name]
        try:
            return value_of(socket, self._groups)
        except UnsupportedError as error:
            value = own_value(Place(socket, self._groups)) if not socket.is_linked else _default(socket)
            shown = ", ".join(f"{number:.3g}" for number in value.numbers)
            self.notes.append(f"{error}; '{name}' is {shown} instead")
            return value

    def number(self, name: str) -> float:
        """An input of one number; of an image its mean, with a note."""
        value = self.value(name).as_number()
        if value.is_image:
            self.notes.append(f"'{name}' is one number for the whole surface; it has the mean of its image")
        return float(value.constant()[0])

    def is_set(self, name: str) -> bool:
        """Whether an input is there and not zero."""
        socket = self._node.inputs.get(name)
        if socket is None:
            return False
        return origin(Place(socket, self._groups)) is not None or bool(
            np.any(own_value(Place(socket, self._groups)).numbers)
        )

    def normals(self) -> dict:
        """The fields of a surface for the normals of a shader."""
        try:
            value, strength = self._normals(Place(self._node.inputs["Normal"], self._groups))
        except UnsupportedError as error:
            self.notes.append(str(error))
            return {}
        return {} if value is None else {"normal": value, "normal_strength": strength}

    def _normals(self, place: Place) -> tuple[Value | None, float]:
        source = origin(place)
        if source is None:
            return None, 1.0
        node, groups = source.socket.node, source.groups
        if node.type == "BUMP":
            self.notes.append(f"{describe(node)} is not supported; the surface is smooth there")
            return self._normals(Place(node.inputs["Normal"], groups))
        if node.type in {"NEW_GEOMETRY", "TEX_COORD"}:
            return None, 1.0
        if node.type != "NORMAL_MAP":
            raise UnsupportedError(f"{describe(node)} for normals is not supported")
        if node.space != "TANGENT":
            raise UnsupportedError(f"{describe(node)} in {node.space.replace('_', ' ').lower()} is not supported")
        strength = value_of(node.inputs["Strength"], groups).constant()[0]
        value = value_of(node.inputs["Color"], groups)
        return (value if value.is_image else None), float(strength)


def _default(socket) -> Value:
    value = socket.default_value
    if socket.type == "RGBA":
        return Value(to_rec709(np.array(value[:3], np.float32)))
    return constant(float(value)) if socket.type == "VALUE" else Value(np.array(value[:3], np.float32))


def _shader(place: Place) -> Surface:
    """What feeds a shader input."""
    source = origin(place)
    if source is None:
        return BLACK
    node = source.socket.node
    make = SHADERS.get(node.type)
    if make is None:
        return Surface(notes=(f"{describe(node)} is not supported; the surface is matte grey",))
    inputs = _Inputs(node, source.groups)
    surface = make(node, inputs, source.groups)
    return replace(surface, notes=(*surface.notes, *inputs.notes))


def _principled(node, inputs, groups) -> Surface:
    for name, meaning in LOST_INPUTS.items():
        if inputs.is_set(name):
            inputs.notes.append(f"{meaning} ('{name}') is not supported")
    coat = inputs.value("Coat Weight") if inputs.is_set("Coat Weight") else constant(0.0)
    if inputs.is_set("Coat Weight"):
        if origin(Place(node.inputs["Coat Normal"], groups)) is not None:
            inputs.notes.append("the coat's normal map ('Coat Normal') is not supported")
        if not _is_white(inputs, "Coat Tint"):
            inputs.notes.append("the coat's colour ('Coat Tint') is not supported")
    if not _is_white(inputs, "Specular Tint"):
        inputs.notes.append("the colour of reflections ('Specular Tint') is not supported")
    emission = constant(0.0, 0.0, 0.0)
    if inputs.is_set("Emission Strength") and inputs.is_set("Emission Color"):
        emission = _product(inputs, "emission", inputs.value("Emission Color"), inputs.value("Emission Strength"))
    opacity = inputs.value("Alpha")
    level, metallic = inputs.number("Specular IOR Level"), inputs.value("Metallic")
    # A dielectric without reflection is matte; the renderer would let it reflect at grazing angles.
    matte = level == 0.0 and not metallic.numbers.any() and not inputs.is_set("Transmission Weight")
    return Surface(
        base=inputs.value("Base Color").as_colour(),
        metallic=metallic,
        roughness=constant(1.0) if matte else inputs.value("Roughness"),
        coat=coat,
        coat_roughness=inputs.value("Coat Roughness"),
        transmission=inputs.value("Transmission Weight"),
        opacity=opacity,
        emission=_covered(inputs, emission, opacity),
        ior=inputs.number("IOR"),
        level=level,
        **inputs.normals(),
    )


def _is_white(inputs: _Inputs, name: str) -> bool:
    if name not in inputs:
        return True
    value = inputs.value(name)
    return not value.is_image and bool(np.all(np.abs(value.numbers - 1.0) < 1e-4))


def _product(inputs: _Inputs, what: str, colour: Value, share: Value) -> Value:
    """A colour times a number, or the colour alone with a note where the two are laid in different ways."""
    try:
        return combined(np.multiply, colour.as_colour(), share)
    except UnsupportedError as error:
        inputs.notes.append(f"of its {what}: {error}")
        return colour.as_colour() if share.is_image else share.as_colour()


def _covered(inputs: _Inputs, emission: Value, opacity: Value) -> Value:
    """Emission where the surface is there; the renderer would let holes shine."""
    if not np.any(emission.numbers) or (not opacity.is_image and opacity.numbers[0] == 1.0):
        return emission
    return _product(inputs, "emission", emission, opacity)


def _diffuse(node, inputs, groups) -> Surface:
    if inputs.is_set("Roughness"):
        inputs.notes.append("the roughness of its diffuse part ('Roughness') is not supported")
    return Surface(base=inputs.value("Color").as_colour(), **inputs.normals())


def _glossy(node, inputs, groups) -> Surface:
    if inputs.is_set("Anisotropy"):
        inputs.notes.append("anisotropy is not supported")
    return Surface(
        base=inputs.value("Color").as_colour(),
        metallic=constant(1.0),
        roughness=inputs.value("Roughness"),
        level=0.5,
        **inputs.normals(),
    )


def _metallic(node, inputs, groups) -> Surface:
    if node.fresnel_type != "F82":
        inputs.notes.append("a metal's measured indices of refraction are not supported; its colour is grey")
        return Surface(base=constant(0.8, 0.8, 0.8), metallic=constant(1.0), roughness=inputs.value("Roughness"))
    if not _is_white(inputs, "Edge Tint"):
        inputs.notes.append("a metal's colour at its edges ('Edge Tint') is not supported")
    return _glossy(node, _Renamed(inputs, {"Color": "Base Color"}), groups)


class _Renamed:
    """Inputs under the names of another node."""

    def __init__(self, inputs: _Inputs, names: dict[str, str]):
        self._inputs, self._names = inputs, names
        self.notes = inputs.notes

    def value(self, name: str) -> Value:
        return self._inputs.value(self._names.get(name, name))

    def is_set(self, name: str) -> bool:
        return self._inputs.is_set(self._names.get(name, name))

    def normals(self) -> dict:
        return self._inputs.normals()


def _glass(node, inputs, groups) -> Surface:
    if node.type == "BSDF_REFRACTION":
        inputs.notes.append("a refraction without reflection is not supported; it reflects as glass does")
    if not _is_white(inputs, "Color"):
        inputs.notes.append(f"reflections of {describe(node)} are white and not of its colour")
    # Its colour is that of one surface, the renderer's that of a way through the body.
    colour = combined(np.multiply, *[inputs.value("Color").as_colour()] * 2)
    return Surface(
        base=colour,
        roughness=inputs.value("Roughness"),
        transmission=constant(1.0),
        ior=inputs.number("IOR"),
        level=0.5,
        **inputs.normals(),
    )


def _transparent(node, inputs, groups) -> Surface:
    colour = inputs.value("Color").as_colour()
    if not colour.is_image and bool(np.all(colour.numbers >= 1.0 - 1e-4)):
        return INVISIBLE
    if float(np.ptp(colour.constant())) > 1e-3:
        inputs.notes.append(f"the colour of {describe(node)} is not supported; it lets grey light through")
    opacity = combined(lambda a: np.clip(1.0 - a, 0.0, 1.0), colour.as_number())
    return Surface(base=constant(0.0, 0.0, 0.0), opacity=opacity)


def _emission(node, inputs, groups) -> Surface:
    emission = _product(inputs, "emission", inputs.value("Color"), inputs.value("Strength"))
    return replace(BLACK, emission=emission)


def _translucent(node, inputs, groups) -> Surface:
    inputs.notes.append(f"{describe(node)} lets no light through; it is matte")
    return Surface(base=inputs.value("Color").as_colour(), **inputs.normals())


def _subsurface(node, inputs, groups) -> Surface:
    inputs.notes.append(f"{describe(node)} is matte; light does not pass below its surface")
    return Surface(base=inputs.value("Color").as_colour(), **inputs.normals())


def _mix(node, inputs, groups) -> Surface:
    factor_socket, *shader_sockets = node.inputs
    first, second = (_shader(Place(socket, groups)) for socket in shader_sockets)
    share_source = origin(Place(factor_socket, groups))
    if share_source is not None and share_source.socket.node.type == "FRESNEL":
        coated = _plastic(first, second, share_source, groups)
        if coated is not None:
            return coated
    share = inputs.value(factor_socket.name)
    try:
        return _blended(node, first, second, share)
    except UnsupportedError as error:
        inputs.notes.append(f"{describe(node)}: {error}; only the first shader is used")
        return first


def _plastic(first: Surface, second: Surface, share_source: Place, groups) -> Surface | None:
    """A matte surface below reflections by Fresnel's law, which is a dielectric."""
    matte = first.metallic.numbers.max() == 0.0 and first.level == 0.0 and first.visible
    mirror = not second.metallic.is_image and second.metallic.numbers[0] == 1.0
    if not (matte and mirror):
        return None
    ior = value_of(share_source.socket.node.inputs["IOR"], share_source.groups).constant()[0]
    return replace(
        first,
        roughness=second.roughness,
        ior=float(ior),
        level=0.5,
        normal=first.normal or second.normal,
        notes=(*first.notes, *second.notes),
    )


def _blended(node, first: Surface, second: Surface, share: Value) -> Surface:
    """A mixture of two surfaces; exact where one of them is a hole or only shines."""
    if not share.is_image and share.numbers[0] <= 0.0:
        return first
    if not share.is_image and share.numbers[0] >= 1.0:
        return second
    clipped = combined(lambda a: np.clip(a, 0.0, 1.0), share)
    notes = (*first.notes, *second.notes)
    for whole, other, weight in (
        (first, second, combined(lambda a: 1.0 - a, clipped)),
        (second, first, clipped),
    ):
        if not other.visible:
            return replace(
                whole,
                opacity=combined(np.multiply, whole.opacity, weight),
                emission=combined(np.multiply, whole.emission, weight),
                notes=notes,
            )

    def between(a: Value, b: Value) -> Value:
        if not a.is_image and not b.is_image and np.array_equal(a.numbers, b.numbers) and a.attribute == b.attribute:
            return a
        return combined(lambda low, high, part: low + part * (high - low), a, b, clipped)

    part = float(clipped.constant()[0])
    # A surface that only shines is black: it takes nothing but its share of the colour.
    shines = [surface.base is BLACK.base for surface in (first, second)]
    if shines == [True, False]:
        first = replace(second, base=first.base, emission=first.emission, coat=first.coat)
    elif shines == [False, True]:
        second = replace(first, base=second.base, emission=second.emission, coat=second.coat)
    elif not _alike(first, second):
        notes += (f"{describe(node)} of unlike shaders is one material of their mean",)
    return Surface(
        **{
            name: between(getattr(first, name), getattr(second, name))
            for name in (
                "base",
                "metallic",
                "roughness",
                "coat",
                "coat_roughness",
                "transmission",
                "opacity",
                "emission",
            )
        },
        ior=first.ior + part * (second.ior - first.ior),
        level=first.level + part * (second.level - first.level),
        normal=first.normal or second.normal,
        normal_strength=(first if first.normal else second).normal_strength,
        notes=notes,
    )


def _alike(first: Surface, second: Surface) -> bool:
    """Whether the mean of two surfaces' settings is near the mean of what they show: they differ in colour alone."""
    names = ("metallic", "roughness", "transmission", "coat")
    return first.level == second.level and all(
        np.array_equal(getattr(first, name).numbers, getattr(second, name).numbers) for name in names
    )


def _add(node, inputs, groups) -> Surface:
    first, second = (_shader(Place(socket, groups)) for socket in node.inputs)
    for whole, other in ((first, second), (second, first)):
        if other.base is BLACK.base and other.visible:  # it only shines
            emission = combined(np.add, whole.emission, other.emission)
            if not whole.visible:
                emission = constant(0.0, 0.0, 0.0)
                inputs.notes.append(f"{describe(node)}: light of a surface that is not there is not supported")
            return replace(whole, emission=emission, notes=(*first.notes, *second.notes))
    inputs.notes.append(f"{describe(node)} of two reflecting shaders is not supported; only the first is used")
    return first


SHADERS = {
    "BSDF_PRINCIPLED": _principled,
    "BSDF_DIFFUSE": _diffuse,
    "BSDF_GLOSSY": _glossy,
    "BSDF_ANISOTROPIC": _glossy,
    "BSDF_METALLIC": _metallic,
    "BSDF_GLASS": _glass,
    "BSDF_REFRACTION": _glass,
    "BSDF_TRANSPARENT": _transparent,
    "BSDF_TRANSLUCENT": _translucent,
    "SUBSURFACE_SCATTERING": _subsurface,
    "EMISSION": _emission,
    "MIX_SHADER": _mix,
    "ADD_SHADER": _add,
}
"""Supported shader nodes, by Blender's type."""


def reflection_ior(surface: Surface) -> float:
    """Index of refraction of a dielectric whose reflection is the Principled BSDF's, specular level included."""
    normal = ((surface.ior - 1.0) / (surface.ior + 1.0)) ** 2 * 2.0 * surface.level
    root = float(np.sqrt(min(max(normal, 0.0), 0.35)))
    return (1.0 + root) / (1.0 - root)

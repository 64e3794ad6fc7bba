"""What a socket of a shader node tree amounts to: a constant, or an image laid by one set of coordinates.

Constants are folded and whatever is done to one image is done to its pixels; what varies in another way cannot be
exported and is reported by name. Formulas are those of Cycles' nodes (Blender's manual, "Shader Nodes").
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from mathutils import Euler, Matrix, Vector

from .images import LUMINANCE, MISSING, ImageError, pixels, to_rec709

ATTRIBUTE_COLOUR, UV, GENERATED, OBJECT = "COLOUR", "UV", "GENERATED", "OBJECT"


class UnsupportedError(Exception):
    """A sentence's end that says what is not supported, as in "node 'Noise' (Noise Texture) is not supported"."""


@dataclass(frozen=True)
class Lay:
    """How an image is laid onto a mesh.

    Attributes:
        source: UV, GENERATED or OBJECT coordinates.
        name: of the UV map; empty for the one that is active for rendering.
        matrix: applied to the coordinates, row by row.
        extension: REPEAT, EXTEND, CLIP or MIRROR.
        nearest: hard texels.
        box: projected along the nearest axis instead of along z.
    """

    source: str = UV
    name: str = ""
    matrix: tuple[tuple[float, ...], ...] = ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))
    extension: str = "REPEAT"
    nearest: bool = False
    box: bool = False


@dataclass(frozen=True, eq=False)
class Value:
    """What a socket has.

    Attributes:
        numbers: shape (1,) or (3,) of a constant, (height, width, 1 or 3) of an image, first row at the top; linear.
        lay: how the image is laid; ``None`` for constants.
        attribute: name of the colour attribute that the numbers are multiplied by, or ``None``.
    """

    numbers: np.ndarray
    lay: Lay | None = None
    attribute: str | None = None

    @property
    def is_image(self) -> bool:
        """Whether it varies over the surface by an image."""
        return self.lay is not None

    def constant(self) -> np.ndarray:
        """The constant, or an image's mean; shape (1,) or (3,)."""
        return self.numbers.reshape(-1, self.numbers.shape[-1]).mean(axis=0) if self.is_image else self.numbers

    def as_number(self) -> "Value":
        """As Blender turns a colour into a number."""
        if self.numbers.shape[-1] == 1:
            return self
        return replace(self, numbers=self.numbers @ LUMINANCE[:, None])

    def as_colour(self) -> "Value":
        """With three channels."""
        if self.numbers.shape[-1] == 3:
            return self
        return replace(self, numbers=np.repeat(self.numbers, 3, axis=-1))


def constant(*numbers: float) -> Value:
    """A constant of one or three channels."""
    return Value(np.array(numbers, np.float32))


@dataclass(frozen=True)
class Place:
    """A socket, and the group nodes that lead to its tree, the outermost first."""

    socket: Any
    groups: tuple = ()


def origin(place: Place) -> Place | None:
    """The output socket that feeds an input, through reroutes, groups and muted nodes; ``None`` if nothing does.

    An input that is left to its own value inside a group or outside it is given by :func:`own`.
    """
    found = _step(place)
    return found if found.socket.is_output else None


def own(place: Place) -> Place:
    """The unlinked input whose own value counts."""
    return _step(place)


def _step(place: Place) -> Place:
    socket, groups = place.socket, place.groups
    for _ in range(1000):
        if not socket.is_output:
            links = [link for link in socket.links if link.is_valid and not link.is_muted]
            if not links:
                return Place(socket, groups)
            socket = links[0].from_socket
        node = socket.node
        if node.mute:
            inner = [link.from_socket for link in node.internal_links if link.to_socket == socket]
            if not inner:
                return Place(socket, groups)
            socket = inner[0]
        elif node.type == "REROUTE":
            socket = node.inputs[0]
        elif node.type == "GROUP" and node.node_tree is not None:
            inner_output = next(
                (each for each in node.node_tree.nodes if each.type == "GROUP_OUTPUT" and each.is_active_output), None
            )
            counterpart = None if inner_output is None else _same(inner_output.inputs, socket.identifier)
            if counterpart is None:
                return Place(socket, groups)
            socket, groups = counterpart, (*groups, node)
        elif node.type == "GROUP_INPUT" and groups:
            counterpart = _same(groups[-1].inputs, socket.identifier)
            if counterpart is None:
                return Place(socket, groups)
            socket, groups = counterpart, groups[:-1]
        else:
            return Place(socket, groups)
    raise UnsupportedError("a loop of nodes is not supported")


def _same(sockets, identifier):
    return next((socket for socket in sockets if socket.identifier == identifier), None)


def describe(node) -> str:
    """A node by its name and kind."""
    return f"node '{node.label or node.name}' ({node.bl_label})"


def value_of(socket, groups: tuple = ()) -> Value:
    """What an input socket amounts to, linear Rec.709 where it is a colour.

    Raises:
        UnsupportedError: it varies in a way that is not supported.
    """
    place = Place(socket, groups)
    source = origin(place)
    if source is None:
        return own_value(place)
    node = source.socket.node
    make = NODES.get(node.type)
    if make is None:
        raise UnsupportedError(f"{describe(node)} is not supported")
    value = make(node, source.socket, source.groups)
    return value.as_number() if socket.type == "VALUE" else value


def own_value(place: Place) -> Value:
    """The value that an unlinked input has by itself."""
    socket = own(place).socket
    if not hasattr(socket, "default_value"):
        return constant(0.0)
    return _numbers(socket.default_value, socket.type)


def _numbers(value, kind) -> Value:
    if kind == "RGBA":
        return Value(to_rec709(np.array(value[:3], np.float32)))
    if kind in {"VALUE", "INT", "BOOLEAN"}:
        return constant(float(value))
    return Value(np.array(value[:3], np.float32))


def combined(function: Callable[..., np.ndarray], *values: Value) -> Value:
    """Apply a function of arrays to values, texel by texel.

    Raises:
        UnsupportedError: the values are images that are mapped in different ways.
    """
    if any(value.attribute is not None for value in values):
        raise UnsupportedError("a colour attribute that is not only multiplied is not supported")
    pictures = [value for value in values if value.is_image]
    lays = {value.lay for value in pictures}
    if len(lays) > 1:
        raise UnsupportedError("a mixture of images that are mapped in different ways is not supported")
    arrays = [value.numbers for value in values]
    if pictures:
        height, width = (max(value.numbers.shape[axis] for value in pictures) for axis in (0, 1))
        arrays = [resized(array, height, width) if array.ndim == 3 else array for array in arrays]
    result = np.asarray(function(*arrays), np.float32)
    return Value(np.where(np.isfinite(result), result, 0.0), lays.pop() if lays else None)


def resized(array: np.ndarray, height: int, width: int) -> np.ndarray:
    """An image of shape (h, w, channels) at another size, by linear interpolation between texel centres."""
    for axis, size in ((0, height), (1, width)):
        if array.shape[axis] != size:
            places = np.clip((np.arange(size) + 0.5) * array.shape[axis] / size - 0.5, 0.0, array.shape[axis] - 1.0)
            low = np.floor(places).astype(int)
            high = np.minimum(low + 1, array.shape[axis] - 1)
            share = (places - low).astype(np.float32).reshape((-1, 1, 1) if axis == 0 else (1, -1, 1))
            array = np.take(array, low, axis) * (1.0 - share) + np.take(array, high, axis) * share
    return array


def _image(node, socket, groups) -> Value:
    lay = lay_of(node, groups)
    if node.image is not None and node.image.source in {"SEQUENCE", "MOVIE", "TILED"}:
        kind = {"SEQUENCE": "a sequence", "MOVIE": "a movie", "TILED": "a set of tiles"}[node.image.source]
        raise UnsupportedError(f"image '{node.image.name}' of {describe(node)} is {kind}, which is not supported")
    try:
        found = _cached(node.image, _uses_alpha(node))
    except ImageError:
        found = None
    if found is None:
        found = np.tile(MISSING, (1, 1, 1))
    numbers = found[..., 3:] if socket.identifier == "Alpha" else found[..., :3]
    if lay.extension == "CLIP":  # nothing lies beyond its edges
        numbers = np.pad(numbers, ((1, 1), (1, 1), (0, 0)))
        height, width = found.shape[:2]
        across, up = width / (width + 2), height / (height + 2)
        frame = Matrix.Translation((1 / (width + 2), 1 / (height + 2), 0)) @ Matrix.Diagonal((across, up, 1, 1))
        lay = replace(lay, matrix=_rows(frame @ Matrix(lay.matrix)))
    if node.interpolation == "Closest":
        lay = replace(lay, nearest=True)
    return Value(numbers, lay)


def missing_images(tree, seen=None) -> list[str]:
    """Sentences on the image textures of a tree, groups included, whose pictures cannot be read."""
    seen = set() if seen is None else seen
    said = []
    for node in tree.nodes:
        if node.type == "GROUP" and node.node_tree is not None and node.node_tree.name not in seen:
            seen.add(node.node_tree.name)
            said += missing_images(node.node_tree, seen)
        if node.type == "TEX_IMAGE" and any(output.is_linked for output in node.outputs):
            if node.image is None:
                said.append(f"{describe(node)} has no image and shows magenta, as in Cycles")
            elif node.image.source in {"FILE", "GENERATED"}:
                try:
                    _cached(node.image, _uses_alpha(node))
                except ImageError as error:
                    said.append(f"image '{node.image.name}' of {describe(node)} {error}; it shows magenta")
    return said


_pictures: dict[tuple, np.ndarray] = {}


def forget_pictures() -> None:
    """Let go of the pixels that were read for one export."""
    _pictures.clear()


def _cached(image, with_alpha: bool) -> np.ndarray | None:
    if image is None:
        return None
    key = (image.as_pointer(), with_alpha)
    if key not in _pictures:
        _pictures[key] = pixels(image, with_alpha)
    return _pictures[key]


def _uses_alpha(node) -> bool:
    output = node.outputs.get("Alpha")
    return output is not None and output.is_linked


def lay_of(node, groups) -> Lay:
    """How an image texture node lays its image.

    Raises:
        UnsupportedError: by coordinates that a mesh file has no place for.
    """
    if node.projection not in {"FLAT", "BOX"}:
        raise UnsupportedError(f"the {node.projection.lower()} projection of {describe(node)} is not supported")
    place = Place(node.inputs["Vector"], groups)
    unlinked = Lay(GENERATED if node.projection == "BOX" else UV)
    lay = unlinked if origin(place) is None else _coordinates(place)
    own_mapping = node.texture_mapping
    if tuple(own_mapping.scale) != (1, 1, 1) or any(own_mapping.translation) or any(own_mapping.rotation):
        matrix = Matrix.LocRotScale(own_mapping.translation, own_mapping.rotation, own_mapping.scale)
        lay = replace(lay, matrix=_rows(matrix @ Matrix(lay.matrix)))
    return replace(lay, extension=node.extension, box=node.projection == "BOX")


def _coordinates(place: Place) -> Lay:
    source = origin(place)
    node, groups = source.socket.node, source.groups
    if node.type == "TEX_COORD":
        kind = source.socket.identifier
        if kind not in {"UV", "Generated", "Object"} or (kind == "Object" and node.object is not None):
            raise UnsupportedError(f"output '{source.socket.name}' of {describe(node)} is not supported")
        return Lay(kind.upper())
    if node.type == "UVMAP":
        return Lay(UV, node.uv_map)
    if (
        node.type == "ATTRIBUTE"
        and node.attribute_type == "GEOMETRY"
        and source.socket.identifier in {"Vector", "Color"}
    ):
        return Lay(UV, node.attribute_name)
    if node.type == "MAPPING":
        inner = Place(node.inputs["Vector"], groups)
        if origin(inner) is None:
            raise UnsupportedError(f"{describe(node)} without coordinates is not supported")
        lay = _coordinates(inner)
        return replace(lay, matrix=_rows(_mapping(node, groups) @ Matrix(lay.matrix)))
    raise UnsupportedError(f"{describe(node)} for the coordinates of an image is not supported")


def _mapping(node, groups) -> Matrix:
    def vector(name, default):
        socket = node.inputs.get(name)
        if socket is None or not socket.enabled:
            return Vector(default)
        found = value_of(socket, groups)
        if found.is_image:
            raise UnsupportedError(f"{describe(node)} with an image as its {name.lower()} is not supported")
        return Vector(found.as_colour().numbers)

    turn = Euler(vector("Rotation", (0, 0, 0)), "XYZ").to_matrix().to_4x4()
    scale = Matrix.Diagonal((*vector("Scale", (1, 1, 1)), 1.0))
    move = Matrix.Translation(vector("Location", (0, 0, 0)))
    if node.vector_type == "POINT":
        return move @ turn @ scale
    if node.vector_type == "VECTOR":
        return turn @ scale
    if node.vector_type == "TEXTURE" and 0.0 not in scale.to_scale():
        return (move @ turn @ scale).inverted()
    raise UnsupportedError(f"{describe(node)} of the kind {node.vector_type.lower()} is not supported")


def _rows(matrix: Matrix) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(round(number, 6) for number in row) for row in matrix)


def _value(node, socket, groups) -> Value:
    return _numbers(socket.default_value, socket.type)


def _vertex_colour(node, socket, groups) -> Value:
    name = node.layer_name if node.type == "VERTEX_COLOR" else node.attribute_name
    if socket.identifier != "Color" or getattr(node, "attribute_type", "GEOMETRY") != "GEOMETRY":
        raise UnsupportedError(f"output '{socket.name}' of {describe(node)} is not supported")
    return Value(np.ones(3, np.float32), attribute=name)


def _inputs(node, groups) -> list[Value]:
    return [value_of(socket, groups) for socket in node.inputs if socket.enabled]


def _screen(a, b):
    return 1.0 - (1.0 - a) * (1.0 - b)


def _overlay(a, b):
    return np.where(a < 0.5, 2.0 * a * b, 1.0 - 2.0 * (1.0 - a) * (1.0 - b))


BLENDS: dict[str, Callable] = {
    "MIX": lambda a, b: b,
    "MULTIPLY": np.multiply,
    "ADD": np.add,
    "SUBTRACT": np.subtract,
    "SCREEN": _screen,
    "OVERLAY": _overlay,
    "DIFFERENCE": lambda a, b: np.abs(a - b),
    "DARKEN": np.minimum,
    "LIGHTEN": np.maximum,
    "DIVIDE": lambda a, b: np.divide(a, b, out=np.zeros(np.broadcast(a, b).shape, np.float32), where=b != 0.0),
}
"""What a mix node does where its factor is 1."""


def _mix(node, socket, groups) -> Value:
    if node.type == "MIX_RGB":
        factor, a, b = _inputs(node, groups)
        blend, clamp_factor, clamp = node.blend_type, True, node.use_clamp
    else:
        factor, a, b = _inputs(node, groups)
        blend = node.blend_type if node.data_type == "RGBA" else "MIX"
        clamp_factor, clamp = node.clamp_factor, node.data_type == "RGBA" and node.clamp_result
        if node.data_type == "RGBA":
            a, b = a.as_colour(), b.as_colour()
    if blend not in BLENDS:
        raise UnsupportedError(f"{describe(node)} with '{blend.replace('_', ' ').lower()}' is not supported")
    if (a.attribute or b.attribute) and blend == "MULTIPLY" and not factor.is_image and factor.numbers[0] == 1.0:
        if a.attribute and b.attribute:
            raise UnsupportedError(f"{describe(node)} of two colour attributes is not supported")
        found = combined(np.multiply, replace(a, attribute=None), replace(b, attribute=None))
        return replace(found, attribute=a.attribute or b.attribute)
    function = BLENDS[blend]

    def mixed(share, first, second):
        share = np.clip(share, 0.0, 1.0) if clamp_factor else share
        result = first + share * (function(first, second) - first)
        return np.clip(result, 0.0, 1.0) if clamp else result

    return combined(mixed, factor, a, b)


def _safe(function: Callable) -> Callable:
    def quiet(*arrays):
        with np.errstate(all="ignore"):
            return function(*arrays)

    return quiet


MATH: dict[str, Callable] = {
    "ADD": lambda a, b, c: a + b,
    "SUBTRACT": lambda a, b, c: a - b,
    "MULTIPLY": lambda a, b, c: a * b,
    "DIVIDE": lambda a, b, c: np.where(b != 0.0, a / b, 0.0),
    "MULTIPLY_ADD": lambda a, b, c: a * b + c,
    "POWER": lambda a, b, c: np.power(a, b),
    "LOGARITHM": lambda a, b, c: np.where((a > 0.0) & (b > 0.0), np.log(a) / np.log(b), 0.0),
    "SQRT": lambda a, b, c: np.sqrt(np.maximum(a, 0.0)),
    "ABSOLUTE": lambda a, b, c: np.abs(a),
    "EXPONENT": lambda a, b, c: np.exp(a),
    "MINIMUM": lambda a, b, c: np.minimum(a, b),
    "MAXIMUM": lambda a, b, c: np.maximum(a, b),
    "LESS_THAN": lambda a, b, c: (a < b) * 1.0,
    "GREATER_THAN": lambda a, b, c: (a > b) * 1.0,
    "ROUND": lambda a, b, c: np.floor(a + 0.5),
    "FLOOR": lambda a, b, c: np.floor(a),
    "CEIL": lambda a, b, c: np.ceil(a),
    "FRACT": lambda a, b, c: a - np.floor(a),
    "SINE": lambda a, b, c: np.sin(a),
    "COSINE": lambda a, b, c: np.cos(a),
}


def _math(node, socket, groups) -> Value:
    if node.operation not in MATH:
        raise UnsupportedError(f"{describe(node)} with '{node.operation.replace('_', ' ').lower()}' is not supported")
    values = [value_of(each, groups).as_number() for each in node.inputs if each.enabled]
    values += [constant(0.0)] * (3 - len(values))
    found = combined(_safe(MATH[node.operation]), *values)
    return replace(found, numbers=np.clip(found.numbers, 0.0, 1.0)) if node.use_clamp else found


def _vector_math(node, socket, groups) -> Value:
    values = _inputs(node, groups)
    functions: dict[str, Callable] = {
        "ADD": np.add,
        "SUBTRACT": np.subtract,
        "MULTIPLY": np.multiply,
        "SCALE": np.multiply,
    }
    if node.operation not in functions:
        raise UnsupportedError(f"{describe(node)} with '{node.operation.replace('_', ' ').lower()}' is not supported")
    return combined(functions[node.operation], *values[:2])


def _clamp(node, socket, groups) -> Value:
    return combined(lambda a, low, high: np.clip(a, low, high), *_inputs(node, groups))


def _map_range(node, socket, groups) -> Value:
    if node.data_type != "FLOAT" or node.interpolation_type != "LINEAR":
        raise UnsupportedError(f"{describe(node)} that is not linear is not supported")

    def mapped(value, low, high, to_low, to_high):
        with np.errstate(all="ignore"):
            share = (value - low) / (high - low)
        share = np.clip(share, 0.0, 1.0) if node.clamp else share
        return to_low + share * (to_high - to_low)

    return combined(mapped, *_inputs(node, groups))


def _gamma(node, socket, groups) -> Value:
    return combined(
        lambda a, power: np.where(a > 0.0, np.power(np.maximum(a, 1e-30), power), a), *_inputs(node, groups)
    )


def _invert(node, socket, groups) -> Value:
    factor, colour = _inputs(node, groups)
    return combined(lambda share, a: a + share * (1.0 - 2.0 * a), factor, colour.as_colour())


def _brightness(node, socket, groups) -> Value:
    colour, bright, contrast = _inputs(node, groups)
    return combined(lambda a, b, c: np.maximum(a * (1.0 + c) + b - 0.5 * c, 0.0), colour.as_colour(), bright, contrast)


def _hue_saturation(node, socket, groups) -> Value:
    values = {each.identifier: value_of(each, groups) for each in node.inputs}
    order = [values[name] for name in ("Hue", "Saturation", "Value")]
    factor = next(values[name] for name in ("Fac", "Factor") if name in values)

    def shifted(colour, hue, saturation, value, share):
        h, s, v = _to_hsv(colour)
        h, s, v = (h + hue[..., 0] + 0.5) % 1.0, np.clip(s * saturation[..., 0], 0.0, 1.0), v * value[..., 0]
        return np.maximum(colour + share * (_from_hsv(h, s, v) - colour), 0.0)

    return combined(shifted, values["Color"].as_colour(), *order, factor)


def _to_hsv(colour):
    high, low = colour.max(axis=-1), colour.min(axis=-1)
    spread = high - low
    red, green, blue = np.moveaxis(colour, -1, 0)
    safe = np.where(spread > 0.0, spread, 1.0)
    hue = np.where(
        red == high,
        (green - blue) / safe,
        np.where(green == high, 2.0 + (blue - red) / safe, 4.0 + (red - green) / safe),
    )
    return (
        np.where(spread > 0.0, hue / 6.0 % 1.0, 0.0),
        np.where(high > 0.0, spread / np.maximum(high, 1e-30), 0.0),
        high,
    )


def _from_hsv(hue, saturation, value):
    channels = []
    for turn in (5.0, 3.0, 1.0):
        place = (turn + 6.0 * hue) % 6.0
        channels.append(value * (1.0 - saturation * np.clip(np.minimum(place, 4.0 - place), 0.0, 1.0)))
    return np.stack(channels, axis=-1)


def _to_number(node, socket, groups) -> Value:
    return value_of(node.inputs[0], groups).as_colour().as_number()


def _separate(node, socket, groups) -> Value:
    if getattr(node, "mode", "RGB") != "RGB":
        raise UnsupportedError(f"{describe(node)} into {node.mode} is not supported")
    index = list(node.outputs).index(socket)
    return combined(lambda a: a[..., index : index + 1], value_of(node.inputs[0], groups).as_colour())


def _combine(node, socket, groups) -> Value:
    if getattr(node, "mode", "RGB") != "RGB":
        raise UnsupportedError(f"{describe(node)} of {node.mode} is not supported")
    return combined(
        lambda *parts: np.concatenate(np.broadcast_arrays(*parts), axis=-1),
        *(each.as_number() for each in _inputs(node, groups)),
    )


LEVELS = 1024


def _ramp(node, socket, groups) -> Value:
    table = np.array([node.color_ramp.evaluate(level / (LEVELS - 1)) for level in range(LEVELS)], np.float32)
    table = table[:, 3:] if socket.identifier == "Alpha" else to_rec709(table)[:, :3]
    factor = value_of(node.inputs[0], groups).as_number()
    return combined(lambda a: _looked_up(table, a[..., 0]), factor)


def _looked_up(table, share):
    place = np.clip(share, 0.0, 1.0) * (LEVELS - 1)
    low = np.floor(place).astype(int)
    part = (place - low)[..., None]
    return table[low] * (1.0 - part) + table[np.minimum(low + 1, LEVELS - 1)] * part


def _curves(node, socket, groups) -> Value:
    curves = node.mapping
    curves.initialize()
    levels = np.arange(LEVELS) / (LEVELS - 1)
    tables = [
        np.array([curves.evaluate(curve, curves.evaluate(curves.curves[3], level)) for level in levels], np.float32)
        for curve in list(curves.curves)[:3]
    ]
    factor, colour = _inputs(node, groups)

    def bent(share, a):
        moved = np.stack([np.interp(a[..., channel], levels, tables[channel]) for channel in range(3)], axis=-1)
        return a + share * (moved - a)

    return combined(bent, factor, colour.as_colour())


NODES: dict[str, Callable[[Any, Any, tuple], Value]] = {
    "TEX_IMAGE": _image,
    "RGB": _value,
    "VALUE": _value,
    "VERTEX_COLOR": _vertex_colour,
    "ATTRIBUTE": _vertex_colour,
    "MIX": _mix,
    "MIX_RGB": _mix,
    "MATH": _math,
    "VECT_MATH": _vector_math,
    "CLAMP": _clamp,
    "MAP_RANGE": _map_range,
    "GAMMA": _gamma,
    "INVERT": _invert,
    "BRIGHTCONTRAST": _brightness,
    "HUE_SAT": _hue_saturation,
    "RGBTOBW": _to_number,
    "SEPARATE_COLOR": _separate,
    "SEPRGB": _separate,
    "SEPXYZ": _separate,
    "COMBINE_COLOR": _combine,
    "COMBRGB": _combine,
    "COMBXYZ": _combine,
    "VALTORGB": _ramp,
    "CURVE_RGB": _curves,
}
"""Nodes whose outputs are supported, by Blender's type."""

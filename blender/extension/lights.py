"""Blender's lamps as emissive geometry: what shines in the real world has a surface.

Blender's power ``P`` in watts is the flux of a lamp that shines to all sides: a point of radius ``r`` has the radiance
``P / (4 pi^2 r^2)``, an area lamp of area ``A``, which shines to one side only, ``P / (pi A)``.
"""

import math
from typing import Any

import numpy as np
from mathutils import Matrix, Vector

from . import graph
from .images import to_rec709

SMALLEST_RADIUS = 0.02
"""Radius, in metres, that a lamp without a size gets; a smaller one would be found by few rays."""
SUN_DISTANCE = 2000.0
"""Distance from the world's origin, in metres, of the disk that stands for a sun."""
SMALLEST_SPOT = 0.1
"""Smallest radius of a spot's shining disk, as a share of the lamp's; a smaller one is found by few rays."""
SHARES = ("diffuse_factor", "specular_factor", "transmission_factor", "volume_factor")


def emitters(name: str, light, to_world: Matrix) -> tuple[list[dict[str, Any]], list[str]]:
    """The ``[[synthetic]]`` tables of a lamp.

    Args:
        name: the lamp's name, unique.
        light: its settings, evaluated.
        to_world: its matrix.

    Returns:
        The tables, and notes on what of the lamp is not supported.
    """
    if getattr(
        getattr(light, "cycles", None), "is_portal", False
    ):  # shows Cycles where light comes from and gives none
        return [], []
    colour, notes = strength(name, light)
    if max(colour) <= 0.0:
        return [], notes
    make = {"POINT": _point, "AREA": _area, "SPOT": _spot, "SUN": _sun}[light.type]
    tables, more = make(name, light, to_world, colour)
    return tables, notes + more


def strength(name: str, light) -> tuple[list[float], list[str]]:
    """Colour times power of a lamp and its nodes, in watts per channel, or watts per square metre of a sun; and notes."""
    factor, notes = _shader(name, light)
    if not light.use_shadow:
        notes.append(f"Light '{name}': it casts shadows, though they are switched off")
    if any(getattr(light, share, 1.0) != 1.0 for share in SHARES):
        notes.append(f"Light '{name}': its shares for diffuse, specular, transmission and volume are not supported")
    return [max(0.0, float(a * b)) for a, b in zip(_colour(light), factor, strict=True)], notes


def _shader(name: str, light) -> tuple[np.ndarray, list[str]]:
    """What the lamp's nodes multiply its colour by, shape (3,), and notes on what of them is not supported."""
    if not getattr(light, "use_nodes", True) or light.node_tree is None:
        return np.ones(3), []
    output = light.node_tree.get_output_node("CYCLES") or light.node_tree.get_output_node("ALL")
    source = None if output is None else graph.origin(graph.Place(output.inputs["Surface"]))
    if source is None:
        return np.zeros(3), []
    node = source.socket.node
    if node.type != "EMISSION":
        return np.ones(3), [f"Light '{name}': {graph.describe(node)} is not supported; it shines evenly in its colour"]
    factor, notes = np.ones(3), []
    for socket in (node.inputs["Color"], node.inputs["Strength"]):
        try:
            value = graph.value_of(socket, source.groups)
        except graph.UnsupportedError as error:
            notes.append(f"Light '{name}': {error}; it shines evenly")
            continue
        if value.is_image:
            notes.append(f"Light '{name}': its image is not supported; it shines evenly with the image's mean colour")
        factor = factor * value.constant()
    return factor, notes


def _colour(light) -> list[float]:
    """Colour times power: watts per channel; watts per square metre for a sun."""
    power = light.energy * 2.0 ** getattr(light, "exposure", 0.0)
    colour = [float(channel) for channel in to_rec709(np.array(light.color, np.float32))]
    if getattr(light, "use_temperature", False):
        colour = [a * b for a, b in zip(colour, light.temperature_color, strict=True)]
    return [max(0.0, channel * power) for channel in colour]


def _emitter(colour, factor) -> dict[str, Any]:
    """A lamp's surface: it shines on its front and holds back no light, as lamps do in Cycles."""
    radiance = [channel * factor for channel in colour]
    return {"type": "principled", "base_color": [0.0, 0.0, 0.0], "opacity": 0.0, "emission": radiance}


def make_plain(light) -> None:
    """Switch off what changes a lamp's colour and power beyond these themselves."""
    for plain, value in (("use_nodes", False), ("exposure", 0.0), ("use_temperature", False), ("normalize", True)):
        if hasattr(light, plain):
            setattr(light, plain, value)


def normalized(light) -> bool:
    """Whether the power is the lamp's own, whatever its size (always so before 4.5)."""
    return getattr(light, "normalize", True)


def _radius(name, light) -> tuple[float, list[str]]:
    radius = light.shadow_soft_size
    if radius >= SMALLEST_RADIUS:
        return radius, []
    return SMALLEST_RADIUS, [f"Light '{name}': a lamp has a size; its radius became {1000 * SMALLEST_RADIUS:g} mm"]


def sphere_radiance(light, radius) -> float:
    """Radiance of a sphere for each watt."""
    return 1.0 / (4.0 * math.pi**2 * radius**2) if normalized(light) else 1.0 / math.pi


def _point(name, light, to_world, colour):
    radius, notes = _radius(name, light)
    return [
        {
            "name": name,
            "shape": "sphere",
            "center": list(to_world.translation),
            "radius": radius,
            "material": _emitter(colour, sphere_radiance(light, radius)),
        }
    ], notes


def _area(name, light, to_world, colour):
    notes = []
    if light.spread < math.pi - 1e-3:
        notes.append(f"Light '{name}': its spread is not supported; it shines to its whole front side")
    scale = to_world.to_scale()
    width = light.size * scale.x
    depth = (light.size_y if light.shape in {"RECTANGLE", "ELLIPSE"} else light.size) * scale.y
    round_shape = light.shape in {"DISK", "ELLIPSE"}
    area = width * depth * (math.pi / 4.0 if round_shape else 1.0)
    table = _facing_down(name, "disk" if round_shape else "rectangle", to_world, (0.5 * width, 0.5 * depth, 1.0))
    return [
        table | {"material": _emitter(colour, 1.0 / (math.pi * area) if normalized(light) else 1.0 / math.pi)}
    ], notes


def _facing_down(name, shape, to_world, scale) -> dict[str, Any]:
    """A unit shape whose +z is the lamp's -z."""
    turned = to_world.to_quaternion().to_matrix() @ Matrix.Rotation(math.pi, 3, "X")
    return {
        "name": name,
        "shape": shape,
        "position": list(to_world.translation),
        "rotation": [math.degrees(angle) for angle in turned.to_euler("XYZ")],
        "scale": [abs(value) for value in scale],
    }


def _spot(name, light, to_world, colour):
    """A shining disk with the intensity of a point lamp along its axis, in a black tube that cuts off the cone.

    The tube's opening shows half of the disk in the middle of the lamp's blend, and its rim is as wide as the blend.
    """
    radius, notes = _radius(name, light)
    notes.append(f"Light '{name}': a spot is a disk in a black tube, which casts shadows")
    if light.use_square:
        notes.append(f"Light '{name}': a spot is round; its square shape is not supported")
    half = 0.5 * light.spot_size
    if half >= math.radians(80.0):
        notes.append(f"Light '{name}': a spot so wide is a disk that shines to its whole front side")
        disk, tube_length = SMALLEST_SPOT * radius, 0.0
    else:
        inner, middle, outer = (
            math.tan(math.acos(min(1.0, math.cos(half) + (1.0 - math.cos(half)) * light.spot_blend * share)))
            for share in (1.0, 0.5, 0.0)
        )
        disk = max(0.5 * (outer - inner) / middle, SMALLEST_SPOT) * radius
        tube_length = radius / middle
    emitter = _emitter(colour, sphere_radiance(light, radius) * (radius / disk) ** 2)
    tables = [_facing_down(name, "disk", to_world, (disk, disk, 1.0)) | {"material": emitter}]
    if tube_length:
        tube = _facing_down(f"{name} housing", "cylinder", to_world, (radius, radius, tube_length))
        tables.append(tube | {"material": {"type": "diffuse", "color": [0.0, 0.0, 0.0]}})
    return tables, notes


def _sun(name, light, to_world, colour):
    """A disk far away whose irradiance on a surface across its direction is the sun's strength."""
    half = max(0.5 * light.angle, math.radians(0.05))
    notes = []
    if 0.5 * light.angle < half:
        notes.append(f"Light '{name}': a sun has a size; its angle became {math.degrees(2 * half):g} degrees")
    notes.append(f"Light '{name}': a sun is a disk {SUN_DISTANCE:g} m away; real walls that stand in its way block it")
    radius = SUN_DISTANCE * math.tan(half)
    turn = to_world.to_quaternion().to_matrix().to_4x4()  # where a sun's lamp stands means nothing
    away = Matrix.Translation(turn @ Vector((0.0, 0.0, SUN_DISTANCE)))
    table = _facing_down(name, "disk", away @ turn, (radius, radius, 1.0))
    radiance = 1.0 / (math.pi * math.sin(half) ** 2) if normalized(light) else 1.0
    return [table | {"material": _emitter(colour, radiance)}], notes

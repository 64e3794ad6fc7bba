"""Blender's motion blur: where instances and the camera are while the shutter is open, as keys of the scene file."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from mathutils import Matrix

from . import meshes, roles
from .groups import Together

ANIMATION = "shutter"
"""Name of the animation of a mesh file whose vertices move while the shutter is open."""
KEYED = ("position", "rotation", "fov", "aperture", "focus_distance", "shift", "interocular_distance")
"""What of a camera may have keys; ``convergence_distance`` as well, where it does not come and go."""
REMADE = {"NODES", "MESH_SEQUENCE_CACHE", "FLUID", "OCEAN", "PARTICLE_INSTANCE"}
"""Modifiers that may move vertices though they are no deforming ones."""
SetFrame = Callable[[int, float], None]
"""Evaluates the scene that is rendered at a frame and a part of one, as ``RenderEngine.frame_set``."""
Instance = tuple[str, str, tuple[int, ...]]
"""An object, its instancer, and its number there."""
_EPSILON = 1e-6


@dataclass(frozen=True)
class Shutter:
    """When the shutter is open, in Blender's frames and in those of the scene file.

    The scene file's shutter is open around the frame. Blender's may begin or end at it, or be open for longer than a
    frame: its time is then mapped to the scene file's.

    Attributes:
        frame: number of the frame in the scene file, which begins at 0.
        share: of a frame, during which the scene file's shutter is open.
        rate: frames per second.
        now: Blender's frame that is rendered.
        times: Blender's frames that are looked at, the opening first, the closing last.
    """

    frame: int
    share: float
    rate: float
    now: float
    times: tuple[float, ...]

    @property
    def keys(self) -> list[float]:
        """Frames of the scene file at which ``times`` are."""
        middle, open_for = 0.5 * (self.times[0] + self.times[-1]), self.times[-1] - self.times[0]
        return [self.frame + (time - middle) / open_for * self.share for time in self.times]

    @property
    def seconds(self) -> list[float]:
        """The same as seconds since the scene file's first frame."""
        return [(key - self.frame + 1.0) / self.rate for key in self.keys]

    def table(self) -> dict[str, Any]:
        """``[sequence]``."""
        return {"frames": [self.frame - 1, self.frame + 1], "fps": self.rate, "shutter": self.share}


def shutter_of(scene) -> tuple[Shutter | None, list[str]]:
    """The shutter of an evaluated scene, ``None`` where it has no motion blur; and notes."""
    render = scene.render
    if not render.use_motion_blur or render.motion_blur_shutter < _EPSILON:
        return None, []
    notes = []
    if cycles(scene, "rolling_shutter_type", "NONE") != "NONE":
        notes.append("Rolling shutter is not supported; the whole picture is exposed at once")
    curve = render.motion_blur_shutter_curve
    curve.initialize()
    if min(curve.evaluate(curve.curves[0], share) for share in np.linspace(0.05, 0.95, 10)) < 0.99:
        notes.append("The shutter's curve is not supported; it opens and closes at once")
    now, open_for = scene.frame_current + scene.frame_subframe, render.motion_blur_shutter
    opens = now + {"START": 0.0, "CENTER": -0.5, "END": -1.0}[render.motion_blur_position] * open_for
    steps = 2 ** max((_steps(item) for item in scene.objects), default=1)
    times = tuple(opens + open_for * step / steps for step in range(steps + 1))
    rate = render.fps / render.fps_base
    return Shutter(max(scene.frame_current, 1), min(open_for, 1.0), rate, now, times), notes


def cycles(owner, name: str, default: Any) -> Any:
    """A setting that Blender has for Cycles, or a default where Cycles is switched off."""
    return getattr(getattr(owner, "cycles", None), name, default)


def _steps(item) -> int:
    return cycles(item, "motion_steps", 1) if cycles(item, "use_motion_blur", True) else 1


@dataclass
class Motion:
    """What is where at each of the shutter's times.

    Attributes:
        shutter: the shutter.
        places: matrices by instance, one dictionary for each time.
        shapes: likewise meshes of what deforms; ``None`` where a mesh has no faces.
        cameras: likewise the cameras' tables by name.
    """

    shutter: Shutter
    places: list[dict[Instance, np.ndarray]] = field(default_factory=list)
    shapes: list[dict[Instance, meshes.Triangles | None]] = field(default_factory=list)
    cameras: list[dict[str, dict[str, Any]]] = field(default_factory=list)

    def ways(self, instance: Instance, place: np.ndarray, item) -> list[np.ndarray] | None:
        """Matrices of an instance at all times; ``None`` where it stands still.

        Args:
            instance: which.
            place: its matrix at the frame.
            item: its object.
        """
        if not cycles(item, "use_motion_blur", True):
            return None
        found = [places.get(instance) for places in self.places]
        if any(each is None for each in found):  # comes or goes
            return None
        size = np.abs(place).max()
        return found if any(np.abs(each - place).max() > _EPSILON * size for each in found) else None

    def deformed(self, instance: Instance, now: meshes.Triangles) -> tuple[list[meshes.Triangles] | None, bool]:
        """Meshes of an instance at all times, ``None`` where it does not deform; and whether its faces stay the same."""
        found = [shapes.get(instance) for shapes in self.shapes]
        if any(each is None for each in found):
            return None, True
        if any(
            not np.array_equal(each.loops, now.loops) or len(each.positions) != len(now.positions) for each in found
        ):
            return None, False
        size = np.abs(now.positions).max(initial=0.0)
        moves = any(np.abs(each.positions - now.positions).max(initial=0.0) > _EPSILON * size for each in found)
        return (found if moves else None), True

    def with_keys(self, name: str, table: dict[str, Any]) -> dict[str, Any]:
        """A camera's table with keys for what changes."""
        found = [tables.get(name) for tables in self.cameras]
        if any(each is None for each in found):
            return table
        keyed = {key: [each[key] for each in found] for key in KEYED if all(key in each for each in found)}
        if all("convergence_distance" in each for each in found):
            keyed["convergence_distance"] = [each["convergence_distance"] for each in found]
        return table | {key: self.keys(values) for key, values in keyed.items() if not _alike(values)}

    def keys(self, values: list[Any]) -> dict[str, Any]:
        """A table of keys."""
        return {"frame": self.shutter.keys, "value": values}

    def placement(self, places: list[np.ndarray]) -> dict[str, Any] | None:
        """``position``, ``rotation`` and ``scale`` along a way, ``None`` where it shears or flattens."""
        found: dict[str, list[Any]] = {"position": [], "rotation": [], "scale": []}
        before = None
        for place in places:
            parts = decomposed(Matrix(place.tolist()), before)
            if parts is None:
                return None
            before = parts[1]
            for values, part in zip(found.values(), parts, strict=True):
                values.append(list(part))
        found["rotation"] = [[math.degrees(angle) for angle in angles] for angles in found["rotation"]]
        return {key: values[0] if _alike(values) else self.keys(values) for key, values in found.items()}


def decomposed(to_world: Matrix, near=None):
    """A matrix as position, Euler angles and scale, or ``None`` where it shears or flattens.

    Args:
        to_world: the matrix.
        near: Euler angles near which those are to be.
    """
    position, rotation, scale = to_world.decompose()
    again = Matrix.LocRotScale(position, rotation, scale)
    size = max(abs(value) for row in to_world.to_3x3() for value in row)
    apart = max(abs(again[i][j] - to_world[i][j]) for i in range(3) for j in range(3))
    if apart > 1e-5 * size or min(abs(value) for value in scale) == 0.0:
        return None
    return position, rotation.to_euler("XYZ") if near is None else rotation.to_euler("XYZ", near), scale


def _alike(values: list[Any]) -> bool:
    return all(np.allclose(value, values[0], rtol=_EPSILON, atol=_EPSILON) for value in values[1:])


Found = tuple[Any, np.ndarray, bool, Instance]
"""An object, its matrix, whether it is an instance, and which."""


def instances(depsgraph, numbered: bool = True) -> Iterator[Found]:
    """Objects that are rendered and what they make instances of, one by one; as for :func:`gathered`."""
    yield from (found[:4] for found in gathered(depsgraph, lambda _: True, numbered))


def gathered(
    depsgraph, stands_apart: Callable[[Any], bool], numbered: bool = True
) -> Iterator[tuple[Any, np.ndarray, bool, Instance, Together | None]]:
    """Objects that are rendered and what they make instances of.

    The viewport's objects are there as far as renderings have them. Of instances that are alike, made by one object, only
    the first is looked at: Blender makes an object of Python's for all that is asked of each.

    Args:
        depsgraph: the evaluated scene.
        stands_apart: of an object, whether its instances are wanted one by one.
        numbered: tell instances of one instancer from each other by their numbers; it takes time.

    Yields:
        The object, which is valid until the next one, its matrix, of shape (4, 4), float64, not used again, whether it is
        an instance, which, and where not apart all that are alike, whose places are known at the end.
    """
    viewport = depsgraph.mode == "VIEWPORT"
    found = depsgraph.object_instances
    matrices = np.empty(16 * len(found), np.float32)
    found.foreach_get("matrix_world", matrices)
    matrices = matrices.reshape(-1, 4, 4).transpose(0, 2, 1)
    known: dict[tuple, list[int] | None] = {}
    gatherings: list[Together] = []
    for index, each in enumerate(found):
        key = None
        if is_made := each.is_instance:
            # The object is one and the same for all; what it is made of is not.
            key = (each.instance_object, each.object.data, each.parent)
            alike = known.get(key)
            if alike is not None:
                alike.append(index)
                continue
        item, parent = each.object, each.parent if is_made else None
        if not each.show_self or (viewport and (item.hide_render or (parent is not None and parent.hide_render))):
            continue
        together = None
        if is_made and not stands_apart(item):
            together = Together([index])
            known[key] = together.members
            gatherings.append(together)
        number = tuple(each.persistent_id) if numbered and is_made else ()
        instance = (item.name, "" if parent is None else parent.name, number)
        yield item, matrices[index].astype(np.float64), is_made, instance, together
    for together in gatherings:
        together.places = matrices[together.members].astype(np.float64)


def observed(
    depsgraph,
    set_frame: SetFrame,
    shutter: Shutter,
    origin: np.ndarray,
    tables: Callable[[], dict[str, dict[str, Any]]],
) -> Motion:
    """Look at the scene at all times of the shutter; it is at the frame afterwards.

    Args:
        depsgraph: the scene, evaluated.
        set_frame: evaluates it at another time.
        shutter: when.
        origin: of the scene file, shape (3,).
        tables: of the cameras as the scene is then.
    """
    motion = Motion(shutter)
    try:
        for time in shutter.times:
            _set(set_frame, time)
            places: dict[Instance, np.ndarray] = {}
            shapes: dict[Instance, meshes.Triangles | None] = {}
            known: dict[int, meshes.Triangles | None] = {}
            for item, to_world, _, instance in instances(depsgraph):
                if item.type != "MESH" or item.lightdepth.role in roles.REAL:
                    continue
                to_world[:3, 3] -= origin
                places[instance] = to_world
                if _may_deform(item, depsgraph.scene):
                    pointer = item.data.as_pointer()
                    if pointer not in known:
                        known[pointer] = meshes.triangles_of_object(item)
                    shapes[instance] = known[pointer]
            motion.places.append(places)
            motion.shapes.append(shapes)
            motion.cameras.append(tables())
    finally:
        _set(set_frame, shutter.now)
    return motion


def _set(set_frame: SetFrame, time: float) -> None:
    whole = math.floor(time + _EPSILON)
    set_frame(whole, max(time - whole, 0.0))


def _may_deform(item, scene) -> bool:
    if not (cycles(item, "use_motion_blur", True) and cycles(item, "use_deform_motion", True)):
        return False
    original = item.original
    made = any(modifier.type in REMADE and modifier.show_render for modifier in original.modifiers)
    return made or original.is_deform_modified(scene, "RENDER") or original.data.animation_data is not None

"""Animations of glTF: nodes, joints and weights of morph targets at a time."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError
from lightdepth.scene.meshes.file_camera import listed
from lightdepth.scene.meshes.gltf_accessors import GltfAccessors
from lightdepth.scene.meshes.gltf_file import GltfFile
from lightdepth.scene.meshes.gltf_schema import AnimationEntry, Channel, Node, checked_part
from lightdepth.scene.meshes.part import Note

FloatArray = NDArray[np.float64]
INTERPOLATIONS = ("LINEAR", "STEP", "CUBICSPLINE")
WIDTHS = {"translation": 3, "rotation": 4, "scale": 3}
"""Numbers of a value of each path; ``weights`` has as many as there are morph targets."""
NEARLY_ALIKE = 1.0 - 1e-9
"""Cosine between two quaternions from which on they are interpolated as numbers."""


class GltfAnimation:
    """One animation of a file.

    Args:
        file: the file.
        accessors: those of the file.
        name: the animation's; one without a name is called by its number.
        note: called with what of it is left out.

    Attributes:
        duration: time of its last key, seconds.

    Raises:
        InputError: there is no such animation, or it is broken.
    """

    def __init__(self, file: GltfFile, accessors: GltfAccessors, name: str, note: Note) -> None:
        self._file, self._accessors, self._note = file, accessors, note
        number = _number(file, name)
        self._place = f"animations[{number}]"
        try:
            self._entry = checked_part(AnimationEntry, file.header.animations[number], self._place)
        except ValueError as error:
            raise InputError(f"{file.path}: {error}") from error
        self._tracks = [track for channel in self._entry.channels if (track := self._track(channel)) is not None]
        self.duration = max((float(track.times[-1]) for track in self._tracks), default=0.0)

    def nodes_at(self, time: float, loop: bool = False) -> list[Node]:
        """The file's nodes at a time.

        Args:
            time: seconds; before the first key a value is that of the first, after the last that of the last.
            loop: begin again where the animation ends.
        """
        if loop and self.duration > 0.0:
            time %= self.duration
        changes: dict[int, dict[str, Any]] = {}
        for track in self._tracks:
            changes.setdefault(track.node, {})[track.path] = track.at(time)
        nodes = list(self._file.header.nodes)
        for number, change in changes.items():
            nodes[number] = nodes[number].model_copy(update=change)
        return nodes

    def _track(self, channel: Channel) -> _Track | None:
        """What a channel moves, or ``None`` where that is nothing that is shown."""
        target = channel.target
        if target.node is None or target.path not in (*WIDTHS, "weights"):
            self._note(f"{self._place} moves {target.path[:40]!r}, which is left out")
            return None
        node = self._file.entry(self._file.header.nodes, target.node, "node")
        if node.matrix is not None and target.path in WIDTHS:
            raise InputError(
                f"{self._file.path}: {self._place} moves the {target.path} of node {target.node}, which has a matrix "
                "instead; a node that moves must have translation, rotation and scale"
            )
        sampler = self._file.entry(self._entry.samplers, channel.sampler, "animation sampler")
        if sampler.interpolation not in INTERPOLATIONS:
            raise InputError(
                f"{self._file.path}: {self._place} has the interpolation {sampler.interpolation[:40]!r}; allowed are "
                f"{', '.join(INTERPOLATIONS)}"
            )
        times = self._accessors.floats(sampler.input, 1)[:, 0]
        if not len(times) or not np.isfinite(times).all() or (np.diff(times) <= 0.0).any():
            raise InputError(
                f"{self._file.path}: {self._place}: the times of accessor {sampler.input} are not in order, each after "
                "the one before"
            )
        width = WIDTHS.get(target.path)
        if width is None:
            width = self._targets(node)
            values = self._accessors.floats(sampler.output, 1)
        else:
            values = self._accessors.floats(sampler.output, width)
        rows = len(times) * (3 if sampler.interpolation == "CUBICSPLINE" else 1)
        if values.size != rows * width or not np.isfinite(values).all():
            raise InputError(
                f"{self._file.path}: {self._place}: accessor {sampler.output} has {values.size} numbers for the "
                f"{target.path} of node {target.node}, but {rows * width} finite ones are needed"
            )
        if not width:
            return None
        return _Track(target.node, target.path, times, values.reshape(rows, width), sampler.interpolation)

    def _targets(self, node: Node) -> int:
        """How many morph targets a node's mesh has."""
        if node.mesh is None:
            return 0
        mesh = self._file.entry(self._file.header.meshes, node.mesh, "mesh")
        return max((len(primitive.targets) for primitive in mesh.primitives), default=0)


class _Track:
    """One value of a node over time.

    Args:
        node: number of the node.
        path: name of the value.
        times: of the keys, strictly increasing, shape (n,), seconds.
        values: at the keys, shape (n, k); of a cubic spline (3 n, k): incoming tangent, value, outgoing tangent of each.
        interpolation: one of ``INTERPOLATIONS``.
    """

    def __init__(self, node: int, path: str, times: FloatArray, values: FloatArray, interpolation: str) -> None:
        self.node, self.path, self.times = node, path, times
        self._interpolation = interpolation
        self._incoming = self._outgoing = values
        if interpolation == "CUBICSPLINE":
            self._incoming, values, self._outgoing = values[0::3], values[1::3], values[2::3]
        self._values = values

    def at(self, time: float) -> tuple[float, ...]:
        """The value at a time (glTF 2.0 specification, appendix C)."""
        before = int(np.searchsorted(self.times, time, side="right")) - 1
        if before < 0:
            return tuple(self._values[0].tolist())
        if before == len(self.times) - 1 or self._interpolation == "STEP":
            return tuple(self._values[before].tolist())
        span = self.times[before + 1] - self.times[before]
        u = (time - self.times[before]) / span
        begin, end = self._values[before], self._values[before + 1]
        if self._interpolation == "CUBICSPLINE":
            leaving, arriving = span * self._outgoing[before], span * self._incoming[before + 1]
            value = (
                (2 * u**3 - 3 * u**2 + 1) * begin
                + (u**3 - 2 * u**2 + u) * leaving
                + (3 * u**2 - 2 * u**3) * end
                + (u**3 - u**2) * arriving
            )
        elif self.path == "rotation":
            value = _between(begin, end, u)
        else:
            value = (1.0 - u) * begin + u * end
        return tuple(value.tolist())


def _between(begin: FloatArray, end: FloatArray, u: float) -> FloatArray:
    """Quaternion a share ``u`` of the short way from one to another."""
    lengths = float(np.linalg.norm(begin)), float(np.linalg.norm(end))
    if min(lengths) == 0.0:
        return end if u > 0.5 else begin
    begin, end = begin / lengths[0], end / lengths[1]
    cosine = float(begin @ end)
    if cosine < 0.0:
        cosine, end = -cosine, -end
    if cosine > NEARLY_ALIKE:
        return (1.0 - u) * begin + u * end
    angle = np.arccos(cosine)
    return np.asarray((np.sin((1.0 - u) * angle) * begin + np.sin(u * angle) * end) / np.sin(angle))


def _number(file: GltfFile, name: str) -> int:
    """Number of an animation by its name, or by the number that stands for its name.

    Raises:
        InputError: there is none; the message lists those that are there.
    """
    found = file.header.animations
    names = [each.get("name") if isinstance(each, dict) else None for each in found]
    called = [each if isinstance(each, str) and each else str(number) for number, each in enumerate(names)]
    if name in called:
        return called.index(name)
    if not called:
        raise InputError(f"{file.path}: has no animation '{name[:100]}'; it has no animations at all")
    raise InputError(f"{file.path}: has no animation '{name[:100]}'; it has {listed(called)}")

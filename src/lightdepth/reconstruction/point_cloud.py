"""Point clouds from files: PLY, LAS and LAZ, E57, XYZ."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError, SetupError, warn
from lightdepth.packages import optional_package
from lightdepth.reconstruction.point_text import read_text_cloud
from lightdepth.scene.meshes.ply_file import read_ply_file

FloatArray = NDArray[np.float64]
LAS_HEADER_SIZE_AT, LAS_RECORD_COUNT_END, LAS_RECORD_HEADER, LAS_COMPRESSED = 94, 104, 54, 0x80
"""Bytes of a LAS file: where its header's own size stands, where the number of records ends and the kind of its points is,
and a record's own header; the bit of that kind by which points are compressed."""

LAS_WKT, LAS_GEO_KEYS, LAS_UNIT_KEY, LAS_UNITS = 2112, 34735, 3076, {9001: 1.0, 9002: 0.3048, 9003: 1200.0 / 3937.0}
"""Records of a LAS file that hold its coordinate system, as text or as keys; the key of lengths, and its values."""
LAS_NOISE = (7, 18)
"""Classes of points."""


@dataclass(frozen=True)
class PointCloud:
    """Measured points.

    Attributes:
        points: metres, shape (n, 3), float64.
        toward_air: vectors from each point into the open, of any length, shape (n, 3), float64: normals, or the way to
            the scanner; ``None`` where the file has neither.
        unit: metres in the unit that the file states; ``None`` where it states none.
    """

    points: FloatArray
    toward_air: FloatArray | None = None
    unit: float | None = None

    def chosen(self, mask: NDArray[np.bool_]) -> PointCloud:
        """The points where a mask of shape (n,) is true."""
        return replace(
            self, points=self.points[mask], toward_air=None if self.toward_air is None else self.toward_air[mask]
        )


def read_points(
    path: Path, scale: float = 1.0, up: str = "z", origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> PointCloud:
    """Read a point cloud and bring it to metres with z up.

    Args:
        path: a .ply, .las, .laz, .e57, .xyz, .txt, .csv or .pts file; of the last four see
            :func:`lightdepth.reconstruction.point_text.read_text_cloud`.
        scale: metres per unit of the file.
        up: the file's axis that points up, ``z`` or ``y``.
        origin: the point, in the file's own coordinates, that becomes the world's origin.

    Returns:
        The points with finite coordinates.

    Raises:
        InputError: the file is missing, unreadable, of another format, or has fewer than 100 points.
        SetupError: the package that reads the format is not installed.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: '{path.suffix}' is not a format for points; allowed are {', '.join(READERS)}")
    try:
        cloud = reader(path)
    except (InputError, SetupError):
        raise
    except Exception as error:  # The packages that read these formats raise whatever they meet.
        raise InputError(f"{path}: not a readable {path.suffix} file of points: it is damaged or cut off") from error
    finite = np.all(np.isfinite(cloud.points), axis=1)
    if not finite.all():
        warn(
            f"{path}: {np.count_nonzero(~finite)} of {finite.size} points have no finite coordinates; they are left out"
        )
    cloud = cloud.chosen(finite)
    nothing: NDArray[np.bool_] = np.asarray(~cloud.points.any(axis=1))
    if np.count_nonzero(nothing) > 1:  # Scanners write rays that met nothing so.
        warn(f"{path}: {np.count_nonzero(nothing)} points lie at 0, 0, 0, which means not measured; they are left out")
        cloud = cloud.chosen(~nothing)
    if cloud.unit is not None and abs(scale / cloud.unit - 1.0) > 0.01:
        warn(
            f"{path}: its unit is {cloud.unit:g} m, and one of {scale:g} m is used; --scale {cloud.unit:g} converts it"
        )
    if len(cloud.points) < 100:
        raise InputError(f"{path}: has {len(cloud.points)} points with finite coordinates; at least 100 are needed")
    turn = np.eye(3) if up == "z" else np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    return replace(
        cloud,
        points=(cloud.points - origin) @ turn.T * scale,
        toward_air=None if cloud.toward_air is None else cloud.toward_air @ turn.T,
    )


def _from_ply(path: Path) -> PointCloud:
    vertex = read_ply_file(path).elements.get("vertex")
    columns = {} if vertex is None else vertex.columns
    if not {"x", "y", "z"} <= columns.keys():
        raise InputError(f"{path}: has no element 'vertex' with the properties x, y and z")
    points = np.column_stack([columns[name] for name in "xyz"]).astype(np.float64)
    names = ("nx", "ny", "nz")
    if not columns.keys() >= set(names):
        return PointCloud(points)
    return PointCloud(points, np.column_stack([columns[name] for name in names]).astype(np.float64))


def _from_las(path: Path) -> PointCloud:
    laspy = optional_package("laspy", "points")
    if path.suffix.lower() == ".laz" and not laspy.LazBackend.detect_available():
        optional_package("lazrs", "points")  # One that laspy can decompress with.
    _check_las_header(path)
    file = laspy.read(path)
    cloud = PointCloud(np.asarray(file.xyz, dtype=np.float64), unit=_las_unit(file.header.vlrs, path))
    noise = np.asarray(np.isin(np.asarray(file.classification), LAS_NOISE) | (np.asarray(file.withheld) != 0))
    if noise.any():
        warn(f"{path}: {np.count_nonzero(noise)} points are marked as noise or withheld; they are left out")
        cloud = cloud.chosen(~noise)
    return cloud


def _las_unit(records: Any, path: Path) -> float | None:
    """Metres in the unit that the coordinate system states.

    Raises:
        InputError: the coordinates are degrees.
    """
    for record in records:
        text = getattr(record, "string", "") if record.record_id == LAS_WKT else ""
        if text.startswith("GEOGC"):
            raise InputError(f"{path}: its coordinates are degrees; points in metres are needed: project them first")
        units = re.findall(r'(?:LENGTH)?UNIT\["([^"]*)",\s*([0-9.eE+-]+)', text)
        lengths = [float(size) for name, size in units if re.search("foot|feet|met(re|er)", name, re.IGNORECASE)]
        if lengths:
            return lengths[0]
        if record.record_id == LAS_GEO_KEYS:
            for key in getattr(record, "geo_keys", []):
                if key.id == LAS_UNIT_KEY and key.tiff_tag_location == 0:
                    return LAS_UNITS.get(key.value_offset)
    return None


def _check_las_header(path: Path) -> None:
    """Refuse a header whose claims do not fit its file.

    laspy would go through all records that it claims, and lazrs would take memory for all chunks and end the process.
    """
    with path.open("rb") as file:
        head = file.read(LAS_RECORD_COUNT_END + 1)
        if len(head) <= LAS_RECORD_COUNT_END:
            raise InputError(f"{path}: not a readable {path.suffix} file of points: it is cut off in its header")
        whole = path.stat().st_size
        size, points_at, records = struct.unpack_from("<HII", head, LAS_HEADER_SIZE_AT)
        if size + LAS_RECORD_HEADER * records > points_at or points_at > whole:
            raise InputError(
                f"{path}: not a readable {path.suffix} file of points: its header claims {records} records before byte "
                f"{points_at} of {whole}"
            )
        if head[LAS_RECORD_COUNT_END] & LAS_COMPRESSED:
            _check_chunks(file, points_at, whole, path)


def _check_chunks(file: BinaryIO, points_at: int, whole: int, path: Path) -> None:
    """Refuse a table of more chunks than the file has bytes; where it is stands before the points, or at the end."""
    file.seek(points_at)
    at = file.read(8)
    if at == b"\xff" * 8:
        file.seek(whole - 8)
        at = file.read(8)
    place = int.from_bytes(at, "little")
    file.seek(min(place, whole))
    table = file.read(8)
    chunks = int.from_bytes(table[4:], "little")
    if len(table) < 8 or chunks > whole:
        raise InputError(
            f"{path}: not a readable {path.suffix} file of points: its table claims {chunks} chunks at byte {place} of "
            f"{whole}"
        )


def _from_e57(path: Path) -> PointCloud:
    file = optional_package("pye57", "points").E57(str(path))
    try:
        scans, ways = [], []
        for index in range(file.scan_count):
            scan = file.read_scan(index, ignore_missing_fields=True)
            points = np.column_stack([scan[f"cartesian{axis}"] for axis in "XYZ"]).astype(np.float64)
            header = file.get_header(index)
            scans.append(points)
            ways.append((header.translation if header.has_pose() else np.zeros(3)) - points)
    finally:
        file.close()
    return PointCloud(np.concatenate(scans), np.concatenate(ways))


def _from_text(path: Path) -> PointCloud:
    points, unit = read_text_cloud(path)
    return PointCloud(points, unit=unit)


READERS: dict[str, Callable[[Path], PointCloud]] = {
    ".ply": _from_ply,
    ".las": _from_las,
    ".laz": _from_las,
    ".e57": _from_e57,
    ".xyz": _from_text,
    ".txt": _from_text,
    ".csv": _from_text,
    ".pts": _from_text,
}
"""Readers by file name extension. A new format is one function and one line here."""

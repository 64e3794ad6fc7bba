"""The boxes by which players know a spherical or stereoscopic video: ``st3d`` and ``sv3d`` of an MP4 or QuickTime file.

Google's "Spherical Video V2 RFC". The boxes stand in the sample entry of the video track. A header box, ``svhd``, is always
written: FFmpeg refuses the projection without it.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Literal

from lightdepth.errors import InputError

Stereo = Literal["mono", "top-bottom", "side-by-side"]
STEREO_MODES: dict[Stereo, int] = {"mono": 0, "top-bottom": 1, "side-by-side": 2}
"""Numbers of the arrangements, the left eye first."""
_SAMPLE_ENTRY_FIELDS = 8 + 70
"""Bytes of a video sample entry before its boxes: those of every sample entry, and those of a video's."""
_QUARTER = 0x3FFFFFFF
"""A quarter as the standard rounds it, in units of 2^-32."""


@dataclass(frozen=True)
class Sphere:
    """What a video shows of the sphere, equirectangularly.

    Attributes:
        stereo: how the pictures of the two eyes are arranged.
        half: only the front half is shown, as VR180 has it.
    """

    stereo: Stereo = "mono"
    half: bool = False


@dataclass(frozen=True)
class _Box:
    kind: bytes
    start: int
    content: int
    end: int


def spherical_boxes(sphere: Sphere, software: str) -> bytes:
    """The boxes ``st3d`` and ``sv3d``.

    Args:
        sphere: what the video shows.
        software: that made it.
    """
    side = _QUARTER if sphere.half else 0
    projection = _box(
        b"proj",
        _full_box(b"prhd", struct.pack(">3i", 0, 0, 0)),  # yaw, pitch, roll
        _full_box(b"equi", struct.pack(">4I", 0, 0, side, side)),  # top, bottom, left, right
    )
    stereo = _full_box(b"st3d", bytes([STEREO_MODES[sphere.stereo]]))
    return stereo + _box(b"sv3d", _full_box(b"svhd", software.encode() + b"\0"), projection)


def mark_spherical(source: Path, target: Path, sphere: Sphere, software: str) -> None:
    """Copy a video with the boxes of a spherical one, its index first, so that it plays while it loads.

    Args:
        source: an MP4 or QuickTime file with one video track.
        target: the copy; it is overwritten.
        sphere: what it shows.
        software: that made it.

    Raises:
        InputError: the file is no such video.
        OSError: a file cannot be read or written.
    """
    with source.open("rb") as reading:
        size = source.stat().st_size
        boxes = list(_top_boxes(reading, size, source))
        movie = next((box for box in boxes if box.kind == b"moov"), None)
        if movie is None:
            raise InputError(f"{source}: is not an MP4 or QuickTime video: it has no box 'moov'")
        reading.seek(movie.start)
        header = bytearray(reading.read(movie.end - movie.start))
        _insert(header, spherical_boxes(sphere, software), source)
        before = [box for box in boxes if box.kind == b"ftyp"]
        others = [box for box in boxes if box is not movie and box not in before]
        places, position = {}, sum(box.end - box.start for box in before) + len(header)
        for box in others:
            places[box.start, box.end] = position - box.start
            position += box.end - box.start
        _shift_chunks(header, places, source)
        with target.open("wb") as writing:
            for box in before:
                _copy(reading, box, writing)
            writing.write(header)
            for box in others:
                _copy(reading, box, writing)


def _box(kind: bytes, *contents: bytes) -> bytes:
    content = b"".join(contents)
    return struct.pack(">I4s", 8 + len(content), kind) + content


def _full_box(kind: bytes, content: bytes) -> bytes:
    """A box with a version and flags, which are 0."""
    return _box(kind, bytes(4), content)


def _top_boxes(file: BinaryIO, size: int, path: Path) -> Iterator[_Box]:
    position = 0
    while position + 8 <= size:
        file.seek(position)
        yield (box := _parsed(file.read(16), position, size, path))
        position = box.end


def _boxes(data: bytes | bytearray, start: int, end: int, path: Path) -> Iterator[_Box]:
    while start + 8 <= end:
        box = _parsed(bytes(data[start : start + 16]), start, end, path)
        yield box
        start = box.end


def _parsed(head: bytes, start: int, limit: int, path: Path) -> _Box:
    length, kind = struct.unpack_from(">I4s", head)
    content = start + 8
    if length == 1 and len(head) == 16:
        (length,), content = struct.unpack_from(">Q", head, 8), start + 16
    elif length == 0:
        length = limit - start
    if length < content - start or start + length > limit:
        raise InputError(f"{path}: is not a complete MP4 or QuickTime video")
    return _Box(kind, start, content, start + length)


def _insert(movie: bytearray, boxes: bytes, path: Path) -> None:
    """Put boxes at the end of the video's sample entry, in place; every box around them grows."""
    for track in _boxes(movie, 8, len(movie), path):
        if track.kind != b"trak":
            continue
        trail = _trail(movie, track, path)
        if trail is None:
            continue
        entry = trail[-1]
        for box in (_Box(b"moov", 0, 8, len(movie)), *trail):
            struct.pack_into(">I", movie, box.start, box.end - box.start + len(boxes))
        movie[entry.end : entry.end] = boxes
        return
    raise InputError(f"{path}: has no video track")


def _trail(movie: bytearray, track: _Box, path: Path) -> list[_Box] | None:
    """The boxes from a video track down to its first sample entry; ``None`` where it is of sound."""
    media = _child(movie, track, b"mdia", path)
    handler = _child(movie, media, b"hdlr", path)
    if movie[handler.content + 8 : handler.content + 12] != b"vide":
        return None
    information = _child(movie, media, b"minf", path)
    table = _child(movie, information, b"stbl", path)
    descriptions = _child(movie, table, b"stsd", path)
    entry = next(_boxes(movie, descriptions.content + 8, descriptions.end, path), None)  # After flags and their number.
    if entry is None or entry.end - entry.content < _SAMPLE_ENTRY_FIELDS:
        raise InputError(f"{path}: its video track is damaged")
    return [track, media, information, table, descriptions, entry]


def _child(movie: bytearray, parent: _Box, kind: bytes, path: Path) -> _Box:
    found = next((box for box in _boxes(movie, parent.content, parent.end, path) if box.kind == kind), None)
    if found is None:
        raise InputError(f"{path}: is not a complete video: the box '{kind.decode()}' is missing")
    return found


def _shift_chunks(movie: bytearray, places: dict[tuple[int, int], int], path: Path) -> None:
    """Correct where the movie says that its samples lie, in place."""
    for track in _boxes(movie, 8, len(movie), path):
        if track.kind != b"trak":
            continue
        table = track
        for kind in (b"mdia", b"minf", b"stbl"):
            table = _child(movie, table, kind, path)
        for box in _boxes(movie, table.content, table.end, path):
            code = {b"stco": "I", b"co64": "Q"}.get(box.kind)
            if code is None:
                continue
            (count,) = struct.unpack_from(">I", movie, box.content + 4)
            offsets = struct.unpack_from(f">{count}{code}", movie, box.content + 8)
            moved = [
                offset + next((by for (start, end), by in places.items() if start <= offset < end), 0)
                for offset in offsets
            ]
            struct.pack_into(f">{count}{code}", movie, box.content + 8, *moved)


def _copy(source: BinaryIO, box: _Box, target: BinaryIO) -> None:
    source.seek(box.start)
    left = box.end - box.start
    while left:
        block = source.read(min(left, 1 << 22))
        if not block:
            raise InputError("the video ends early")
        target.write(block)
        left -= len(block)

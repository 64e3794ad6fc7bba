"""Where the meshes and images of exported scenes go, each content once."""

import atexit
import hashlib
import os
import pickle
import re
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path

LONGEST_NAME = 60
"""Letters of an object's name in the name of its file."""
KEPT = 4
"""Exports after whose last use a file is removed: an animation's frames take turns with its view layers."""


@dataclass(frozen=True)
class Made:
    """What became of a mesh and its materials.

    Attributes:
        files: the mesh's file and those that it names; none where there was nothing to write.
        notes: what is not supported.
        materials: names of the materials of its parts, in their order; empty where a part has none.
    """

    files: tuple[str, ...]
    notes: tuple[str, ...]
    materials: tuple[str, ...] = ()


class MeshFolder:
    """A folder for the files of scenes.

    Args:
        path: of the folder, made with the first file.
        by_content: name every file by its content. Such a folder serves one export after the other: what is in it is
            not written again. Else meshes have their objects' names, for people to read.
    """

    def __init__(self, path: Path, by_content: bool = False):
        self.path = path
        self._by_content = by_content
        self._made: dict[bytes, Made] = {}
        self._names: dict[str, str] = {}
        self._taken: set[str] = set()
        self._counts: dict[str, int] = {}
        self._last: dict[str, int] = {}
        self._exports = 0

    def begin(self) -> None:
        """Begin an export: what has not been used for some is removed."""
        self._exports += 1
        for name in [name for name, last in self._last.items() if last <= self._exports - 1 - KEPT]:
            del self._last[name]
            (self.path / name).unlink(missing_ok=True)
        self._made = {key: made for key, made in self._made.items() if all(name in self._last for name in made.files)}
        self._names = {key: name for key, name in self._names.items() if name in self._last}

    def found(self, key: bytes) -> Made | None:
        """What became of the contents with a key, if it is still there."""
        made = self._made.get(key)
        if made is None or not all((self.path / name).is_file() for name in made.files):
            return None
        self._last |= dict.fromkeys(made.files, self._exports)
        return made

    def keep(self, key: bytes, made: Made) -> None:
        """Remember what became of the contents with a key."""
        self._made[key] = made

    def write(self, name: str, suffix: str, data: bytes) -> str:
        """Write a file, unless it is there; returns its name.

        Args:
            name: of the object; empty for what is always named by its content.
            suffix: of the file, with a dot.
            data: its content.

        Raises:
            OSError: it cannot be written.
        """
        digest = hashlib.blake2b(data, digest_size=16).hexdigest() + suffix
        file = self._names.get(digest)
        if file is None:
            file = digest if self._by_content or not name else self._unique(name, suffix)
            self._names[digest] = file
        path = self.path / file
        if file not in self._last or not path.is_file():
            self.path.mkdir(parents=True, exist_ok=True)
            part = path.with_name(f".{file}.part")  # what breaks off is no content
            part.write_bytes(data)
            os.replace(part, path)
        self._last[file] = self._exports
        return file

    def _unique(self, name: str, suffix: str) -> str:
        """A name that no other object's file has, also where letters' case does not count."""
        plain = re.sub(r"[^\w.-]+", "_", name, flags=re.ASCII)[:LONGEST_NAME] or "mesh"
        candidate = f"{plain}{suffix}"
        while candidate.lower() in self._taken:
            key = f"{plain}{suffix}".lower()
            self._counts[key] = self._counts.get(key, 0) + 1
            candidate = f"{plain}_{self._counts[key]}{suffix}"
        self._taken.add(candidate.lower())
        return candidate


def digest_of(*contents: object) -> bytes:
    """A digest of plain values and arrays by their contents."""
    state = hashlib.blake2b(digest_size=16)
    state.update(pickle.dumps(contents, protocol=5, buffer_callback=state.update))
    return state.digest()


_session: dict[str, MeshFolder] = {}


def of_session(name: str = "meshes") -> MeshFolder:
    """A folder for what is rendered in this session of Blender; its parent has room for the scene file.

    Args:
        name: of the folder; what is written at the same time as others needs its own.

    Raises:
        OSError: it cannot be made.
    """
    if name not in _session or not _session[name].path.parent.is_dir():
        parent = Path(tempfile.mkdtemp(prefix="lightdepth-scenes-"))
        _session[name] = MeshFolder(parent / name, by_content=True)
    return _session[name]


@atexit.register
def remove() -> None:
    """Remove the session's folders: Blender quits, or the extension is switched off."""
    for folder in _session.values():
        shutil.rmtree(folder.path.parent, ignore_errors=True)
    _session.clear()

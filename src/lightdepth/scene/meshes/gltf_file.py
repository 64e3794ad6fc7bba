"""The container of glTF 2.0: its JSON, binary buffers and images, from .gltf and .glb files."""

from __future__ import annotations

import base64
import binascii
import json
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError
from lightdepth.images.radiance import READERS
from lightdepth.scene.materials.image import eight_bit
from lightdepth.scene.meshes.gltf_basisu import KTX2_MAGIC, decoded_ktx2
from lightdepth.scene.meshes.gltf_extensions import unsupported_extensions
from lightdepth.scene.meshes.gltf_meshopt import decompressed
from lightdepth.scene.meshes.gltf_schema import Header, checked_header
from lightdepth.scene.meshes.text_file import named_file

_GLB_MAGIC, _GLB_JSON, _GLB_BINARY = b"glTF", b"JSON", b"BIN\0"
Entry = TypeVar("Entry")


class GltfFile:
    """An opened file.

    Attributes:
        path: where it is; files that it names are beside it.
        header: its JSON.
    """

    def __init__(self, path: Path) -> None:
        """Open a file.

        Raises:
            InputError: it is not glTF 2.0, is damaged, or needs an extension that is not supported.
        """
        self.path = path
        content = path.read_bytes()
        self._binary: bytes | None = None
        self._buffers: dict[int, bytes] = {}
        self._views: dict[int, memoryview] = {}
        self._images: dict[int, NDArray[np.uint8]] = {}
        self.extensions: list[str] = []
        if content[:4] == _GLB_MAGIC:
            content = self._take_chunks(content)
        self.header: Header = self._read_header(content)
        if not self.header.asset.version.startswith("2."):
            raise InputError(f"{path}: is glTF of version {self.header.asset.version[:20]}; 2.0 is needed")
        if not self.header.asset.min_version.startswith("2.0"):
            raise InputError(f"{path}: needs a reader of glTF {self.header.asset.min_version[:20]}; 2.0 is read")
        if missing := unsupported_extensions(self.header.extensions_required):
            raise InputError(
                f"{path}: needs the extension{'s' if len(missing) > 1 else ''} {', '.join(missing)[:200]}, which "
                "lightdepth does not support; export it without"
            )

    def _read_header(self, content: bytes) -> Header:
        try:
            document = json.loads(content.decode("utf-8-sig"))
        except UnicodeDecodeError as error:
            raise InputError(f"{self.path}: not a readable glTF file: it is not UTF-8 text") from error
        except json.JSONDecodeError as error:
            raise InputError(
                f"{self.path}: not a readable glTF file: no valid JSON at line {error.lineno}, column {error.colno}"
            ) from error
        except (RecursionError, ValueError) as error:
            raise InputError(
                f"{self.path}: not a readable glTF file: its JSON is nested too deeply or has numbers that are too long"
            ) from error
        if isinstance(document, dict) and isinstance(document.get("asset"), dict):
            document["asset"]["version"] = str(document["asset"].get("version", "unknown"))[:20]
            document["asset"]["minVersion"] = str(document["asset"].get("minVersion", "2.0"))[:20]
        self.extensions = found_extensions(document)
        try:
            return checked_header(document)
        except ValueError as error:
            raise InputError(f"{self.path}: not a readable glTF file: {error}") from error
        except RecursionError as error:
            raise InputError(f"{self.path}: not a readable glTF file: its JSON is nested too deeply") from error

    def _take_chunks(self, content: bytes) -> bytes:
        """Split a .glb file; keeps the binary chunk and returns the JSON."""
        if len(content) >= 8 and (version := struct.unpack_from("<I", content, 4)[0]) != 2:
            raise InputError(f"{self.path}: is glTF of version {version}; 2.0 is needed")
        # What stands behind the length that the file says does not belong to it.
        said = struct.unpack_from("<I", content, 8)[0] if len(content) >= 12 else 0
        content = content[:said] if said >= 20 else content
        text, offset = b"", 12
        while offset + 8 <= len(content):
            length, kind = struct.unpack_from("<I4s", content, offset)
            chunk = content[offset + 8 : offset + 8 + length]
            if len(chunk) < length:
                raise InputError(f"{self.path}: the file is cut off ({len(content)} bytes)")
            if kind == _GLB_JSON and not text:
                text = chunk
            elif kind == _GLB_BINARY and self._binary is None:
                self._binary = chunk
            offset += 8 + length
        return text.rstrip(b"\0 ")  # Some programs fill up with zeros.

    def entry(self, entries: Sequence[Entry], index: int, what: str) -> Entry:
        """An entry of one of the header's lists.

        Raises:
            InputError: there is none of that number.
        """
        if not 0 <= index < len(entries):
            raise InputError(f"{self.path}: refers to {what} {index}, but the file has {len(entries)} of them")
        return entries[index]

    def buffer(self, index: int) -> bytes:
        """The bytes of a buffer."""
        if index not in self._buffers:
            buffer = self.entry(self.header.buffers, index, "buffer")
            if buffer.uri is not None:
                self._buffers[index] = self._resource(buffer.uri)
            elif index == 0 and self._binary is not None:
                self._buffers[index] = self._binary
            else:
                raise InputError(f"{self.path}: buffer {index} has no data")
        return self._buffers[index]

    def view(self, index: int) -> memoryview:
        """The bytes of a buffer view, decompressed."""
        if index not in self._views:
            view = self.entry(self.header.buffer_views, index, "buffer view")
            packed = view.compression or view
            content = self.buffer(packed.buffer)
            end = packed.byte_offset + packed.byte_length
            if end > len(content):
                raise InputError(
                    f"{self.path}: buffer view {index} ends at byte {end} of buffer {packed.buffer}, which has "
                    f"{len(content)}; the file is cut off or damaged"
                )
            data = memoryview(content)[packed.byte_offset : end]
            if view.compression is not None:
                try:
                    data = memoryview(decompressed(bytes(data), view.compression))
                except ValueError as error:
                    raise InputError(f"{self.path}: buffer view {index}: {error}") from error
            self._views[index] = data
        return self._views[index]

    def image(self, index: int) -> NDArray[np.uint8]:
        """The pixels of an image, shape (height, width, 4), uint8, row 0 at the top."""
        if index not in self._images:
            entry = self.entry(self.header.images, index, "image")
            if entry.buffer_view is not None:
                data = bytes(self.view(entry.buffer_view))
            elif entry.uri is not None:
                data = self._resource(entry.uri)
            else:
                raise InputError(f"{self.path}: image {index} has no data")
            try:
                found = decoded_ktx2(data) if data.startswith(KTX2_MAGIC) else eight_bit(data, "RGBA")
            except ValueError as error:
                uri = "" if entry.uri is None or entry.uri.startswith("data:") else entry.uri
                name = (entry.name or uri)[:60]
                raise InputError(f"{self.path}: image {index} ({name}) cannot be read: {error}") from error
            self._images[index] = found
        return self._images[index]

    def radiance_file(self, index: int) -> Path | None:
        """The file of an image of high dynamic range (.exr or .hdr beside this one), which glTF does not provide.

        Raises:
            InputError: it is missing.
        """
        uri = unquote(self.entry(self.header.images, index, "image").uri or "")
        if uri.startswith("data:") or Path(uri).suffix.lower() not in READERS:
            return None
        if (file := named_file(self.path.parent, uri)) is None:
            raise InputError(f"{self.path}: refers to the file {uri[:100]}, which does not exist in its folder")
        return file

    def _resource(self, uri: str) -> bytes:
        """The bytes behind a URI: of the file itself (``data:``), or of a file beside it."""
        if uri.startswith("data:"):
            try:
                return base64.b64decode(unquote(uri.partition(",")[2]))
            except (binascii.Error, ValueError) as error:
                raise InputError(f"{self.path}: embedded data is not valid base64") from error
        name = unquote(uri)
        for candidate in (name, uri):
            if (file := named_file(self.path.parent, candidate)) is not None:
                return file.read_bytes()
        raise InputError(f"{self.path}: refers to the file {name[:200]}, which does not exist in its folder")


def found_extensions(document: object) -> list[str]:
    """Names of the extensions that a document holds anywhere, whether it declares them or not."""
    found: dict[str, None] = {}
    waiting = [document]
    while waiting:
        value = waiting.pop()
        if isinstance(value, dict):
            extensions = value.get("extensions")
            found.update(dict.fromkeys(extensions) if isinstance(extensions, dict) else {})
            waiting += [inner for key, inner in value.items() if key != "extras" and isinstance(inner, dict | list)]
        elif isinstance(value, list) and value and isinstance(value[0], dict | list):
            waiting += value
    return list(found)

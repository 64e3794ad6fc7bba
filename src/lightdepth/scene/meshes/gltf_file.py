"""The container of glTF 2.0: its JSON, binary buffers and images, from .gltf and .glb files."""

from __future__ import annotations

import base64
import io
import json
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lightdepth.errors import InputError
from lightdepth.images.radiance import READERS
from lightdepth.scene.materials.image import eight_bit

_GLB_MAGIC, _GLB_JSON, _GLB_BINARY = b"glTF", b"JSON", b"BIN\0"
UNDECODABLE = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_texture_basisu", "EXT_mesh_gpu_instancing")
"""Extensions that change how geometry and images are stored; a file that requires one cannot be read."""


class GltfFile:
    """An opened file.

    Attributes:
        path: where it is; files that it names are beside it.
        header: its JSON.
    """

    def __init__(self, path: Path) -> None:
        """Open a file.

        Raises:
            InputError: it is not glTF 2.0, or needs an extension that is not supported.
        """
        self.path = path
        content = path.read_bytes()
        self._binary = b""
        self._buffers: dict[int, bytes] = {}
        self._images: dict[int, NDArray[np.uint8]] = {}
        if content[:4] == _GLB_MAGIC:
            content = self._take_chunks(content)
        try:
            self.header: dict[str, Any] = json.loads(content)
        except (UnicodeDecodeError, json.JSONDecodeError) as error:
            raise InputError(f"{path}: not a readable glTF file ({error})") from error
        version = str(self.header.get("asset", {}).get("version", "unknown"))
        if not version.startswith("2."):
            raise InputError(f"{path}: is glTF of version {version}; 2.0 is needed")
        if missing := [name for name in self.header.get("extensionsRequired", []) if name in UNDECODABLE]:
            raise InputError(
                f"{path}: needs {', '.join(missing)}, which is not supported; export it without compression and with "
                ".png or .jpg images"
            )

    def _take_chunks(self, content: bytes) -> bytes:
        """Split a .glb file; keeps the binary chunk and returns the JSON."""
        text, offset = b"", 12
        while offset + 8 <= len(content):
            length, kind = struct.unpack_from("<I4s", content, offset)
            chunk = content[offset + 8 : offset + 8 + length]
            if len(chunk) < length:
                raise InputError(f"{self.path}: the file is cut off ({len(content)} bytes)")
            if kind == _GLB_JSON:
                text = chunk
            elif kind == _GLB_BINARY:
                self._binary = chunk
            offset += 8 + length
        return text

    def buffer(self, index: int) -> bytes:
        """The bytes of a buffer."""
        if index not in self._buffers:
            uri = self.header["buffers"][index].get("uri")
            self._buffers[index] = self._binary if uri is None else self._resource(uri)
        return self._buffers[index]

    def image(self, index: int) -> NDArray[np.uint8]:
        """The pixels of an image, shape (height, width, 4), uint8, row 0 at the top."""
        if index not in self._images:
            self._images[index] = self._decoded(index)
        return self._images[index]

    def radiance_file(self, index: int) -> Path | None:
        """The file of an image of high dynamic range (.exr or .hdr beside this one), which glTF does not provide.

        Raises:
            InputError: it is missing.
        """
        uri = unquote(self.header["images"][index].get("uri", ""))
        if uri.startswith("data:") or Path(uri).suffix.lower() not in READERS:
            return None
        file = self.path.parent / uri
        if not file.is_file():
            raise InputError(f"{self.path}: names the file {uri}, which does not exist in its folder")
        return file

    def _decoded(self, index: int) -> NDArray[np.uint8]:
        entry = self.header["images"][index]
        if "bufferView" in entry:
            view = self.header["bufferViews"][entry["bufferView"]]
            start = view.get("byteOffset", 0)
            data = self.buffer(view["buffer"])[start : start + view["byteLength"]]
        else:
            data = self._resource(entry["uri"])
        try:
            with Image.open(io.BytesIO(data)) as image:
                return eight_bit(image, "RGBA")
        except (OSError, SyntaxError, Image.DecompressionBombError) as error:
            name = entry.get("name", entry.get("uri", ""))[:60]
            raise InputError(f"{self.path}: image {index} ({name}) cannot be read ({error})") from error

    def _resource(self, uri: str) -> bytes:
        """The bytes behind a URI: of the file itself (``data:``), or of a file beside it."""
        if uri.startswith("data:"):
            return base64.b64decode(uri.partition(",")[2])
        file = self.path.parent / unquote(uri)
        if not file.is_file():
            raise InputError(f"{self.path}: names the file {unquote(uri)}, which does not exist in its folder")
        return file.read_bytes()

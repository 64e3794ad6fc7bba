"""``EXT_meshopt_compression`` and ``KHR_meshopt_compression``: compressed buffer views."""

from __future__ import annotations

from typing import Any

import numpy as np

from lightdepth.errors import SetupError
from lightdepth.packages import optional_package
from lightdepth.scene.meshes.gltf_schema import Compression

_LARGEST = 1 << 30


def decompressed(data: bytes, how: Compression) -> bytes:
    """The bytes of a buffer view.

    Raises:
        ValueError: they are damaged, compressed in a way that is not known, or the package that decodes is missing.
    """
    try:
        meshopt: Any = optional_package("meshoptimizer", "gltf")
    except SetupError as error:
        raise ValueError(f"is compressed with meshopt; {error}") from error
    count, stride = how.count, how.byte_stride
    if count * stride > _LARGEST:
        raise ValueError(f"says it has {count} elements of {stride} bytes, which is too much")
    try:
        if how.mode == "ATTRIBUTES" and stride % 4 == 0:
            decoded = meshopt.decode_vertex_buffer(count, stride, data, dtype=np.dtype(f"V{stride}"))
        elif how.mode == "TRIANGLES" and stride in (2, 4) and count % 3 == 0:
            decoded = meshopt.decode_index_buffer(count, stride, data)
        elif how.mode == "INDICES" and stride in (2, 4):
            decoded = meshopt.decode_index_sequence(count, stride, data)
        else:
            raise ValueError(
                f"is compressed with meshopt in mode {how.mode[:20]} with a stride of {stride}, which is unknown"
            )
    except RuntimeError as error:
        raise ValueError("its data compressed with meshopt is damaged") from error
    content = decoded.tobytes()[: count * stride]
    if how.mode != "ATTRIBUTES" or how.filter == "NONE":
        return content
    filtered = np.frombuffer(content, np.uint8).copy()
    if how.filter == "OCTAHEDRAL" and stride in (4, 8):
        filtered = meshopt.decode_filter_oct(filtered, count, stride)
    elif how.filter == "QUATERNION" and stride == 8:
        filtered = meshopt.decode_filter_quat(filtered, count, stride)
    elif how.filter == "EXPONENTIAL":
        filtered = meshopt.decode_filter_exp(filtered, count, stride)
    else:
        raise ValueError(f"is compressed with the meshopt filter {how.filter[:20]}, which is not supported")
    return filtered.tobytes()

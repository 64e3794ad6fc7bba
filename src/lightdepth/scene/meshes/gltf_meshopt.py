"""``EXT_meshopt_compression`` and ``KHR_meshopt_compression``: compressed buffer views."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

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
        raise ValueError(f"states {count} elements of {stride} bytes, which is too much")
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
    elif how.filter == "COLOR" and stride in (4, 8):
        return _colours(filtered.view("<u1" if stride == 4 else "<u2").reshape(-1, 4))
    else:
        raise ValueError(f"is compressed with the meshopt filter {how.filter[:20]}, which is not supported")
    return filtered.tobytes()


def _colours(stored: NDArray[np.unsignedinteger]) -> bytes:
    """Undo the filter COLOR of ``KHR_meshopt_compression``, which the package does not know.

    A row holds luma, two signed chroma components and alpha, all in fewer bits than its type has; the highest bit of
    alpha says how many.
    """
    bits = 8 * stored.dtype.itemsize
    luma, alpha = stored[:, 0].astype(np.int64), stored[:, 3].astype(np.int64)
    orange, green = (stored[:, i].astype(f"i{stored.dtype.itemsize}").astype(np.int64) for i in (1, 2))
    largest = alpha.copy()  # Of as many bits as are used.
    for shift in (1, 2, 4, 8):
        largest |= largest >> shift
    colours = np.stack(
        [
            luma + orange - green,
            luma + green,
            luma - orange - green,
            (alpha << 1 & largest) | (alpha & 1),  # The mark gives its place to one bit more.
        ],
        axis=1,
    )
    shares = np.clip(colours / np.maximum(largest, 1)[:, None], 0.0, 1.0)
    return np.floor(shares * (2**bits - 1) + 0.5).astype(stored.dtype).tobytes()

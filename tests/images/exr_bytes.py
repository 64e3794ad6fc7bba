"""OpenEXR files byte by byte, for what the library's own binding does not write."""

import struct

import numpy as np


def _attribute(name, kind, value):
    return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value


def uncompressed_exr(channels, size, extra=b""):
    """A file of one part with float channels; ``channels`` maps names to (pixels, sampling).

    A channel with a sampling of 2 has a pixel for every second column and row.
    """
    width, height = size
    ordered = sorted(channels.items())
    listed = b"".join(name.encode() + b"\0" + struct.pack("<iiii", 2, 0, step, step) for name, (_, step) in ordered)
    box = struct.pack("<iiii", 0, 0, width - 1, height - 1)
    header = struct.pack("<ii", 20000630, 2)
    header += _attribute("channels", "chlist", listed + b"\0") + _attribute("compression", "compression", b"\0")
    header += _attribute("dataWindow", "box2i", box) + _attribute("displayWindow", "box2i", box)
    header += _attribute("lineOrder", "lineOrder", b"\0") + _attribute(
        "pixelAspectRatio", "float", struct.pack("<f", 1)
    )
    header += _attribute("screenWindowCenter", "v2f", bytes(8))
    header += _attribute("screenWindowWidth", "float", struct.pack("<f", 1)) + extra + b"\0"
    rows = []
    for row in range(height):
        data = b"".join(
            np.asarray(pixels[row // step], "<f4").tobytes() for _, (pixels, step) in ordered if row % step == 0
        )
        rows.append(struct.pack("<ii", row, len(data)) + data)
    starts = len(header) + 8 * height + np.cumsum([0, *map(len, rows[:-1])])
    return header + starts.astype("<u8").tobytes() + b"".join(rows)

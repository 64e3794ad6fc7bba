"""DNG files byte by byte: a mosaic or linear RGB, with black levels and a white balance."""

import struct

import numpy as np

_FORMATS = {1: "B", 3: "H", 4: "I", 5: "II", 10: "ii"}
_XYZ_TO_CAMERA = [3.2404542, -1.5371385, -0.4985314, -0.9692660, 1.8760108, 0.0415560, 0.0556434, -0.2040259, 1.0572252]
"""A camera whose primaries are Rec.709's."""


def write_dng(path, pixels, black, white, neutral=(1.0, 1.0, 1.0), time=(1, 60), colours=None):
    """Write readings as DNG.

    Args:
        path: the file.
        pixels: shape (height, width) is an RGGB mosaic, (height, width, 3) linear RGB, (height, width, 1) linear grey;
            whole numbers.
        black: level of each channel of linear RGB, or the one of a mosaic.
        white: level.
        neutral: readings of grey.
        time: exposure, as a fraction of a second.
        colours: linear Rec.709 to the camera's colours, shape (3, 3), rows of sum 1; by default the same.
    """
    height, width = pixels.shape[:2]
    channels = pixels.shape[2] if pixels.ndim == 3 else 1
    to_camera = np.reshape(_XYZ_TO_CAMERA, (3, 3)) if colours is None else colours @ np.reshape(_XYZ_TO_CAMERA, (3, 3))
    tags = {
        254: (4, [0]), 256: (4, [width]), 257: (4, [height]), 258: (3, [16] * channels), 259: (3, [1]),
        262: (3, [34892 if pixels.ndim == 3 else 32803]), 271: (2, b"Test\0"), 272: (2, b"Synthetic\0"), 273: (4, [0]),
        274: (3, [1]), 277: (3, [channels]), 278: (4, [height]), 279: (4, [pixels.size * 2]), 284: (3, [1]),
        33434: (5, [time]), 50706: (1, [1, 4, 0, 0]), 50707: (1, [1, 1, 0, 0]), 50708: (2, b"Test Synthetic\0"),
        50713: (3, [1, 1]), 50714: (5, [(level, 1) for level in black]), 50717: (4, [white] * channels),
        50721: (10, [(int(value * 10000), 10000) for value in np.ravel(to_camera)]),
        50728: (5, [(int(value * 1000), 1000) for value in neutral]), 50778: (3, [21]),
    }  # fmt: skip
    if pixels.ndim == 2:
        tags |= {33421: (3, [2, 2]), 33422: (1, [0, 1, 1, 2])}
    values = {tag: _packed(*entry) for tag, entry in sorted(tags.items())}
    outside = 8 + 2 + 12 * len(values) + 4
    start = outside + sum(len(data) + len(data) % 2 for _, _, data in values.values() if len(data) > 4)
    values[273] = (4, 1, struct.pack("<I", start))
    directory, more = struct.pack("<H", len(values)), b""
    for tag, (kind, count, data) in values.items():
        if len(data) > 4:
            directory += struct.pack("<HHII", tag, kind, count, outside + len(more))
            more += data + b"\0" * (len(data) % 2)
        else:
            directory += struct.pack("<HHI", tag, kind, count) + data.ljust(4, b"\0")
    pixels = np.round(pixels).astype("<u2").tobytes()
    path.write_bytes(b"II*\0" + struct.pack("<I", 8) + directory + bytes(4) + more + pixels)


def _packed(kind, values):
    if kind == 2:
        return kind, len(values), values
    flat = [number for value in values for number in (value if isinstance(value, tuple) else (value,))]
    letter = _FORMATS[kind][0]
    return kind, len(values), struct.pack(f"<{len(flat)}{letter}", *flat)

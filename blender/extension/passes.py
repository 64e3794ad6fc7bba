"""The parts of the renderer's file as passes of Blender's render result."""

import numpy as np

PASSES = {
    "Plate": ("plate", "RGB", "COLOR"),
    "Change": ("change", "RGB", "COLOR"),
    "Synthetic": ("synthetic", "RGB", "COLOR"),
    "Coverage": ("alpha", "Y", "VALUE"),
    "Object ID": ("object_id", "X", "VALUE"),
    "Depth": ("depth", "Z", "VALUE"),
    "Normal": ("normal", "XYZ", "VECTOR"),
    "Albedo": ("albedo", "RGB", "COLOR"),
    "Variance": ("variance", "RGB", "COLOR"),
}
"""Blender's name of a pass: the part's name in the file, the channels' names in Blender, the kind of pass."""


def from_parts(parts: dict[str, dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Pixels by pass name.

    Args:
        parts: what :func:`.exr.read` gives; the part ``beauty`` must be there, the others may be.

    Returns:
        Arrays of shape (height, width, channels), the first row at the top; ``Combined`` has red, green, blue, alpha.

    Raises:
        KeyError: the finished image is missing.
    """
    beauty = parts["beauty"]
    pixels = {"Combined": np.stack([beauty[name] for name in "RGBA"], axis=-1)}
    for name, (part, channels, _) in PASSES.items():
        if part in parts:
            found = parts[part]
            # A single channel is the only one of its part, whatever the file calls it.
            planes = [found[channel] for channel in channels] if len(channels) > 1 else [next(iter(found.values()))]
            pixels[name] = np.stack(planes, axis=-1)
    return pixels

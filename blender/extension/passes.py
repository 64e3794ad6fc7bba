"""The parts of the renderer's file as passes of Blender's render result."""

import numpy as np

from .images import from_rec709

PASSES = {
    "Plate": ("plate", "RGB", "COLOR"),
    "Change": ("change", "RGB", "COLOR"),
    "Synthetic": ("synthetic", "RGB", "COLOR"),
    "Coverage": ("coverage", "Y", "VALUE"),
    "Object ID": ("object_id", "X", "VALUE"),
    "Depth": ("depth", "Z", "VALUE"),
    "Normal": ("normal", "XYZ", "VECTOR"),
    "Albedo": ("albedo", "RGB", "COLOR"),
    "Variance": ("variance", "RGB", "COLOR"),
}
"""Blender's name of a pass: the part's name in the file, the channels' names in Blender, the kind of pass."""
INDEX = "IndexOB"
"""Blender's name of the pass with the objects' pass indices."""


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
            # Channels are called after their layer, which is mostly that of the part; a single one is taken as it is.
            found = {name.rpartition(".")[2]: plane for name, plane in found.items()}
            planes = [found[channel] for channel in channels] if len(channels) > 1 else [next(iter(found.values()))]
            pixels[name] = np.stack(planes, axis=-1)
    for name in ("Combined", *(name for name, (_, _, kind) in PASSES.items() if kind == "COLOR" and name in pixels)):
        pixels[name] = from_rec709(pixels[name])
    return pixels


def keep_circle(pixels: dict[str, np.ndarray], share: float) -> None:
    """Make everything outside a circle empty, in place.

    Args:
        pixels: by pass name.
        share: the circle's radius as a share of half the picture's width.
    """
    height, width = pixels["Combined"].shape[:2]
    x, y = np.meshgrid(np.arange(width) + 0.5 - 0.5 * width, np.arange(height) + 0.5 - 0.5 * height)
    outside = np.hypot(x, y) > 0.5 * share * width
    for values in pixels.values():
        values[outside] = 0.0


def make_transparent(pixels: dict[str, np.ndarray]) -> None:
    """Leave of the finished picture what belongs over the photograph, in place.

    Alpha is the least with which the picture laid over the plate is the finished one and no colour is negative: the
    objects' coverage, and of their shadows the strongest channel.
    """
    if "Plate" not in pixels or "Coverage" not in pixels:
        return
    beauty, plate = pixels["Combined"][..., :3], pixels["Plate"]
    ratio = np.divide(beauty, plate, out=np.ones_like(beauty), where=plate > 1e-12).min(axis=-1, keepdims=True)
    alpha = np.clip(np.maximum(pixels["Coverage"], 1.0 - ratio), 0.0, 1.0)
    pixels["Combined"] = np.concatenate([np.maximum(beauty - plate * (1.0 - alpha), 0.0), alpha], axis=-1)


def indices(numbers: np.ndarray, of_objects: list[int]) -> np.ndarray:
    """Pass indices of object numbers: 0 where there is none.

    Args:
        numbers: of the objects, from 1 on; any shape.
        of_objects: each object's pass index.
    """
    table = np.array([0, *of_objects], np.float32)
    return table[np.clip(numbers.astype(np.int64), 0, len(of_objects))]

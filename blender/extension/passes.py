"""The parts of the renderer's file as passes of Blender's render result."""

import json

import numpy as np

from .images import from_rec709

PASSES = {
    "Plate": ("plate", "RGB", "COLOR"),
    "Change": ("change", "RGB", "COLOR"),
    "Shadow": ("shadow", "RGB", "COLOR"),
    "Synthetic": ("synthetic", "RGB", "COLOR"),
    "Coverage": ("coverage", "Y", "VALUE"),
    "Object ID": ("object_id", "X", "VALUE"),
    "Depth": ("depth", "Z", "VALUE"),
    "Normal": ("normal", "XYZ", "VECTOR"),
    "Albedo": ("albedo", "RGB", "COLOR"),
    "Variance": ("variance", "RGB", "COLOR"),
}
"""Blender's name of a pass: the part's name in the file, the channels' names in Blender, the kind of pass."""
INDEX, MATERIAL_INDEX = "IndexOB", "IndexMA"
"""Blender's names of the passes with the pass indices of objects and of materials."""

MATTES = {"CryptoObject": "object", "CryptoMaterial": "material", "CryptoAsset": "asset"}
"""Blender's names of the Cryptomatte layers that are made, and what the view layer's settings call them."""
_RENDERERS_MATTES = {"CryptoMaterial": "CryptoMaterial"}
"""The renderer's layer that one is made of; that of the objects otherwise."""


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


def material_indices(beauty: dict[str, np.ndarray], of_materials: dict[str, int]) -> np.ndarray:
    """Pass index of the material that covers most of each pixel, of what objects cover more than half of: 0 elsewhere.

    Args:
        beauty: channels of the finished picture, with those of the renderer's mattes where there are any.
        of_materials: pass indices by the names that the renderer's mattes have.

    Returns:
        Shape (height, width, 1).
    """
    found = np.zeros((*beauty["A"].shape, 1), np.float32)
    if "CryptoMaterial00.R" in beauty:
        ids = np.ascontiguousarray(beauty["CryptoMaterial00.R"], np.float32).view(np.uint32)
        for name, index in of_materials.items():
            found[(ids == matte_id(name)) & (beauty["CryptoMaterial00.G"] > 0.5)] = index
    return found


def mattes(beauty: dict[str, np.ndarray], layer: str, names: dict[str, str], count: int) -> dict[str, np.ndarray]:
    """A Cryptomatte layer by the names that objects have in Blender.

    Args:
        beauty: channels of the finished picture, with those of the renderer's mattes where there are any.
        layer: out of ``MATTES``.
        names: the name that counts, by that of the renderer.
        count: passes of two ranks each.

    Returns:
        Arrays of shape (height, width, 4) by the name of their pass.
    """
    shape = beauty["A"].shape
    numbers = {matte_id(name): matte_id(meant) for name, meant in names.items()}
    known = np.array(sorted(numbers), np.uint32)
    wanted = np.array([numbers[number] for number in known.tolist()], np.uint32)
    found = {}
    for index in range(count):
        made = found[f"{layer}{index:02}"] = np.zeros((*shape, 4), np.float32)
        for channel, letter in enumerate("RGBA"):
            plane = beauty.get(f"{_RENDERERS_MATTES.get(layer, 'CryptoObject')}{index:02}.{letter}")
            if plane is None:
                continue
            plane = np.ascontiguousarray(plane, np.float32)
            if letter in "RB" and len(known):
                ids = plane.view(np.uint32)
                place = np.minimum(np.searchsorted(known, ids), len(known) - 1)
                plane = np.where(known[place] == ids, wanted[place], ids).view(np.float32)
            made[..., channel] = plane
    return found


def matte_facts(layer: str, names: dict[str, str]) -> dict[str, str]:
    """What the file's header says of a Cryptomatte layer; arguments as for :func:`mattes`, the layer's name in full."""
    prefix = f"cryptomatte/{murmur3(layer.encode()):08x}"[: len("cryptomatte/") + 7]
    manifest = {name: f"{matte_id(name):08x}" for name in names.values()}
    facts = {"name": layer, "hash": "MurmurHash3_32", "conversion": "uint32_to_float32"}
    facts["manifest"] = json.dumps(manifest, ensure_ascii=False)
    return {f"{prefix}/{key}": value for key, value in facts.items()}


def matte_id(name: str) -> int:
    """The id of a name, as Cryptomatte's specification 1.2.0 has it."""
    value = murmur3(name.encode())
    return value ^ (1 << 23) if (value >> 23) & 255 in (0, 255) else value


def murmur3(data: bytes) -> int:
    """MurmurHash3_x86_32 with the seed 0 (A. Appleby, public domain)."""

    def rotated(value: int, by: int) -> int:
        return (value << by | value >> (32 - by)) & 0xFFFFFFFF

    value, whole = 0, len(data) // 4 * 4
    for start in range(0, len(data), 4):
        block = int.from_bytes(data[start : start + 4], "little") * 0xCC9E2D51 & 0xFFFFFFFF
        value ^= rotated(block, 15) * 0x1B873593 & 0xFFFFFFFF
        if start < whole:
            value = (rotated(value, 13) * 5 + 0xE6546B64) & 0xFFFFFFFF
    value ^= len(data)
    for shift, factor in ((16, 0x85EBCA6B), (13, 0xC2B2AE35)):
        value = (value ^ value >> shift) * factor & 0xFFFFFFFF
    return value ^ value >> 16

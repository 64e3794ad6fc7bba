"""The principled material nearest to the statements of an .mtl file.

Phong's exponent ``Ns`` becomes roughness by the usual match of lobes, ``alpha^2 = 2 / (Ns + 2)``; the extension ``Pr``
and ``Pm`` say roughness and metalness themselves. ``Ka`` has no meaning where light is traced, and ``illum`` none
beside the statements that it switches on.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightdepth.quantities import BRIGHTEST
from lightdepth.scene.materials import Principled, Texture
from lightdepth.scene.materials.image import read_pixels
from lightdepth.scene.materials.texture import SRGB_TO_LINEAR
from lightdepth.scene.meshes.part import Note
from lightdepth.scene.meshes.text_file import named_file

_APPLIED = frozenset(
    {
        "kd", "ks", "ns", "pr", "pm", "ke", "d", "tr", "pc", "pcr", "map_kd", "map_d", "map_ke", "map_pr", "map_pm",
        "norm", "map_bump", "bump",
    }
)  # fmt: skip
_MEANINGLESS = frozenset({"ka", "map_ka", "illum", "ni", "sharpness", "map_aat"})
_GLASS = frozenset({"4", "6", "7", "9"})
"""Illumination models that refract or let light through."""


@dataclass(frozen=True)
class Statement:
    """One line of an .mtl file.

    Attributes:
        keyword: as it is written.
        rest: what stands behind it.
        path: the file.
        line: counted from 1.
    """

    keyword: str
    rest: str
    path: Path
    line: int

    @property
    def place(self) -> str:
        """File and line, for messages."""
        return f"{self.path.name}: line {self.line}"


def principled(name: str, statements: Mapping[str, Statement], has_uv: bool, note: Note) -> Principled:
    """Make a material.

    Args:
        name: its name, for notes.
        statements: by keyword in lower case.
        has_uv: whether the mesh has texture coordinates; without, images are left out.
        note: called with what is left out or taken otherwise.
    """
    reader = _Reader(name, statements, has_uv, note)
    reader.name_the_rest()
    kd = reader.triple("kd", 0.8, 1.0)
    ke = reader.triple("ke", 0.0, math.inf)
    if max(ke) > BRIGHTEST:
        note(
            f"{statements['ke'].place}: 'Ke' of material '{name[:40]}' is {max(ke):.3g}, which is taken as {BRIGHTEST:g}"
        )
        ke = (min(ke[0], BRIGHTEST), min(ke[1], BRIGHTEST), min(ke[2], BRIGHTEST))
    base: Any = reader.colour("map_kd", kd)
    if isinstance(base, Texture) and not any(kd):
        note(f"material '{name}': Kd 0 0 0 multiplies its map_Kd and makes it black")
    if "map_ke" in statements and not any(ke):
        ke = (1.0, 1.0, 1.0)
        emission: Any = reader.colour("map_ke", ke)
        emission = emission if isinstance(emission, Texture) else (0.0, 0.0, 0.0)
    else:
        emission = reader.colour("map_ke", ke)
    shininess = max(reader.number("ns", 0.0), 0.0)
    settings: dict[str, Any] = {
        "base_color": base,
        "metallic": reader.share("map_pm", reader.fraction("pm", 0.0)),
        "roughness": reader.share("map_pr", reader.fraction("pr", (2.0 / (shininess + 2.0)) ** 0.25)),
        "specular": float(np.mean(reader.triple("ks", 0.5, 1.0))),
        "clearcoat": reader.fraction("pc", 0.0),
        "clearcoat_roughness": reader.fraction("pcr", 0.0),
        "emission": emission,
        "opacity": reader.opacity(),
    }
    if (normals := reader.normal_map()) is not None:
        settings["normal_map"] = normals
    return Principled(**settings)


@dataclass
class _Reader:
    """Numbers and images of one material."""

    name: str
    statements: Mapping[str, Statement]
    has_uv: bool
    note: Note

    def name_the_rest(self) -> None:
        """Note what is not carried, unless it says nothing."""
        for key, statement in self.statements.items():
            if key in _APPLIED or key in _MEANINGLESS or _says_nothing(statement.rest, 1.0 if key == "tf" else 0.0):
                continue
            self.note(f"{statement.place}: '{statement.keyword[:20]}' of material '{self.name[:40]}' is left out")
        illum = self.statements.get("illum")
        if illum is not None and illum.rest in _GLASS and self.opacity_number() == 1.0:
            self.note(
                f"{illum.place}: illum {illum.rest} of material '{self.name[:40]}' may mean glass or a mirror; it is "
                "left out, give the object a material of its own for these"
            )

    def numbers(self, key: str) -> list[float]:
        """The numbers of a statement, empty where it has none."""
        statement = self.statements.get(key)
        if statement is None:
            return []
        found = []
        for word in statement.rest.removeprefix("-halo").split("#")[0].split():
            try:
                value = float(word)
            except ValueError:
                value = math.nan
            if not math.isfinite(value):
                self.note(
                    f"{statement.place}: '{statement.keyword} {statement.rest[:40]}' is not in numbers and is left out"
                )
                return []
            found.append(value)
        return found

    def number(self, key: str, default: float) -> float:
        """The first number of a statement."""
        return next(iter(self.numbers(key)), default)

    def triple(self, key: str, default: float, upper: float) -> tuple[float, float, float]:
        """Three numbers of a statement, or one for all three, within 0 and an upper limit."""
        found = self.numbers(key)
        if len(found) not in (1, 3):
            if found:
                statement = self.statements[key]
                self.note(f"{statement.place}: '{statement.keyword}' needs one number or three and is left out")
            found = [default]
        red, green, blue = self._within(key, found if len(found) == 3 else found * 3, upper)
        return red, green, blue

    def fraction(self, key: str, default: float) -> float:
        """The first number of a statement, within 0 and 1."""
        return self._within(key, [self.number(key, default)], 1.0)[0]

    def _within(self, key: str, values: list[float], upper: float) -> list[float]:
        """Values within 0 and an upper limit; a note where some were beyond."""
        if min(values) < 0.0 or max(values) > upper:
            statement = self.statements[key]
            limits = "below 0" if upper == math.inf else "beyond 0 to 1"
            self.note(
                f"{statement.place}: '{statement.keyword} {statement.rest[:40]}' of material '{self.name[:40]}' goes "
                f"{limits} and is cut"
            )
        return [min(max(value, 0.0), upper) for value in values]

    def opacity_number(self) -> float:
        """Opacity without images.

        ``Tr`` should be ``1 - d``; but many programs write ``Tr 1`` and mean opaque, for nobody models what cannot be
        seen.
        """
        transparency = self.number("tr", 1.0)
        dissolve = self.number("d", 0.0 if transparency < 1.0 else 1.0)
        # Where the two contradict each other, the one by which something is seen is right.
        opacity = dissolve if dissolve > 0.0 or transparency >= 1.0 else 1.0 - transparency
        return float(np.clip(opacity, 0.0, 1.0))

    def opacity(self) -> Texture | float:
        """Opacity with its image, if there is one."""
        number = self.opacity_number()
        tr = self.numbers("tr")
        for key in ("d", "tr"):
            self.fraction(key, 0.0)
        if "d" in self.statements and self.statements["d"].rest.startswith("-halo"):
            self.note(f"{self.statements['d'].place}: '-halo' is left out; the opacity is the same seen from anywhere")
        if "d" not in self.statements and tr and tr[0] >= 1.0:
            self.note(
                f"{self.statements['tr'].place}: 'Tr 1' of material '{self.name[:40]}' would make it invisible; many "
                "programs mean opaque by it, and so it is taken"
            )
        elif number == 0.0:
            self.note(f"material '{self.name[:40]}' is invisible (d 0)")
        return self.share("map_d", number, factor=number)

    def colour(self, key: str, factor: tuple[float, float, float]) -> Any:
        """An image times a colour, or the colour where there is none that can be used."""
        if (found := self._image(key)) is None:
            return factor
        pixels, options = found
        if pixels.dtype == np.uint8:
            linear = SRGB_TO_LINEAR[pixels[:, :, :3]]
            if key == "map_kd" and "map_d" not in self.statements and (pixels[:, :, 3] < 255).any():
                self.note(f"the alpha of '{options.path.name}' is left out; name the image in 'map_d' to use it")
        else:
            linear = pixels[:, :, :3].astype(np.float64)
        values = np.maximum(options.adjusted(linear) * factor, 0.0)
        if key == "map_kd":
            values = np.minimum(values, 1.0)
        return options.texture(values.astype(np.float16 if values.max(initial=0.0) < 6e4 else np.float32))

    def share(self, key: str, number: float, factor: float = 1.0) -> Texture | float:
        """One channel of an image times a factor, or the number where there is no image that can be used."""
        if (found := self._image(key)) is None:
            return float(number)
        pixels, options = found
        if pixels.dtype != np.uint8:
            self.note(f"'{options.path.name}' of '{options.keyword}' is left out: an 8-bit image is needed there")
            return float(number)
        channel = options.channel(pixels, alpha=key == "map_d") / 255.0
        return options.texture(np.clip(options.adjusted(channel) * factor, 0.0, 1.0).astype(np.float16)[:, :, None])

    def normal_map(self) -> Texture | None:
        """The image of ``norm``, or of ``map_Bump`` where that is one of normals."""
        for key in ("norm", "map_bump", "bump"):
            if (found := self._image(key)) is None:
                continue
            pixels, options = found
            if pixels.dtype != np.uint8 or (key != "norm" and not _looks_like_normals(pixels)):
                self.note(f"'{options.path.name}' of '{options.keyword}' is left out: only maps of normals are used")
                continue
            values = pixels[:, :, :3] / 255.0
            values[:, :, :2] = 0.5 + (values[:, :, :2] - 0.5) * options.bump
            return options.texture(np.clip(values, 0.0, 1.0).astype(np.float16))
        return None

    def _image(self, key: str) -> tuple[NDArray[Any], _Options] | None:
        """Pixels (uint8 RGBA, or float32 RGB) and options of a map, or ``None`` where it cannot be used."""
        statement = self.statements.get(key)
        if statement is None:
            return None
        place = f"{statement.place}: {statement.keyword}"
        words, name = _split_options(statement.rest)
        path = named_file(statement.path.parent, name)
        if path is None:
            self.note(f"{place}: the image '{name[:80]}' does not exist; material '{self.name[:40]}' is without it")
            return None
        if not self.has_uv:
            self.note(f"{place}: the mesh has no texture coordinates to lay '{name[:80]}' by; it is left out")
            return None
        options = _Options.of(words, path, statement, self.note)
        try:
            return read_pixels(path), options
        except ValueError as error:
            self.note(f"{place}: {error}; material '{self.name[:40]}' is without it")
            return None


_OPTION_LENGTHS = {"-o": 3, "-s": 3, "-t": 3, "-mm": 2, "-bm": 1, "-boost": 1, "-texres": 1, "-clamp": 1, "-blendu": 1}
_OPTION_LENGTHS |= {"-blendv": 1, "-imfchan": 1, "-type": 1, "-cc": 1, "-colorspace": 1}
_OF_NUMBERS = ("-o", "-s", "-t", "-mm")
"""Options that may have fewer numbers."""


def _split_options(rest: str) -> tuple[list[tuple[str, list[str]]], str]:
    """The options of a map, each with its values, and the file's name, which may have spaces."""
    options = []
    remaining = rest.strip()
    while remaining.startswith("-"):
        key, _, after = remaining.partition(" ")
        length = _OPTION_LENGTHS.get(key.lower())
        if length is None:
            break
        values: list[str] = []
        after = after.strip()
        while len(values) < length and " " in after:
            word, _, further = after.partition(" ")
            if key.lower() in _OF_NUMBERS and not _is_number(word):
                break
            values.append(word)
            after = further.strip()
        options.append((key.lower(), values))
        remaining = after
    return options, remaining


def _says_nothing(text: str, nothing: float) -> bool:
    """Whether all words are the number that has no effect, or ``off``."""
    return all(word == "off" or (_is_number(word) and float(word) == nothing) for word in text.split())


def _is_number(word: str) -> bool:
    try:
        return math.isfinite(float(word))
    except ValueError:
        return False


@dataclass(frozen=True)
class _Options:
    """What stands between a map's keyword and its file.

    Attributes:
        path: the image.
        keyword: of the statement.
        scale: of the texture coordinates.
        offset: added to them afterwards.
        base: added to the image's values.
        gain: that these are multiplied by before.
        bump: strength of normals.
        clamp: the image is not repeated.
        source: the channel that is used where one is needed, ``r g b m l z`` or empty.
    """

    path: Path
    keyword: str
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)
    base: float = 0.0
    gain: float = 1.0
    bump: float = 1.0
    clamp: bool = False
    source: str = ""

    @classmethod
    def of(cls, words: list[tuple[str, list[str]]], path: Path, statement: Statement, note: Note) -> _Options:
        """Read the options; what changes the picture and is not supported is noted."""
        found: dict[str, Any] = {}
        for key, values in words:
            numbers = [float(value) for value in values if _is_number(value)]
            if key == "-s" and numbers:
                found["scale"] = (numbers[0], numbers[1] if len(numbers) > 1 else 1.0)
            elif key == "-o" and numbers:
                found["offset"] = (numbers[0], numbers[1] if len(numbers) > 1 else 0.0)
            elif key == "-mm" and len(numbers) == 2:
                found["base"], found["gain"] = numbers
            elif key == "-bm" and numbers:
                found["bump"] = numbers[0]
            elif key == "-clamp":
                found["clamp"] = values == ["on"]
            elif key == "-imfchan" and values:
                found["source"] = values[0].lower()
            elif key in ("-t", "-boost", "-cc", "-type", "-colorspace") and not _says_nothing(" ".join(values), 0.0):
                note(f"{statement.place}: option {key} of {statement.keyword} is left out")
        return cls(path, statement.keyword, **found)

    def adjusted(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """The image's values with base and gain."""
        return values if (self.base, self.gain) == (0.0, 1.0) else self.base + self.gain * values

    def channel(self, pixels: NDArray[np.uint8], alpha: bool) -> NDArray[np.float64]:
        """The channel that is asked for; else alpha, where that is wanted and says something, or brightness."""
        if self.source in ("r", "g", "b"):
            return pixels[:, :, "rgb".index(self.source)].astype(np.float64)
        if self.source == "m" or (alpha and not self.source and (pixels[:, :, 3] < 255).any()):
            return pixels[:, :, 3].astype(np.float64)
        return pixels[:, :, :3].astype(np.float64) @ [0.299, 0.587, 0.114]

    def texture(self, pixels: NDArray[np.floating]) -> Texture:
        """Pixels laid as the options say; v grows downward in ``to_uv``."""
        (su, sv), (ou, ov) = self.scale, self.offset
        to_uv = np.array([[su, 0.0, ou], [0.0, sv, 1.0 - sv - ov], [0.0, 0.0, 1.0]])
        return Texture(pixels, wrap="clamp" if self.clamp else "repeat", to_uv=to_uv)


def _looks_like_normals(pixels: NDArray[np.uint8]) -> bool:
    """Whether an image is of normals in tangent space: mostly blue, around unit length; heights are grey."""
    vectors = pixels[::4, ::4, :3] / 127.5 - 1.0 if min(pixels.shape[:2]) > 16 else pixels[:, :, :3] / 127.5 - 1.0
    lengths = np.linalg.norm(vectors, axis=2)
    return bool(np.mean(vectors[:, :, 2]) > 0.5 and np.mean(np.abs(lengths - 1.0) < 0.15) > 0.9)

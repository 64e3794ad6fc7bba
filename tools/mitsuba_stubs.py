"""A plugin of mypy that writes the type stubs of Mitsuba and Dr.Jit, corrected, to ``build/stubs``, where mypy looks first.

As they come, the stubs cannot be checked against: Mitsuba's ``Float`` and Dr.Jit's are two types in them, arguments that
are converted are refused, and the unions of what can be converted nest so deeply that mypy takes minutes to print one.
Each correction below fails where a new version has nothing to correct any more.
"""

from __future__ import annotations

import hashlib
import re
import sys
from importlib.util import find_spec
from pathlib import Path

from mypy.plugin import Plugin

TARGET = Path(__file__).parents[1] / "build" / "stubs"
SCALARS = ("Bool", "Int", "Int32", "Int64", "UInt", "UInt32", "UInt64", "Float", "Float16", "Float32", "Float64")
SAME = {"Int32": "Int", "UInt32": "UInt", "Float32": "Float"}
TRIPLES, PAIRS = ("Vector3f", "Point3f", "Color3f", "Normal3f"), ("Vector2f", "Point2f")


def plugin(version: str) -> type[Plugin]:
    """Called by mypy before it looks for modules."""
    write_stubs(TARGET)
    return Plugin


def write_stubs(target: Path) -> None:
    """Write the corrected stubs to a folder unless they are there."""
    originals = {}
    for package in ("mitsuba", "drjit"):
        spec = find_spec(package)
        if spec is None or not spec.submodule_search_locations:
            sys.exit(f"{package} is not installed: there are no stubs to check against")
        folder = Path(spec.submodule_search_locations[0])
        originals |= {
            f"{package}/{file.relative_to(folder).as_posix()}": file for file in sorted(folder.rglob("*.pyi"))
        }
    texts = {name: file.read_text() for name, file in originals.items()}
    state = hashlib.sha256(Path(__file__).read_bytes() + "".join(texts.values()).encode()).hexdigest()
    mark = target / "state"
    if mark.is_file() and mark.read_text() == state:
        return
    for name, text in texts.items():
        file = target / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(CORRECTIONS.get(name, _unchanged)(text))
    for package in ("mitsuba", "drjit"):
        (target / package / "py.typed").touch()
    mark.write_text(state)


def _unchanged(text: str) -> str:
    return text


def _corrected(text: str, pattern: str, replacement: str) -> str:
    text, count = re.subn(pattern, replacement, text, flags=re.MULTILINE)
    if not count:
        sys.exit(f"the stubs of Mitsuba or Dr.Jit no longer have what tools/mitsuba_stubs.py corrects: {pattern}")
    return text


def _mitsuba(text: str) -> str:
    for name in SCALARS:
        own = f"drjit.auto.ad.{SAME.get(name, name)}"
        text = _corrected(text, rf"^class {name}\(drjit\.ArrayBase\[.*\]\): pass$", f"{name}: TypeAlias = {own}")
        convertible = f"drjit.auto.ad._{SAME.get(name, name)}Cp"
        text = _corrected(text, rf"^_{name}Cp: TypeAlias = .*$", f"_{name}Cp: TypeAlias = {convertible}")
    for kinds in (TRIPLES, PAIRS):
        for name in kinds:
            members = ", ".join(f"'{kind}'" for kind in kinds)
            text = _corrected(
                text,
                rf"^_{name}Cp: TypeAlias = .*$",
                f"_{name}Cp: TypeAlias = Union[{members}, drjit.auto.ad._FloatCp]",
            )
    # In the variants that are used here, spectra are colours.
    for name in ("Spectrum", "UnpolarizedSpectrum"):
        text = _corrected(text, rf"^class {name}\(drjit\..*$", f"{name}: TypeAlias = Color3f")
        text = _corrected(text, rf"^_{name}Cp: TypeAlias = .*$", f"_{name}Cp: TypeAlias = '_Color3fCp'")
    text = _corrected(
        text, r"^class TensorXf\(drjit\.(.*\n(?: .*\n|\n(?= ))*)", "TensorXf: TypeAlias = drjit.auto.ad.TensorXf\n"
    )
    text = _corrected(text, r"(def get_texture\(self, name: str.*\)) -> object:", r"\1 -> Texture:")
    text = _corrected(
        text, r"(def get\(self, key: str, def_value: )object \| None = None\) -> object:", r"\1Any = None) -> Any:"
    )
    affine = r"^(_Matrix[34]fCp: TypeAlias = Union\[.*)\]$"
    text = _corrected(text, affine, r"\1, NDArray[numpy.float64]]")
    text = _corrected(text, r"(def add_attribute\(.*buffer: )Sequence\[float\]", r"\1Sequence[float] | Float")
    text = _corrected(text, r"^_TensorXfCp: TypeAlias = .*$", "_TensorXfCp: TypeAlias = drjit.auto.ad._TensorXfCp")
    missing = "".join(f"{name}: TypeAlias = drjit.auto.ad.{name}\n" for name in ("PCG32", "Texture2f"))
    return _converting(_short(text)) + "\n" + missing


def _drjit(text: str) -> str:
    for name in ("__and__", "__iand__"):
        text = _corrected(
            text, rf"def {name}\(self, arg: SelfCpT, /\)", f"def {name}(self, arg: SelfCpT | drjit.auto.ad.Bool, /)"
        )
    text = _corrected(
        text,
        r"^def reinterpret_array\(arg0: type\[ArrayBase\], arg1: ArrayBase, /\) -> object:",
        "def reinterpret_array(arg0: type[T], arg1: ArrayBase, /) -> T:",
    )
    # Plain numbers beside arrays, without the type variables in which mypy loses itself where calls are nested.
    for name in ("maximum", "minimum"):
        simple = f"@overload\ndef {name}(arg0: ArrayT, arg1: float, /) -> ArrayT: ...\n"
        simple += f"@overload\ndef {name}(arg0: float, arg1: ArrayT, /) -> ArrayT: ...\n"
        text = _corrected(text, rf"^(?=@overload\ndef {name}\(arg0: ArrayBase)", simple)
    simple = "@overload\ndef clip(value: ArrayT, min: float, max: float) -> ArrayT: ...\n"
    text = _corrected(text, r"^(?=@overload\ndef clip\(value: ArrayBase)", simple)
    simple = "@overload\ndef power(arg0: ArrayT, arg1: float, /) -> ArrayT: ...\n"
    text = _corrected(text, r"^(?=@overload\ndef power\(arg0: int)", simple)
    simple = "@overload\ndef select(arg0: bool | AnyArray, arg1: ArrayT, arg2: float, /) -> ArrayT: ...\n"
    simple += "@overload\ndef select(arg0: bool | AnyArray, arg1: float, arg2: ArrayT, /) -> ArrayT: ...\n"
    text = _corrected(text, r"^(?=@overload\ndef select\(arg0: bool \| AnyArray, arg1: ArrayBase)", simple)
    return "import drjit.auto.ad\n" + text


def _drjit_arrays(text: str) -> str:
    return _converting(_short(text))


def _short(text: str) -> str:
    """Without the members of unions that belong to other variants and to half precision."""

    def kept(match: re.Match[str]) -> str:
        members = [member for member in re.split(r", (?![^\[]*\])", match[2]) if not re.search(OTHER, member)]
        members = [member.replace("_Float16Cp", "_UInt64Cp") for member in members]
        members = [member for member in members if "16Cp" not in member]
        return f"{match[1]}: TypeAlias = Union[{', '.join(members)}]"

    return re.sub(r"^(_\w+Cp): TypeAlias = Union\[(.*)\]$", kept, text, flags=re.MULTILINE)


OTHER = r"drjit\.scalar\.|drjit\.auto\._|drjit\.(cuda|llvm)|'drjit\.auto\.[A-Z]"


def _converting(text: str) -> str:
    """With parameters of methods that take all that is converted to their scalar type."""
    scalar = re.compile(r"(?<=: )(drjit\.auto\.ad\.)?(Bool|Float|UInt64|UInt|Int)\b(?= = |, |\))")

    def method(match: re.Match[str]) -> str:
        return scalar.sub(r"\g<1>_\g<2>Cp", match[0]) if scalar.search(match[0]) else match[0]

    return re.sub(r"^    def \w+\(.*\)(?= -> )", method, text, flags=re.MULTILINE)


CORRECTIONS = {"mitsuba/__init__.pyi": _mitsuba, "drjit/__init__.pyi": _drjit, "drjit/auto/ad.pyi": _drjit_arrays}

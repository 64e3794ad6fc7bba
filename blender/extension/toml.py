"""Scene files are TOML, which Python reads but does not write: the part of the format that they need."""

import json
from collections.abc import Mapping
from functools import cache
from typing import Any


def dumps(document: Mapping[str, Any]) -> str:
    """A TOML document.

    Args:
        document: tables by name; a table whose values are all tables becomes ``[name.key]`` sections, a list of
            tables becomes ``[[name]]`` sections.
    """
    sections = []
    for name, value in document.items():
        if isinstance(value, list):
            sections += [f"[[{_key(name)}]]\n{_lines(table)}" for table in value]
        elif value and all(isinstance(entry, Mapping) for entry in value.values()):
            sections += [f"[{_key(name)}.{_key(key)}]\n{_lines(table)}" for key, table in value.items()]
        else:
            sections.append(f"[{_key(name)}]\n{_lines(value)}")
    return "\n".join(sections)


def _lines(table: Mapping[str, Any]) -> str:
    return "".join(f"{_key(key)} = {_value(value)}\n" for key, value in table.items())


@cache
def _key(name: str) -> str:
    plain = name.isascii() and name.replace("_", "").replace("-", "").isalnum()
    return name if plain else _value(name)


def _value(value: Any) -> str:
    if isinstance(value, str):
        # Strings of JSON are strings of TOML, except for DEL, which only TOML wants escaped.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return _number(value)
    if isinstance(value, int):
        return repr(value)
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(key)} = {_value(entry)}" for key, entry in value.items()) + " }"
    if all(type(entry) is float for entry in value):  # most lists are
        return "[" + ", ".join(map(_number, value)) + "]"
    return "[" + ", ".join(map(_value, value)) + "]"


def _number(value: float) -> str:
    return repr(float(f"{value:.7g}") + 0.0)  # Blender's numbers have seven digits; + 0.0 for no -0.0

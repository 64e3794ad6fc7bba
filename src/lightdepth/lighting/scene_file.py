"""``[[light]]`` tables, and gloss, in a scene file, which otherwise stays as the person wrote it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.items import AoT

from lightdepth.errors import InputError
from lightdepth.images.writing import whole_file
from lightdepth.toml_file import document_bytes, read_document

PLACE_KEYS = ("direction", "azimuth", "elevation", "latitude", "longitude", "time", "north")
"""The ways to say where a sun stands; one takes the place of all others."""


def write_light(scene: Path, name: str, values: Mapping[str, Any]) -> None:
    """Put a light into a scene file: into its ``[[light]]`` table of the same name, or into a new one.

    Args:
        scene: the scene file; it is replaced whole or not at all.
        name: of the light.
        values: its keys; ``None`` takes a key away, all others of the table stay.

    Raises:
        InputError: the file is missing, is not TOML, its ``light`` is no array of tables, or it cannot be written.
    """
    document = read_document(scene)
    tables = document.get("light")
    if tables is None:
        if not document.as_string().endswith("\n\n"):
            document.add(tomlkit.nl())
        tables = document["light"] = tomlkit.aot()
    if not isinstance(tables, AoT):
        raise InputError(f"{scene}: 'light' must be an array of tables, each under its own [[light]]")
    # A table without a name has that of its type.
    table = next((table for table in tables if table.get("name", table.get("type")) == name), None)
    if table is None:
        tables.append(tomlkit.table())
        table = tables[-1]
        table["type"] = values["type"]
        table["name"] = name
    if any(key in values for key in PLACE_KEYS):
        for key in PLACE_KEYS:
            table.pop(key, None)
    for key, value in values.items():
        if value is None:
            table.pop(key, None)
        else:
            table[key] = value
    _write(scene, document)


def write_gloss(scene: Path, name: str, values: Mapping[str, float]) -> None:
    """Put ``gloss`` into the ``[[real]]`` table of a name.

    Args:
        scene: the scene file; it is replaced whole or not at all.
        name: of the surface.
        values: keys of ``gloss``, which replace those that are there.

    Raises:
        InputError: the file is missing, is not TOML, has no such surface, or it cannot be written.
    """
    document = read_document(scene)
    tables = document.get("real")
    table = next((each for each in tables if each.get("name") == name), None) if isinstance(tables, AoT) else None
    if table is None:
        raise InputError(f"{scene}: has no [[real]] table with name = '{name}'")
    gloss = tomlkit.inline_table()
    gloss.update(values)
    table["gloss"] = gloss
    _write(scene, document)


def _write(scene: Path, document: tomlkit.TOMLDocument) -> None:
    with whole_file(scene) as temporary:
        temporary.write_bytes(document_bytes(document))

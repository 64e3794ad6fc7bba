"""What is wrong with a scene file, in the words of its author: table, key, what was found and what is allowed."""

from __future__ import annotations

import difflib
import types
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel, Tag, ValidationError
from pydantic_core import ErrorDetails

from lightdepth.errors import InputError
from lightdepth.scene.toml_lines import TomlLines

LONGEST = 100
"""Letters of what a user wrote that a message repeats."""
KeyPath = tuple[str | int, ...]
"""Keys and positions from the file's top inward, as pydantic counts them."""


class Problems:
    """Collects the problems of one scene file."""

    def __init__(self, path: Path, text: str, document: Mapping[str, Any]) -> None:
        self._path = path
        self._lines = TomlLines(text)
        self._document = document
        self._messages: list[tuple[int, str]] = []

    @property
    def messages(self) -> tuple[str, ...]:
        """All problems in the order of the file, one line each."""
        return tuple(message for _, message in sorted(self._messages, key=lambda m: m[0]))

    def add(self, path: KeyPath, message: str, key: str | None = None) -> None:
        """Note a problem at a key path of the file, which may stand on the line of a further key there."""
        self._messages.append(self._located(path, message, key))

    def located(self, path: KeyPath, message: str) -> str:
        """A message with the key path of the file that it is about."""
        return self._located(path, message)[1]

    def _as_written(self, path: KeyPath) -> KeyPath:
        """A key path in a file with one plain ``[panorama]``, which is counted as the first of a list."""
        plain = path[:2] == ("panorama", 0) and not isinstance(self._document.get("panorama"), list)
        return (*path[:1], *path[2:]) if plain else path

    def _located(self, path: KeyPath, message: str, key: str | None = None) -> tuple[int, str]:
        path = self._as_written(path)
        table, position, keys, title = _split(path, self._document)
        line = self._lines.line_of(table, position, keys if key is None else (*keys, key))
        where = [str(self._path) + (f":{line}" if line else ""), *([title] if title else []), *keys]
        return line or 0, ": ".join([*where, message])

    @contextmanager
    def noting(self, path: KeyPath) -> Iterator[None]:
        """What is read in here and raises an ``InputError`` is a problem at a key path of the file, and no more."""
        try:
            yield
        except InputError as error:
            self.add(path, str(error))

    def add_all(
        self,
        error: ValidationError,
        model: type[BaseModel],
        known: Collection[KeyPath] = (),
        notes: Mapping[KeyPath, str] | None = None,
        within: KeyPath = (),
    ) -> None:
        """Note every problem that pydantic found while it validated ``model``.

        Args:
            error: what it found.
            model: the type of the whole file, or of a table.
            known: key paths whose problems have been noted before.
            notes: by key path, what to add to a message about it.
            within: key path of the table; empty for the whole file.
        """
        for details in error.errors(include_url=False):
            inner, expected = _without_tags(details["loc"], model)
            path = self._as_written((*within, *inner))
            if any(path[: len(other)] == other for other in known):
                continue
            message = _message(details, expected)
            message += next((note for other, note in (notes or {}).items() if path[: len(other)] == other), "")
            if details["type"] in ("extra_forbidden", "missing") and isinstance(path[-1], str):
                self.add(path[:-1], message, str(path[-1]))
            else:
                self.add(path, message)


def _split(path: KeyPath, document: Mapping[str, Any]) -> tuple[str, int, tuple[str, ...], str]:
    """Table name, position in an array of tables, keys within the table, and the table's title for a message."""
    if not path:
        return "", 0, (), ""
    first, rest = str(path[0]), path[1:]
    if first in ("panorama", "real", "light", "synthetic") and rest and isinstance(rest[0], int):
        index = rest[0]
        entry = document[first][index]
        name = entry.get("image" if first == "panorama" else "name") if isinstance(entry, dict) else None
        title = f"[[{first}]] {index + 1}" + (f' ("{name}")' if isinstance(name, str) else "")
        return first, index, _keys(rest[1:]), title
    if first == "camera" and rest:
        return f"camera.{rest[0]}", 0, _keys(rest[1:]), f"[camera.{rest[0]}]"
    if isinstance(document.get(first), dict):
        return first, 0, _keys(rest), f"[{first}]"
    return "", 0, _keys(path), ""


def _keys(path: KeyPath) -> tuple[str, ...]:
    """The named keys of a path; positions in lists of numbers say little and are left out."""
    return tuple(str(piece) for piece in path if isinstance(piece, str))


_PLAIN_WORDS = {
    "bool_type": "true or false",
    "dict_type": "a table of tables",
    "finite_number": "a finite number",
    "float_parsing": "a number",
    "float_type": "a number",
    "int_from_float": "a whole number",
    "int_parsing": "a whole number",
    "int_parsing_size": "a smaller whole number",
    "int_type": "a whole number",
    "list_type": "tables, each with its own [[...]] line",
    "model_attributes_type": "a table",
    "model_type": "a table",
    "path_type": "the name of a file",
    "string_type": "text in quotes",
}


def _list_of_numbers(expected: Any) -> str:
    """What a tuple's annotation asks for."""
    arms = [arm for arm in _arms(expected) if get_origin(arm) is tuple]
    return f"a list of {len(get_args(arms[0]))} numbers" if arms else "a list of numbers"


def _message(details: ErrorDetails, expected: Any) -> str:
    """One problem in plain words."""
    key, found, context = str(details["loc"][-1]), details["input"], details.get("ctx", {})
    match details["type"]:
        case "extra_forbidden":
            return f"unknown key '{shortened(key)}'{nearest(key, _field_names(expected))}"
        case "missing" if isinstance(details["loc"][-1], int):
            message = f"must be {_list_of_numbers(expected)}"
        case "tuple_type" | "too_long":
            message = f"must be {_list_of_numbers(expected)}"
        case kind if kind in _PLAIN_WORDS:
            message = f"must be {_PLAIN_WORDS[kind]}"
        case "missing":
            return f"the key '{key}' is missing"
        case "union_tag_not_found":
            return f"the key 'type' is missing; allowed: {', '.join(_type_names(expected))}"
        case "union_tag_invalid":
            tag = str(context["tag"])
            return f"type: '{shortened(tag)}' is not known{nearest(tag, _type_names(expected))}"
        case "literal_error":
            allowed = [str(value) for value in _literals(expected)]
            return f"{shortened(repr(found))} is not known{nearest(str(found), allowed)}"
        case "value_error":
            message = str(context["error"])
        case "string_too_short":
            message = "must not be empty"
        case "kind_of_object":
            return details["msg"]
        case _:
            message = details["msg"].replace("Input should", "must", 1).replace("must a ", "must be a ", 1)
    simple = isinstance(found, str | int | float | list) and "no such file" not in message
    return f"{message}, found {shortened(repr(found))}" if simple else message


def shortened(text: str) -> str:
    """What a user wrote, as far as it helps to find it."""
    return text if len(text) <= LONGEST else text[:LONGEST] + "..."


def nearest(word: str, known: Iterable[str]) -> str:
    """``; did you mean 'x'? allowed: ...`` for a word that is not among the known ones."""
    known = list(known)
    close = difflib.get_close_matches(word[:LONGEST].lower(), known, n=1, cutoff=0.5)
    hint = f"; did you mean '{close[0]}'?" if close else ";"
    return f"{hint} allowed: {', '.join(known)}"


def _without_tags(path: Sequence[str | int], model: type[BaseModel]) -> tuple[KeyPath, Any]:
    """Pydantic's location without the union arms that it names, and the type that is expected there.

    Where the last piece is a key that the model does not know, or one that is missing, the type is the model.
    """
    expected: Any = model
    kept: list[str | int] = []
    for piece in path:
        arm = _arm(expected, piece)
        if arm is not None:
            expected = arm
            continue
        kept.append(piece)
        expected = _member(expected, piece)
    return tuple(kept), expected


def _arms(annotation: Any) -> list[Any]:
    """The alternatives of a union, or the type itself."""
    origin = get_origin(annotation)
    if origin is Annotated and not any(isinstance(m, Tag) for m in get_args(annotation)[1:]):
        return _arms(get_args(annotation)[0])
    if origin in (Union, types.UnionType):
        return [arm for part in get_args(annotation) for arm in _arms(part)]
    return [annotation]


def _tags(arm: Any) -> list[str]:
    """What pydantic calls an arm of a discriminated union."""
    if get_origin(arm) is Annotated:
        return [m.tag for m in get_args(arm)[1:] if isinstance(m, Tag)]
    if isinstance(arm, type) and issubclass(arm, BaseModel) and "type" in arm.model_fields:
        return [str(name) for name in get_args(arm.model_fields["type"].annotation)]
    return []


def _arm(annotation: Any, piece: str | int) -> Any:
    """The union's arm that a piece of a location names, or ``None``."""
    arms = _arms(annotation)
    return next((arm for arm in arms if len(arms) > 1 and piece in _tags(arm)), None)


def _model(annotation: Any) -> type[BaseModel] | None:
    """The one model that a type is, if it is one."""
    for arm in _arms(annotation):
        bare = get_args(arm)[0] if get_origin(arm) is Annotated else arm
        if isinstance(bare, type) and issubclass(bare, BaseModel):
            return bare
    return None


def _member(annotation: Any, piece: str | int) -> Any:
    """The type of a field or an element; the model itself where it has no such field."""
    if (model := _model(annotation)) is not None:
        field = model.model_fields.get(str(piece))
        if field is None or field.annotation is None:
            return model
        return Annotated[field.annotation, *field.metadata] if field.metadata else field.annotation
    for arm in _arms(annotation):
        arguments = get_args(arm)
        if get_origin(arm) in (list, dict) and arguments:
            return arguments[-1]
    return annotation


def _field_names(annotation: Any) -> list[str]:
    model = _model(annotation)
    return [] if model is None else list(model.model_fields)


def _type_names(annotation: Any) -> list[str]:
    return [tag for arm in _arms(annotation) for tag in _tags(arm)]


def _literals(annotation: Any) -> list[Any]:
    return [value for arm in _arms(annotation) if get_origin(arm) is Literal for value in get_args(arm)]

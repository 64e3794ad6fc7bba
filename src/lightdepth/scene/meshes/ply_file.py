"""The container of Stanford PLY: elements with properties, ASCII or binary in either byte order."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError
from lightdepth.scene.meshes.text_file import decoded

_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4",
    "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "float32": "f4", "float64": "f8", "int64": "i8", "uint64": "u8",
}  # fmt: skip
_FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass(frozen=True)
class Property:
    """A property of an element.

    Attributes:
        name: in lower case.
        kind: NumPy's code of its numbers' type, without byte order.
        count_kind: for lists the type of their lengths, else ``None``.
    """

    name: str
    kind: str
    count_kind: str | None = None


@dataclass(frozen=True)
class Lists:
    """A list property of all rows of an element.

    Attributes:
        values: all numbers, one list after the other.
        lengths: of each list, shape (n,), int64.
    """

    values: NDArray[np.generic]
    lengths: NDArray[np.int64]


@dataclass
class Element:
    """The rows of one element.

    Attributes:
        count: how many.
        properties: in the order of the file.
        columns: numbers of the properties that have one in each row, by name.
        lists: the list properties, by name.
    """

    count: int
    properties: list[Property] = field(default_factory=list)
    columns: dict[str, NDArray[np.generic]] = field(default_factory=dict)
    lists: dict[str, Lists] = field(default_factory=dict)


@dataclass(frozen=True)
class PlyFile:
    """A file's content.

    Attributes:
        elements: by name, in the order of the file.
        comments: the comment lines, without the keyword.
        behind: what stands behind the last element, in words; empty where nothing does.
    """

    elements: dict[str, Element]
    comments: list[str]
    behind: list[str] = field(default_factory=list)


def read_ply_file(path: Path) -> PlyFile:
    """Read a file.

    Raises:
        InputError: it is not PLY, damaged or cut off.
    """
    content = path.read_bytes()
    head, body = _split(path, content)
    file, order = _header(path, head)
    if order:
        _Binary(path, body, order).read(file)
    else:
        _Ascii(path, body, first_line=head.count(b"\n") + 2).read(file)
    return file


def _split(path: Path, content: bytes) -> tuple[bytes, bytes]:
    """Header, without its last line, and body."""
    if content[:3].rstrip() != b"ply":
        raise InputError(f"{path}: not a PLY file: it does not begin with 'ply'")
    for line_end in (b"\r\n", b"\n", b"\r"):
        mark = line_end + b"end_header"
        place = content.find(mark + line_end)
        if place < 0 and content.endswith(mark):
            place = len(content) - len(mark)
        if place >= 0:
            head = content[:place].replace(b"\r\n", b"\n").replace(b"\r", b"\n")
            return head, content[place + len(mark) + len(line_end) :]
    place = content.find(b"\nend_header")
    end = content.find(b"\n", place + 1)
    if place < 0 or (end >= 0 and content[place + 11 : end].strip()):
        raise InputError(f"{path}: its header has no end ('end_header')")
    return content[:place].replace(b"\r\n", b"\n"), content[end + 1 :] if end >= 0 else b""


def _header(path: Path, head: bytes) -> tuple[PlyFile, str]:
    """The elements without their rows, and the byte order; empty for ASCII."""
    file = PlyFile({}, [])
    order: str | None = None
    element: Element | None = None
    for number, line in enumerate(decoded(head).split("\n"), start=1):
        words = line.split()

        def refuse(number: int = number, line: str = line) -> InputError:
            return InputError(f"{path}: line {number} of the header: '{line.strip()[:60]}' is not understood")

        match words:
            case [] | ["ply"] | ["obj_info", *_]:
                continue
            case ["comment", *_]:
                file.comments.append(line.strip()[len("comment") :].strip())
            case ["format", name, *_] if name in _FORMATS:
                order = _FORMATS[name]
            case ["element", name, count] if count.isascii() and count.isdigit() and len(count) < 16:
                element = Element(int(count))
                if name in file.elements:
                    raise InputError(f"{path}: line {number} of the header: element '{name}' appears twice")
                file.elements[name] = element
            case ["property", "list", count_kind, kind, name] if (
                element is not None and _TYPES.get(count_kind, "f")[0] != "f" and kind in _TYPES
            ):
                element.properties.append(Property(name.lower(), _TYPES[kind], _TYPES[count_kind]))
            case ["property", kind, name] if element is not None and kind in _TYPES:
                element.properties.append(Property(name.lower(), _TYPES[kind]))
            case _:
                raise refuse()
    if order is None:
        raise InputError(f"{path}: its header does not state the format")
    for name, element in file.elements.items():
        names = [p.name for p in element.properties]
        if len(set(names)) < len(names):
            raise InputError(f"{path}: element '{name[:40]}' has two properties of the same name")
        if not names:
            element.count = 0
    return file, order


class _Binary:
    """Takes the elements from a binary body."""

    def __init__(self, path: Path, body: bytes, order: str) -> None:
        self._path = path
        self._body = np.frombuffer(body, np.uint8)
        self._order = order
        self._offset = 0

    def read(self, file: PlyFile) -> None:
        """Fill the elements in."""
        for name, element in file.elements.items():
            if any(p.count_kind for p in element.properties):
                self._rows_with_lists(name, element)
            else:
                kinds = [(p.name, self._order + p.kind) for p in element.properties]
                row = np.dtype(kinds).itemsize if kinds else 0
                table = self._take(name, element, row * element.count).view(np.dtype(kinds)) if row else None
                for p in element.properties:
                    assert table is not None
                    element.columns[p.name] = table[p.name].astype(p.kind)
        if tail := len(self._body) - self._offset:
            file.behind.append(f"{tail} bytes")

    def _take(self, name: str, element: Element, size: int) -> NDArray[np.uint8]:
        if self._offset + size > len(self._body):
            raise self._cut_off(name, element)
        taken = self._body[self._offset : self._offset + size]
        self._offset += size
        return taken

    def _cut_off(self, name: str, element: Element) -> InputError:
        return InputError(
            f"{self._path}: the file ends before its {element.count} elements '{name[:40]}' are complete; it is cut "
            "off or damaged"
        )

    def _rows_with_lists(self, name: str, element: Element) -> None:
        """Rows of varying length: first where everything stands, then all numbers of a property together."""
        smallest = sum(np.dtype(p.count_kind or p.kind).itemsize for p in element.properties)
        if element.count * smallest > len(self._body) - self._offset:
            raise self._cut_off(name, element)
        count, places = element.count, len(element.properties)
        starts = np.zeros((places, count), np.int64)
        lengths = np.ones((places, count), np.int64)
        body, end, at = self._body.data, len(self._body), self._offset
        byte_order: str = "little" if self._order == "<" else "big"
        steps = [
            (
                k,
                np.dtype(p.count_kind).itemsize if p.count_kind else 0,
                (p.count_kind or "u")[0] == "i",
                np.dtype(p.kind).itemsize,
            )
            for k, p in enumerate(element.properties)
        ]
        for row in range(count):
            for k, count_size, signed, size in steps:
                if count_size:
                    if count_size == 1 and not signed:
                        length = body[at] if at < end else end
                    else:
                        length = int.from_bytes(body[at : at + count_size], byte_order, signed=signed)  # type: ignore[arg-type]
                    at += count_size
                    if length < 0:
                        raise InputError(f"{self._path}: element '{name[:40]}' {row} has a list of length {length}")
                    lengths[k, row] = length if length <= end else end + 1
                    starts[k, row] = at
                    at += length * size
                else:
                    starts[k, row] = at
                    at += size
            if at > end:
                raise self._cut_off(name, element)
        self._offset = at
        for k, p in enumerate(element.properties):
            numbers = self._gathered(starts[k], lengths[k], p.kind)
            if p.count_kind:
                element.lists[p.name] = Lists(numbers, lengths[k])
            else:
                element.columns[p.name] = numbers

    def _gathered(self, starts: NDArray[np.int64], lengths: NDArray[np.int64], kind: str) -> NDArray[np.generic]:
        """Numbers that stand in pieces, one after the other."""
        size = np.dtype(kind).itemsize
        index = np.repeat(starts - np.concatenate([[0], np.cumsum(lengths)[:-1]]) * size, lengths)
        index += np.arange(len(index)) * size
        raw = self._body[index[:, None] + np.arange(size)]
        return np.ascontiguousarray(raw).view(self._order + kind).reshape(-1).astype(kind)


class _Ascii:
    """Takes the elements from an ASCII body."""

    def __init__(self, path: Path, body: bytes, first_line: int) -> None:
        self._path = path
        self._lines = body.split(b"\n" if b"\n" in body else b"\r")
        self._numbers = [first_line + n for n, line in enumerate(self._lines) if line.strip()]
        self._lines = [line for line in self._lines if line.strip()]
        self._at = 0

    def read(self, file: PlyFile) -> None:
        """Fill the elements in."""
        for name, element in file.elements.items():
            lines = self._lines[self._at : self._at + element.count]
            if len(lines) < element.count:
                raise InputError(
                    f"{self._path}: has {len(lines)} of {element.count} elements '{name[:40]}'; it is cut off"
                )
            if any(p.count_kind for p in element.properties):
                self._rows_with_lists(element, lines)
            else:
                width = len(element.properties)
                table = self._table(lines, width)
                for column, p in enumerate(element.properties):
                    element.columns[p.name] = self._as_kind(table[:, column], p)
            self._at += element.count
        if tail := len(self._lines) - self._at:
            file.behind.append(f"{tail} lines")

    def _table(self, lines: list[bytes], width: int) -> NDArray[np.float64]:
        """Rows of the same number of values; where a row has others, its line is named."""
        if not lines:
            return np.zeros((0, width))
        numbers = self._parsed(lines)
        if len(numbers) != len(lines) * width or any(len(line.split()) != width for line in lines):
            for offset, line in enumerate(lines):
                if len(line.split()) != width:
                    raise InputError(f"{self._place(offset)}: {len(line.split())} values, {width} are needed")
        return numbers.reshape(-1, width)

    def _parsed(self, lines: list[bytes]) -> NDArray[np.float64]:
        """All values of some lines."""
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", DeprecationWarning)  # That is how NumPy says that a text is no number.
                return np.fromstring(b" ".join(lines).decode("latin-1"), dtype=np.float64, sep=" ")
        except (ValueError, DeprecationWarning):
            for offset, line in enumerate(lines):
                for word in line.split():
                    try:
                        float(word)
                    except ValueError:
                        found = decoded(word)[:40]
                        raise InputError(f"{self._place(offset)}: '{found}' is not a number") from None
            return np.array([float(word) for line in lines for word in line.split()], np.float64)

    def _place(self, offset: int) -> str:
        return f"{self._path}: line {self._numbers[self._at + offset]}"

    def _rows_with_lists(self, element: Element, lines: list[bytes]) -> None:
        widths = np.array([len(line.split()) for line in lines], np.int64)
        numbers = self._parsed(lines)
        if len(numbers) != widths.sum():
            raise InputError(f"{self._place(0)}: the lines from here on are not numbers")
        starts = np.concatenate([[0], np.cumsum(widths)[:-1]]).astype(np.int64) if len(lines) else widths
        at, ends = starts.copy(), starts + widths
        for p in element.properties:
            lengths = np.ones(len(at), np.int64)
            if p.count_kind:
                self._within(at + 1, ends)
                counts = numbers[at] if len(at) else np.zeros(0)
                bad = ~((counts >= 0) & (counts == np.floor(counts)) & (counts <= 1e9))
                if bad.any():
                    raise InputError(
                        f"{self._place(int(bad.argmax()))}: {counts[bad][0]:g} is not the length of a list"
                    )
                lengths = counts.astype(np.int64)
                at = at + 1
            self._within(at + lengths, ends)
            index = np.repeat(at - np.concatenate([[0], np.cumsum(lengths)[:-1]]), lengths) if len(at) else at
            values = self._as_kind(numbers[index + np.arange(len(index))], p)
            if p.count_kind:
                element.lists[p.name] = Lists(values, lengths)
            else:
                element.columns[p.name] = values
            at = at + lengths
        if (longer := at < ends).any():
            raise InputError(f"{self._place(int(longer.argmax()))}: more values than the header states")

    def _within(self, at: NDArray[np.int64], ends: NDArray[np.int64]) -> None:
        if (short := at > ends).any():
            raise InputError(f"{self._place(int(short.argmax()))}: fewer values than the header states")

    def _as_kind(self, values: NDArray[np.float64], p: Property) -> NDArray[np.generic]:
        """The values in the property's type; whole numbers must fit in."""
        if p.kind[0] == "f":
            return values.astype(np.float64)  # As exactly as the text has them.
        limits = np.iinfo(p.kind)
        bad = ~((values >= limits.min) & (values <= limits.max) & (values == np.floor(values)))
        if bad.any():
            raise InputError(
                f"{self._path}: '{p.name[:40]}' has {values[bad][0]:g}, which is not a whole number from {limits.min} "
                f"to {limits.max}"
            )
        return values.astype(p.kind)

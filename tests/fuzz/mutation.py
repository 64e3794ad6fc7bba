"""Makes damaged files out of sound ones."""

import base64
import json
import re

INTEGERS = [0, 1, -1, 2, 3, 127, 128, 255, 256, 32767, 65535, 65536, 2**31 - 1, 2**31, 2**32 - 1, 2**40, -(2**31)]
WORDS = [
    "0", "-1", "1", "3", "65536", "4294967295", "99999999999999999999", "1e308", "-1e308", "1e-320", "nan", "inf",
    "", "x", "1,5", "0x10", "''", '"', "/", "//", "-", "#", "\\", "\u00e9\u6f22", "[", "{", "]", "..", "1/2/3/4",
]  # fmt: skip
VALUES = [
    None, True, False, 0, 1, -1, 3, 2**31, 2**63, 1e308, -1e308, 0.5, "", "x", "data:,", "data:;base64,####", [], {},
    [0], [0, 0, 0], [[]], {"x": 1}, "TRIANGLES", "VEC3", "SCALAR", 5121, 5126, 4, 5, 6,
]  # fmt: skip
_NUMBER = re.compile(rb"[-+]?\d[\d.eE+-]*")


def mutant(content, others, random):
    """A damaged copy.

    Args:
        content: the sound file.
        others: sound files of the same kind, to take pieces from.
        random: a `random.Random`.
    """
    for _ in range(random.choice([1, 1, 1, 2, 3, 8])):
        ways = [_flipped, _number, _truncated, _cut, _doubled, _inserted, _spliced, _word, _line]
        if content[:1] == b"{" and random.random() < 0.85:  # Else hardly one would be JSON.
            ways = [_json, _json_buffer]
        content = random.choice(ways)(content, others, random)
    return content


def _span(content, random, longest=64):
    start = random.randrange(len(content) + 1)
    return start, min(len(content), start + random.choice([1, 2, 4, random.randrange(1, longest)]))


def _flipped(content, others, random):
    changed = bytearray(content)
    for _ in range(random.choice([1, 1, 2, 8])):
        if changed:
            changed[random.randrange(len(changed))] ^= 1 << random.randrange(8)
    return bytes(changed)


def _number(content, others, random):
    size = random.choice([1, 2, 4, 8])
    place = random.randrange(max(len(content) - size, 1))
    value = random.choice(INTEGERS) % (1 << (8 * size))
    return content[:place] + value.to_bytes(size, random.choice(["little", "big"])) + content[place + size :]


def _truncated(content, others, random):
    return content[: random.randrange(len(content) + 1)]


def _cut(content, others, random):
    start, end = _span(content, random, 512)
    return content[:start] + content[end:]


def _doubled(content, others, random):
    start, end = _span(content, random, 512)
    return content[:end] + content[start:end] * random.choice([1, 2, 50]) + content[end:]


def _inserted(content, others, random):
    place = random.randrange(len(content) + 1)
    return content[:place] + random.randbytes(random.choice([1, 4, 32])) + content[place:]


def _spliced(content, others, random):
    other = random.choice(others)
    return content[: random.randrange(len(content) + 1)] + other[random.randrange(len(other) + 1) :]


def _word(content, others, random):
    """Another word for one of the numbers in a text."""
    numbers = list(_NUMBER.finditer(content[:100_000]))
    if not numbers:
        return _flipped(content, others, random)
    found = random.choice(numbers)
    return content[: found.start()] + random.choice(WORDS).encode() + content[found.end() :]


def _line(content, others, random):
    """A line taken out, put elsewhere, or doubled."""
    lines = content.split(b"\n")
    line = lines.pop(random.randrange(len(lines)))
    for _ in range(random.choice([0, 1, 2, 100])):
        lines.insert(random.randrange(len(lines) + 1), line)
    return b"\n".join(lines)


def _json(content, others, random):
    """Another value, or none, in one place of a JSON document."""
    try:
        document = json.loads(content)
    except ValueError:
        return _flipped(content, others, random)
    places = []
    waiting = [document]
    while waiting:
        value = waiting.pop()
        keys = list(value) if isinstance(value, dict) else range(min(len(value), 20))
        places += [(value, key) for key in keys]
        waiting += [value[key] for key in keys if isinstance(value[key], dict | list)]
    if places:
        container, key = random.choice(places)
        if random.random() < 0.25:
            del container[key]
        else:
            container[key] = random.choice([*VALUES, *INTEGERS])
    return json.dumps(document).encode()


def _json_buffer(content, others, random):
    """Damage in the data that a JSON document holds as base64."""
    try:
        document = json.loads(content)
        buffer = random.choice(document["buffers"])
        head, _, data = buffer["uri"].partition(",")
        raw = base64.b64decode(data)
        damaged = random.choice([_flipped, _number, _truncated, _cut])(raw, others, random)
        buffer["uri"] = f"{head},{base64.b64encode(damaged).decode()}"
    except (ValueError, KeyError, IndexError, TypeError, AttributeError):
        return _flipped(content, others, random)
    return json.dumps(document).encode()

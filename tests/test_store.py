"""The store of prepared places on disk."""

import json
import logging
import os
import resource
import subprocess
import sys
import time

import numpy as np
import pytest

from lightdepth import store as module
from lightdepth.errors import InputWarning
from lightdepth.store import Store, default_store

KEY, OTHER = "a1" * 32, "b2" * 32
ARRAYS = {"numbers": np.arange(1000, dtype=np.float32), "none": np.zeros((0, 3), np.int32)}


def same(found, wanted=ARRAYS):
    return found.keys() == wanted.keys() and all(
        found[name].dtype == value.dtype and np.array_equal(found[name], value) for name, value in wanted.items()
    )


def test_arrays_come_back(tmp_path):
    store = Store(tmp_path / "new" / "folder")
    assert store.read(KEY) is None
    store.write(KEY, ARRAYS, "room.exr")
    assert same(store.read(KEY))
    assert store.read(OTHER) is None
    assert [(entry.source, entry.size) for entry in store.entries()] == [
        ("room.exr", (store.folder / f"{KEY}.place").stat().st_size)
    ]


def damaged(contents):
    head, payload = contents.split(b"\n", 1)
    flipped = bytearray(contents)
    flipped[-200] ^= 4
    facts = json.loads(head)
    yield "truncated", contents[:-10]
    yield "header alone", head
    yield "empty", b""
    yield "flipped byte", bytes(flipped)
    yield "no header", b"[]\n" + payload
    yield "wrong version", json.dumps({**facts, "format": module.FORMAT + 1}).encode() + b"\n" + payload
    yield "another key", json.dumps({**facts, "key": OTHER}).encode() + b"\n" + payload


def test_damaged_entries_are_ignored_with_a_warning_and_written_again(tmp_path):
    store = Store(tmp_path)
    store.write(KEY, ARRAYS, "room.exr")
    (entry,) = store.entries()
    for what, contents in damaged(entry.path.read_bytes()):
        entry.path.write_bytes(contents)
        with pytest.warns(InputWarning, match=str(entry.path)) as caught:
            assert store.read(KEY) is None, what
        assert len(caught) == 1
        store.entries()
        store.write(KEY, ARRAYS, "room.exr")
        assert same(store.read(KEY)), what


def test_the_least_recently_used_go_first(tmp_path):
    arrays = {"bytes": np.zeros(10_000, np.uint8)}
    store = Store(tmp_path, limit=35_000)
    keys = [f"{index:064x}" for index in range(4)]
    for age, key in enumerate(keys[:3]):
        store.write(key, arrays, "")
        os.utime(tmp_path / f"{key}.place", (0, time.time() - 1000 + age))
    assert store.read(keys[0]) is not None  # Now the second is the one that was not used for longest.
    store.write(keys[3], arrays, "")
    assert {entry.path.stem for entry in store.entries()} == {keys[0], keys[2], keys[3]}
    store.write(OTHER, {"bytes": np.zeros(40_000, np.uint8)}, "")
    assert store.read(OTHER) is None
    assert len(store.entries()) == 3


def test_what_a_dead_process_left_is_removed_and_what_a_living_one_writes_is_not(tmp_path):
    store = Store(tmp_path)
    for name, age in ((".tmp-dead", 2 * module.ABANDONED), (".tmp-alive", 1.0)):
        (tmp_path / name).write_bytes(b"half")
        os.utime(tmp_path / name, (0, time.time() - age))
    store.write(KEY, ARRAYS, "")
    assert sorted(os.listdir(tmp_path)) == sorted([".tmp-alive", f"{KEY}.place"])
    assert store.clear() == 1
    assert os.listdir(tmp_path) == []


WRITER = """
import sys
import numpy as np
from lightdepth.store import Store
store = Store(__import__("pathlib").Path(sys.argv[1]), limit=300_000)
for turn in range(60):
    key = f"{(turn * 7 + int(sys.argv[2])) % 5:064x}"
    number = int(key, 16)
    found = store.read(key)
    assert found is None or (found["numbers"] == number).all(), key
    store.write(key, {"numbers": np.full(20_000, number, np.float32)}, "")
"""


def test_four_processes_fill_it_at_once(tmp_path):
    command = [sys.executable, "-W", "error", "-c", WRITER, str(tmp_path)]
    writers = [subprocess.Popen([*command, str(number)], stderr=subprocess.PIPE, text=True) for number in range(4)]
    errors = [writer.communicate()[1] for writer in writers]
    # A damaged entry would have been reported on standard error.
    assert [(writer.returncode, error) for writer, error in zip(writers, errors, strict=True)] == [(0, "")] * 4
    store = Store(tmp_path)
    assert 0 < sum(entry.size for entry in store.entries()) <= 300_000
    assert all(name.endswith(".place") for name in os.listdir(tmp_path))
    for entry in store.entries():
        assert (store.read(entry.path.stem)["numbers"] == int(entry.path.stem, 16)).all()


@pytest.mark.parametrize(
    ("environment", "folder"),
    [
        ({"LIGHTDEPTH_CACHE": "/somewhere"}, "/somewhere"),
        ({"LIGHTDEPTH_CACHE": "off", "HOME": "/home/me"}, None),
        ({"XDG_CACHE_HOME": "/xdg", "HOME": "/home/me"}, "/xdg/lightdepth"),
        ({"XDG_CACHE_HOME": "relative", "HOME": "/home/me"}, "/home/me/.cache/lightdepth"),
        ({"HOME": "/home/me"}, "/home/me/.cache/lightdepth"),
        ({"HOME": ""}, None),
        ({}, None),
    ],
)
def test_the_environment_names_the_folder(environment, folder, monkeypatch):
    for name in ("LIGHTDEPTH_CACHE", "XDG_CACHE_HOME", "HOME"):
        monkeypatch.delenv(name, raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    store = default_store()
    assert (None if store is None else str(store.folder)) == folder


def test_other_users_may_read_an_entry(tmp_path):
    Store(tmp_path).write(KEY, ARRAYS, "")
    assert [path.stat().st_mode & 0o777 for path in tmp_path.iterdir()] == [0o644]


def test_a_full_disk_is_warned_of(tmp_path):
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.warns(InputWarning, match=f"{tmp_path}: cannot be written .*'lightdepth cache --clear'"):
            Store(tmp_path).write(KEY, ARRAYS, "")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert list(tmp_path.iterdir()) == []


def test_where_nothing_can_be_written_the_work_goes_on(tmp_path, caplog):
    caplog.set_level(logging.INFO)
    (tmp_path / "file").write_text("")
    for folder in (tmp_path / "file", tmp_path / "file" / "below", "/proc/lightdepth"):
        store = Store(type(tmp_path)(folder))
        caplog.clear()
        store.write(KEY, ARRAYS, "")
        assert "going without a cache" in caplog.text
        assert store.entries() == []
        assert store.clear() == 0
    assert not [record for record in caplog.records if record.levelno > logging.INFO]

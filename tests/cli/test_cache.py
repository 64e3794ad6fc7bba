"""`lightdepth cache` lists and clears what renderings leave in it; `--no-cache` leaves nothing."""

import numpy as np

from lightdepth.store import Store

from .room_folder import make_room


def test_it_lists_and_clears(command, tmp_path, monkeypatch):
    monkeypatch.setenv("LIGHTDEPTH_CACHE", str(tmp_path))
    assert "0 prepared places" in command("cache")[1]
    Store(tmp_path).write("a1" * 32, {"numbers": np.zeros(1 << 20, np.float32)}, "/photographs/[1] room.exr")
    (tmp_path / f"{'b2' * 32}.place").write_bytes(b"torn")
    status, out, err = command("cache")
    assert (status, err) == (0, "")
    assert "4.0 MiB  /photographs/[1] room.exr" in out
    assert "0.0 MiB  damaged" in out
    assert "2 prepared places, 4.0 of at most 1024 MiB" in out
    assert str(tmp_path) in out
    assert "removed 2 prepared places" in command("cache", "--clear")[1]
    assert list(tmp_path.iterdir()) == []


def test_it_may_be_off(command, monkeypatch):
    monkeypatch.setenv("LIGHTDEPTH_CACHE", "off")
    status, out, _ = command("cache")
    assert status == 0
    assert "no cache" in out


def test_rendering_fills_it_unless_it_goes_without(command, tmp_path, monkeypatch):
    scene, folder = make_room(tmp_path), tmp_path / "cache"
    monkeypatch.setenv("LIGHTDEPTH_CACHE", str(folder))
    arguments = ("render", scene, "-o", tmp_path / "picture.exr", "--draft", "--progress", "none")
    assert command(*arguments, "--no-cache")[0] == 0
    assert not folder.exists()
    assert command(*arguments)[0] == 0
    assert [entry.source for entry in Store(folder).entries()] == [str(tmp_path / "room.exr")]
    first = (tmp_path / "picture.exr").read_bytes()
    assert command(*arguments)[0] == 0
    assert (tmp_path / "picture.exr").read_bytes() == first

"""What Blender's own path tracer shows and what is exported must agree."""

import tomllib

import numpy as np
import pytest
from pydantic import TypeAdapter

from lightdepth.cameras import CameraSettings
from lightdepth.directions import euler_rotation


def test_the_panorama_appears_where_it_was_taken(blender, tmp_path):
    worst = blender.run("projection", tmp_path)["worst"]
    for name in ("world", "room", "furniture", "rest", "cleared"):
        assert worst[name] < 1e-4, name
    assert worst["deformed"] > 0.1  # a wall that was moved takes its colour along


def test_cameras_see_what_blenders_see(blender, tmp_path):
    from lightdepth.kernel.start import start

    start()
    import mitsuba as mi

    for case in blender.run("camera_directions", tmp_path)["cases"]:
        table = tomllib.loads((tmp_path / f"{case}.toml").read_text())["camera"]["Camera"]
        camera = TypeAdapter(CameraSettings).validate_python(table)
        width, height = camera.resolution
        x, y = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
        film = mi.Point2f(x.ravel().astype(np.float32), y.ravel().astype(np.float32))
        _, directions, inside = camera.camera_rays(film, mi.Point2f(0.5))
        expected = (euler_rotation(table["rotation"]) @ np.array(directions)).T.reshape(height, width, 3)
        seen = np.load(tmp_path / f"{case}.npy")
        looked = np.abs(np.linalg.norm(seen, axis=-1) - 1.0) < 0.01  # Cycles leaves the rest of a fisheye black
        looked &= np.broadcast_to(np.array(inside), width * height).reshape(height, width)
        assert looked.mean() > 0.5, case
        angle = np.degrees(np.arccos(np.clip((expected * seen).sum(-1) / np.linalg.norm(seen, axis=-1), -1, 1)))
        assert angle[looked].max() < 0.1, case


def _irradiance(table: dict) -> np.ndarray:
    """Irradiance at the origin, facing up, of an emitter above it, shape (3,)."""
    if table["material"]["type"] != "emitter":
        return np.zeros(3)
    radiance = np.array(table["material"]["radiance"])
    if table["shape"] == "sphere":
        return radiance * np.pi * (table["radius"] / table["center"][2]) ** 2
    across, along = table["scale"][:2]
    height = table["position"][2]
    steps = (np.arange(400) + 0.5) / 200 - 1.0
    x, y = np.meshgrid(steps, steps)
    shape = x**2 + y**2 <= 1.0 if table["shape"] == "disk" else np.ones_like(x, dtype=bool)
    kernel = height**2 / ((x * across) ** 2 + (y * along) ** 2 + height**2) ** 2
    return radiance * kernel[shape].sum() * 4.0 * across * along / x.size


def test_lamps_keep_their_power(blender, tmp_path):
    lamps = blender.run("lamps", tmp_path)["lamps"]
    assert len(lamps) >= 7
    for name, lamp in lamps.items():
        expected = sum(_irradiance(table) for table in lamp["tables"])
        assert expected == pytest.approx(lamp["measured"], rel=5e-3), name
    assert any("blend" in note for note in lamps["spot, watts"]["notes"])

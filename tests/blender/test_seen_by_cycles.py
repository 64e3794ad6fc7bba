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

    found = blender.run("camera_directions", tmp_path)
    for case in found["cases"]:
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

    heading = np.degrees(0.5)
    # A panorama's pose is that of the photograph by default; the panorama of the test is 64 x 32.
    expected = {
        "PANORAMA": {"type": "equirectangular", "width": 64},
        "DOME": {"type": "fisheye", "width": 32, "fov": 180.0, "mapping": "equidistant"},
        "PERSPECTIVE": {"type": "perspective", "width": 1920, "height": 1080},
    }
    rotations = {"DOME": [90.0, 0.0, heading], "PERSPECTIVE": [0.0, 0.0, heading]}
    for kind, name in found["added"].items():
        table = tomllib.loads((tmp_path / f"{kind}.toml").read_text())["camera"][name]
        assert table | expected[kind] == table, kind
        assert ("position" in table) == (kind != "PANORAMA")
        if kind in rotations:
            assert table["position"] == pytest.approx([0.5, 0.25, 1.5])
            assert table["rotation"] == pytest.approx(rotations[kind], abs=1e-3)


def test_focus_is_where_blender_has_it(blender, tmp_path):
    found = blender.run("focus", tmp_path)
    assert len(found["cases"]) == 6
    for case, measured in found["cases"].items():
        table = tomllib.loads((tmp_path / f"{case}.toml").read_text())["camera"]["Camera"]
        assert table["focus_distance"] == pytest.approx(measured["depth"], rel=1e-5), case
        # A thin lens spreads a point 2 m away evenly over a disk, whose mean squared radius is half that of its edge.
        pixels = table["width"] / 2.0 / np.tan(np.radians(table["fov"]) / 2.0)
        edge = table["aperture"] * pixels * abs(1.0 / 2.0 - 1.0 / table["focus_distance"])
        assert measured["spread"] - found["sharp"] == pytest.approx(edge**2 / 2.0, rel=0.05), case


def _irradiance(table: dict) -> np.ndarray:
    """Irradiance at the origin, facing up, of an emitter above it, shape (3,)."""
    if "emission" not in table["material"]:
        return np.zeros(3)
    radiance = np.array(table["material"]["emission"])
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
        expected = sum((_irradiance(table) for table in lamp["tables"]), np.zeros(3))
        assert expected == pytest.approx(lamp["measured"], rel=5e-3), name
    assert any("tube" in note for note in lamps["spot, watts"]["notes"])
    assert lamps["portal"]["tables"] == []

"""Modelling, roles, and what a .blend file keeps."""

import pytest


def test_the_place_is_modelled_kept_and_undone(blender, tmp_path):
    found = blender.run("place", tmp_path)
    assert "edges cross" in found["crossing"]
    assert "three or more" in found["two corners"]
    assert "one line" in found["line"]
    assert "missing.exr" in found["no image"]
    assert "8 x 8" in found["square"]
    assert "twice as wide" in found["square"]

    assert sorted(z for _, _, z in found["top"]) == pytest.approx([0.7] * 4)
    assert found["box faces"] == 4  # four sides: the top is a surface of its own, and there is no bottom
    roles = {"Walls": "ENVIRONMENT", "Floor": "SUPPORT", "Box": "ENVIRONMENT", "Box top": "SUPPORT"}
    assert found["roles"] == roles | {"Cube": "SUPPORT", "Cube.001": "SUPPORT"}
    assert found["colours"]["Floor"] == found["colours"]["Cube"] != found["colours"]["Walls"]
    assert found["projected"] == [["lightdepth projection"]] * 2
    assert found["not projected"] == [["Red"], [""]]
    assert found["holes"] == 0
    assert found["holes without walls"] > 1000
    assert found["patches"] == [found["holes without walls"], True]

    kept = found["kept"]
    assert kept["roles"] == roles | {"Cube": "SYNTHETIC", "Cube.001": "SYNTHETIC", "Holes": "SYNTHETIC"}
    assert kept["corners"] == [pytest.approx(c) for c in ([0.1, 0.7], [0.2, 0.7], [0.2, 0.8], [0.1, 0.8])]
    assert {
        name: kept[name] for name in ("image", "capture", "samples", "method", "gloss", "rest", "engine", "world")
    } == {
        "image": "panorama.exr",
        "capture": "Capture point",
        "samples": 7,
        "method": "envpath",
        "gloss": True,
        "rest": True,
        "engine": "LIGHTDEPTH",
        "world": "lightdepth panorama",
    }
    assert kept["noise"] == pytest.approx(0.25)
    assert found["driven"] == pytest.approx([0.25])
    before = found["undone"][0] - 2
    assert found["undone"] == [before + 2, before + 1, before, before + 1, before + 2]
    assert "it was deleted" in found["capture point deleted"]
    assert found["capture point again"]

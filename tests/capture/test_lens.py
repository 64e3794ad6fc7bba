import shutil
import subprocess

import numpy as np
import pytest
from PIL import Image

from lightdepth.capture.lens import PROJECTIONS, Lens, horizontal_fov
from lightdepth.capture.project import read_project
from lightdepth.capture.rig import parse_rig
from lightdepth.directions import direction_to_latlong
from lightdepth.errors import InputError


@pytest.mark.parametrize(
    ("projection", "fov"), [("rectilinear", 80), ("fisheye", 185), ("equisolid", 170), ("stereographic", 150)]
)
def test_lens_and_pose_mean_what_hugin_means(projection, fov, tmp_path):
    if shutil.which("pano_trafo") is None:
        pytest.skip("Hugin's command-line tools are not installed (Debian: hugin-tools)")
    Image.new("RGB", (400, 300)).save(tmp_path / "a.png")

    def run(*arguments, **options):
        return subprocess.run(arguments, cwd=tmp_path, check=True, capture_output=True, text=True, **options).stdout

    run("pto_gen", "-p", str(PROJECTIONS[projection]), "-f", str(fov), "-o", "a.pto", "a.png")
    run("pto_var", "--set", "y0=20,p0=30,r0=40,a0=0.01,b0=-0.02,c0=0.015,d0=3,e0=-5", "-o", "b.pto", "a.pto")
    pixels = np.random.default_rng(0).uniform(40, 260, (8, 2))
    said = run("pano_trafo", "b.pto", "0", input="".join(f"{x} {y}\n" for x, y in pixels))
    expected = np.array([[float(number) for number in line.split()] for line in said.splitlines()])
    header = next(line for line in (tmp_path / "b.pto").read_text().splitlines() if line.startswith("p "))
    width, height = (int(next(part[1:] for part in header.split() if part[0] == key)) for key in "wh")
    lens = read_project(tmp_path / "b.pto")[0][0]
    # Hugin counts from the centre of the first pixel.
    direction = lens.unproject(*(pixels.T + 0.5))
    u, v = direction_to_latlong(direction)
    np.testing.assert_allclose(np.stack([u * width, v * height], axis=1) - 0.5, expected, atol=1e-4)
    np.testing.assert_allclose(np.stack(lens.project(direction), axis=1), pixels + 0.5, atol=1e-6)


def test_field_of_view_from_exif():
    assert horizontal_fov(50, 3600, 2400) == pytest.approx(2 * np.degrees(np.arctan(18 / 50)))


def test_rigs():
    assert [pose[:2] for pose in parse_rig("paper", 7)] == [
        (0, 0), (72, 0), (144, 0), (216, 0), (288, 0), (0, 90), (0, -90),
    ]  # fmt: skip
    assert parse_rig("0,0 120,10,5", 2) == [(0, 0, 0), (120, 10, 5)]
    assert len(parse_rig(" ".join(["123.456,-12.345"] * 40), 40)) == 40  # Longer than a file's name may be.
    for text, count in (("paper", 6), ("0,0 x", 2), ("0 1", 2)):
        with pytest.raises(InputError, match="--rig"):
            parse_rig(text, count)


@pytest.mark.parametrize("pose", [(20, 30, 40), (-170, -60, 175), (100, 90, 0), (100, -90, 0), (0, 0, 0)])
def test_poses_come_back_from_their_rotations(pose):
    lens = Lens(100, 80, "fisheye", 180.0, yaw=pose[0], pitch=pose[1], roll=pose[2])
    back = Lens(100, 80, "fisheye", 180.0).with_rotation(lens.rotation)
    assert (back.yaw, back.pitch, back.roll) == pytest.approx(pose, abs=1e-6)
    tilted = Lens(100, 80, "fisheye", 180.0, yaw=10, pitch=90, roll=25)
    np.testing.assert_allclose(lens.with_rotation(tilted.rotation).rotation, tilted.rotation, atol=1e-9)

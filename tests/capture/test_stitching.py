"""The whole way from photographs of a known panorama to that panorama, and real photographs."""

import json
import shutil
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from lightdepth.capture import hugin
from lightdepth.capture.lens import Lens
from lightdepth.capture.panorama import Panorama
from lightdepth.capture.photometry import Photometry
from lightdepth.capture.project import ControlPoint
from lightdepth.capture.report import warnings_of
from lightdepth.capture.rig import PRESETS
from lightdepth.capture.shoot import MergeOptions, Shoot, read_shoot
from lightdepth.capture.stitching import Orientation, Stitched, groups_of, turned_to_the_rig
from lightdepth.cli.app import app
from lightdepth.directions import pixel_directions
from lightdepth.errors import InputError, SetupError
from lightdepth.images.beauty import read_beauty
from lightdepth.images.exr import read_exr
from lightdepth.images.radiance import read_radiance, write_radiance
from lightdepth.parameters import CaptureParameters
from tests.support.photography import PAPER_RIG, TestCamera, look_up, rig_rotation, room_panorama, shoot

needs_hugin = pytest.mark.skipif(
    any(shutil.which(tool) is None for tool in hugin.ALIGNMENT_TOOLS),
    reason="Hugin's command-line tools are not installed (Debian: hugin-tools)",
)
needs_enblend = pytest.mark.skipif(
    shutil.which("nona") is None or shutil.which("enblend") is None,
    reason="nona or enblend is not installed (Debian: hugin-tools, enblend)",
)


def run(*arguments):
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


def rotations(seed=1, degrees=1.5):
    """The paper's rig, set by hand: every angle is off by a degree or two."""
    rng = np.random.default_rng(seed)
    return [
        rig_rotation(yaw + rng.normal(0, degrees), pitch + rng.normal(0, degrees), rng.normal(0, degrees))
        for yaw, pitch in PAPER_RIG
    ]


def pose_errors(report, truth):
    """Angles in degrees between true and found orientations of the images, after the best common rotation."""
    found = [rig_rotation(image["yaw"], image["pitch"], image["roll"]) for image in report["images"]]
    u, _, vt = np.linalg.svd(sum(true @ own.T for true, own in zip(truth, found, strict=True)))
    common = u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt
    cosines = [(np.trace(true.T @ common @ own) - 1) / 2 for true, own in zip(truth, found, strict=True)]
    return common, np.degrees(np.arccos(np.clip(cosines, -1, 1)))


def radiance_error(panorama, place, common, floor):
    """Logarithm of measured over true radiance, one scale for each channel free, and the true luminance."""
    truth = look_up(place, pixel_directions(*panorama.shape[:2]) @ common.T)
    where = truth.min(axis=2) > floor
    error = np.log(np.maximum(panorama[where], 1e-9) / truth[where])
    return error - np.median(error, axis=0), truth[where].mean(axis=1)


def check_truth(folder, place, size, times, floor, bands):
    truth = rotations()
    photographs = folder / "shoot"
    photographs.mkdir()
    shoot(place, truth, times, photographs, TestCamera(size=(size, size), distortion=0.01))
    left_before = set(Path(tempfile.gettempdir()).glob("lightdepth-stitch-*"))
    result = run(
        "capture", "stitch", photographs, "-o", folder / "out.exr", "--circle", "auto", "--rig", "paper",
        "--fov", "180", "--report", folder / "out.json", "--save-response", folder / "camera.json",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    report = json.loads((folder / "out.json").read_text())
    common, angles = pose_errors(report, truth)
    panorama = read_radiance(folder / "out.exr")
    error, luminance = radiance_error(panorama, place, common, floor)
    median = {low: float(np.median(np.abs(error[(luminance > low) & (luminance < 10 * low)]))) for low in bands}
    print(
        f"orientations within {angles.max():.3f} degrees, radiance {np.median(np.abs(error)):.2%}, by decade {median}"
    )
    assert angles.max() < 0.3
    assert report["control_points"]["median_error_degrees"] < 0.3
    assert max(median.values()) < 0.05
    assert report["coverage"]["share"] == pytest.approx(1.0, abs=1e-4)
    assert report["lens"]["fov"] == pytest.approx(185, abs=3)
    assert report["exposure"]["disagreement"] < 0.03 < report["exposure"]["disagreement_before"]
    assert (folder / "out.png").is_file()
    assert (folder / "camera.json").is_file()
    assert read_exr(folder / "out.exr")[0].channels["A"].min() == 1
    assert set(Path(tempfile.gettempdir()).glob("lightdepth-stitch-*")) <= left_before


@needs_hugin
def test_brackets_of_seven_orientations_become_the_panorama(tmp_path):
    """Small and with five exposures of three stops, so that it is fast; the next test is the full one."""
    check_truth(tmp_path, room_panorama(256), 320, [64 * 8.0 ** (2 - k) for k in range(5)], 3e-3, [1e-2, 1e-1])


@needs_hugin
@pytest.mark.truth
@pytest.mark.parametrize("name", ["made-up", "interior_hotelroom_1k.exr", "lebombo_1k.hdr", "comfy_cafe_1k.hdr"])
def test_seven_orientations_of_nine_exposures(tmp_path, name, request):
    """The paper's rig in full: radiance within 5 per cent over four decades, direction within 0.3 degrees."""
    if name == "made-up":
        place, bands = room_panorama(512), [1e-3, 1e-2, 1e-1, 1e1, 1e2]
    else:
        place = read_radiance(request.getfixturevalue("shared_data") / "hdr" / name)
        # So that the longest exposure shows the darkest percentile.
        place = (place * (2e-3 / np.percentile(place.mean(axis=2), 1))).astype(np.float32)
        # Decades that hold some part of the place: single dark pixels beside lamps are no more resolved than there.
        luminance = place.mean(axis=2) * (place.min(axis=2) > 2e-3)
        decades = (1e-3, 1e-2, 1e-1, 1e0, 1e1, 1e2)
        bands = [low for low in decades if ((luminance > low) & (luminance < 10 * low)).mean() > 2e-3]
    check_truth(tmp_path, place, 640, [64 * 4.0 ** (3 - k) for k in range(9)], 2e-3, bands)


@needs_hugin
@needs_enblend
@pytest.mark.truth
def test_own_remapping_is_closer_to_the_truth_than_nona_and_enblend(tmp_path):
    place, truth = room_panorama(256), rotations()
    (tmp_path / "shoot").mkdir()
    shoot(place, truth, [64 * 4.0 ** (3 - k) for k in range(9)], tmp_path / "shoot", TestCamera(size=(320, 320)))
    errors = {}
    for blender in ("feather", "enblend"):
        run(
            "capture", "stitch", tmp_path / "shoot", "-o", tmp_path / "out.exr", "--circle", "auto", "--rig", "paper",
            "--blend", blender, "--report", tmp_path / "out.json",
        )  # fmt: skip
        common, _ = pose_errors(json.loads((tmp_path / "out.json").read_text()), truth)
        error, _ = radiance_error(read_radiance(tmp_path / "out.exr"), place, common, 2e-3)
        errors[blender] = float(np.median(np.abs(error)))
    print(errors)
    assert errors["feather"] < errors["enblend"] < 0.1


@needs_hugin
@pytest.mark.truth
def test_real_hand_held_photographs(shared_data, tmp_path):
    result = run(
        "capture", "stitch", shared_data / "stitch/durlach_saumarkt", "-o", tmp_path / "square.exr", "--width", "1024",
        "--report", tmp_path / "square.json",
    )  # fmt: skip
    assert result.exit_code == 0
    report = json.loads((tmp_path / "square.json").read_text())
    assert len(report["images"]) == 25
    # Taken without a tripod: parallax leaves a third of a degree.
    assert report["control_points"]["median_error_degrees"] < 0.5
    # The lowest photographs look 19 to 24 degrees down and see 27 degrees further: the cap below is missing. The one
    # towards the zenith looks 17 degrees past it, so that a part of the cap above the other photographs is missing.
    coverage, sides = report["coverage"], np.tan(np.radians(report["lens"]["fov"] / 2))
    pitch = np.sort([image["pitch"] for image in report["images"]])
    reach = np.degrees(np.arctan(sides * 3 / 4))
    cap_below = 0.5 * (1 - np.sin(np.radians(reach - np.median(pitch[:7]))))
    cap_above = 0.5 * (1 - np.sin(np.radians(reach + np.median(pitch[-9:-1]))))
    assert coverage["uncovered_below"] == pytest.approx(cap_below, rel=0.2)
    assert 0 < coverage["uncovered_above"] < cap_above
    assert coverage["share"] == pytest.approx(1 - coverage["uncovered_below"] - coverage["uncovered_above"], abs=1e-6)
    assert report["exposure"]["disagreement"] < 0.08 < report["exposure"]["disagreement_before"]
    assert (read_radiance(tmp_path / "square.exr") > 0).all()


def blank_views(folder, level=0.9):
    for index in range(8):
        write_radiance(folder / f"v{index}.exr", np.full((96, 96, 3), level, np.float32))
    return sorted(folder.glob("v*.exr"))


@needs_hugin
def test_blank_views_are_placed_by_the_rig(tmp_path):
    views = blank_views(tmp_path)
    write_radiance(views[3], np.zeros((96, 96, 3), np.float32))  # One is black all over.
    result = run(
        "capture", "stitch", *views, "-o", tmp_path / "x.exr", "--rig", "six+zenith+nadir", "--fov", 91,
        "--report", tmp_path / "x.json", "--no-gains",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    report = json.loads((tmp_path / "x.json").read_text())
    assert [(image["yaw"], image["pitch"]) for image in report["images"][:6]] == [(60.0 * i, 0.0) for i in range(6)]
    assert [image["pitch"] for image in report["images"][6:]] == [90.0, -90.0]
    assert report["warnings"] == [
        "no control points were found: every image keeps the rig's pose, and the lens is as stated"
    ]
    panorama = read_radiance(tmp_path / "x.exr")
    np.testing.assert_allclose(panorama[:20], 0.9, rtol=1e-3)
    np.testing.assert_allclose(panorama[70:90, 150:170], 0.9, rtol=1e-3)  # Ahead.
    assert panorama[80, :2].max() < 0.01  # Behind, at 180 degrees.
    # Without a terminal, progress is written as lines.
    lines = result.stderr.splitlines()
    assert "control points: 36 of 36" in lines or any(line.startswith("control points: 8 of 36") for line in lines)
    assert len(lines) < 60


def test_images_that_nothing_connects_with_the_first_are_turned_to_the_rig():
    """The first image is blank, so that the optimiser may turn the others together as it likes."""
    rig = PRESETS["paper"]
    stated = [Lens(100, 100, "fisheye", 180.0, yaw=yaw, pitch=pitch, roll=roll) for yaw, pitch, roll in rig]
    off = rig_rotation(-106.0, 12.0, 30.0)
    found = [stated[0], *(lens.with_rotation(off @ lens.rotation) for lens in stated[1:])]
    found[3] = replace(found[3], yaw=found[3].yaw + 1.0)  # One was not set exactly.
    points = [ControlPoint((first, first + 1), (50.0, 50.0), (50.0, 50.0)) for first in range(1, 6)]
    turned = turned_to_the_rig(found, groups_of(7, points), rig)
    assert turned[0] is found[0]
    for lens, own, expected in zip(turned[1:], found[1:], stated[1:], strict=True):
        angle = np.arccos(np.clip((np.trace(lens.rotation.T @ expected.rotation) - 1) / 2, -1, 1))
        assert np.degrees(angle) < 1.0
        between = turned[1].rotation.T @ lens.rotation  # Among each other they stay as they are.
        np.testing.assert_allclose(between, found[1].rotation.T @ own.rotation, atol=1e-9)


@needs_hugin
def test_views_that_nothing_connects_are_refused_without_a_rig(tmp_path):
    with pytest.raises(InputError, match=r"no control points were found between any two .* --rig"):
        run("capture", "stitch", *blank_views(tmp_path), "-o", tmp_path / "x.exr", "--fov", 91)
    assert not (tmp_path / "x.exr").exists()


def test_views_that_show_nothing_are_refused(tmp_path):
    def stitch_all(pixels, names="abcd"):
        for name in names:
            write_radiance(tmp_path / f"{name}.exr", pixels.astype(np.float32))
        files = [tmp_path / f"{name}.exr" for name in "abcd"]
        run("capture", "stitch", *files, "-o", tmp_path / "out.exr", "--rig", "four", "--fov", "90")

    for pixels in (np.zeros((32, 32, 3)), np.full((32, 32, 3), 1e30)):
        with pytest.raises(InputError, match="a.exr and all others: show no light"):
            stitch_all(pixels)
    with pytest.raises(InputError, match="a.exr: is 3 x 2 pixels; at least 16 each way"):
        stitch_all(np.ones((2, 3, 3)))
    shoot = read_shoot([tmp_path / "a.exr"], MergeOptions())
    assert shoot.warnings == []
    write_radiance(tmp_path / "a.exr", np.full((8, 8, 3), -1.0, np.float32))
    (orientation,) = (shoot := read_shoot([tmp_path / "a.exr"], MergeOptions())).orientations
    assert shoot.warnings == ["a.exr: 64 pixels are negative, which light cannot be; they are black here"]
    assert (orientation.radiance == 0.0).all()


@pytest.mark.parametrize(("off", "warned"), [(0.5, False), (7.0, True)])
def test_a_wrong_control_point_is_warned_of(off, warned):
    lenses = [Lens(100, 100, "rectilinear", 90.0, yaw=yaw) for yaw in (0.0, 40.0)]
    points = []
    for pitch, error in ((0.0, 0.0), (5.0, off)):
        pixels = []
        for lens, pitched in zip(lenses, (pitch, pitch + error), strict=True):
            yaw, up = np.radians(20.0), np.radians(pitched)
            direction = [np.sin(yaw) * np.cos(up), np.cos(yaw) * np.cos(up), np.sin(up)]
            pixels.append(tuple(float(axis) for axis in lens.project(direction)))
        points.append(ControlPoint((0, 1), *pixels))
    image = np.ones((100, 100, 3), np.float32)
    seen = np.ones((100, 100), bool)
    shot = Shoot([Orientation(name, image, seen, seen) for name in ("a.exr", "b.exr")], None, "", [["a"], ["b"]])
    photometry = Photometry((0.0, 0.0, 0.0), np.ones((2, 3)), 0.0, 0.0)
    stitched = Stitched(Panorama(image, seen), lenses, points, 2, photometry, [])
    warnings = warnings_of(shot, stitched)
    assert len(warnings) == warned
    assert warnings_of(shot, stitched, CaptureParameters(wrong_point=8.0)) == []
    if warned:
        assert warnings[0].startswith("a.exr, b.exr: a control point is off by 7.0 degrees (1 of 2 by more than 2)")


def test_missing_tool_is_named_with_how_to_install_it(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(SetupError, match=r"cpfind.*apt-get install hugin-tools"):
        hugin.run("cpfind", folder=tmp_path)
    with pytest.raises(SetupError, match="apt-get install enblend"):
        hugin.require(["enblend"])


@needs_hugin
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nowhere", "-o", "x.exr"], "no such file or folder"),
        (["a.jpg", "-o", "x.png"], "must end in .exr"),
        (["a.jpg", "-o", "x.exr", "--width", "101"], "must be even"),
        (["a.jpg", "b.jpg", "-o", "x.exr", "--fov", "60", "--rig", "paper"], "has 7 orientations, but 2"),
        (["a.jpg", "b.jpg", "-o", "x.exr"], "state it as --fov"),
        (["a.jpg", "notes.txt", "-o", "x.exr"], "notes.txt: allowed are photographs"),
    ],
)
def test_wrong_input_is_explained_and_nothing_written(arguments, message, monkeypatch, tmp_path):
    from tests.support.photography import write_photograph

    monkeypatch.chdir(tmp_path)
    for index, name in enumerate(("a.jpg", "b.jpg")):
        write_photograph(tmp_path / name, np.full((32, 32, 3), 99, np.uint8), 1.0, index)
    (tmp_path / "notes.txt").write_text("")
    with pytest.raises(InputError) as error:
        run("capture", "stitch", *arguments)
    assert message in str(error.value)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.jpg", "b.jpg", "notes.txt"]


def test_merge_writes_linear_radiance_picture_response_and_report(bracket, tmp_path):
    result = run(
        "capture", "merge", *[path for path, _ in bracket.pairs], "-o", tmp_path / "view.exr", "--circle", "auto",
        "--save-response", tmp_path / "camera.json", "--report", tmp_path / "view.json",
    )  # fmt: skip
    assert result.exit_code == 0
    assert "clipped in every exposure" in result.output
    report = json.loads((tmp_path / "view.json").read_text())
    assert report["exposure_range_stops"] == pytest.approx(16)
    assert report["orders_of_magnitude"] > 4
    radiance = read_beauty(tmp_path / "view.exr").radiance
    assert (tmp_path / "view.png").is_file()
    # The response of one orientation serves for another.
    run(
        "capture", "merge", *[path for path, _ in bracket.pairs], "-o", tmp_path / "again.exr", "--circle", "auto",
        "--response", tmp_path / "camera.json",
    )  # fmt: skip
    np.testing.assert_allclose(read_beauty(tmp_path / "again.exr").radiance, radiance, rtol=1e-4)


@pytest.mark.parametrize("command", ["merge", "stitch"])
def test_help_has_an_example(command):
    result = run("capture", command, "--help")
    assert "Example: lightdepth capture" in " ".join(result.output.split())

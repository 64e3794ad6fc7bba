"""The whole way of a production, by its commands: photographs, panorama, pose, meshes, object, picture, and the truth.

A virtual room is path-traced as a camera in it would see it, photographed in brackets, merged (and stitched),
calibrated from clicked corners, reconstructed by clicking its layout; objects are inserted, and the picture is compared
with the room path-traced with these objects in it. Then each step is replaced by what it should have found, which tells
what it costs.
"""

from __future__ import annotations

import json
import shutil
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from bench.truth import Estimate
from typer.testing import CliRunner

import lightdepth
from lightdepth.capture import hugin
from lightdepth.cli.app import app
from lightdepth.directions import euler_rotation
from lightdepth.film.frame import Frame
from lightdepth.images.radiance import read_radiance, write_radiance
from lightdepth.scene.model import RealSurface, Scene
from tests.support import textured_room as room
from tests.support.photography import PAPER_RIG, TestCamera, photograph, rig_rotation, shoot, write_photograph

TIMES = [64 * 4.0 ** (3 - index) for index in range(9)]
"""Nine exposures two stops apart, as in the paper; seconds."""
SHADOWED = -0.1
"""Relative change from which a pixel counts as shadow."""
SCENE = """\
[panorama]
image = "{image}"

[[synthetic]]
name = "clay ball"
shape = "sphere"
center = [0.35, 1.45, 0.3]
radius = 0.3
material = {{ type = "diffuse", color = [0.65, 0.3, 0.2] }}

[[synthetic]]
name = "metal block"
shape = "cube"
position = [1.15, 1.2, 0.251]
rotation = [0.0, 0.0, 30.0]
scale = [0.2, 0.2, 0.25]
material = {{ type = "principled", base_color = [0.9, 0.8, 0.6], metallic = 1.0, roughness = 0.4 }}

[camera.view]
type = "perspective"
width = {width}
height = {height}
fov = 58
position = [0.7, -0.9, 1.35]
look_at = [0.75, 1.3, 0.3]
"""


@dataclass(frozen=True)
class Comparison:
    """What a picture is compared with, and where.

    Attributes:
        full: the room with the objects, path-traced.
        empty: the room without them.
        shadow: pixels in the objects' shadow, shape (height, width).
        objects: pixels that the objects cover in full.
    """

    full: Estimate
    empty: Estimate
    shadow: np.ndarray
    objects: np.ndarray


@dataclass(frozen=True)
class Errors:
    """Relative errors of a picture.

    Attributes:
        objects: mean radiance of the objects, signed.
        shadow: mean radiance in the shadow, signed.
        darkening: what the shadow takes away, signed.
        objects_spread: root mean square over the objects' pixels, without the noise of sampling.
        shadow_spread: the same in the shadow.
    """

    objects: float
    shadow: float
    darkening: float
    objects_spread: float
    shadow_spread: float

    def __str__(self) -> str:
        return (
            f"objects {self.objects:+.1%} (pixels {self.objects_spread:.1%}), shadow {self.shadow:+.1%} "
            f"(pixels {self.shadow_spread:.1%}), darkening {self.darkening:+.1%}"
        )


def run(*arguments: object) -> str:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.output


def begin_scene(folder: Path, image: Path, width: int, **settings: int) -> Path:
    path = folder / "scene.toml"
    render = "".join(f"{name} = {value}\n" for name, value in settings.items())
    path.write_text(SCENE.format(image=image, width=width, height=width * 3 // 4) + f"\n[render]\n{render}")
    return path


def calibrated(scene: Path, image: Path, width: int, light_to_world: np.ndarray | None = None) -> None:
    """Click the rug and the room's four upright edges."""
    edges = [
        ("--vertical", room.clicks(np.array([[x, y, 0.0], [x, y, room.HIGH[2]]]), width, light_to_world))
        for x, y, _ in room.FLOOR
    ]
    size = ("--width", room.RUG[1, 0], "--length", room.RUG[2, 1])
    run(
        "calibrate", image, "--rectangle", room.clicks(room.RUG, width, light_to_world), *size,
        *(word for edge in edges for word in edge), "--write", scene,
    )  # fmt: skip


def reconstructed(scene: Path, width: int, light_to_world: np.ndarray | None = None) -> None:
    """Click the floor's corners and one of the ceiling's."""
    run(
        "reconstruct", "layout", scene, "--floor", room.clicks(room.FLOOR, width, light_to_world),
        "--ceiling-corner", room.clicks(room.CEILING_CORNER, width, light_to_world),
        "-o", scene.parent / "meshes", "--write", scene,
    )  # fmt: skip


def with_true_pose(scene: Path) -> None:
    text = scene.read_text()
    pose = f"position = {room.CAPTURE.tolist()}\nrotation = {room.ROTATION.tolist()}\n"
    scene.write_text(text.replace("[panorama]\n", "[panorama]\n" + pose, 1))


def rendered(scene: Scene, samples: int, seed: int = 5) -> Frame:
    return lightdepth.render(scene, "view", samples, seed=seed)


def exact(scene: Scene, panorama: np.ndarray, real: tuple[RealSurface, ...]) -> Scene:
    """The scene as it would be if all had been measured exactly."""
    photo = replace(
        scene.panorama,
        radiance=panorama,
        position=room.CAPTURE,
        rotation=euler_rotation(room.ROTATION),
    )
    return replace(scene, panorama=photo, real=real)


def compare(scene: Scene, truth: Comparison, samples: int) -> Errors:
    """Render, and compare after giving each channel the scale that the empty place has.

    Photographs know radiance up to a factor a channel (exposure, white balance); a person sets it by a grey card.
    """
    frame = rendered(scene, samples)
    gain = truth.empty.mean.mean(axis=(0, 1)) / frame.plate.mean(axis=(0, 1))
    image, change = frame.beauty * gain, frame.change * gain
    assert frame.variance is not None
    noise = frame.variance * gain**2 + truth.full.variance
    error = image - truth.full.mean

    def signed(where: np.ndarray) -> float:
        return float(error[where].sum() / truth.full.mean[where].sum())

    def spread(where: np.ndarray) -> float:
        square = (error[where] ** 2 - noise[where]).mean()
        return float(np.sqrt(max(square, 0.0)) / truth.full.mean[where].mean())

    true_change = (truth.full.mean - truth.empty.mean)[truth.shadow].sum()
    return Errors(
        signed(truth.objects),
        signed(truth.shadow),
        float(change[truth.shadow].sum() / true_change - 1.0),
        spread(truth.objects),
        spread(truth.shadow),
    )


def path_traced(scene: Scene, samples: int) -> Comparison:
    """The truth, and where the objects and their shadow are by a rendering whose noise is not that of the compared ones."""
    view = scene.cameras["view"]
    full = room.trace(view, samples, scene.synthetic, seed=1)
    empty = room.trace(view, samples, seed=3)
    frame = rendered(scene, 32, seed=6)
    relative = frame.change.mean(axis=-1) / frame.plate.mean(axis=-1)
    return Comparison(full, empty, (frame.coverage == 0) & (relative < SHADOWED), full.coverage == 1)


def bracketed(panorama: np.ndarray, folder: Path) -> list[Path]:
    """Exposures of a 360 degree camera, which gives equirectangular pictures by itself."""
    camera, rng = TestCamera(), np.random.default_rng(4)
    folder.mkdir()
    files = []
    for number, time in enumerate(TIMES):
        files.append(folder / f"R{number:04d}.JPG")
        write_photograph(files[-1], photograph(panorama, time / 64, camera, rng), time, number)
    return files


def test_brackets_of_a_360_degree_camera_become_a_picture_with_objects(tmp_path, capsys):
    width = 512
    panorama = room.trace(room.panorama_view(width), 32, seed=2).mean.astype(np.float32)
    image = tmp_path / "room.exr"
    run("capture", "merge", *bracketed(panorama, tmp_path / "photos"), "-o", image)
    scene = begin_scene(tmp_path, image, 96, irradiance_samples=128)
    calibrated(scene, image, width)
    reconstructed(scene, width)
    run("check", scene)

    made = lightdepth.load_scene(scene)
    known = exact(made, panorama, room.true_surfaces(["floor", "rug"]))
    truth = path_traced(known, 128)
    alone, whole = compare(known, truth, 128), compare(made, truth, 128)
    with capsys.disabled():
        print(f"\nrenderer alone: {alone}\nthe whole way: {whole}")
    for errors, bound in ((alone, 0.03), (whole, 0.06)):
        assert abs(errors.objects) < bound
        assert abs(errors.shadow) < bound
        assert abs(errors.darkening) < 4 * bound


@pytest.mark.truth
@pytest.mark.skipif(
    any(shutil.which(tool) is None for tool in hugin.ALIGNMENT_TOOLS),
    reason="Hugin's command-line tools are not installed (Debian: hugin-tools)",
)
def test_what_each_step_of_the_whole_way_costs(tmp_path, capsys):
    """Seven orientations with a fisheye lens, nine exposures each; docs/tutorial.md has the figures and explains them."""
    width = 1024
    panorama = room.trace(room.panorama_view(width), 64, seed=2).mean.astype(np.float32)
    scenes: dict[str, Scene] = {}
    for name in ("clicked layout", "clicked pose and layout", "merged brackets", "stitched fisheye photographs"):
        folder = tmp_path / name
        folder.mkdir()
        image, light_to_world, found_width = folder / "room.exr", euler_rotation(room.ROTATION), width
        if name.startswith("clicked"):
            write_radiance(image, panorama)
        elif name == "merged brackets":
            run("capture", "merge", *bracketed(panorama, folder / "photos"), "-o", image)
        else:
            stitched_to_photographed = stitched(panorama, image, folder)
            light_to_world = light_to_world @ stitched_to_photographed
            found_width = read_radiance(image).shape[1]
        scene = begin_scene(folder, image, 160)
        if name == "clicked layout":
            with_true_pose(scene)
        else:
            calibrated(scene, image, found_width, light_to_world)
        reconstructed(scene, found_width, light_to_world)
        scenes[name] = lightdepth.load_scene(scene)
    first = scenes["clicked layout"]
    everything = ["floor", "rug", "ceiling", "front", "back", "left", "right"]
    known = exact(first, panorama, room.true_surfaces(everything))
    truth = path_traced(known, 512)
    scenes = {
        "all is exact, all surfaces are support": known,
        "walls and ceiling are environment": exact(first, panorama, room.true_surfaces(["floor", "rug"])),
        **scenes,
    }
    errors = {}
    for name, scene in scenes.items():
        errors[name] = compare(scene, truth, 256)
        with capsys.disabled():
            print(f"\n{name}: {errors[name]}", end="", flush=True)
    exact_errors = errors["all is exact, all surfaces are support"]
    assert abs(exact_errors.objects) < 0.01
    assert abs(exact_errors.shadow) < 0.01
    whole = errors["stitched fisheye photographs"]
    assert abs(whole.objects) < 0.06
    assert abs(whole.shadow) < 0.06


def stitched(panorama: np.ndarray, image: Path, folder: Path) -> np.ndarray:
    """Photograph with a fisheye, stitch; the rotation from the stitched panorama's light space to the true one."""
    rng = np.random.default_rng(1)
    true = [rig_rotation(*(np.array([yaw, pitch, 0]) + rng.normal(0, 1.5, 3))) for yaw, pitch in PAPER_RIG]
    photos = folder / "photos"
    photos.mkdir()
    shoot(panorama, true, TIMES, photos, TestCamera(size=(640, 640), distortion=0.01))
    report = folder / "stitch.json"
    run(
        "capture", "stitch", photos, "-o", image, "--circle", "auto", "--rig", "paper", "--fov", "180",
        "--width", panorama.shape[1], "--report", report,
    )  # fmt: skip
    images = json.loads(report.read_text())["images"]
    found = [rig_rotation(one["yaw"], one["pitch"], one["roll"]) for one in images]
    u, _, vt = np.linalg.svd(sum(t @ f.T for t, f in zip(true, found)))
    return u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt

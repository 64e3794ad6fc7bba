"""Hugin's command-line tools: control points between photographs, and the optimisation of lens and poses."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from lightdepth.capture.lens import PROJECTIONS, Lens
from lightdepth.capture.project import angle_between, read_project
from lightdepth.capture.rig import Rig
from lightdepth.errors import InputError, LightdepthError, SetupError
from lightdepth.parameters.capture import DEFAULT, CaptureParameters

PACKAGES = {"enblend": "enblend"}
"""Debian packages of the tools; those not named are in ``hugin-tools``."""

ALIGNMENT_TOOLS = ("pto_gen", "pto_var", "cpfind", "cpclean", "autooptimiser", "pano_modify")

LENS_VARIABLES = "v,a,b,c,d,e"

_SEARCHED = re.compile(r"i\d+ (: Analyzing|<> i\d+ : Found)")
"""What cpfind prints of each image and of each pair of images."""


def require(tools: Sequence[str]) -> None:
    """Check that tools are installed.

    Raises:
        SetupError: one is not; the message names it and how to install it.
    """
    missing = [tool for tool in tools if shutil.which(tool) is None]
    if missing:
        packages = sorted({PACKAGES.get(tool, "hugin-tools") for tool in missing})
        raise SetupError(
            f"{', '.join(missing)} not found on the PATH: stitching needs Hugin's command-line tools; install them "
            f"with 'apt-get install {' '.join(packages)}' (Debian, Ubuntu) or from https://hugin.sourceforge.io"
        )


def run(tool: str, *arguments: str, folder: Path, on_line: Callable[[str], None] = lambda _: None) -> str:
    """Run a tool in a folder and return what it printed.

    Args:
        tool: its name.
        arguments: its arguments.
        folder: where it runs, and where it keeps temporary files.
        on_line: called with every line that it prints, when it prints it.

    Raises:
        SetupError: it is not installed.
        LightdepthError: it failed; the message has its last words.
    """
    require([tool])
    printed = []
    with (
        tempfile.TemporaryFile("w+", errors="replace") as errors,
        subprocess.Popen(
            [tool, *arguments],
            cwd=folder,
            env={**os.environ, "LC_ALL": "C", "TMPDIR": str(folder)},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
            errors="replace",
        ) as process,
    ):
        assert process.stdout is not None
        try:
            for line in process.stdout:
                printed.append(line)
                on_line(line)
        except BaseException:
            process.kill()
            raise
        status = process.wait()
        errors.seek(0)
        complaint = errors.read().strip()
    if status != 0:
        words = (complaint or "".join(printed).strip()).splitlines()[-5:]
        raise LightdepthError(f"{tool} failed with status {status}: {' / '.join(words) or 'no message'}")
    return "".join(printed)


def find_poses(
    images: Sequence[str],
    folder: Path,
    projection: str,
    fov: float,
    rig: Rig | None,
    rolls: Sequence[float],
    circular: bool,
    progress: Callable[[str], None],
    searching: Callable[[int, int], None],
    tuned: CaptureParameters = DEFAULT,
) -> tuple[Path, Path]:
    """Find control points and optimise lens and poses.

    Args:
        images: names of images in ``folder``, all taken with the same lens.
        folder: where the tools work.
        projection: a key of :data:`lightdepth.capture.lens.PROJECTIONS`.
        fov: degrees across an image's width, as far as known.
        rig: orientations as far as known; the first image then keeps its own.
        rolls: degrees by which the camera was turned about its axis, where no rig is known.
        circular: the images are black outside the circle within their square.
        progress: called before each step with its name.
        searching: called while control points are searched, with how many images and pairs of images of how many have
            been looked at.
        tuned: which control points and lenses are plausible.

    Returns:
        ``(matched, optimised)``: project files with the control points found, and with lens and poses. Without control
        points these are the rig's.

    Raises:
        InputError: no control points were found, and no rig is given.
        SetupError: a tool is not installed.
        LightdepthError: a tool failed.
    """
    progress("project")
    number = PROJECTIONS[projection]
    run("pto_gen", "-o", "images.pto", "-p", str(number), "-f", f"{fov:.6f}", "-s", "1", *images, folder=folder)
    project = "images.pto"
    if circular:
        project = _edit(folder, project, "circle.pto", "--crop=96%,96%")
    if rig is not None:
        poses = ",".join(f"y{i}={yaw},p{i}={pitch},r{i}={roll}" for i, (yaw, pitch, roll) in enumerate(rig))
        project = _edit(folder, project, "rig.pto", f"--set={poses}")
    elif any(rolls):
        project = _edit(
            folder, project, "rolls.pto", "--set=" + ",".join(f"r{i}={roll}" for i, roll in enumerate(rolls))
        )
    progress("control points")
    strategy = "--prealigned" if rig is not None else "--multirow"
    total, done = len(images) * (len(images) + 1) // 2, 0

    def on_line(line: str) -> None:
        nonlocal done
        if _SEARCHED.match(line):
            done = min(done + 1, total)
            searching(done, total)

    run("cpfind", strategy, "--sieve2size", "3", "-o", "matched.pto", project, folder=folder, on_line=on_line)
    progress("cleaning control points")
    project = "matched.pto" if rig is None else _near_the_rig(folder, "matched.pto", "likely.pto", tuned)
    project = _clean(folder, project)
    if _count(folder, project) == 0:
        if rig is None:
            raise InputError(
                "no control points were found between any two of the images: they show too little, or overlap too "
                "little; state the orientations by --rig"
            )
        return folder / "matched.pto", folder / project
    progress("lens and poses")
    if rig is None:
        # Pairwise from the first photograph on, then all poses and the field of view as far as the points allow.
        run("autooptimiser", "-a", "-o", "posed.pto", project, folder=folder)
        project = "posed.pto"
    anchor = "!y0,!p0,!r0"
    for step, lens in enumerate(("v", "v,b,d,e", LENS_VARIABLES)):
        edited = _edit(folder, project, f"variables{step}.pto", f"--opt=y,p,r,{lens},{anchor}")
        run("autooptimiser", "-n", "-o", f"optimised{step}.pto", edited, folder=folder)
        # Few control points cannot hold many variables; the last plausible lens is then kept.
        if not _plausible(read_project(folder / f"optimised{step}.pto")[0][0], fov, tuned):
            break
        project = f"optimised{step}.pto"
    if rig is None:
        run("pano_modify", "--straighten", "-o", "level.pto", project, folder=folder)
        project = "level.pto"
    return folder / "matched.pto", folder / project


def _plausible(lens: Lens, expected_fov: float, tuned: CaptureParameters) -> bool:
    """Whether a lens could be real: about the expected field of view, mild distortion, axis near the centre."""
    radius = np.linspace(0.0, 1.0, 33)
    a, b, c = lens.distortion
    slope = 4 * a * radius**3 + 3 * b * radius**2 + 2 * c * radius + 1 - a - b - c
    return bool(
        tuned.lens_least_fov < lens.fov / expected_fov < tuned.lens_greatest_fov
        and tuned.lens_least_slope < slope.min() <= slope.max() < tuned.lens_greatest_slope
        and max(map(abs, lens.shift)) < tuned.lens_shift * lens.width
    )


def _edit(folder: Path, project: str, result: str, change: str) -> str:
    run("pto_var", change, "-o", result, project, folder=folder)
    return result


def _near_the_rig(folder: Path, project: str, result: str, tuned: CaptureParameters) -> str:
    """The project without control points that the rig's orientations make impossible."""
    lines = (folder / project).read_text().splitlines(keepends=True)
    lenses, points = read_project(folder / project)
    likely = iter(angle_between(lenses, point) < tuned.rig_tolerance for point in points)
    kept = [line for line in lines if not line.startswith("c ") or next(likely)]
    (folder / result).write_text("".join(kept))
    return result


def _clean(folder: Path, project: str) -> str:
    """The project without outliers; as it is where it holds too few points to judge."""
    if _count(folder, project) < 4:
        return project
    run("cpclean", "-o", "clean.pto", project, folder=folder)
    return "clean.pto"


def _count(folder: Path, project: str) -> int:
    """How many control points a project holds."""
    return sum(line.startswith("c ") for line in (folder / project).read_text().splitlines())

"""Real panoramas on roughly fitted geometry: there is no truth, so only noise and time are measured."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

import lightdepth
from bench.methods.job import MAX_BOUNCES
from bench.places.meshes import box, rectangle
from bench.places.objects import object_set
from lightdepth.cameras import Equirectangular
from lightdepth.directions import euler_rotation
from lightdepth.images.radiance import read_radiance
from lightdepth.kernel.start import start
from lightdepth.scene.model import CameraView, Mesh, Panorama, RealSurface, RenderSettings, Role, Scene

DATA = Path(os.environ.get("LIGHTDEPTH_SHARED_DATA", Path(__file__).parents[1] / "../shared/data")) / "hdr"
METHODS = ("difference", "directional", "envpath")
WIDTH = 512


def _inward(mesh: Mesh) -> Mesh:
    return Mesh(mesh.vertices, mesh.faces[:, ::-1].copy())


def real_panoramas() -> dict[str, tuple[Path, float, tuple[RealSurface, ...]]]:
    """File, height of the capture point in metres and surfaces of each panorama, by name."""
    room = box((-2.0, -2.6, 0.0), (2.4, 2.4, 2.6), "-x+x-y+y+z")
    room_floor = rectangle((-2.0, -2.6, 0.0), (4.4, 0.0, 0.0), (0.0, 5.0, 0.0))
    lawn = rectangle((-15.0, -15.0, 0.0), (30.0, 0.0, 0.0), (0.0, 30.0, 0.0))
    return {
        "hotel room": (
            DATA / "interior_hotelroom_1k.exr",
            1.4,
            (
                RealSurface("floor", room_floor, Role.SUPPORT),
                RealSurface("walls and ceiling", _inward(room), Role.ENVIRONMENT),
            ),
        ),
        "noon_grass": (DATA / "noon_grass_1k.hdr", 1.6, (RealSurface("lawn", lawn, Role.SUPPORT),)),
    }


def real(quick: bool, console: Console) -> dict[str, Any] | None:
    """Noise and time of the product's methods, as a table of text; ``None`` where the panoramas are not there."""
    start()
    from lightdepth.preparation import METHODS as OWN

    rows = []
    for name, (path, height, surfaces) in real_panoramas().items():
        if not path.is_file():
            return None
        position, turn = np.array([0.0, 0.0, height]), euler_rotation((0.0, 0.0, 0.0))
        scene = Scene(
            panorama=Panorama(read_radiance(path), position, turn, sky=True),
            real=surfaces,
            synthetic=object_set("mixed", (0.1, 1.3)),
            cameras={"shot": CameraView(Equirectangular(type="equirectangular", width=WIDTH), position, turn)},
            render=RenderSettings(max_bounces=MAX_BOUNCES),
        )
        for method in (method for method in METHODS if method in OWN):
            for samples in (8,) if quick else (16, 64):
                console.print(f"{name}: {method}, {samples} samples", highlight=False)
                lightdepth.render(scene, camera="shot", samples=samples, method=method, seed=1)
                began = time.perf_counter()
                frame = lightdepth.render(scene, camera="shot", samples=samples, method=method, seed=2)
                seconds = time.perf_counter() - began
                row = [name, method, str(samples), f"{seconds:.2f}"]
                for region in (frame.coverage > 0.5, (frame.coverage == 0.0) & (frame.samples > 0)):
                    noise = np.sqrt(frame.variance[region].mean()) / max(frame.beauty[region].mean(), 1e-9)
                    row.append(f"{100.0 * noise:.2f} %")
                rows.append(row)
    head = ["panorama", "method", "samples", "seconds", "noise on objects", "noise on sampled real surfaces"]
    return {"title": "Real panoramas, 512 pixels wide: noise (standard error) and time", "head": head, "rows": rows}

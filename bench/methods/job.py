"""A rendering job for a renderer that runs in another Python: plain files that its worker reads."""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.places.place import Part, Place
from bench.projection import without_lamps
from lightdepth.directions import euler_rotation
from lightdepth.images.exr import ExrPart, write_exr
from lightdepth.scene.model import AnalyticShape, CameraView

MAX_BOUNCES = 8
"""For every method, ours and the others."""
PEERS_PYTHON = Path(os.environ.get("LIGHTDEPTH_BENCH_PEERS", Path(__file__).parents[2] / ".venv-peers")) / "bin/python"
"""Interpreter of the environment that ``make bench-peers`` makes."""


@dataclass(frozen=True)
class Rendered:
    """A method's image, linear RGB, shape (height, width, 3), float64, and the seconds that it took."""

    image: NDArray[np.float64]
    seconds: float


@dataclass(frozen=True)
class Shot:
    """What every method is given: the photograph, the model of the place, and the image wanted.

    Attributes:
        place: surfaces, objects, capture pose.
        panorama: the photograph, shape (h, 2 h, 3), float32.
        view: the camera.
        plate: the photograph that the objects are composited into, as seen by ``view``, shape (height, width, 3).
        coverage: share of each pixel that objects cover, for compositing, shape (height, width).
    """

    place: Place
    panorama: NDArray[np.float32]
    view: CameraView
    plate: NDArray[np.float64]
    coverage: NDArray[np.float64]

    @property
    def modelled(self) -> tuple[Part, ...]:
        """The surfaces as the user modelled them."""
        return self.place.parts if self.place.modelled is None else self.place.modelled

    @property
    def capture(self) -> NDArray[np.float64]:
        """The capture point as the user believes it, world, metres."""
        return np.asarray(self.place.position) + np.asarray(self.place.capture_error)

    @cached_property
    def panorama_without_lamps(self) -> NDArray[np.float32]:
        """For methods that project the photograph and place the lamps as lights of their own."""
        lamps = [part.mesh for part in self.modelled if part.radiance is not None]
        return without_lamps(self.panorama, self.capture, euler_rotation(self.place.rotation), lamps)


def is_ground(part: Part) -> bool:
    """Whether two-pass methods take a part as the local scene: what the objects stand on."""
    return part.name in ("floor", "ground")


def run_worker(worker: str, shot: Shot, renders: Sequence[dict[str, Any]]) -> list[Rendered]:
    """Run a worker script of this folder in the peers' environment.

    Args:
        worker: file name.
        shot: what to render.
        renders: one dictionary a rendering, with what the worker understands.

    Raises:
        RuntimeError: the worker failed; with the end of what it said.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file, image in (
            ("panorama.exr", shot.panorama),
            ("panorama_without_lamps.exr", shot.panorama_without_lamps),
        ):
            write_exr(folder / file, [ExrPart({c: image[..., i] for i, c in enumerate("RGB")})])
        camera = shot.view.camera
        width, height = camera.resolution
        arrays: dict[str, Any] = {"plate": shot.plate, "coverage": shot.coverage}
        real, objects = [], []
        for index, part in enumerate(shot.modelled):
            arrays |= {f"real_{index}_vertices": part.mesh.vertices, f"real_{index}_faces": part.mesh.faces}
            real.append({"name": part.name, "color": part.color, "radiance": part.radiance, "ground": is_ground(part)})
        for piece in (piece for item in shot.place.objects for piece in item.parts):
            material = {"type": type(piece.material).__name__, **piece.material.model_dump()}
            if isinstance(piece.geometry, AnalyticShape):
                entry = {"kind": piece.geometry.kind, "to_world": piece.geometry.to_world.tolist()}
            else:
                entry = {"kind": "mesh"}
                prefix = f"object_{len(objects)}"
                arrays |= {f"{prefix}_vertices": piece.geometry.vertices, f"{prefix}_faces": piece.geometry.faces}
            objects.append({**entry, "material": material})
        outputs = [folder / f"{index}.npz" for index in range(len(renders))]
        job = {
            "panorama": "panorama.exr",
            "panorama_without_lamps": "panorama_without_lamps.exr",
            "capture": {"position": shot.capture.tolist(), "rotation": shot.place.rotation},
            "real": real,
            "objects": objects,
            "camera": {
                "type": camera.type,
                "width": width,
                "height": height,
                "fov": getattr(camera, "fov", None),
                "position": shot.view.position.tolist(),
                "rotation": shot.view.rotation.tolist(),
            },
            "max_bounces": MAX_BOUNCES,
            "threads": len(os.sched_getaffinity(0)),
            "renders": [{**one, "out": str(out)} for one, out in zip(renders, outputs, strict=True)],
        }
        (folder / "job.json").write_text(json.dumps(job))
        np.savez(folder / "job.npz", **arrays)
        command = [str(PEERS_PYTHON), str(Path(__file__).parent / worker), str(folder / "job.json")]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0 or not all(out.is_file() for out in outputs):
            raise RuntimeError(f"{worker} failed ({done.returncode}): {done.stdout[-1500:]} {done.stderr[-3000:]}")
        rendered = []
        for out in outputs:
            with np.load(out) as stored:
                rendered.append(Rendered(stored["image"].astype(np.float64), float(stored["seconds"])))
        return rendered

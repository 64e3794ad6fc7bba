"""A camera one metre beside the capture point over a polished floor: with its gloss recovered, declared, and without."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

import lightdepth
from bench.methods.job import MAX_BOUNCES
from bench.places.place import Place
from bench.places.polished_room import polished_room
from bench.truth import Estimate, truth
from lightdepth.kernel.raycasting import RayCaster
from lightdepth.lighting.gloss import RecoveredGloss, recover_gloss
from lightdepth.scene.model import CameraView, Gloss, Scene

FLOOR = "floor"
ROUGHNESSES = (0.12, 0.25, 0.4)
BLOCK = 8


@dataclass(frozen=True)
class Size:
    """How much is spent: widths in pixels, samples a pixel."""

    photograph: int
    photograph_samples: int
    width: int
    truth_samples: int
    samples: int


FULL, QUICK = Size(1024, 64, 320, 256, 64), Size(256, 64, 128, 64, 16)


@dataclass(frozen=True)
class Compared:
    """Pictures of the camera elsewhere, linear RGB, shape (height, width, 3), and the floor in them.

    Attributes:
        truth: path-traced, with the objects.
        empty: path-traced, without.
        matte: by lightdepth without gloss: beauty and plate.
        declared: with the true gloss.
        recovered: with the recovered one; ``None`` where there is none.
        floor: pixels whose middle shows the floor, behind objects or not, shape (height, width).
        objects: pixels that show objects alone.
        found: the recovered gloss.
    """

    truth: Estimate
    empty: Estimate
    matte: tuple[NDArray[np.float32], NDArray[np.float32]]
    declared: tuple[NDArray[np.float32], NDArray[np.float32]]
    recovered: tuple[NDArray[np.float32], NDArray[np.float32]] | None
    floor: NDArray[np.bool_]
    objects: NDArray[np.bool_]
    found: RecoveredGloss

    def errors(self, picture: tuple[NDArray[np.float32], NDArray[np.float32]]) -> tuple[float, float, float, float]:
        """Root mean square error of 8 by 8 means, relative to the mean.

        Of the empty floor, of the floor with objects on it, of the objects, and of the whole picture. The photograph's
        resolution limits the last one, at the windows' edges.
        """
        everything = np.ones_like(self.floor)
        return (
            block_error(picture[1], self.empty.mean, self.floor),
            block_error(picture[0], self.truth.mean, self.floor),
            block_error(picture[0], self.truth.mean, self.objects),
            block_error(picture[0], self.truth.mean, everything),
        )


def compare(place: Place, size: Size, console: Console | None = None) -> Compared:
    """Render a place's camera ``view`` with and without gloss, and its truth.

    Args:
        place: its first part is the floor.
        size: how much to spend.
        console: for progress.
    """
    scene = place.scene(size.photograph, size.photograph_samples, view_width=size.width)
    scene = replace(scene, render=replace(scene.render, max_bounces=MAX_BOUNCES))
    if console is not None:
        console.print(f"{place.name}: path tracing", highlight=False)
    full = truth(place, "view", size.width, size.truth_samples)
    empty = truth(place, "view", size.width, size.truth_samples, objects=False)
    (found,) = recover_gloss(scene, (FLOOR,))

    def rendered(gloss: Gloss | None) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        frame = lightdepth.render(with_gloss(scene, gloss), "view", samples=size.samples, cache=False)
        return frame.beauty, frame.plate

    finish = place.parts[0].finish
    assert finish is not None
    return Compared(
        full,
        empty,
        rendered(None),
        rendered(finish.gloss),
        None if found.gloss is None else rendered(Gloss(found.gloss.roughness, found.gloss.specular)),
        floor_of(place, scene.cameras["view"]),
        full.coverage == 1.0,
        found,
    )


def with_gloss(scene: Scene, gloss: Gloss | None) -> Scene:
    """The scene with another gloss of its floor."""
    real = tuple(replace(each, gloss=gloss) if each.name == FLOOR else each for each in scene.real)
    return replace(scene, real=real)


def floor_of(place: Place, view: CameraView) -> NDArray[np.bool_]:
    """Pixels in whose middle a camera sees the place's first part, shape (height, width)."""
    import mitsuba as mi

    from lightdepth.kernel.arrays import aligned

    width, height = view.resolution
    y, x = (np.mgrid[:height, :width] + 0.5).reshape(2, -1)
    film = mi.Point2f(mi.Float(aligned(x / width)), mi.Float(aligned(y / height)))
    ray = view.rays(film, mi.Point2f(0.5)).ray
    hits = RayCaster([part.mesh for part in place.parts]).cast(np.array(ray.o).T, np.array(ray.d).T)
    return (hits.mesh == 0).reshape(height, width)


def block_error(image: NDArray, reference: NDArray, mask: NDArray[np.bool_]) -> float:
    """Root mean square error of the means of blocks inside a mask, relative to the mean of the reference there."""
    rows, columns = mask.shape[0] // BLOCK * BLOCK, mask.shape[1] // BLOCK * BLOCK

    def blocks(values: NDArray) -> NDArray:
        tiles = values[:rows, :columns].reshape(rows // BLOCK, BLOCK, columns // BLOCK, BLOCK, -1)
        return np.asarray(tiles.mean(axis=(1, 3)))

    whole = blocks(mask.astype(np.float64))[..., 0] == 1.0
    wanted = blocks(reference)[whole]
    return float(np.sqrt(np.mean(np.square(blocks(image)[whole] - wanted))) / wanted.mean())


def table(quick: bool, console: Console) -> dict[str, Any]:
    """The comparison for floors of several roughnesses, as a table of text."""
    size = QUICK if quick else FULL
    rows = []
    for roughness in ROUGHNESSES:
        found = compare(polished_room(gloss=Gloss(roughness, 0.5)), size, console)
        gloss = found.found.gloss
        errors = [
            "-" if picture is None else " / ".join(f"{100 * error:.1f} %" for error in found.errors(picture))
            for picture in (found.matte, found.declared, found.recovered)
        ]
        recovered = found.found.finding if gloss is None else f"{gloss.roughness:.3f}, {gloss.specular:.2f}"
        rows.append([f"{roughness:.2f}, 0.50", f"{recovered} ({found.found.confidence})", *errors])
    return {
        "title": (
            f"polished_room, camera 1 m beside, panorama {size.photograph} pixels wide: error of 8x8 means of the empty "
            "floor / of it with objects / of the objects / of the whole picture"
        ),
        "head": ["gloss", "recovered (confidence)", "without", "true gloss", "recovered gloss"],
        "rows": rows,
    }

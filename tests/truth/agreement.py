"""Comparing a rendering with full path tracing, pixel by pixel, and leaving the pictures behind where they differ."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from bench.measures import display
from bench.places import Place
from bench.truth import truth
from numpy.typing import NDArray
from scipy.stats import norm

import lightdepth
from lightdepth.images.exr import ExrPart, write_exr
from lightdepth.images.png import write_png
from lightdepth.scene.model import Scene

CHANGED = 0.01
"""Relative change from which a pixel counts as influenced."""
FIRST_SEED = 5
"""Of the renderings that are compared."""
PIXELS_SEED = 1005
"""Of the one by which pixels are chosen."""
MOST_SAMPLES = 256
"""Of that one."""
OUTPUT = Path(__file__).parents[2] / "test-output"
SIGNIFICANCE = 0.01
"""Of the Z-tests of all pixels together (Sidak's correction), as Mitsuba's own image tests have it."""


@dataclass(frozen=True)
class Size:
    """How much an agreement test spends: widths in pixels, samples a pixel.

    Light lists and the radiance cache give all pixels of a rendering an error in common, which the variances of its pixels
    do not tell: several seeds do.
    """

    photograph: int
    photograph_samples: int
    width: int
    truth_samples: int
    samples: int
    seeds: int = 1


@dataclass(frozen=True)
class Agreement:
    """How a rendering compares with truth over the pixels that the objects influence.

    Attributes:
        signed: mean signed error over mean radiance.
        signed_error: standard error of ``signed``: the truth's from its variance, the renderings' from how they differ, or
            from its variance where there is one alone.
        passed: share of pixels whose channels all pass the Z-test.
        image: the mean of the renderings, composited into the path-traced empty place.
        reference: the truth.
    """

    signed: float
    signed_error: float
    passed: float
    image: NDArray[np.float64]
    reference: NDArray[np.float64]


def compare(place: Place, camera: str, method: str, size: Size) -> Agreement:
    """Render a place's photograph with its objects, and compare.

    What is tested is the light that the method adds, so it is added to the path-traced empty place: the plate itself is
    the photograph, whose resampling is tested elsewhere.
    """
    full = truth(place, camera, size.width, size.truth_samples)
    empty = truth(place, camera, size.width, size.truth_samples, objects=False, seed=3)
    scene = place.scene(size.photograph, size.photograph_samples)
    scene = replace(scene, cameras={camera: place.camera(camera, size.width)})
    scene = replace(scene, render=replace(scene.render, max_bounces=32))
    full = replace(full, variance=full.variance + empty.variance)
    influenced = _influenced(scene, camera, min(size.samples * size.seeds, MOST_SAMPLES))
    total = full.mean[influenced].sum()
    image, own, signed = np.zeros_like(full.mean), np.zeros_like(full.variance), []
    for seed in range(FIRST_SEED, FIRST_SEED + size.seeds):
        frame = lightdepth.render(scene, camera=camera, samples=size.samples, method=method, seed=seed)
        one = empty.mean * (1.0 - frame.coverage[..., None]) + frame.change + frame.synthetic
        image += one / size.seeds
        own += frame.variance / size.seeds**2
        signed.append(float((one - full.mean)[influenced].sum() / total))
    error = (image - full.mean)[influenced]
    z = np.abs(error) / np.sqrt(np.maximum((full.variance + own)[influenced], 1e-20))
    allowed = norm.isf(0.5 * (1.0 - (1.0 - SIGNIFICANCE) ** (1.0 / z.size)))
    known = full.variance + (own if size.seeds == 1 else 0.0)
    between = 0.0 if size.seeds == 1 else np.var(signed, ddof=1) / size.seeds
    return Agreement(
        float(np.mean(signed)),
        float(np.sqrt(known[influenced].sum() / total**2 + between)),
        float((z < allowed).all(axis=-1).mean()),
        image,
        full.mean,
    )


def _influenced(scene: Scene, camera: str, samples: int) -> NDArray[np.bool_]:
    """Pixels that the objects cover, or change by more than ``CHANGED``, shape (height, width).

    By a rendering with a seed of its own: pixels chosen by what the compared images show would be those where their
    noise happens to be large, which biases the mean error.
    """
    frame = lightdepth.render(scene, camera=camera, samples=samples, seed=PIXELS_SEED)
    change = np.abs(frame.change).mean(axis=-1)
    return (frame.coverage > 0.0) | (change > CHANGED * frame.plate.mean(axis=-1))


def leave_behind(agreement: Agreement, name: str) -> Path:
    """Write image, reference and error map under ``test-output/``, as EXR with parts and as PNG side by side."""
    OUTPUT.mkdir(exist_ok=True)
    error = agreement.image - agreement.reference
    parts = {"image": agreement.image, "reference": agreement.reference, "error": error}
    path = OUTPUT / f"{name}.exr"
    write_exr(
        path,
        [
            ExrPart({c: np.ascontiguousarray(pixels[..., i], np.float32) for i, c in enumerate("RGB")}, part)
            for part, pixels in parts.items()
        ],
    )
    exposure = 0.4 / float(np.median(agreement.reference))
    shown = [display(exposure * agreement.image), display(exposure * agreement.reference)]
    shown.append(np.clip(0.5 + 2.0 * exposure * error, 0.0, 1.0))
    write_png(path.with_suffix(".png"), (255.0 * np.concatenate(shown, axis=1) + 0.5).astype(np.uint8))
    return path

"""Motion blur: the mean of frames that were rendered at instants while the shutter was open."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lightdepth.film.cryptomatte import Mattes
from lightdepth.film.frame import Frame

MEANS = ("change", "synthetic", "coverage", "alpha")
"""Layers of which the mean is taken as it is;"""
OPTIONAL_MEANS = ("normal", "albedo", "photograph")
"""likewise, of those that a frame may lack."""

WHOLE = 1e-6
"""By which the shares of all instants may differ from one."""


class ShutterMean:
    """Collects the frames of one camera at several instants.

    Each instant counts by its share of the time, however many samples it took: where sums of samples were merged
    instead, an instant to which the adaptive sampling gave more would weigh more.

    Args:
        middle: number of the frame whose depth stands for all: a mean of depths would be that of nothing.
    """

    def __init__(self, middle: int) -> None:
        self._middle, self._number = middle, 0
        self._weight = 0.0
        self._still = True
        self._first: Frame | None = None
        self._kept: Frame | None = None
        self._sums: dict[str, NDArray] = {}
        self._mattes: list[tuple[Mattes, float]] = []
        self._errors = 0.0
        self._taken = 0.0

    def add(self, frame: Frame, share: float) -> None:
        """Add the frame of an instant, or of several that are alike.

        Args:
            frame: the frame; its arrays may be kept.
            share: of the time that the shutter is open.
        """
        if self._first is None:
            self._first = frame
        elif self._still and not np.array_equal(frame.plate, self._first.plate):
            self._still = False
            # So far the coverage may have been another one each time, on the same plate.
            self._sums["plate"] = self._first.plate * np.float32(self._weight)
            self._sums["blocked"] = self._first.plate * self._sums["coverage"][..., None]
        added = {name: getattr(frame, name) for name in MEANS}
        if not self._still:
            added |= {"plate": frame.plate, "blocked": frame.plate * frame.coverage[..., None]}
        added |= {name: values for name in OPTIONAL_MEANS if (values := getattr(frame, name)) is not None}
        for name, values in added.items():
            self._add(name, values, share)
        if frame.variance is not None:
            self._add("variance", frame.variance, share**2)
        if frame.samples is not None:
            self._sums["samples"] = self._sums.get("samples", np.uint32(0)) + frame.samples
        if frame.mattes is not None:
            self._mattes.append((frame.mattes, share))
        self._errors += (share * float(frame.metadata.get("error", 0.0))) ** 2
        self._taken += float(frame.metadata.get("samples", 0.0))
        if self._kept is None or self._number <= self._middle:
            self._kept = frame
        self._weight += share
        self._number += 1

    @property
    def is_empty(self) -> bool:
        """Whether nothing was added."""
        return self._first is None

    def frame(self) -> Frame:
        """The frame with its motion blur; where a part of the time was not added, the mean of the rest.

        Its plate is that of the instants, bit for bit, where the camera stands; else their mean. ``change`` then also
        holds what the mean of plates behind moving objects differs from the mean plate behind their mean coverage, so
        that the finished picture is the mean of those of the instants.
        """
        first, kept, sums, weight = self._first, self._kept, self._sums, self._weight
        if abs(weight - 1.0) > WHOLE:
            whole = {"samples": 1.0, "variance": weight**2}
            sums = {name: (values / whole.get(name, weight)).astype(values.dtype) for name, values in sums.items()}
        assert first is not None
        assert kept is not None
        plate = first.plate if self._still else sums["plate"]
        change, coverage = sums["change"], np.minimum(sums["coverage"], np.float32(1.0))
        if not self._still:
            change = change + (plate * coverage[..., None] - sums["blocked"])
        normal = sums.get("normal")
        if normal is not None:
            lengths = np.linalg.norm(normal, axis=2, keepdims=True)
            normal = np.divide(normal, lengths, out=np.zeros_like(normal), where=lengths > 0.0)
        mattes = _merged([(each, share / weight) for each, share in self._mattes])
        object_id = kept.object_id
        if mattes is not None and object_id is not None:
            owners = [kept.object_names.index(name) for name in mattes.objects]
            object_id = mattes.dominant(coverage.size, owners).reshape(coverage.shape)
        facts = {**kept.metadata, "samples": f"{self._taken:.1f}", "error": f"{np.sqrt(self._errors) / weight:.5f}"}
        return replace(
            kept,
            plate=plate,
            change=change,
            synthetic=sums["synthetic"],
            coverage=coverage,
            alpha=first.alpha if self._still else np.minimum(sums["alpha"], np.float32(1.0)),
            object_id=object_id,
            normal=None if normal is None else normal.astype(np.float16),
            albedo=sums["albedo"].astype(np.float16) if "albedo" in sums else None,
            photograph=sums.get("photograph"),
            variance=sums.get("variance"),
            samples=sums.get("samples"),
            metadata=facts,
            mattes=mattes,
        )

    def _add(self, name: str, values: NDArray, share: float) -> None:
        added = values.astype(np.float32) * np.float32(share)
        if name in self._sums:
            self._sums[name] += added
        else:
            self._sums[name] = added


def _merged(parts: list[tuple[Mattes, float]]) -> Mattes | None:
    """Mean coverage. Shapes count by their object and material, since their number may differ from instant to instant."""
    if not parts:
        return None
    known: dict[tuple[str, str], int] = {}
    pixels, shapes, shares = [], [], []
    for mattes, share in parts:
        names = zip(mattes.objects, mattes.materials, strict=True)
        index = np.array([known.setdefault(name, len(known)) for name in names], np.uint32)
        pixels.append(mattes.pixels)
        shapes.append(index[mattes.shapes] if len(index) else mattes.shapes)
        shares.append(mattes.shares.astype(np.float64) * share)
    key = (np.concatenate(pixels).astype(np.uint64) << np.uint64(32)) | np.concatenate(shapes).astype(np.uint64)
    unique, inverse = np.unique(key, return_inverse=True)
    total = np.bincount(inverse, np.concatenate(shares), len(unique)).astype(np.float32)
    return Mattes(
        (unique >> np.uint64(32)).astype(np.uint32),
        (unique & np.uint64(0xFFFFFFFF)).astype(np.uint32),
        np.minimum(total, np.float32(1.0)),
        tuple(thing for thing, _ in known),
        tuple(material for _, material in known),
    )

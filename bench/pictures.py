"""Convergence plots and side-by-side pictures with error maps."""

from __future__ import annotations

from pathlib import Path
from statistics import median
from typing import Any

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

from bench.analysis import select
from bench.measures import display

mpl.use("Agg")
import matplotlib.pyplot as plt

ERROR_RANGE = 0.5
"""Relative error that the error maps show in full colour."""


def plot_convergence(results: dict[str, Any], place: str, camera: str, path: Path) -> None:
    """Error on objects and in shadow and bounce light against time, one line a method."""
    figure, axes = plt.subplots(1, 2, figsize=(10, 3.8), layout="constrained", sharey=True)
    for axis, region in zip(axes, ("objects", "changed"), strict=True):
        for method, label in results["labels"].items():
            records = select(
                results["records"], place=place, camera=camera, model="exact", method=method, denoised=False
            )
            records = [record for record in records if region in record["measures"]]
            if records:
                times = [median(record["seconds"]) for record in records]
                errors = [100.0 * record["measures"][region]["rmse"] for record in records]
                axis.loglog(times, errors, marker="o", markersize=3, label=label.replace("`", ""))
        axis.set_title({"objects": "on objects", "changed": "in shadow and bounce light"}[region])
        axis.set_xlabel("seconds")
        axis.grid(visible=True, which="both", alpha=0.25)
    axes[0].set_ylabel("RMSE, % of the region's mean")
    # Below the curves: inside the axes it would hide some.
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, fontsize=7, loc="outside lower center", ncols=4)
    figure.savefig(path, dpi=100)
    plt.close(figure)


def show_side_by_side(results: dict[str, Any], place: str, camera: str, model: str, path: Path) -> None:
    """The truth and every method's image at the largest of the timed budgets, with signed error maps below."""
    records = select(results["records"], place=place, camera=camera, model=model)
    truth = next(record["image"] for record in records if record["method"] == "truth")
    samples = results["effort"]["budgets"][-2]
    shown = [("truth", truth)]
    for method, label in results["labels"].items():
        found = select(records, method=method, denoised=False, samples=samples)
        shown += [(label.replace("`", ""), record["image"]) for record in found]
    height, width = truth.shape[:2]
    figure, axes = plt.subplots(
        2, len(shown), figsize=(2.3 * len(shown), 2 * 2.3 * height / width + 0.5), layout="constrained", squeeze=False
    )
    exposure = 0.4 / float(np.median(truth.mean(axis=-1)))
    for column, (label, image) in enumerate(shown):
        axes[0, column].imshow(display(exposure * image), interpolation="nearest")
        axes[0, column].set_title(label, fontsize=6.5)
        drawn = axes[1, column].imshow(
            _relative_error(image, truth), cmap="RdBu", vmin=-ERROR_RANGE, vmax=ERROR_RANGE, interpolation="nearest"
        )
    for axis in axes.ravel():
        axis.set_axis_off()
    bar = figure.colorbar(drawn, ax=axes[1, -1], shrink=0.8)
    bar.ax.tick_params(labelsize=6)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _relative_error(image: NDArray[np.float64], truth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Signed error of the mean of the channels over the truth's."""
    wanted = truth.mean(axis=-1)
    return (image.mean(axis=-1) - wanted) / np.maximum(wanted, 0.05 * wanted.mean())

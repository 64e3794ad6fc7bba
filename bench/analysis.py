"""From records to figures: noise and bias apart, time to a given error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Convergence:
    """How a method's error falls: ``error^2 = bias^2 + noise^2 / samples``, in time ``samples * seconds``.

    Attributes:
        bias: error that stays, relative to the region's mean.
        noise: standard deviation of one sample, relative.
        seconds_per_sample: median, a sample a pixel.
        overhead: seconds that do not depend on the number of samples.
    """

    bias: float
    noise: float
    seconds_per_sample: float
    overhead: float

    def seconds_to(self, error: float) -> float:
        """Seconds until the error is reached; infinite where the bias alone is larger."""
        if error <= self.bias:
            return float("inf")
        return self.overhead + self.seconds_per_sample * self.noise**2 / (error**2 - self.bias**2)


def convergence(records: Sequence[dict[str, Any]], region: str) -> Convergence | None:
    """Fit the model to the budgets of one method on one shot; ``None`` without such a region."""
    records = [record for record in records if region in record["measures"]]
    if len(records) < 2:
        return None
    samples = np.array([record["samples"] for record in records], dtype=float)
    squared = np.array([record["measures"][region]["rmse"] ** 2 for record in records])
    seconds = np.array([median(record["seconds"]) for record in records])
    # Relative residuals: every budget counts alike.
    weight = 1.0 / np.maximum(squared, 1e-12)
    design = np.stack([np.ones_like(samples), 1.0 / samples], axis=1) * weight[:, None]
    bias, noise = np.linalg.lstsq(design, squared * weight, rcond=None)[0]
    if bias < 0.0:
        bias, noise = 0.0, float(np.average(squared * samples, weights=np.ones_like(samples)))
    slope, overhead = np.polyfit(samples, seconds, 1)
    slope = max(float(slope), 1e-9)
    return Convergence(float(np.sqrt(bias)), float(np.sqrt(max(noise, 0.0))), slope, max(float(overhead), 0.0))


def select(records: Sequence[dict[str, Any]], **wanted: Any) -> list[dict[str, Any]]:
    """Records with the given values."""
    return [record for record in records if all(record.get(key) == value for key, value in wanted.items())]


def percent(share: float) -> str:
    """A share for tables."""
    return f"{100.0 * share:.2f} %"


def spread(seconds: Sequence[float]) -> str:
    """Median and range of times, for tables."""
    if len(seconds) == 1:
        return f"{seconds[0]:.2f}"
    return f"{median(seconds):.2f} ({min(seconds):.2f} to {max(seconds):.2f})"

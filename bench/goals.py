"""The figures that matter most, drawn from the records: bias, error at convergence, wrong models, time to equal error."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from bench.analysis import convergence, percent, select

Table = tuple[str, list[str], list[list[str]]]


def goals(results: dict[str, Any]) -> Iterator[Table]:
    """Titles, heads and rows of the summary's tables, of the camera ``view`` without denoising."""
    records = select(results["records"], camera="view", denoised=False)
    places, labels = results["effort"]["places"], results["labels"]
    yield from _converged(records, places, labels, results["effort"]["converged"])
    yield _wrong(records, places, results["effort"]["converged"])
    yield from _equal_error(records, places, labels, results["effort"]["budgets"][1:-1])


def _converged(
    records: list[dict[str, Any]], places: tuple[str, ...], labels: dict[str, str], samples: int
) -> Iterator[Table]:
    rows_signed, rows = [], []
    for place in places:
        found = select(records, place=place, model="exact")
        ours = select(found, method="difference", samples=samples)
        if not ours:
            continue
        measures = ours[0]["measures"]
        rows_signed.append(
            [place, *(f"{100 * measures[region]['signed']:+.2f} %" for region in ("influenced", "objects", "changed"))]
        )
        for region in ("objects", "changed", "influenced"):
            own_error = measures[region]["block_rmse"]
            row = [place, region, percent(own_error)]
            for method in list(labels)[1:]:
                theirs = max(select(found, method=method), key=lambda record: record["samples"], default=None)
                row.append("" if theirs is None else _against(theirs["measures"][region]["block_rmse"], own_error))
            rows.append(row)
    yield (
        f"Mean signed error of `difference` at {samples} samples, exact model",
        ["place", "influenced pixels", "on objects", "changed surfaces"],
        rows_signed,
    )
    yield (
        f"Error at convergence, exact model: RMSE of the means of 8 by 8 pixels, of `difference` at {samples} samples and "
        "of the others at their largest budget, the noise that is left included (in brackets, how many times ours)",
        ["place", "region", *labels.values()],
        rows,
    )


def _against(error: float, own: float) -> str:
    return f"{percent(error)} ({error / max(own, 1e-9):.1f}x)"


def _wrong(records: list[dict[str, Any]], places: tuple[str, ...], samples: int) -> Table:
    rows = []
    for place in places:
        models = dict.fromkeys(record["model"] for record in select(records, place=place))
        for model in (model for model in models if model != "exact"):
            errors = {
                record["method"]: record["measures"]["influenced"]
                for record in select(records, place=place, model=model)
                if record["method"] != "truth"
            }
            own, other = (errors[method] for method in ("difference", "directional"))
            row = [place, model]
            for measure in ("rmse", "block_rmse"):
                row += [percent(own[measure]), _against(other[measure], own[measure])]
            rows.append(row)
    head = ["place", "model", "`difference`, RMSE", "`directional`, RMSE", "`difference`, 8x8", "`directional`, 8x8"]
    title = f"Wrong models, influenced pixels, {samples} samples: RMSE, and RMSE of the means of 8 by 8 pixels"
    return title, head, rows


def _equal_error(
    records: list[dict[str, Any]], places: tuple[str, ...], labels: dict[str, str], budgets: tuple[int, ...]
) -> Iterator[Table]:
    rows = []
    for place in places:
        found = select(records, place=place, model="exact")
        for region in ("objects", "changed"):
            ours = convergence(select(found, method="difference"), region)
            if ours is None:
                continue
            for samples in budgets:
                error = math.sqrt(ours.bias**2 + ours.noise**2 / samples)
                row = [place, region, percent(error)]
                for method in labels:
                    fitted = convergence(select(found, method=method), region)
                    row.append("" if fitted is None else _time(fitted.seconds_to(error), ours.seconds_to(error)))
                rows.append(row)
    yield (
        "Time to the error that `difference` has at the middle budgets, from the fits (*never*: the bias alone is "
        "larger; in brackets, against ours)",
        ["place", "region", "error", *labels.values()],
        rows,
    )


def _time(needed: float, own: float) -> str:
    return "never" if math.isinf(needed) else f"{needed:.2g} s ({needed / own:.1f}x)"

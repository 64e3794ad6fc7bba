"""The figures that matter most, drawn from the records: bias, error at convergence, wrong models, time to equal error."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from operator import itemgetter
from statistics import median
from typing import Any

from bench.analysis import convergence, percent, select

Table = tuple[str, list[str], list[list[str]]]


def goals(results: dict[str, Any]) -> Iterator[Table]:
    """Titles, heads and rows of the summary's tables, of the camera ``view`` without denoising."""
    records = select(results["records"], camera="view", denoised=False)
    effort, labels = results["effort"], results["labels"]
    places, budgets = effort["places"], effort["budgets"]
    exact = select(records, model="exact")
    yield _signed(select(exact, samples=budgets[-1]), places, budgets[-1])
    yield _converged(exact, places, labels, budgets[-1], effort["longer"])
    yield _wrong(records, places, effort["converged"])
    yield from _equal_error(records, places, labels, budgets[1:])


def _signed(records: list[dict[str, Any]], places: tuple[str, ...], samples: int) -> Table:
    rows = []
    for place in places:
        for ours in select(records, place=place, method="difference"):
            found = (ours["converged"].get(region) for region in ("influenced", "objects", "changed"))
            rows.append([place, *("" if one is None else f"{100 * one['signed']:+.2f} %" for one in found)])
    return (
        f"Mean signed error of `difference`, exact model, mean of two renderings with {samples} samples each",
        ["place", "influenced pixels", "on objects", "changed surfaces"],
        rows,
    )


def _converged(
    records: list[dict[str, Any]],
    places: tuple[str, ...],
    labels: dict[str, str],
    samples: int,
    longer: dict[str, int],
) -> Table:
    rows = []
    for place, region in itertools.product(places, ("objects", "changed", "influenced")):
        found = {
            record["method"]: record["converged"][region]
            for record in sorted(select(records, place=place), key=itemgetter("samples"))
            if region in record["converged"]
        }
        ours = found.pop("difference", None)
        if ours is None:
            continue
        row = [place, region, percent(ours["truth_noise"]), _with_interval(ours)]
        rows.append(row + [_times(found[method], ours) if method in found else "" for method in list(labels)[1:]])
    return (
        "Error at convergence, exact model: RMSE of the means of 8 by 8 pixels, the noise of the images and of the truth "
        f"taken out, from two renderings with {samples} samples each"
        + "".join(f", of {labels[name]} with {number}" for name, number in longer.items() if name in labels)
        + " (in brackets, how many times ours)",
        ["place", "region", "truth's own noise (8x8)", *labels.values()],
        rows,
    )


def _with_interval(found: dict[str, float]) -> str:
    """An error at convergence and its uncertainty; an interval where it may as well be none."""
    if found["low"] == 0.0:
        return f"{percent(found['error'])} (0 to {100.0 * found['high']:.2f})"
    return f"{percent(found['error'])} ± {50.0 * (found['high'] - found['low']):.2f}"


def _times(theirs: dict[str, float], ours: dict[str, float]) -> str:
    """Their error at convergence, and how many times ours it is: at least, where ours may as well be none."""
    if theirs["low"] == 0.0:
        return _with_interval(theirs)
    if ours["low"] == 0.0:
        return f"{percent(theirs['error'])} (> {theirs['error'] / max(ours['high'], 1e-9):.1f}x)"
    return _against(theirs["error"], ours["error"])


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
            for samples in budgets:
                ours = [
                    each for each in select(found, method="difference", samples=samples) if region in each["measures"]
                ]
                if not ours:
                    continue
                error, seconds = ours[0]["measures"][region]["rmse"], median(ours[0]["seconds"])
                row = [place, region, percent(error)]
                for method in labels:
                    fitted = convergence(select(found, method=method), region)
                    needed = seconds if method == "difference" else fitted and fitted.seconds_to(error)
                    row.append("" if needed is None else _time(needed, seconds))
                rows.append(row)
    yield (
        f"Time to the error that `difference` has with {', '.join(map(str, budgets))} samples: ours as measured there, "
        "since its error falls faster than the fit's, the others' from their fits (*never*: the bias alone is larger; in "
        "brackets, against ours)",
        ["place", "region", "error", *labels.values()],
        rows,
    )


def _time(needed: float, own: float) -> str:
    return "never" if math.isinf(needed) else f"{needed:.2g} s ({needed / own:.1f}x)"

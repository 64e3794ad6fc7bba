"""docs/benchmarks.md and its pictures, from the results."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from bench.analysis import convergence, percent, select, spread
from bench.foreign import kept
from bench.goals import goals
from bench.missing_light import kept as kept_missing_light
from bench.pictures import plot_convergence, show_side_by_side
from bench.run import RESULTS

CAPTURES = RESULTS / "captures.json"
BOXES = RESULTS / "boxes.json"
FIREFLIES = RESULTS / "fireflies.json"
DOCS = Path(__file__).parents[1] / "docs"
REGION_TITLES = {
    "objects": "On objects",
    "changed": "In shadow and bounce light on real surfaces",
    "untouched": "Untouched (changed by less than 1 %)",
    "influenced": "Objects and changed surfaces together",
}
INTRODUCTION = """# Benchmarks

Written by `make bench`; the raw figures are in `bench/results/`. Every method gets the same photograph of a virtual
place, the same model of it and the same objects, and is compared with full path tracing of the place with the objects in
it (stock Mitsuba `path`, up to 32 path vertices, through the same camera).

- Errors are relative to the mean radiance of the region. The truth's own noise is known per pixel and subtracted from
  every squared error. The photograph's noise is not: it is part of every method's input. Its pixels that show lamps
  have enough rays that the lamps' power is accurate.
- The *error at convergence* is the error at a method's largest budget without its noise. Two images A and B, rendered with
  different random numbers, are compared with the truth T in the means of blocks of 8 by 8 pixels. The mean over the
  blocks of (A - T) (B - T), less the variance of T, has the squared error as its expectation: the noise of A and B is
  independent and drops out, that of T is in both factors and known. The root of this is shown, by the same rule for every
  method. Results that a method prepares once for all images, such as irradiance, are the same in A and B, and their error
  counts.
- Its uncertainty (±, one standard deviation) is a bootstrap over the blocks (200 resamples). Where that reaches down
  to 0, the interval is shown instead, and the factor by which others are larger is a bound (>) from its upper end.
  *Truth's own noise* is the error that all these figures would contain if it were not subtracted.
- All methods composite onto the same plate, so that only their contributions are compared.
- *Bias* is the error that remains with any number of samples, *noise* that of one sample per pixel, both from a fit of
  `error^2 = bias^2 + noise^2 / samples` over the budgets.
- Times are medians of interleaved runs on the same machine, warm, without loading the scene.
- PSNR, SSIM and FLIP are of the sRGB image at one exposure per place.
- *untouched* holds pixels of real surfaces that the objects change by less than 1 %: small changes there are real.
- In the L-shaped room the walls of the far leg are occluded from the capture point. Methods that project the photograph
  give them the colours of whatever occludes them, and metal mirrors that. `difference` gives them the mean colour of
  visible walls near them, and the light that arrives there.

"""


def write_report(results: dict[str, Any], cost: dict[str, Any] | None) -> Path:
    """Write the page, and its pictures where there are images; otherwise they stay as they are.

    Args:
        results: of :func:`bench.run.run`, or as :func:`bench.run.save` keeps them. ``note`` is a sentence about the
            circumstances, printed on top.
        cost: of :func:`bench.cost.cost`, or ``None``.
    """
    folder = DOCS / "images" / "benchmarks"
    folder.mkdir(parents=True, exist_ok=True)
    lines = [INTRODUCTION]
    machine = results["machine"]
    lines.append(
        f"Machine: {machine['processor']}, {machine['threads']} threads, Python {machine['python']}; "
        f"{machine['date']}; load before the run {machine['load_before']}.\n"
    )
    if results.get("note"):
        lines.append(f"**{results['note']}**\n")
    effort, labels = results["effort"], results["labels"]
    lines.append(
        f"Photographs {effort['photograph'][0]} pixels wide with {effort['photograph'][1]} samples, truth with "
        f"{effort['truth_samples']} samples, images {effort['cameras']}, budgets {list(effort['budgets'])} samples, "
        f"{effort['repeats']} runs, object set `{effort['objects']}`."
        + "".join(f" {labels[name]} with {samples} samples as well." for name, samples in effort["longer"].items())
        + "\n"
    )
    lines.append("## Summary\n")
    for title, head, rows in goals(results):
        lines += [f"**{title}**\n", _table(head, rows)]
    for place in effort["places"]:
        lines.append(f"## {place}\n")
        for camera in effort["cameras"]:
            lines += _shot(results, place, camera, folder)
        lines += _wrong_models(results, place)
    if cost is not None:
        lines += _cost(cost)
    lines += missing_light()
    lines += _foreign()
    lines += _captures()
    lines += _boxes()
    lines += _fireflies()
    lines.append("## Settings of the methods\n")
    lines += [f"- {results['labels'][key]}: {text}." for key, text in results["settings"].items()]
    path = DOCS / "benchmarks.md"
    path.write_text("\n".join(lines) + "\n")
    return path


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def _shot(results: dict[str, Any], place: str, camera: str, folder: Path) -> Iterator[str]:
    """Tables and pictures of the exact model through one camera."""
    records = select(results["records"], place=place, camera=camera, model="exact")
    shown = results["effort"]["budgets"][-2]
    yield f"### {place}, camera `{camera}`\n"
    name = f"{place}_{camera}"
    if any("image" in record for record in records):
        show_side_by_side(results, place, camera, "exact", folder / f"{name}.png")
        plot_convergence(results, place, camera, folder / f"{name}_convergence.png")
    yield (
        f"![Truth and the methods at {shown} samples; below, signed relative error]"
        f"(images/benchmarks/{name}.png)\n\n![Convergence](images/benchmarks/{name}_convergence.png)\n"
    )
    for region, title in REGION_TITLES.items():
        rows = []
        for denoised in (False, True):
            for method, label in results["labels"].items():
                found = select(records, method=method, denoised=denoised)
                final = [record for record in select(found, samples=shown) if region in record["measures"]]
                if not final:
                    continue
                measures = final[0]["measures"][region]
                fitted = convergence(found, region)
                flip = measures["flip"]
                rows.append(
                    [
                        label + (", denoised" if denoised else ""),
                        spread(final[0]["seconds"]),
                        percent(measures["signed"]),
                        percent(measures["rmse"]),
                        f"{measures['relative_mse']:.4f}",
                        percent(measures["block_rmse"]),
                        percent(fitted.bias) if fitted else "",
                        percent(fitted.noise) if fitted else "",
                        f"{measures['psnr']:.1f}",
                        f"{measures['ssim']:.3f}",
                        "" if flip is None else f"{flip:.4f}",
                    ]
                )
        if rows:
            yield f"**{title}**, {shown} samples:\n"
            yield _table(
                [
                    "method",
                    "seconds",
                    "signed",
                    "RMSE",
                    "relMSE",
                    "RMSE of 8x8",
                    "bias",
                    "noise",
                    "PSNR",
                    "SSIM",
                    "FLIP",
                ],
                rows,
            )


def _wrong_models(results: dict[str, Any], place: str) -> Iterator[str]:
    """How the product's methods fare with a wrong model of the place."""
    records = select(results["records"], place=place, camera="view", denoised=False)
    effort = results["effort"]
    models = list(dict.fromkeys(record["model"] for record in records))
    rows = []
    for model in models:
        for method, label in results["labels"].items():
            samples = max(effort["budgets"]) if model == "exact" else effort["converged"]
            found = select(records, model=model, method=method, samples=samples)
            if found and (method in ("difference", "directional", "envpath")):
                row = [model, label]
                for region in ("objects", "changed"):
                    measures = found[0]["measures"].get(region)
                    row += (
                        ["", ""] if measures is None else [percent(measures["signed"]), percent(measures["block_rmse"])]
                    )
                rows.append(row)
    if rows:
        yield f"### {place}: wrong models\n"
        yield _table(
            ["model", "method", "objects: signed", "objects: RMSE of 8x8", "changed: signed", "changed: RMSE of 8x8"],
            rows,
        )


def missing_light() -> Iterator[str]:
    """Suns, clipped light and gloss, as ``python -m bench suns``, ``clipped`` and ``gloss`` measured them."""
    tables = kept_missing_light()
    if tables:
        yield "## Light that the photograph lacks\n"
        yield (
            "Measured with `python -m bench suns`, `clipped` and `gloss`; see [Light that the photograph "
            "lacks](recovery.md). ± is the standard error, from the truth's noise and the images' own. The cost of a "
            "declared sun is compared with that of the same sun in the photograph: the room without a sun has neither its "
            "light nor the hard edges of its shadows. *At equal error* is time times variance.\n"
        )
    for table in tables:
        yield f"**{table['title']}**\n"
        yield _table(table["head"], table["rows"])


def _foreign() -> Iterator[str]:
    """Scenes of others that ``python -m bench truth`` measured, which break the assumption of matte surfaces."""
    tables = kept()
    if tables:
        yield "## Scenes with glossy surfaces and open windows\n"
        yield (
            "Measured one by one with `python -m bench truth`. Their glossy floors and the sky behind their windows break "
            "the assumption that real surfaces look the same from all directions. The methods get a sixteenth of the "
            "truth's samples. In `living-room` much of the light at the objects is a sunset that the capture point does "
            "not see through the windows: `difference` takes it from the visible sky beside it. With 96 samples, two "
            "seeds and the noise subtracted, objects are 1.2 % too dark, and the error of 8x8 means is 7.4 % on them and "
            "9.6 % on influenced pixels. (`envpath` was measured before it did so.)\n"
        )
    for table in tables:
        yield f"**{table['title']}**\n"
        yield _table(table["head"], table["rows"])


def _captures() -> Iterator[str]:
    """Several captures of one room, which ``python -m bench captures`` measured."""
    tables = json.loads(CAPTURES.read_text()) if CAPTURES.is_file() else {}
    if tables:
        yield "## Several captures of one room\n"
        yield (
            "Measured with `python -m bench captures --quick --panorama-samples 1024`. In the L-shaped room a camera "
            "travels from the first capture point around the corner into the far leg, of which the first capture sees "
            "almost nothing; the second is there, the third in the corner. The flat is furnished, and a bookcase divides "
            "it: the camera moves past it into the area behind. The second capture is in the passage, the third behind "
            "the bookcase; only the far sides of furniture are seen by none. Errors are root mean squares over all "
            "frames. The change from frame to frame is that of plates 4 cm apart in the middle of the path, the 99th "
            "percentile over the pixels. Its excess over the truth's is the noise of the panoramas, which moves with the "
            "surfaces: with 64 samples instead of 1024, two and three captures of the L-shaped room have 1.46 and 1.37.\n"
        )
    for table in tables.values():
        yield f"**{table['title']}**\n"
        yield _table(table["head"], table["rows"])
        yield f"![Truth, and one, two and three captures, along the way](pictures/{table['picture']})\n"


def _boxes() -> Iterator[str]:
    """The first guess of a room's box, which ``python -m bench boxes`` measured."""
    table = json.loads(BOXES.read_text()) if BOXES.is_file() else None
    if table:
        yield "## The guessed box of a room\n"
        yield (
            "Measured with `python -m bench boxes`: the box that `lightdepth new` fits, given the camera's height. Walls "
            "of photographed rooms were measured by hand (`bench/places/photographed_rooms.toml`). The virtual rooms are "
            "the benchmark's four box-shaped places, path-traced and denoised. The furnished rooms are random, painted "
            "instead of lit, and harder than most: furniture hides much of their floor's edges.\n"
        )
        yield f"**{table['title']}**\n"
        yield _table(table["head"], table["rows"])


def _fireflies() -> Iterator[str]:
    """What denoising leaves of fireflies, which ``python -m bench fireflies`` measured."""
    table = json.loads(FIREFLIES.read_text()) if FIREFLIES.is_file() else None
    if table:
        yield "## Fireflies and lost light\n"
        yield (
            "Measured with `python -m bench fireflies`: first pictures of `lightdepth new` with chrome and grey balls or "
            "rough silver and matte red ones, 320 x 200 pixels. A firefly is twice as bright as 128 samples of another "
            "seed, and brighter by a tenth of the picture's mean. The light is that added by denoising, as a share of the "
            "layer. The error is relative to the mean, with radiance clipped at the screen's white: in such small "
            "pictures the lamps and the sun in the chrome ball are smaller than a pixel, and the denoiser softens them.\n"
        )
        yield f"**{table['title']}**\n"
        yield _table(table["head"], table["rows"])


def _cost(cost: dict[str, Any]) -> Iterator[str]:
    """What rendering costs."""
    yield "## Cost\n"
    for table in cost["tables"]:
        yield f"**{table['title']}**\n"
        yield _table(table["head"], table["rows"])

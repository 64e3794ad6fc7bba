"""`lightdepth doctor`: does everything work on this machine?"""

from __future__ import annotations

import platform
import shutil
from typing import Annotated, Literal

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from lightdepth.errors import LightdepthError, SetupError

HUGIN_TOOLS = ("pto_gen", "pto_var", "cpfind", "cpclean", "autooptimiser", "pano_modify")
LARGEST_ERROR = 0.01
"""Of the trial's mean radiance; its noise stays below one half of that."""


def doctor(
    device: Annotated[Literal["auto", "cpu", "cuda"], typer.Option(help="Where to render the trial.")] = "auto",
) -> None:
    """Report what is installed, and render a tiny test picture.

    The exit status is 2 where something that rendering needs is missing, too old or broken.

    Example: lightdepth doctor
    """
    from lightdepth.kernel import diagnosis

    versions = diagnosis.package_versions()
    denoiser = versions.pop("mitsuba-oidn")
    cache = diagnosis.kernel_cache()
    missing = [tool for tool in HUGIN_TOOLS if shutil.which(tool) is None]
    facts = {
        "Python": f"{platform.python_version()} on {platform.system()} {platform.machine()}",
        **{package: version or "not installed" for package, version in versions.items()},
        "Open Image Denoise": denoiser or "not installed (only --denoise needs it): pip install mitsuba-oidn",
        "Hugin tools": f"not found: {', '.join(missing)} (only stitching needs them)" if missing else "found",
        "processors": str(diagnosis.usable_processors()),
        "memory": f"{diagnosis.memory() / 2**30:.1f} GiB",
        "kernel cache": str(cache) if cache else "off, as HOME is not set: every start compiles again",
    }
    _print(facts)
    problem: LightdepthError | None = None
    try:
        path, version = diagnosis.libllvm()
        _print({"libLLVM": f"{version} ({path})"})
    except SetupError as error:
        if device == "cpu" or device == "auto":
            problem = error
    if problem is None:
        trial = diagnosis.trial_render(device)
        _print(
            {
                "variants": ", ".join(v for v in diagnosis.compiled_variants() if v.endswith("_ad_rgb")),
                "trial": f"{trial.variant}, {trial.seconds:.2f} s",
            }
        )
        if trial.error > LARGEST_ERROR:
            problem = SetupError(f"the trial's mean radiance is wrong by {100 * trial.error:.1f} %")
    if problem is not None:
        raise problem
    Console(highlight=False).print("[green]everything that rendering needs works[/]")


def _print(facts: dict[str, str]) -> None:
    table = Table.grid(padding=(0, 2))
    table.add_column(min_width=18)
    table.add_column(overflow="fold")
    for name, fact in facts.items():
        table.add_row(Text(name), Text(fact))
    Console(highlight=False).print(table)

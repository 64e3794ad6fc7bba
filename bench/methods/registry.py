"""The compared methods by name, and how many samples each is given."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from bench.methods.debevec import debevec
from bench.methods.job import PEERS_PYTHON, Rendered, Shot, run_worker
from bench.methods.own import own


@dataclass(frozen=True)
class Method:
    """A way of rendering.

    Attributes:
        label: for tables.
        render: from a shot, sample counts, whether to denoise, and the seed to the images, in turn.
        settings: its best settings, for the report.
        peer: needs ``make bench-peers``.
    """

    label: str
    render: Callable[[Shot, Sequence[int], bool, int], list[Rendered]]
    settings: str
    peer: bool = False


def _own(name: str, shot: Shot, budgets: Sequence[int], denoise: bool, seed: int) -> list[Rendered]:
    return own(shot, name, budgets, denoise, seed)


def _debevec(shot: Shot, budgets: Sequence[int], denoise: bool, seed: int) -> list[Rendered]:
    return [debevec(shot, samples, denoise, seed) for samples in budgets]


def _worker(script: str, workflow: str, shot: Shot, budgets: Sequence[int], denoise: bool, seed: int) -> list[Rendered]:
    renders = [{"workflow": workflow, "samples": samples, "denoise": denoise, "seed": seed} for samples in budgets]
    return run_worker(script, shot, renders)


OWN_METHODS = ("difference", "directional", "envpath")
"""The product's own, which are also measured with wrong models of the places."""
METHODS: dict[str, Method] = {
    "difference": Method("lightdepth `difference`", partial(_own, "difference"), "defaults, 8 bounces"),
    "directional": Method("lightdepth `directional`", partial(_own, "directional"), "defaults, 8 bounces"),
    "envpath": Method("lightdepth `envpath` (the paper's)", partial(_own, "envpath"), "defaults, 8 bounces"),
    "debevec": Method(
        "Debevec two-pass, Mitsuba `path`",
        _debevec,
        "photograph, its lamps painted over, baked into area lights (256 texels a rectangle), lamps with their true "
        "radiance, ground with its true "
        "albedo, the same seed in both passes, multijittered samples, 8 bounces",
    ),
    "cycles_proxy": Method(
        "Cycles, emissive proxy, two renders",
        partial(_worker, "cycles_worker.py", "proxy"),
        "photograph, its lamps painted over, projected in the shader, lamps with their true radiance sampled from "
        "their front, light tree, "
        "ground with its true albedo, no clamping, no glossy filter, caustics on, the same seed in both, 8 bounces",
        peer=True,
    ),
    "cycles_catcher": Method(
        "Cycles, HDRI and shadow catcher",
        partial(_worker, "cycles_worker.py", "catcher"),
        "importance map of twice the panorama's width, catcher pass multiplied onto the plate, ground with its true "
        "albedo, no clamping, no glossy filter, caustics on, 8 bounces",
        peer=True,
    ),
    "luxcore_catcher": Method(
        "LuxCore, HDRI and shadow catcher",
        partial(_worker, "luxcore_worker.py", "catcher"),
        "PATHCPU with the Sobol sampler, ground with its true albedo as catcher, no clamping, 9 path vertices",
        peer=True,
    ),
}
"""A new method is a line here."""


def available() -> dict[str, Method]:
    """The methods that can run here: those of the product that exist, and the peers where they are installed."""
    from lightdepth.preparation import METHODS as OWN

    return {
        name: method
        for name, method in METHODS.items()
        if (name not in OWN_METHODS or name in OWN) and (not method.peer or PEERS_PYTHON.is_file())
    }

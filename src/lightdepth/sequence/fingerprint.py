"""Whether a frame on disk is the one that would be rendered now."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from enum import StrEnum
from fractions import Fraction
from importlib import metadata
from pathlib import Path

import numpy as np

from lightdepth.errors import InputError
from lightdepth.files import exists
from lightdepth.film.layers import FILE_LAYOUT, Structure
from lightdepth.images.exr import ExrReader
from lightdepth.scene.identity import digest, scene_digest, view_digest
from lightdepth.scene.model import CameraView, Scene
from lightdepth.session.session import Job

FINGERPRINT = "fingerprint"
"""Key of a frame's metadata: digest of its inputs."""
_ATTRIBUTE = f"lightdepth:{FINGERPRINT}"


class State(StrEnum):
    """What is on disk of a frame."""

    CURRENT = "current"
    """What would be rendered now."""
    MISSING = "missing"
    OUTDATED = "outdated"
    """Made from another scene, other settings or files, or by another version."""
    DAMAGED = "damaged"
    """Not whole, or no frame."""


def frame_seed(seed: int, frame: int) -> int:
    """Seed of a frame: another one for each, or the noise would stand on the screen like dirt on the lens."""
    return int(np.random.SeedSequence([seed, frame]).generate_state(1)[0])


def fingerprint(
    scene: Scene,
    view: CameraView,
    job: Job,
    layers: Collection[str] | None,
    rate: Fraction,
    structure: Structure = "multipart",
    shutter: tuple[float, int] | None = None,
    motion: Sequence[tuple[Scene, CameraView]] = (),
) -> str:
    """Digest of all that decides a frame.

    Args:
        scene: at the frame.
        view: the camera, at the frame.
        job: its settings; the seed is that of the frame.
        layers: that are written.
        rate: frames per second, which the file states.
        structure: of the file.
        shutter: how long it is open and how many instants are rendered; ``None`` where the frame is sharp.
        motion: the scene and the camera where it opens and where it closes.
    """
    settings = scene.render
    chosen = (
        settings.samples if job.samples is None else job.samples,
        settings.noise if job.noise is None else job.noise,
        job.method,
        job.seed,
        job.draft,
        job.denoise,
        None if layers is None else sorted(layers),
        str(rate),
        structure,
        FILE_LAYOUT,
        metadata.version("lightdepth"),
    )
    sharp = scene_digest(scene), view_digest(view), chosen
    if shutter is None:
        return digest(*sharp)
    return digest(*sharp, shutter, [(scene_digest(other), view_digest(its_view)) for other, its_view in motion])


def state_of(file: Path, wanted: str) -> State:
    """What is on disk of a frame whose fingerprint would be ``wanted``."""
    if not exists(file):
        return State.MISSING
    try:
        with ExrReader(file) as reader:
            if not reader.is_whole():
                return State.DAMAGED
            found = reader.headers[0].attributes.get(_ATTRIBUTE)
    except InputError:
        return State.DAMAGED if exists(file) else State.MISSING
    return State.CURRENT if found == wanted else State.OUTDATED

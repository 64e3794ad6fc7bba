"""The real place, guessed: a box fitted to a room's edges, a dome, or the ground under the sky."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lightdepth.parameters.quickstart import DEFAULT, QuickstartParameters
from lightdepth.parameters.reconstruction import DEFAULT as RECONSTRUCTION
from lightdepth.parameters.reconstruction import BoxParameters
from lightdepth.quickstart.kind import is_open, open_sky_evidence
from lightdepth.quickstart.pose import GuessedPose
from lightdepth.reconstruction.layout import ground, room
from lightdepth.reconstruction.room_box import fit_room_box
from lightdepth.scene.model import Mesh, RealSurface, Role

FloatArray = NDArray[np.float64]
Kind = Literal["box", "dome", "ground"]


@dataclass(frozen=True)
class GuessedPlace:
    """The place's surfaces.

    Attributes:
        kind: what was guessed.
        surfaces: world, metres, the first of them the floor.
        sky: what they leave open is sky.
        words: what was guessed and how sure it is, a sentence.
        low: least x and y of the free floor, metres, shape (2,).
        high: greatest x and y of the free floor, metres, shape (2,).
    """

    kind: Kind
    surfaces: list[RealSurface]
    sky: bool
    words: str
    low: FloatArray
    high: FloatArray


def guess_place(
    radiance: NDArray[np.float32],
    pose: GuessedPose,
    kind: Kind | None = None,
    tuned: QuickstartParameters = DEFAULT,
    boxes: BoxParameters = RECONSTRUCTION.box,
) -> GuessedPlace:
    """Guess the surfaces of the place; the floor is at height 0.

    Args:
        radiance: the panorama, linear RGB, finite, shape (height, 2 height, 3).
        pose: of the panorama.
        kind: what the user says it is; ``None`` finds out.
        tuned: how it is guessed.
        boxes: how a box is fitted to a room's edges.
    """
    if kind is None and is_open(radiance, pose.rotation, pose.frame is not None, tuned):
        kind = "ground"
    if kind == "ground":
        return _ground(radiance, pose, tuned)
    if pose.frame is None or kind == "dome":
        why = "as asked for" if kind == "dome" else "guess: no room's edges were found to fit a box to"
        return _dome(pose, why, tuned)
    box = fit_room_box(radiance, pose.frame, pose.height, boxes)
    if kind is None and not box.is_likely:
        return _dome(
            pose, f"guess: no box fits the place's edges (only {100 * box.evidence:.0f} % of them are seen)", tuned
        )
    low, high = box.low * pose.height, box.high * pose.height
    corners = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
    size = f"{high[0] - low[0]:.2f} x {high[1] - low[1]:.2f} m, {high[2] + pose.height:.2f} m high"
    words = f"guess: a box of {size}, fitted to edges; {100 * box.evidence:.0f} % of its edges are seen in the picture"
    return GuessedPlace("box", room(corners, 0.0, float(high[2] + pose.height)), False, words, low[:2], high[:2])


def _ground(radiance: NDArray[np.float32], pose: GuessedPose, tuned: QuickstartParameters) -> GuessedPlace:
    share = open_sky_evidence(radiance, pose.rotation, tuned)
    words = (
        f"guess: flat ground under the sky, as in the open; {100 * share:.0f} % of what is above the horizon has the "
        "colour of the sky"
    )
    reach = np.full(2, 0.5 * tuned.ground_radius)
    surfaces = ground(np.array([0.0, 0.0, pose.height]), 0.0, tuned.ground_radius)
    return GuessedPlace("ground", surfaces, True, words, -reach, reach)


def _dome(pose: GuessedPose, why: str, tuned: QuickstartParameters) -> GuessedPlace:
    radius, height = tuned.dome_radius * pose.height, tuned.dome_height * pose.height
    words = f"{why}; a dome of {radius:.1f} m radius, {height:.1f} m high, that bends into the ground"
    flat = (1.0 - tuned.fillet) * radius
    reach = np.full(2, flat / np.sqrt(2.0))
    return GuessedPlace("dome", dome(pose.height, radius, height, tuned.fillet), False, words, -reach, reach)


def dome(camera_height: float, radius: float, height: float, fillet: float = DEFAULT.fillet) -> list[RealSurface]:
    """Flat ground (support) that bends up into a round wall and a vault (environment): closed, seen from inside.

    Args:
        camera_height: of the capture point, which stands over its middle, metres.
        radius: metres.
        height: of its top, metres, more than ``fillet`` of the radius.
        fillet: share of the radius over which the ground bends up into the wall.
    """
    bend = fillet * radius
    flat = radius - bend
    floor = ground(np.array([0.0, 0.0, camera_height]), 0.0, flat)[0]
    turn = np.linspace(0.0, 0.5 * np.pi, 9)[1:]
    vault = np.linspace(0.0, 0.5 * np.pi, 25)[1:-1]
    reach = np.concatenate([[flat], flat + bend * np.sin(turn), radius * np.cos(vault)])
    rise = np.concatenate([[0.0], bend * (1.0 - np.cos(turn)), bend + (height - bend) * np.sin(vault)])
    spokes = 64  # As many as the ground has, so that the two meet without a gap.
    angles = 2.0 * np.pi * np.arange(spokes) / spokes
    rings = np.stack(
        [
            reach[:, None] * np.cos(angles),
            reach[:, None] * np.sin(angles),
            np.broadcast_to(rise[:, None], (len(reach), spokes)),
        ],
        axis=-1,
    )
    vertices = np.concatenate([rings.reshape(-1, 3), [[0.0, 0.0, height]]])
    here, following = np.arange(spokes), (np.arange(spokes) + 1) % spokes
    faces = [
        np.concatenate(
            [
                np.stack([here, here + spokes, following + spokes], axis=1),
                np.stack([here, following + spokes, following], axis=1),
            ]
        )
        + spokes * ring
        for ring in range(len(reach) - 1)
    ]
    last = spokes * (len(reach) - 1)
    faces.append(np.stack([last + here, np.full(spokes, len(vertices) - 1), last + following], axis=1))
    mesh = Mesh(vertices.astype(np.float32), np.concatenate(faces).astype(np.int32))
    renamed = RealSurface("floor", floor.mesh, Role.SUPPORT)
    return [renamed, RealSurface("dome", mesh, Role.ENVIRONMENT)]

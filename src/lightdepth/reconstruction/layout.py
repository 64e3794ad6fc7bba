"""Meshes of a place from a few clicks: floor plan, walls and ceiling, furniture; outdoors the ground.

Faces turn their front to the air: a room's walls inward, a cupboard's sides outward.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lightdepth.calibration.clicks import read_clicks
from lightdepth.errors import InputError
from lightdepth.parameters.reconstruction import DEFAULT, ClickParameters
from lightdepth.reconstruction.hanging import hanging_lamp
from lightdepth.reconstruction.polygon import contains, crossing_sides, signed_area, triangulate
from lightdepth.reconstruction.pose import Pose, on_level
from lightdepth.reconstruction.posed_panorama import PosedPanorama
from lightdepth.reconstruction.sloped_ceiling import ceiling_under, slope_plane, walls_under
from lightdepth.scene.model import Mesh, RealSurface, Role

FloatArray = NDArray[np.float64]

FURNITURE_FORM = (
    "write it as 'NAME: x,y x,y x,y height=METRES', with the name left out if you like, and at the end, where it "
    "applies, 'top=support' (the top of a box receives shadows) and 'clicked=top' (the clicks are the corners of a "
    "box's top)"
)


@dataclass(frozen=True)
class Furniture:
    """One ``--box``, ``--table`` or ``--panel`` as it was written.

    Attributes:
        option: ``--box``, ``--table`` or ``--panel``.
        name: of the surface.
        directions: the clicks, light space, shape (n, 3).
        height: of its top above the floor, metres.
        support: whether its top receives shadows.
        clicked_top: whether the clicks lie at the height of the top instead of on the floor.
    """

    option: str
    name: str
    directions: FloatArray
    height: float
    support: bool
    clicked_top: bool

    def corners(self, pose: Pose, floor: float, tuned: ClickParameters = DEFAULT.clicks) -> FloatArray:
        """The clicked points' world x and y, metres, shape (n, 2).

        Raises:
            InputError: a click lies on the wrong side of the horizon.
        """
        level = floor + self.height if self.clicked_top else floor
        return on_level(self.directions, pose, level, f"{self.option} {self.name}", tuned)


@dataclass(frozen=True)
class Clicked:
    """What was clicked, as it was written on the command line.

    Attributes:
        floor: the floor's corners, in order around it; ``None`` outdoors.
        ceiling_corner: one corner of the ceiling, or ``None``.
        boxes: furniture.
        tables: table tops.
        panels: upright sheets.
        slopes: sloped ceilings, each by clicks where it meets walls.
        lamps: that hang from the ceiling.
    """

    floor: str | None = None
    ceiling_corner: str | None = None
    boxes: Sequence[str] = ()
    tables: Sequence[str] = ()
    panels: Sequence[str] = ()
    slopes: Sequence[str] = ()
    lamps: Sequence[str] = ()


def surfaces_from_layout(
    clicked: Clicked,
    panorama: PosedPanorama,
    *,
    camera_height: float | None = None,
    ceiling: float | None = None,
    ground_radius: float | None = None,
    angles: bool = False,
    tuned: ClickParameters = DEFAULT.clicks,
) -> list[RealSurface]:
    """Make a place from clicks.

    Args:
        clicked: the clicks.
        panorama: the panorama and its pose.
        camera_height: of the capture point above the floor, metres; ``None`` puts the floor at z = 0.
        ceiling: height of its level part above the floor, metres; ``None`` takes it from the clicked corner, if there is
            one.
        ground_radius: of a ground disk, metres, instead of a room; ``None`` makes a room.
        angles: clicks are degrees instead of pixels.
        tuned: how exactly clicks must fit together.

    Returns:
        The surfaces, world, metres: closed, or outdoors open to the sky.

    Raises:
        InputError: something was clicked or written wrong.
    """
    pose = panorama.pose
    size = None if angles or panorama.radiance is None else panorama.radiance.shape[:2]
    floor = 0.0 if camera_height is None else float(pose.position[2] - camera_height)
    if pose.position[2] <= floor:
        raise InputError(
            f"the capture point is at height {pose.position[2]:g} m and the floor at 0; give --camera-height, or a "
            "pose in which the floor is at height 0"
        )
    planes: list[FloatArray] = []
    if ground_radius is not None:
        surfaces = ground(pose.position, floor, ground_radius)
    else:
        corners = floor_plan(read_clicks(clicked.floor or "", size, "--floor"), pose, floor, tuned)
        if ceiling is not None:
            planes.append(np.array([0.0, 0.0, floor + ceiling]))
        elif clicked.ceiling_corner is not None:
            (click,) = read_clicks(clicked.ceiling_corner, size, "--ceiling-corner", 1)
            planes.append(np.array([0.0, 0.0, ceiling_height(click, corners, pose, tuned)]))
        for text in clicked.slopes:
            what = f"--slope '{text}'"
            planes.append(slope_plane(read_clicks(text, size, what), corners, pose, what, tuned))
        _check_ceiling(planes, corners, pose, floor)
        surfaces = sloped_room(corners, floor, planes) if clicked.slopes else room(corners, floor, planes[0][2])
    for option, texts, make in (
        ("--box", clicked.boxes, box),
        ("--table", clicked.tables, table),
        ("--panel", clicked.panels, panel),
    ):
        for number, text in enumerate(texts, start=1):
            surfaces += make(parse_furniture(text, size, option, number), pose, floor, tuned)
    for number, text in enumerate(clicked.lamps, start=1):
        surfaces += hanging_lamp(text, number, size, pose, floor, planes, tuned)
    names = [surface.name for surface in surfaces]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InputError(f"'{twice}' is the name of two surfaces; names are unique")
    return surfaces


def parse_furniture(text: str, size: tuple[int, int] | None, option: str, number: int) -> Furniture:
    """Read ``NAME: x,y x,y x,y height=METRES [top=support] [clicked=top]``.

    Args:
        text: as it was written.
        size: height and width of the panorama in pixels, or ``None`` where clicks are angles.
        option: ``--box``, ``--table`` or ``--panel``.
        number: which of its kind, from 1, for its name.

    Raises:
        InputError: it is written otherwise, has too few clicks or a height that is not positive.
    """
    what = f"{option} '{text}'"
    name, colon, rest = text.rpartition(":")
    words = rest.split()
    settings = dict(word.split("=", 1) for word in words if "=" in word)
    unknown = settings.keys() - {"height", "top", "clicked"}
    try:
        height = float(settings.get("height", ""))
    except ValueError:
        height = 0.0
    well_formed = (
        not unknown
        and 0.0 < height < np.inf
        and settings.get("top", "support") == "support"
        and settings.get("clicked", "top") == "top"
        and (not colon or re.fullmatch(r"[A-Za-z0-9][\w-]*", name.strip()))
    )
    if not well_formed:
        raise InputError(f"{what}: {FURNITURE_FORM}")
    directions = read_clicks(" ".join(word for word in words if "=" not in word), size, what)
    fewest = 2 if option == "--panel" else 3
    if len(directions) < fewest:
        raise InputError(f"{what}: {len(directions)} clicks found; at least {fewest} are needed")
    return Furniture(
        option,
        name.strip() or f"{option.removeprefix('--')}-{number}",
        directions,
        height,
        support=option == "--table" or "top" in settings,
        clicked_top=option == "--table" or "clicked" in settings,
    )


def floor_plan(directions: FloatArray, pose: Pose, floor: float, tuned: ClickParameters = DEFAULT.clicks) -> FloatArray:
    """The floor's corners from their clicks, counter-clockwise seen from above.

    Args:
        directions: light space, shape (n, 3), in order around the room, either way round.
        pose: of the panorama.
        floor: height of the floor, world z, metres.
        tuned: how far from the horizon clicks must lie.

    Returns:
        World x and y, metres, shape (n, 2).

    Raises:
        InputError: fewer than three corners, sides that cross, or a plan that does not hold the capture point.
    """
    if len(directions) < 3:
        raise InputError(f"--floor: {len(directions)} corners found; at least 3 are needed")
    corners = on_level(directions, pose, floor, "--floor", tuned)
    crossing = crossing_sides(corners)
    if crossing is not None:
        i, j = crossing
        raise InputError(
            f"--floor: the side from corner {i + 1} crosses the side from corner {j + 1}; click the "
            "corners in order around the floor"
        )
    if not contains(corners, pose.position[:2]):
        raise InputError(
            "--floor: the capture point does not stand on the floor that was clicked; is a corner missing?"
        )
    return corners if signed_area(corners) > 0 else corners[::-1].copy()


def ceiling_height(
    direction: FloatArray, corners: FloatArray, pose: Pose, tuned: ClickParameters = DEFAULT.clicks
) -> float:
    """Height of the ceiling from one of its corners, which stands plumb above a corner of the floor.

    Args:
        direction: the clicked ceiling corner, light space, shape (3,).
        corners: the floor plan, world, metres, shape (n, 2).
        pose: of the panorama.
        tuned: how near to plumb it must stand.

    Returns:
        World z, metres.

    Raises:
        InputError: no floor corner lies below the click, or the click lies below the horizon.
    """
    world = pose.to_world(direction)
    elevation = np.degrees(np.arcsin(np.clip(world[2], -1.0, 1.0)))
    if elevation < tuned.horizon:
        raise InputError(
            f"--ceiling-corner: the click looks {elevation:+.1f} degrees from the horizon; it must be above"
        )
    offsets = corners - pose.position[:2]
    azimuths = np.degrees(np.arctan2(offsets[:, 0], offsets[:, 1]) - np.arctan2(world[0], world[1]))
    beside = np.abs((azimuths + 180.0) % 360.0 - 180.0)
    nearest = int(np.argmin(beside))
    if beside[nearest] > tuned.ceiling_corner:
        raise InputError(
            f"--ceiling-corner: the nearest floor corner is {beside[nearest]:.1f} degrees of azimuth away; click a "
            f"ceiling corner within {tuned.ceiling_corner:g} degrees of a corner of --floor"
        )
    return float(pose.position[2] + np.linalg.norm(offsets[nearest]) * np.tan(np.radians(elevation)))


def room(corners: FloatArray, floor: float, ceiling: float) -> list[RealSurface]:
    """Floor (support), walls and ceiling (environment) over a floor plan: closed.

    Args:
        corners: the plan, counter-clockwise, world, metres, shape (n, 2).
        floor: height of the floor, world z, metres.
        ceiling: height of the ceiling, world z, metres.
    """
    upward = triangulate(corners)
    return [
        RealSurface("floor", _level(corners, floor, upward), Role.SUPPORT),
        RealSurface("walls", _upright(corners[::-1], floor, ceiling, closed=True), Role.ENVIRONMENT),
        RealSurface("ceiling", _level(corners, ceiling, upward[:, ::-1]), Role.ENVIRONMENT),
    ]


def sloped_room(corners: FloatArray, floor: float, planes: Sequence[FloatArray]) -> list[RealSurface]:
    """The same under the lowest of several planes.

    Args:
        corners: the plan, counter-clockwise, world, metres, shape (n, 2).
        floor: height of the floor, world z, metres.
        planes: each ``(a, b, c)`` of ``z = a x + b y + c``, above the floor everywhere on the plan.
    """
    walls, ceiling = walls_under(planes, corners, floor), ceiling_under(planes, corners)
    return [
        RealSurface("floor", _level(corners, floor, triangulate(corners)), Role.SUPPORT),
        RealSurface("walls", Mesh(walls[0].astype(np.float32), walls[1]), Role.ENVIRONMENT),
        RealSurface("ceiling", Mesh(ceiling[0].astype(np.float32), ceiling[1]), Role.ENVIRONMENT),
    ]


def _check_ceiling(planes: Sequence[FloatArray], corners: FloatArray, pose: Pose, floor: float) -> None:
    """Refuse a ceiling below the camera or below the floor."""
    if not planes:
        raise InputError("the ceiling is not known: give --ceiling, --ceiling-corner or --slope")
    above = min(float(plane @ [*pose.position[:2], 1.0]) for plane in planes)
    if above <= pose.position[2]:
        raise InputError(
            f"--ceiling: the ceiling is {above - floor:g} m above the floor, but the camera is "
            f"{pose.position[2] - floor:g} m above it; the ceiling must be higher"
        )
    for number, corner in enumerate(corners, start=1):
        height = min(float(plane @ [*corner, 1.0]) for plane in planes) - floor
        if height < 0.0:
            raise InputError(
                f"--slope: at the floor's corner {number} (x {corner[0]:.2f}, y {corner[1]:.2f} m) the ceiling would be "
                f"{-height:.2f} m below the floor; click where the slope meets the walls"
            )


def ground(position: FloatArray, floor: float, radius: float) -> list[RealSurface]:
    """A level disk below the capture point that receives shadows; finer near its centre.

    Args:
        position: capture point, world, metres, shape (3,).
        floor: height of the ground, world z, metres.
        radius: metres.
    """
    spokes = 64
    radii = np.geomspace(min(0.25 * (position[2] - floor), 0.1 * radius), radius, 16)
    angles = 2.0 * np.pi * np.arange(spokes) / spokes
    circles = radii[:, None, None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    points = np.concatenate([[[0.0, 0.0]], circles.reshape(-1, 2)]) + position[:2]
    here, following = np.arange(spokes), (np.arange(spokes) + 1) % spokes
    fan = np.stack([np.zeros(spokes, int), 1 + here, 1 + following], axis=1)
    ring = np.concatenate(
        [
            np.stack([here, here + spokes, following + spokes], axis=1),
            np.stack([here, following + spokes, following], axis=1),
        ]
    )
    faces = np.concatenate([fan, *(1 + spokes * i + ring for i in range(len(radii) - 1))])
    return [RealSurface("ground", _level(points, floor, faces), Role.SUPPORT)]


def box(furniture: Furniture, pose: Pose, floor: float, tuned: ClickParameters = DEFAULT.clicks) -> list[RealSurface]:
    """A piece of furniture that stands on the floor; three clicked corners are those of a parallelogram.

    Raises:
        InputError: its sides cross, or a click lies on the wrong side of the horizon.
    """
    corners = _outline(furniture, pose, floor, tuned)
    top = floor + furniture.height
    lid = _level(corners, top, triangulate(corners))
    sides = _upright(corners, floor, top, closed=True)
    if furniture.support:
        return [
            RealSurface(f"{furniture.name}-top", lid, Role.SUPPORT),
            RealSurface(furniture.name, sides, Role.ENVIRONMENT),
        ]
    return [RealSurface(furniture.name, _joined([lid, sides]), Role.ENVIRONMENT)]


def table(furniture: Furniture, pose: Pose, floor: float, tuned: ClickParameters = DEFAULT.clicks) -> list[RealSurface]:
    """A table's top without its legs; three clicked corners are those of a parallelogram. It receives shadows.

    Raises:
        InputError: its sides cross, or a click lies on the wrong side of the horizon.
    """
    corners = _outline(furniture, pose, floor, tuned)
    return [RealSurface(furniture.name, _level(corners, floor + furniture.height, triangulate(corners)), Role.SUPPORT)]


def panel(furniture: Furniture, pose: Pose, floor: float, tuned: ClickParameters = DEFAULT.clicks) -> list[RealSurface]:
    """An upright sheet, like a screen or a curtain, over a clicked line; its front looks at the capture point.

    Raises:
        InputError: a click lies on the wrong side of the horizon.
    """
    line = furniture.corners(pose, floor, tuned)
    across, seen_from = line[-1] - line[0], pose.position[:2] - line[0]
    if across[0] * seen_from[1] - across[1] * seen_from[0] > 0:
        line = line[::-1]
    return [
        RealSurface(furniture.name, _upright(line, floor, floor + furniture.height, closed=False), Role.ENVIRONMENT)
    ]


def _outline(furniture: Furniture, pose: Pose, floor: float, tuned: ClickParameters) -> FloatArray:
    """The corners counter-clockwise, the fourth of a parallelogram added where three were clicked."""
    corners = furniture.corners(pose, floor, tuned)
    if len(corners) == 3:
        corners = np.concatenate([corners, [corners[0] + corners[2] - corners[1]]])
    crossing = crossing_sides(corners)
    if crossing is not None:
        raise InputError(
            f"{furniture.option} {furniture.name}: the side from corner {crossing[0] + 1} crosses the side from corner "
            f"{crossing[1] + 1}; click the corners in order"
        )
    return corners if signed_area(corners) > 0 else corners[::-1].copy()


def _level(points: FloatArray, height: float, faces: NDArray[np.integer]) -> Mesh:
    vertices = np.column_stack([points, np.full(len(points), height)])
    return Mesh(vertices.astype(np.float32), np.ascontiguousarray(faces, dtype=np.int32))


def _upright(line: FloatArray, bottom: float, top: float, *, closed: bool) -> Mesh:
    """Upright rectangles over the sides of a line; around a counter-clockwise polygon they look outward."""
    n = len(line)
    vertices = np.concatenate([np.column_stack([line, np.full(n, z)]) for z in (bottom, top)])
    start = np.arange(n if closed else n - 1)
    end = (start + 1) % n
    faces = np.concatenate([np.stack([start, end, end + n], axis=1), np.stack([start, end + n, start + n], axis=1)])
    return Mesh(vertices.astype(np.float32), faces.astype(np.int32))


def _joined(meshes: Sequence[Mesh]) -> Mesh:
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]).astype(np.int32),
    )

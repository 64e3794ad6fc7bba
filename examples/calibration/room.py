"""A furnished-looking room, computed, as a panorama whose pose is known: to try `lightdepth calibrate` on.

    python examples/calibration/room.py -o room.exr
    python examples/calibration/room.py --photo plate.png

The second is an ordinary photograph from another place, through a lens that distorts, for `lightdepth calibrate view`.

The world's origin is a corner of the rug, which lies along x for 2 metres and along y for 3. The light is invented;
directions are exact.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from lightdepth.cameras import Perspective
from lightdepth.directions import (
    FloatArray,
    direction_to_latlong,
    euler_rotation,
    look_at_rotation,
    pixel_directions,
)
from lightdepth.images.png import write_png
from lightdepth.images.radiance import write_radiance
from lightdepth.images.tonemapping import auto_exposure, tone_map

POSITION = np.array([1.3, -0.9, 1.55])
ROTATION = np.array([3.0, -2.0, 21.0])
LOW, HIGH = np.array([-1.4, -2.1, 0.0]), np.array([3.6, 4.4, 2.7])
RUG = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 3.0, 0.0], [0.0, 3.0, 0.0]])
"""The rug's corners, counter-clockwise seen from above, world, metres."""
FLOOR = np.array([[x, y, 0.0] for x, y in ((LOW[0], LOW[1]), (HIGH[0], LOW[1]), (HIGH[0], HIGH[1]), (LOW[0], HIGH[1]))])
"""The floor's corners, in the same order."""
DOOR = (0.2, 1.1, 2.05)
"""The door's two sides and its top on the wall at the far end of x, along y and z, metres."""
WINDOW = (0.3, 2.3, 0.9, 2.2)
"""The window's sides, sill and top on the wall at the far end of y, along x and z, metres."""
LAMP = np.array([1.0, 1.5, 2.5])
BAND = 8
"""Rows of a panorama that are computed together."""
PHOTO = Perspective(type="perspective", width=1200, height=800, fov=72, distortion=(-0.16, 0.03))
"""The camera of the ordinary photograph."""
PHOTO_POSITION = np.array([-1.1, -1.7, 1.4])
PHOTO_ROTATION = look_at_rotation(PHOTO_POSITION, [2.5, 2.4, 0.9]) @ euler_rotation([0.0, 2.0, 0.0])


def pixels(
    points: FloatArray, width: int, position: FloatArray = POSITION, rotation: FloatArray = ROTATION
) -> FloatArray:
    """Where world points, shape (..., 3), are in a panorama of some width, shape (..., 2)."""
    u, v = direction_to_latlong((np.asarray(points) - position) @ euler_rotation(rotation))
    return np.stack([u * width, v * width / 2], axis=-1)


def radiance(width: int, position: FloatArray = POSITION, rotation: FloatArray = ROTATION) -> np.ndarray:
    """The panorama, two samples across each pixel, linear RGB, shape (width / 2, width, 3), float32."""
    directions, to_world = pixel_directions(width, 2 * width), euler_rotation(rotation).T
    picture = np.empty((width // 2, width, 3), np.float32)
    for top in range(0, width // 2, BAND):  # Small arrays stay in the processor's cache.
        colour = _seen(directions[2 * top : 2 * (top + BAND)] @ to_world, position)
        picture[top : top + BAND] = colour.reshape(-1, 2, width, 2, 3).mean(axis=(1, 3))
    return picture


def photo_pixels(points: FloatArray) -> FloatArray:
    """Where world points, shape (..., 3), are in the ordinary photograph, shape (..., 2)."""
    film, _ = PHOTO.film_of((np.asarray(points) - PHOTO_POSITION) @ PHOTO_ROTATION)
    return film * PHOTO.resolution


def photo(width: int = PHOTO.width) -> np.ndarray:
    """The ordinary photograph, some pixels wide, two samples across each pixel, for the screen, uint8."""
    height = width * PHOTO.height // PHOTO.width
    x, y = (np.arange(2 * width) + 0.5) / (2 * width), (np.arange(2 * height) + 0.5) / (2 * height)
    film = np.stack(np.broadcast_arrays(x[None, :], y[:, None]), axis=-1)
    colour = _seen(PHOTO.directions_of(film) @ PHOTO_ROTATION.T, PHOTO_POSITION)
    picture = colour.reshape(height, 2, width, 2, 3).mean(axis=(1, 3)).astype(np.float32)
    return tone_map(picture, auto_exposure(picture))


def photo_lines() -> list[tuple[str, FloatArray]]:
    """Edges that the photograph shows, four points along each, from minus to plus: option and points, shape (4, 3)."""
    start, end, top = DOOR
    left, right, sill, head = WINDOW
    x, y, z = HIGH
    ends = {
        "x-line": [([0.4, 0, 0], [2, 0, 0]), ([0, 3, 0], [2, 3, 0]), ([left, y, sill], [right, y, sill])],
        "y-line": [([2, 0.1, 0], [2, 3, 0]), ([x, start, top], [x, end, top]), ([x, 0.1, 0], [x, 4.2, 0])],
        "z-line": [([x, start, 0], [x, start, top]), ([x, end, 0], [x, end, top]), ([left, y, sill], [left, y, head])],
    }
    ends["z-line"].append(([x, y, 0], [x, y, z - 0.8]))
    along = np.linspace(0.0, 1.0, 4)[:, None]
    return [
        (name, np.array(low) + along * (np.array(high) - np.array(low)))
        for name, pairs in ends.items()
        for low, high in pairs
    ]


def _seen(directions: FloatArray, position: FloatArray) -> FloatArray:
    """Radiance from directions, shape (height, width, 3), at a position."""
    with np.errstate(divide="ignore"):
        to_low, to_high = (LOW - position) / directions, (HIGH - position) / directions
    distance = np.where(directions > 0, to_high, to_low)
    axis = np.argmin(distance, axis=-1)
    points = position + np.take_along_axis(distance, axis[..., None], axis=-1) * directions
    level = axis == 2
    colour = np.empty(points.shape)
    colour[level] = _floor_and_ceiling(points[level])
    colour[~level] = _walls(points[~level], axis[~level])
    return colour


def _floor_and_ceiling(points: FloatArray) -> FloatArray:
    x, y, z = np.moveaxis(points, -1, 0)
    plank = np.floor(x / 0.14)
    tone = 0.75 + 0.25 * np.modf(np.abs(np.sin(12.9 * plank + 78.2 * np.floor((y + 0.37 * plank) / 1.3)) * 437.5))[0]
    gap = np.abs(x / 0.14 - np.round(x / 0.14)) < 0.03
    wood = np.where(gap, 0.35, tone)[..., None] * np.array([0.42, 0.27, 0.15])
    edge = np.minimum(np.minimum(x, 2.0 - x), np.minimum(y, 3.0 - y))
    stripe = np.floor(edge / 0.12) % 3 == 1
    rug = np.where(stripe[..., None], np.array([0.62, 0.52, 0.36]), np.array([0.36, 0.07, 0.08]))
    floor = np.where((edge > 0)[..., None], rug, wood) * _light(points, np.array([0.0, 0.0, 1.0]))
    shade = np.hypot(x - LAMP[0], y - LAMP[1]) < 0.25
    ceiling = np.where(shade[..., None], np.array([9.0, 7.5, 5.5]), 0.5 + 0.0 * points)
    return np.where((z < 1.0)[..., None], floor, ceiling)


def _walls(points: FloatArray, axis: FloatArray) -> FloatArray:
    x, y, z = np.moveaxis(points, -1, 0)
    along_x, far = axis == 1, np.where(axis == 1, y > 1.0, x > 1.0)
    normal = np.where(along_x[..., None], np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0]))
    normal = np.where(far[..., None], -normal, normal)
    wall = np.where(along_x[..., None], np.array([0.62, 0.6, 0.54]), np.array([0.5, 0.57, 0.56]))
    wall = np.where((z < 0.1)[..., None], np.array([0.8, 0.8, 0.78]), wall)
    start, end, top = DOOR
    door = ~along_x & far & (y > start) & (y < end) & (z < top)
    panel = (np.abs((y - start) / (end - start) - 0.5) < 0.34) & (np.abs(np.modf(z / 1.0)[0] - 0.5) < 0.36)
    wood = np.where(panel[..., None], np.array([0.3, 0.17, 0.09]), np.array([0.4, 0.24, 0.13]))
    wall = np.where(door[..., None], wood, wall)
    picture = ~along_x & ~far & (np.abs(y - 1.6) < 0.7) & (np.abs(z - 1.5) < 0.45)
    frame = picture & ((np.abs(y - 1.6) > 0.64) | (np.abs(z - 1.5) > 0.39))
    wall = np.where(picture[..., None], np.stack([0.2 + 0.0 * y, 0.25 + 0.15 * z, 0.5 - 0.1 * z], axis=-1), wall)
    wall = np.where(frame[..., None], np.array([0.08, 0.06, 0.05]), wall)
    lit = wall * _light(points, normal)
    left, right, sill, head = WINDOW
    across, up = (x - left) / (right - left), (z - sill) / (head - sill)
    window = along_x & far & (across > 0) & (across < 1) & (up > 0) & (up < 1)
    bars = (
        np.minimum.reduce([np.abs(across - k / 2) * 2 for k in range(3)] + [np.abs(up - k / 2) for k in range(3)])
        < 0.04
    )
    sky = np.stack([5.0 + 3.0 * up, 6.0 + 4.0 * up, 7.5 + 5.0 * up], axis=-1)
    return np.where(window[..., None], np.where(bars[..., None], 0.55, sky), lit)


def _light(points: FloatArray, normal: FloatArray) -> FloatArray:
    """Irradiance / pi of a lamp, of a window taken as a point, and from all around; it looks like a room's."""
    total = 0.12 * np.ones(points.shape[:-1])
    window = np.array([np.mean(WINDOW[:2]), HIGH[1] - 0.3, np.mean(WINDOW[2:])])
    for source, power in ((LAMP, 0.9), (window, 2.2)):
        toward = source - points
        square = np.sum(toward**2, axis=-1)
        total = total + power * np.clip(np.sum(toward * normal, axis=-1), 0.0, None) / (0.3 + square) ** 1.5
    return total[..., None]


def main() -> None:
    """Write the panorama and say what can be clicked in it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=Path("room.exr"), help="panorama to write (.exr or .hdr)")
    parser.add_argument("--photo", type=Path, help="write the ordinary photograph instead (.png)")
    parser.add_argument("--width", type=int, default=2048, help="its width in pixels")
    options = parser.parse_args()
    if options.photo is not None:
        write_png(options.photo, photo())
        print(f"position {PHOTO_POSITION}, fov {PHOTO.fov}, distortion {PHOTO.distortion}")
        for name, points in photo_lines():
            print(f'--{name} "{" ".join(f"{x:.0f},{y:.0f}" for x, y in photo_pixels(points))}"')
        return
    write_radiance(options.output, radiance(options.width))

    def clicks(points: list[list[float]] | FloatArray) -> str:
        return " ".join(f"{x:.0f},{y:.0f}" for x, y in pixels(np.array(points), options.width))

    print(f"position {POSITION}, rotation {ROTATION}")
    print(f'--rectangle "{clicks(RUG)}" --width 2 --length 3')
    start, end, top = DOOR
    for y in (start, end):
        print(f'--vertical "{clicks([[HIGH[0], y, 0.0], [HIGH[0], y, top]])}"')
    for x, y in ((LOW[0], HIGH[1]), (HIGH[0], HIGH[1]), (LOW[0], LOW[1])):
        print(f'--vertical "{clicks([[x, y, 0.0], [x, y, HIGH[2]]])}"')
    print(f'--heading "{clicks(POSITION + np.array([[0.0, 2.0, 0.0]]))}"')


if __name__ == "__main__":
    main()

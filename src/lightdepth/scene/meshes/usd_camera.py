"""Cameras of USD files: where they are, which way they look, and how wide."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
from pxr import Gf, Usd, UsdGeom

from lightdepth.errors import InputError, warn
from lightdepth.scene.meshes.file_camera import Y_UP_TO_Z_UP, FileCamera, listed, turned
from lightdepth.scene.meshes.usd_file import UsdFile


def read_camera(path: Path, name: str | None, animation: str | None, time: float, loop: bool) -> FileCamera:
    """A camera out of a USD file; see :func:`~lightdepth.scene.camera_file.read_camera`.

    ``name`` is that of its prim, or the path of it.
    """
    try:
        status = path.stat()
        file = _opened(path, status.st_mtime_ns, status.st_size)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    with file.reporting():
        prim = _found(file, name)
        return _read(file, prim, file.time(animation, time, loop))


@lru_cache(maxsize=4)
def _opened(path: Path, _changed: int, _size: int) -> UsdFile:
    """A file, opened once for all frames."""
    noted: set[str] = set()

    def note(message: str) -> None:
        if message not in noted:
            noted.add(message)
            warn(f"{path}: {message}")

    return UsdFile(path, note)


def _read(file: UsdFile, prim: Usd.Prim, time: Usd.TimeCode) -> FileCamera:
    camera = UsdGeom.Camera(prim).GetCamera(time)
    if camera.projection != Gf.Camera.Perspective:
        raise InputError(f"{file.path}: {prim.GetPath()} is not a perspective camera; only these are read")
    if camera.horizontalApertureOffset or camera.verticalApertureOffset:
        file.note(f"{prim.GetPath()}: the offset of its aperture is left out; shift in the scene file does the same")
    if camera.fStop:
        file.note(
            f"{prim.GetPath()}: its depth of field is left out; set aperture and focus_distance in the scene file"
        )
    world = file.to_scene @ np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(time)).T
    rotation = turned(world[:3, :3])
    if rotation is None:
        raise InputError(f"{file.path}: {prim.GetPath()} is scaled to nothing")
    aspect = camera.aspectRatio
    return FileCamera(
        world[:3, 3],
        rotation @ Y_UP_TO_Z_UP.T,
        camera.GetFieldOfView(Gf.Camera.FOVVertical),
        aspect if np.isfinite(aspect) and aspect > 0.0 else None,
    )


def _found(file: UsdFile, name: str | None) -> Usd.Prim:
    prims = Usd.PrimRange(file.stage.GetPseudoRoot(), Usd.TraverseInstanceProxies())
    cameras = [prim for prim in prims if prim.IsA(UsdGeom.Camera)]
    if not cameras:
        raise InputError(f"{file.path}: has no camera")
    called = listed([str(prim.GetPath()) for prim in cameras])
    if name is None:
        if len(cameras) > 1:
            raise InputError(f"{file.path}: has {len(cameras)} cameras, and node must name one of them: {called}")
        return cameras[0]
    for prim in cameras:
        if name in (prim.GetName(), str(prim.GetPath())):
            return prim
    raise InputError(f"{file.path}: has no camera '{name[:100]}'; it has {called}")

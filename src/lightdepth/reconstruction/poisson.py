"""Closed surfaces from oriented points: screened Poisson reconstruction (Kazhdan and Hoppe, 2013) by PyMeshLab.

PyMeshLab runs in a process of its own: it brings an OpenMP whose threads spin, which on a busy machine costs twenty
times the work unless this is set before it is loaded, and a crash in it ends in a message instead of taking the
program along.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import LightdepthError
from lightdepth.packages import require_package
from lightdepth.parameters.reconstruction import DEFAULT, PointParameters
from lightdepth.scene.model import Mesh


def poisson_surface(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    cell: float,
    most_faces: int,
    tuned: PointParameters = DEFAULT.points,
) -> Mesh:
    """A closed surface through points.

    Args:
        points: metres, shape (n, 3).
        normals: unit, into the open, shape (n, 3).
        cell: size of the finest details, metres.
        most_faces: the surface is simplified to this many triangles (quadric edge collapse), where it has more.
        tuned: the volume that the surface is reconstructed in, and how finely at most.

    Returns:
        Triangles that are counter-clockwise seen from the open.

    Raises:
        SetupError: PyMeshLab is not installed.
        LightdepthError: it failed.
    """
    require_package("pymeshlab", "points")
    extent = float(np.ptp(points, axis=0).max())
    halvings = np.round(np.log2(tuned.volume * extent / cell))
    depth = int(np.clip(halvings, tuned.coarsest, tuned.finest))
    centre = points.mean(axis=0)  # PyMeshLab computes in single precision.
    with tempfile.TemporaryDirectory(prefix="lightdepth-") as folder:
        given, made = Path(folder) / "points.npz", Path(folder) / "surface.npz"
        np.savez(
            given,
            points=points - centre,
            normals=normals,
            depth=depth,
            scale=tuned.volume,
            most_faces=most_faces,
        )
        # The child finds its modules where this process does.
        environment = {
            **os.environ,
            "OMP_WAIT_POLICY": "PASSIVE",
            "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
        }
        child = subprocess.run(
            [sys.executable, "-m", "lightdepth.reconstruction.poisson", str(given), str(made)],
            env=environment,
            capture_output=True,
            text=True,
        )
        if child.returncode != 0 or not made.is_file():
            last = (child.stderr or child.stdout).strip().splitlines()[-1:] or ["no message"]
            raise LightdepthError(f"screened Poisson reconstruction failed (status {child.returncode}): {last[0]}")
        with np.load(made) as surface:
            vertices, faces = surface["vertices"] + centre, surface["faces"]
    if len(faces) == 0:
        raise LightdepthError("screened Poisson reconstruction found no surface; are the points of one place?")
    return Mesh(vertices.astype(np.float32), faces.astype(np.int32))


def _reconstruct(given: Path, made: Path) -> None:
    """What the process of its own does."""
    import pymeshlab

    with np.load(given) as data:
        cloud = pymeshlab.Mesh(vertex_matrix=data["points"], v_normals_matrix=data["normals"])
        depth, scale, most_faces = int(data["depth"]), float(data["scale"]), int(data["most_faces"])
    meshes = pymeshlab.MeshSet(verbose=False)
    meshes.add_mesh(cloud)
    threads = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    meshes.generate_surface_reconstruction_screened_poisson(depth=depth, scale=scale, preclean=True, threads=threads)
    # Where nothing was measured, the surface may swell out of the volume that it is computed in.
    meshes.meshing_close_holes(maxholesize=meshes.current_mesh().edge_number(), selfintersection=False)
    if meshes.current_mesh().face_number() > most_faces:
        meshes.meshing_decimation_quadric_edge_collapse(
            targetfacenum=most_faces, preservenormal=True, planarquadric=True, preservetopology=True
        )
    surface = meshes.current_mesh()
    np.savez(made, vertices=surface.vertex_matrix(), faces=surface.face_matrix())


if __name__ == "__main__":
    _reconstruct(Path(sys.argv[1]), Path(sys.argv[2]))

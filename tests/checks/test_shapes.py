"""Analytic shapes as meshes: closed where they are, and wound outward."""

import numpy as np
import pytest

from lightdepth.checks.sampling import object_mesh
from lightdepth.scene.meshes.geometry import face_areas, is_closed
from lightdepth.scene.model import AnalyticShape, SyntheticObject, SyntheticPart


@pytest.mark.parametrize(
    ("kind", "volume", "area"),
    [("sphere", 4 / 3 * np.pi, 4 * np.pi), ("cube", 8.0, 24.0), ("cylinder", None, 2 * np.pi), ("disk", None, np.pi),
     ("rectangle", None, 4.0)],
)  # fmt: skip
def test_size_and_winding(kind, volume, area):
    for mirror in (1.0, -1.0):
        to_world = np.diag([mirror, 1.0, 1.0, 1.0])
        mesh = object_mesh(SyntheticObject("a", (SyntheticPart(AnalyticShape(kind, to_world), None),)))
        areas = face_areas(mesh.vertices, mesh.faces)
        assert (areas > 0.0).all()
        assert areas.sum() == pytest.approx(area, rel=3e-3)
        assert is_closed(mesh) == (volume is not None)
        a, b, c = (mesh.vertices[mesh.faces[:, corner]].astype(np.float64) for corner in range(3))
        outward = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0
        if volume is not None:
            assert outward.sum() == pytest.approx(volume, rel=3e-3)
        if kind in ("disk", "rectangle"):
            assert (np.cross(b - a, c - a)[:, 2] > 0.0).all()
        if kind == "cylinder":
            middle = (a + b + c) / 3.0 * [1.0, 1.0, 0.0]
            assert (np.einsum("ij,ij->i", middle, np.cross(b - a, c - a)) > 0.0).all()

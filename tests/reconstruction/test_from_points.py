"""Closed surfaces from point clouds of a room that is known exactly."""

import struct

import laspy
import numpy as np
import pye57
import pytest
import trimesh

from lightdepth.errors import InputError, InputWarning
from lightdepth.reconstruction.cleaning import smoothed, thinned, without_outliers
from lightdepth.reconstruction.coverage import measure_coverage
from lightdepth.reconstruction.from_points import surfaces_from_points
from lightdepth.reconstruction.point_cloud import PointCloud, read_points
from lightdepth.scene.model import Role
from tests.reconstruction.virtual_room import CAPTURE, distance_to_surface


def test_a_noisy_scan_gives_the_closed_room_within_two_centimetres(scan, pose):
    steps = []
    result = surfaces_from_points(PointCloud(scan), pose, cell=0.08, progress=lambda step, share: steps.append(step))
    floor, place = result.surfaces
    assert (floor.role, place.role) == (Role.SUPPORT, Role.ENVIRONMENT)
    meshes = [trimesh.Trimesh(s.mesh.vertices, s.mesh.faces, process=False) for s in result.surfaces]
    for mesh in meshes:
        samples = trimesh.sample.sample_surface(mesh, 20_000, seed=0)[0]
        assert np.median(distance_to_surface(samples)) < 0.01
    whole = trimesh.util.concatenate(meshes)
    whole.merge_vertices()
    assert whole.is_watertight
    assert whole.volume < -40.0  # Faces look inward.
    assert measure_coverage(result.surfaces, pose).open == 0.0
    # The floor goes on below the tripod, where nothing was measured.
    centres = meshes[0].triangles_center[:, :2] - CAPTURE[:2]
    assert np.linalg.norm(centres, axis=1).min() < 0.1
    assert np.abs(floor.mesh.vertices[:, 2]).max() < 0.01
    assert steps[0] == "Cleaning points"


def test_stray_points_go_and_noise_is_smoothed(scan):
    thin = thinned(PointCloud(scan), 0.02)
    clean = without_outliers(thin)
    assert np.percentile(distance_to_surface(scan), 99.7) > 0.1
    assert np.percentile(distance_to_surface(clean.points), 99.7) < 0.06
    assert len(clean.points) > 0.97 * len(thin.points)
    points, normals = smoothed(clean, CAPTURE)
    assert np.median(distance_to_surface(points)) < 0.35 * np.median(distance_to_surface(clean.points))
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-6)
    assert (np.einsum("ij,ij->i", normals, CAPTURE - points) > -0.05).all()


def test_what_the_file_tells_of_the_normals_counts():
    random = np.random.default_rng(1)
    points = np.column_stack([random.uniform(-1, 1, (2_000, 2)), np.zeros(2_000)])
    _, normals = smoothed(PointCloud(points, np.tile([0.1, 0.0, -1.0], (2_000, 1))), np.array([0.0, 0.0, 2.0]))
    np.testing.assert_allclose(normals, np.tile([0.0, 0.0, -1.0], (2_000, 1)), atol=1e-9)


def write_las(path, points, classes=0, system=None):
    las = laspy.create(point_format=6 if system else 0, file_version="1.4" if system else "1.2")
    if system is not None:
        las.header.vlrs.append(laspy.vlrs.known.WktCoordinateSystemVlr(system))
    las.header.scales, las.header.offsets = [1e-4] * 3, points.mean(axis=0)
    las.x, las.y, las.z = points.T
    las.classification[:] = classes
    las.write(str(path))


def write_e57(path, points):
    file = pye57.E57(str(path), mode="w")
    data = {f"cartesian{axis}": points[:, i] - CAPTURE[i] for i, axis in enumerate("XYZ")}
    file.write_scan_raw(data, rotation=np.array([1.0, 0.0, 0.0, 0.0]), translation=CAPTURE)
    file.close()


def write_text(path, points):
    rows = "\n".join(" ".join(f"{x:.5f}" for x in point) + " 128 7 9" for point in points)
    path.write_text(f"{len(points)}\n{rows}\n", encoding="utf-8")


WRITERS = {
    "cloud.ply": lambda path, points: trimesh.PointCloud(points).export(path),
    "cloud.las": write_las,
    "cloud.laz": write_las,
    "cloud.e57": write_e57,
    "cloud.xyz": write_text,
    "cloud.pts": write_text,
    "cloud.csv": lambda path, points: np.savetxt(path, points, delimiter=",", header="x,y,z", comments=""),
}


@pytest.mark.parametrize("name", WRITERS)
def test_every_format_is_read(name, tmp_path, scan):
    path = tmp_path / name
    WRITERS[name](path, scan[:500])
    cloud = read_points(path)
    np.testing.assert_allclose(cloud.points, scan[:500], atol=2e-4)
    if name.endswith("e57"):  # It tells where the scanner stood.
        np.testing.assert_allclose(cloud.toward_air, CAPTURE - scan[:500], atol=2e-4)


def test_a_table_of_too_many_chunks_is_refused(tmp_path, scan):
    """The library would take memory for all of them and end the process."""
    path = tmp_path / "cloud.laz"
    write_las(path, scan[:500])
    content = bytearray(path.read_bytes())
    (points_at,) = struct.unpack_from("<I", content, 96)
    (table,) = struct.unpack_from("<q", content, points_at)
    struct.pack_into("<I", content, table + 4, 2**32 - 2)
    path.write_bytes(content)
    with pytest.raises(InputError, match="its table claims 4294967294 chunks"):
        read_points(path)


def test_noise_and_units_of_las_files_are_heeded(tmp_path, scan):
    classes = np.where(np.arange(300) % 3 == 0, 7, 2)
    write_las(tmp_path / "noise.las", scan[:300], classes)
    with pytest.warns(InputWarning, match="100 points are marked as noise or withheld"):
        assert len(read_points(tmp_path / "noise.las").points) == 200
    feet = 'PROJCS["x",GEOGCS["y",UNIT["degree",0.0174532925]],UNIT["US survey foot",0.3048006096012192]]'
    write_las(tmp_path / "feet.las", scan[:300], system=feet)
    with pytest.warns(InputWarning, match=r"its unit is 0.304801 m, .*--scale 0.304801"):
        read_points(tmp_path / "feet.las")
    read_points(tmp_path / "feet.las", scale=0.3048)
    write_las(tmp_path / "degrees.las", scan[:300], system=feet[feet.index("GEOGCS") : feet.index(',UNIT["US')])
    with pytest.raises(InputError, match="its coordinates are degrees"):
        read_points(tmp_path / "degrees.las")


def test_normals_in_a_ply_file_are_read(tmp_path):
    rows = "\n".join(f"{i} {i % 7} 0 0 0 -1" for i in range(120))
    header = "\n".join(f"property float {name}" for name in ("x", "y", "z", "nx", "ny", "nz"))
    path = tmp_path / "normals.ply"
    path.write_text(f"ply\nformat ascii 1.0\nelement vertex 120\n{header}\nend_header\n{rows}\n", encoding="utf-8")
    np.testing.assert_array_equal(read_points(path).toward_air, np.tile([0.0, 0.0, -1.0], (120, 1)))


def test_units_axes_and_origin_are_brought_to_the_world(tmp_path, scan):
    feet = (scan[:200] @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])) / 0.3048 + [1000.0, 20.0, -5.0]  # y up
    np.savetxt(tmp_path / "feet.xyz", feet, fmt="%.6f")
    cloud = read_points(tmp_path / "feet.xyz", scale=0.3048, up="y", origin=(1000.0, 20.0, -5.0))
    np.testing.assert_allclose(cloud.points, scan[:200], atol=1e-5)


def test_wrong_files_are_explained(tmp_path, pose):
    (tmp_path / "few.xyz").write_text("1 2 3\n4 5 6\n", encoding="utf-8")
    (tmp_path / "words.xyz").write_text("a b c\n" * 200, encoding="utf-8")
    (tmp_path / "broken.las").write_bytes(b"LASF")
    (tmp_path / "broken.ply").write_bytes(b"ply\nformat")
    (tmp_path / "broken.e57").write_bytes(b"E57")
    (tmp_path / "cloud.pcd").touch()
    for name, message in (
        ("none.ply", "no such file"),
        ("few.xyz", "has 2 points"),
        ("words.xyz", "not a readable file of points: line 2 is 'a b c'"),
        ("broken.las", "not a readable .las"),
        ("broken.ply", "its header has no end"),
        ("broken.e57", "not a readable .e57"),
        ("cloud.pcd", "is not a format for points"),
    ):
        with pytest.raises(InputError, match=message):
            read_points(tmp_path / name)
    surveyed = PointCloud(np.random.default_rng(2).uniform(0, 8, (300, 3)) + [460_000.0, 5_427_000.0, 112.0])
    with pytest.raises(InputError, match=r"lie around 46000\d.\d,542700\d.\d,11\d.\d, .* --origin"):
        surfaces_from_points(surveyed, pose)
    far_apart = PointCloud(np.random.default_rng(2).uniform(-50, 50, (300, 3)))
    with pytest.raises(InputError, match=r"points are left|no floor found"):
        surfaces_from_points(far_apart, pose)

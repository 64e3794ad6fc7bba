"""Files of instances: where their meshes stand, and what is refused."""

import numpy as np
import pytest

from lightdepth.checks.sampling import object_mesh
from lightdepth.errors import InputError
from lightdepth.scene import load_scene

TABLE = '[[synthetic]]\nname = "tile"\nmesh = "floor.ply"\ninstances = "tiles.npy"\n'


def matrices(count=3):
    """Small tiles one above the other, the last one mirrored."""
    found = np.tile(np.diag([0.1, 0.1, 0.1, 1.0]), (count, 1, 1))
    found[:, 2, 3] = np.arange(count)
    found[-1, 0, 0] *= -1.0
    return found


@pytest.mark.parametrize("rows", [3, 4])
def test_instances_stand_where_the_file_and_the_table_say(write_scene, scene_folder, rows):
    np.save(scene_folder / "tiles.npy", matrices()[:, :rows].astype(np.float32))
    scene = load_scene(write_scene(TABLE + "position = [1.0, 0.0, 0.0]\nscale = 2.0\n"))
    first, mirrored = scene.synthetic[0].parts
    assert [len(part.places) for part in (first, mirrored)] == [2, 1]
    assert all((np.linalg.det(part.places[:, :3, :3]) > 0.0).all() for part in (first, mirrored))
    mesh = object_mesh(scene.synthetic[0])
    np.testing.assert_allclose(np.unique(mesh.vertices[:, 2]), [0.0, 2.0, 4.0])
    np.testing.assert_allclose([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)], [[0.4, -0.6, 0], [1.6, 0.6, 4]])
    corners = mesh.vertices[mesh.faces]
    up = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2]
    assert (up > 0.0).all()  # A mirrored mesh keeps its outside.


def refused(write_scene, text=TABLE):
    with pytest.raises(InputError) as caught:
        load_scene(write_scene(text))
    return str(caught.value)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda m: m.reshape(-1), "of shape (48,); instances are matrices of shape (n, 3, 4) or (n, 4, 4)"),
        (lambda m: m.astype(np.int64), "is an array of int64"),
        (lambda m: m[:0], "has 0 instances"),
        (lambda m: m * np.array([np.nan, 1.0, 1.0])[:, None, None], "1 of 3 instances are not finite; the first is 0"),
        (lambda m: m + np.diag([0, 0, 0, 1.0]), "no affine maps"),
        (lambda m: m * np.array([[1.0], [1.0], [0.0], [1.0]]), "3 of 3 instances are flat"),
        (lambda m: m + far(), "so far from the world's origin"),
    ],
)
def test_what_is_refused_says_why(write_scene, scene_folder, change, said):
    np.save(scene_folder / "tiles.npy", change(matrices()))
    message = refused(write_scene)
    assert said in message
    assert "tiles.npy" in message


def far():
    """Moves the second instance far out."""
    shift = np.zeros((3, 4, 4))
    shift[1, 0, 3] = 1e6
    return shift


def test_other_files_are_refused(write_scene, scene_folder):
    (scene_folder / "tiles.npy").write_bytes(b"\x93NUMPY\x01\x00v\x00{'descr': '<f4'")
    assert "not a readable .npy file" in refused(write_scene)
    with (scene_folder / "tiles.npy").open("wb") as file:
        np.savez(file, matrices())
    assert "an archive of arrays" in refused(write_scene)
    np.save(scene_folder / "tiles.npy", np.array([{"a": 1}], object), allow_pickle=True)
    assert "Python objects" in refused(write_scene)
    np.save(scene_folder / "tiles.npy", matrices())
    assert "instances stand where their file says" in refused(write_scene, TABLE + "at = [8, 6]\n")

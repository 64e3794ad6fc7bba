import pytest
import trimesh

from lightdepth.checks import Severity, find_problems
from lightdepth.scene.model import Mesh

from .rooms import HIGH, LOW, RealSurface, Role, box, room, scene, side, sphere, to_mesh


def errors(scene):
    return [p.message for p in find_problems(scene) if p.severity is Severity.ERROR]


def test_good_room_has_no_problems():
    assert find_problems(scene(synthetic=[sphere([0.5, 1.0, 0.3], 0.3)])) == []


@pytest.mark.parametrize("wound_outward", [False, True])
def test_winding_of_a_closed_room_does_not_matter(wound_outward):
    mesh = box(LOW, HIGH)
    mesh = mesh if wound_outward else Mesh(mesh.vertices, mesh.faces[:, ::-1])
    assert find_problems(scene([RealSurface("room", mesh, Role.ENVIRONMENT)])) == []


def test_capture_point_on_the_floor():
    (message,) = errors(scene(position=[0.3, 0.2, 0.005]))
    assert '"floor"' in message
    assert "5.0 mm" in message


def test_capture_point_inside_a_wall():
    inner, outer = trimesh.creation.box(bounds=[LOW, HIGH]), trimesh.creation.box(bounds=[LOW - 0.3, HIGH + 0.3])
    inner.invert()
    walls = RealSurface("thick walls", to_mesh(trimesh.util.concatenate([inner, outer])), Role.ENVIRONMENT)
    assert errors(scene([walls])) == []
    (message,) = errors(scene([walls], position=[LOW[0] - 0.15, 0.4, 1.3]))
    assert 'inside "thick walls"' in message
    assert "0.30 m" in message


def test_capture_point_inside_furniture():
    (message,) = errors(
        scene(
            [*room(), RealSurface("cabinet", box([0.6, 1, 0], [1.1, 2, 2]), Role.ENVIRONMENT)],
            position=[0.85, 1.5, 1.2],
        )
    )
    assert 'inside "cabinet"' in message


@pytest.mark.parametrize("position", [[6.0, 0.0, 1.3], [0.0, 0.0, -1.0], [0.0, -20.0, 5.0]])
@pytest.mark.parametrize("wound_outward", [False, True])
def test_capture_point_outside_the_room(position, wound_outward):
    mesh = box(LOW, HIGH)
    mesh = mesh if wound_outward else Mesh(mesh.vertices, mesh.faces[:, ::-1])
    (message,) = errors(scene([RealSurface("room", mesh, Role.ENVIRONMENT)], position=position))
    assert "outside the room" in message


def test_open_places_are_no_rooms():
    table = RealSurface("table", box([-0.5, 0.5, 0.0], [0.5, 1.2, 0.7]), Role.SUPPORT)
    for real in ([RealSurface("ground", side("floor"), Role.SUPPORT)], [table]):
        assert errors(scene(real, position=[0.0, -0.5, 1.6], sky=True)) == []

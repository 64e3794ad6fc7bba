"""Rooms whose sun is known, photographed by path tracing."""

from dataclasses import replace

import pytest
from bench.places import PLACES
from bench.places.barred_windows import BAR, HEIGHT, LEFT_EDGES, PANE_HEIGHT, PANE_WIDTH, SILL, X0, X1, Y1
from bench.places.meshes import join, rectangle

from lightdepth.images.radiance import write_radiance
from lightdepth.reconstruction.scene_file import write_meshes

WIDTH, SAMPLES = 256, 64


@pytest.fixture(scope="session")
def barred():
    return PLACES["barred_windows"]()


@pytest.fixture(scope="session")
def barred_scene(barred):
    return replace(barred.scene(WIDTH, SAMPLES), lights=())


@pytest.fixture(scope="session")
def without_bars(barred, barred_scene):
    """The same photograph with a model in which each window is one pane."""
    width, height = 2 * PANE_WIDTH + BAR, 2 * PANE_HEIGHT + BAR
    holes = [(x - X0, x - X0 + width, SILL, SILL + height) for x in LEFT_EDGES]
    meshes = {
        "window wall": rectangle((X0, Y1, 0.0), (X1 - X0, 0.0, 0.0), (0.0, 0.0, HEIGHT), holes),
        "panes": join([rectangle((x, Y1, SILL), (width, 0.0, 0.0), (0.0, 0.0, height)) for x in LEFT_EDGES]),
    }
    real = tuple(replace(surface, mesh=meshes.get(surface.name, surface.mesh)) for surface in barred_scene.real)
    return replace(barred_scene, real=real)


@pytest.fixture(scope="session")
def barred_folder(barred, barred_scene, tmp_path_factory):
    """The room as a user has it: a scene file with comments, a panorama and meshes."""
    folder = tmp_path_factory.mktemp("barred")
    write_radiance(folder / "pano.exr", barred_scene.panorama.radiance)
    write_meshes(barred_scene.real, folder / "meshes")
    lines = [
        "# the room with the bars",
        "[panorama]",
        'image = "pano.exr"',
        f"position = {list(barred.position)}  # by tape",
        f"rotation = {list(barred.rotation)}",
    ]
    for surface in barred_scene.real:
        lines += ["", "[[real]]", f'name = "{surface.name}"', f'mesh = "meshes/{surface.name}.ply"']
        lines += [f'role = "{surface.role.value}"', *(["opening = true"] if surface.opening else [])]
    (folder / "room.toml").write_text("\n".join(lines) + "\n")
    return folder

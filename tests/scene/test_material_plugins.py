"""Materials as Mitsuba sees them: energy, textures on shapes, and what it refuses."""

import numpy as np
import pytest

from lightdepth.errors import InputError
from lightdepth.scene import load_scene
from tests.scene.gltf_writer import png


@pytest.fixture
def shapes_of(mi, write_scene):
    """Shapes of a scene file's `[[synthetic]]` tables."""
    from lightdepth.kernel.shapes import synthetic_shapes

    def build(*tables):
        text = "\n".join(f'[[synthetic]]\nname = "thing {i}"\n{table}' for i, table in enumerate(tables))
        return [shape for _, shape in synthetic_shapes(load_scene(write_scene(text))).numbered]

    return build


KEEPS_ALL = [
    'type = "diffuse", color = 1',
    'type = "principled", base_color = 1, roughness = 0.05',
    'type = "principled", base_color = 1, roughness = 0.5',
    'type = "principled", base_color = 1, roughness = 1.0',
    'type = "principled", base_color = 1, metallic = 1, roughness = 0.6',
    'type = "principled", base_color = 1, roughness = 0.4, clearcoat = 1, clearcoat_roughness = 0.1',
    'type = "principled", base_color = 1, roughness = 0.3, opacity = 0.4',
    'type = "metal", name = "none"',
    'type = "glass", ior = 1.5',
    'type = "glass", thin = true',
]
LOSES = [
    'type = "metal", name = "Au", roughness = 0.3',
    'type = "glass", ior = 1.5, roughness = 0.4',
    'type = "principled", base_color = 1, roughness = 0.3, transmission = 1',
    'type = "principled", base_color = 1, roughness = 0.3, transmission = 0.5',
    'type = "principled", base_color = 1, roughness = 0.3, transmission = 1, thin = true',
    'type = "principled", base_color = 1, metallic = 0.5, roughness = 0.5',
    'mitsuba = { type = "roughplastic", alpha = 0.2 }',
]
SPHERE = 'shape = "sphere"\ncenter = [0, 0, 0]\nradius = 1\nmaterial = {{ {} }}'
OFFSETS = np.array([0.0, 0.5, 0.8, 0.95])


def furnace(shapes_of, material, samples):
    """Radiance of a sphere in a white environment, seen frontally and ever more slanted, and its standard error."""
    from tests.scene.tracing import radiance_and_error

    origins = np.stack([OFFSETS, 0 * OFFSETS, 0 * OFFSETS + 3], axis=1)
    return radiance_and_error(shapes_of(SPHERE.format(material)), origins, [0, 0, -1], samples=samples, depth=200)


@pytest.mark.parametrize("material", KEEPS_ALL)
def test_white_materials_vanish_in_a_white_furnace(shapes_of, material):
    found, error = furnace(shapes_of, material, 20000)
    assert (np.abs(found - 1.0) < 0.004 + 4.0 * error).all()
    assert error.max() < 0.01


@pytest.mark.parametrize("material", LOSES)
def test_no_material_makes_light(shapes_of, material):
    found, error = furnace(shapes_of, material, 10000)
    assert (found < 1.004 + 4.0 * error).all()
    assert error.max() < 0.02
    assert (found > 0.3).all()


def test_emitters_send_what_they_say(shapes_of):
    from tests.scene.tracing import radiance

    found = radiance(shapes_of(SPHERE.format('type = "emitter", radiance = [4, 2, 1]')), [0, 0, 3], [0, 0, -1])
    np.testing.assert_allclose(found, [[4, 2, 1]])


def test_an_image_stands_upright_on_a_shape(shapes_of, scene_folder):
    from tests.scene.tracing import radiance

    picture = [[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]]
    (scene_folder / "picture.png").write_bytes(png(np.repeat(np.repeat(picture, 8, axis=0), 8, axis=1)))
    shapes = shapes_of('shape = "rectangle"\nmaterial = { type = "diffuse", color = "picture.png" }')
    corners = np.array([[-0.5, 0.5, 2], [0.5, 0.5, 2], [-0.5, -0.5, 2], [0.5, -0.5, 2]])
    found = radiance(shapes, corners, [0, 0, -1], samples=4000)
    np.testing.assert_allclose(found, np.reshape(picture, (4, 3)) / 255, atol=0.01)


@pytest.mark.parametrize(
    ("material", "message"),
    [
        ('mitsuba = { type = "roughconductorx" }', 'Plugin "roughconductorx" not found'),
        ('mitsuba = { type = "roughconductor", alhpa = 0.1 }', 'unreferenced property .* "alhpa"'),
        ('mitsuba = { type = "diffuse", reflectance = [-1, 2, 3] }', r"must be in the range \[0, 1\]"),
        ('mitsuba = { type = "sphere" }', "'sphere' is not a BSDF"),
        ('mitsuba = { type = "blendbsdf" }', "blendbsdf needs a weight"),
        ('mitsuba = { alpha = 0.1 }', "every plugin needs a type"),
        ('mitsuba = { type = "diffuse", reflectance = { type = "bitmap", filename = "no.png" } }', "no.png: no "),
        ('type = "diffuse", color = "no.png"', "no.png: no such file"),
        ('type = "principled", roughness = "p.exr"', "an 8-bit image .* is needed here"),
        ('type = "principled", ior = 1.5, specular = 0.5', "give specular or ior, not both"),
    ],
)  # fmt: skip
def test_what_mitsuba_refuses_is_bad_input(shapes_of, material, message):
    with pytest.raises(InputError, match=message) as caught:
        shapes_of(SPHERE.format('type = "diffuse"'), SPHERE.format(material))
    assert '[[synthetic]] 2 ("thing 1"): material' in str(caught.value)
    assert "parser.cpp" not in str(caught.value)


def test_materials_and_textures_are_made_once(mi, write_scene, scene_folder):
    from lightdepth.kernel.shapes import synthetic_shapes

    (scene_folder / "picture.png").write_bytes(png([[[9, 9, 9]]]))
    table = '[[synthetic]]\nname = "{}"\nmesh = "two.obj"\nmaterial = {{ type = "diffuse", color = "picture.png" }}\n'
    (scene_folder / "two.mtl").write_text("newmtl a\nKd 1 1 1\nnewmtl b\nKd 1 1 1\n")
    (scene_folder / "two.obj").write_text(
        "mtllib two.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\nusemtl b\nf 3/1 2/1 1/1\n"
    )
    scene = load_scene(write_scene(table.format("x")))
    (first, a), (second, b) = synthetic_shapes(scene).numbered
    assert (first, second) == (0, 0)
    assert a.bsdf() == b.bsdf()

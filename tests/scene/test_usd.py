"""USD files, against closed forms; `tests/blender` compares with what Blender writes."""

import math

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from lightdepth.errors import InputError, InputWarning
from lightdepth.scene import load_scene
from lightdepth.scene.camera_file import read_camera
from lightdepth.scene.frames import SceneFrames
from lightdepth.scene.materials import Texture, VertexColors
from lightdepth.scene.meshes import AnimatedMesh, read_mesh_file
from tests.cli.room_folder import edit, make_room

pxr = pytest.importorskip("pxr", reason="of the extra usd")

HEAD = '#usda 1.0\n(\n    upAxis = "{axis}"\n    metersPerUnit = {unit}\n    timeCodesPerSecond = 24\n)\n'
QUAD = """
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (2, 0, 0), (2, 0, 1), (0, 0, 1)]
"""
CAGE = QUAD.replace('"none"', '"catmullClark"')
CORNERS = np.array([[0, 0, 0], [2, 0, 0], [2, 0, 1], [0, 0, 1]], float)


@pytest.fixture
def usd(tmp_path):
    def write(text, axis="Z", unit=1, name="thing.usda"):
        path = tmp_path / name
        path.write_text(HEAD.format(axis=axis, unit=unit) + text, errors="surrogateescape")
        return path

    return write


def only(parts):
    (part,) = parts
    return part


def test_transforms_move_with_the_time_line(usd):
    """A parent that turns and a child that travels, y up, in centimetres."""
    path = usd(
        f"""def Xform "turning" {{
    double xformOp:rotateY.timeSamples = {{ 10: 0, 34: 90 }}
    uniform token[] xformOpOrder = ["xformOp:rotateY"]
    def Mesh "quad" {{ {QUAD}
        double3 xformOp:translate.timeSamples = {{ 10: (0, 0, 0), 58: (200, 40, 0) }}
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}
}}""",
        axis="Y",
        unit=0.01,
    )
    moving = AnimatedMesh(path, with_materials=True)

    def expected(seconds):
        travelled = (CORNERS + np.array([100.0, 20.0, 0.0]) * min(seconds, 2.0)) * 0.01
        x, y, z = Rotation.from_euler("y", 90.0 * min(seconds, 1.0), degrees=True).apply(travelled).T
        return np.stack([x, -z, y], axis=1)

    for time in (0.0, 0.3, 0.5, 1.7, 2.0):
        found = only(moving.parts("timeline", time, False)).mesh
        np.testing.assert_allclose(found.vertices[found.faces].reshape(-1, 3)[:3], expected(time)[:3], atol=1e-7)
    held = only(moving.parts("timeline", 9.0, False)).mesh.vertices
    np.testing.assert_allclose(held, expected(2.0), atol=1e-7)
    looped = only(moving.parts("timeline", 2.5, True)).mesh.vertices
    np.testing.assert_allclose(looped, expected(0.5), atol=1e-7)
    with pytest.warns(InputWarning, match="its animation is left out; the pose is that of its first time code"):
        still = only(read_mesh_file(path, with_materials=True)).mesh.vertices
    np.testing.assert_allclose(still, expected(0.0), atol=1e-7)


SKINNED = """def SkelRoot "rig" {{
    double3 xformOp:translate = (5, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Skeleton "bones" (prepend apiSchemas = ["SkelBindingAPI"]) {{
        uniform token[] joints = ["root", "root/tip"]
        uniform matrix4d[] bindTransforms = [{one}, ((1,0,0,0),(0,1,0,0),(0,0,1,0),(1,0,0,1))]
        uniform matrix4d[] restTransforms = [{one}, ((1,0,0,0),(0,1,0,0),(0,0,1,0),(1,0,0,1))]
        rel skel:animationSource = <../move>
    }}
    def SkelAnimation "move" {{
        uniform token[] joints = ["root", "root/tip"]
        float3[] translations = [(0,0,0), (1,0,0)]
        quatf[] rotations.timeSamples = {{ 0: [(1,0,0,0), (1,0,0,0)], 24: [(1,0,0,0), ({c},0,{s},0)] }}
        half3[] scales = [(1,1,1), (1,1,1)]
        uniform token[] blendShapes = ["grow"]
        float[] blendShapeWeights.timeSamples = {{ 0: [0], 24: [0.5] }}
    }}
    def Mesh "skin" (prepend apiSchemas = ["SkelBindingAPI"]) {{ {quad}
        normal3f[] normals = [(0,-1,0), (0,-1,0), (1,0,0), (0,-1,0)] (interpolation = "vertex")
        rel skel:skeleton = <../bones>
        int[] primvars:skel:jointIndices = [0, 1, 1, 0] (elementSize = 1; interpolation = "vertex")
        float[] primvars:skel:jointWeights = [1, 1, 1, 1] (elementSize = 1; interpolation = "vertex")
        uniform token[] skel:blendShapes = ["grow"]
        rel skel:blendShapeTargets = <grow>
        def BlendShape "grow" {{
            uniform vector3f[] offsets = [(0, 0, 2)]
            uniform int[] pointIndices = [2]
        }}
    }}
}}"""
ONE = "((1,0,0,0),(0,1,0,0),(0,0,1,0),(0,0,0,1))"


def test_skeletons_and_blend_shapes_move_a_mesh(usd):
    """The tip, at x = 1, turns about y by 90 degrees in a second; a blend shape lifts a point before that."""
    half = math.radians(45.0)
    path = usd(SKINNED.format(quad=QUAD, one=ONE, c=math.cos(half), s=math.sin(half)))
    moving = AnimatedMesh(path, with_materials=True)
    for time, weight in ((0.0, 0.0), (0.5, 0.25), (1.0, 0.5)):
        mesh = only(moving.parts("timeline", time, False)).mesh
        shaped = CORNERS + weight * np.array([[0, 0, 0], [0, 0, 0], [0, 0, 2.0], [0, 0, 0]])
        turn = Rotation.from_euler("y", 90.0 * time, degrees=True)
        tip = np.array([1.0, 0, 0])
        turned = turn.apply(shaped - tip) + tip
        expected = np.where([[False], [True], [True], [False]], turned, shaped) + np.array([5.0, 0, 0])
        np.testing.assert_allclose(mesh.vertices, expected, atol=1e-6)
        np.testing.assert_allclose(mesh.normals[2], turn.apply([1.0, 0, 0]), atol=1e-6)
        np.testing.assert_allclose(mesh.normals[0], [0, -1, 0], atol=1e-6)


MATERIALS = """def Mesh "quad" (prepend apiSchemas = ["MaterialBindingAPI"]) {{ {quad}
    texCoord2f[] primvars:UVMap = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "faceVarying")
    rel material:binding = </painted>
}}
def Material "painted" {{
    token outputs:surface.connect = </painted/surface.outputs:surface>
    token inputs:set = "UVMap"
    def Shader "surface" {{
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </painted/image.outputs:rgb>
        float inputs:roughness.connect = </painted/image.outputs:g>
        float inputs:metallic = 0.25
        float inputs:ior = 2
        color3f inputs:emissiveColor = (3, 0, 1)
        normal3f inputs:normal.connect = </painted/normals.outputs:rgb>
        token outputs:surface
    }}
    def Shader "image" {{
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @colours.png@
        token inputs:sourceColorSpace = "sRGB"
        token inputs:wrapS = "mirror"
        token inputs:wrapT = "mirror"
        float4 inputs:scale = (0.5, 1, 1, 1)
        float2 inputs:st.connect = </painted/moved.outputs:result>
        float3 outputs:rgb
        float outputs:g
    }}
    def Shader "normals" {{
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @colours.png@
        token inputs:sourceColorSpace = "raw"
        float4 inputs:scale = (2, 2, 2, 1)
        float4 inputs:bias = (-1, -1, -1, 0)
        float2 inputs:st.connect = </painted/moved.outputs:result>
        float3 outputs:rgb
    }}
    def Shader "moved" {{
        uniform token info:id = "UsdTransform2d"
        float2 inputs:in.connect = </painted/reader.outputs:result>
        float2 inputs:scale = (2, 3)
        float2 inputs:translation = (0.25, 0.5)
        float2 outputs:result
    }}
    def Shader "reader" {{
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname.connect = </painted.inputs:set>
        float2 outputs:result
    }}
}}"""


def painted(usd, tmp_path):
    codes = np.array([[[255, 0, 128], [0, 255, 255]]], np.uint8)
    Image.fromarray(codes).save(tmp_path / "colours.png")
    return usd(MATERIALS.format(quad=QUAD)), codes


def test_preview_surfaces_become_principled(usd, tmp_path):
    path, codes = painted(usd, tmp_path)
    package = tmp_path / "packed.usdz"
    assert pxr.UsdUtils.CreateNewUsdzPackage(str(path), str(package))
    for file in (path, package):
        part = only(read_mesh_file(file, with_materials=True))
        material, base = part.material, part.material.base_color
        assert (material.metallic, material.ior, material.emission) == (0.25, 2.0, (3.0, 0.0, 1.0))
        linear = np.where(codes / 255 <= 0.04045, codes / 255 / 12.92, ((codes / 255 + 0.055) / 1.055) ** 2.4)
        np.testing.assert_allclose(base.pixels, linear * [0.5, 1, 1], atol=1e-3)
        np.testing.assert_allclose(material.roughness.pixels[..., 0], linear[..., 1], atol=1e-3)
        np.testing.assert_allclose(material.normal_map.pixels, codes / 255, atol=1e-3)
        assert base.wrap == "mirror"
        # u and v of the file, v upward, become 2 u + 1/4 and 3 v + 1/2; those of `to_uv` have v downward.
        u, v = part.mesh.texture_coordinates[2]
        across, down, _ = base.to_uv @ [u, 1.0 - v, 1.0]
        assert (across, 1.0 - down) == pytest.approx((2.25, 3.5))


def test_faces_have_the_materials_of_their_subsets(usd):
    text = """def Mesh "two" (prepend apiSchemas = ["MaterialBindingAPI"]) {
    uniform token subdivisionScheme = "none"
    uniform token orientation = "leftHanded"
    int[] faceVertexCounts = [3, 3]
    int[] faceVertexIndices = [0, 1, 2, 0, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1)]
    color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)] (interpolation = "uniform")
    uniform token subsetFamily:materialBind:familyType = "nonOverlapping"
    def GeomSubset "second" (prepend apiSchemas = ["MaterialBindingAPI"]) {
        uniform token elementType = "face"
        uniform token familyName = "materialBind"
        int[] indices = [1]
        rel material:binding = </metal>
    }
}
def Material "metal" {
    token outputs:surface.connect = </metal/surface.outputs:surface>
    def Shader "surface" {
        uniform token info:id = "UsdPreviewSurface"
        float inputs:metallic = 1
        float inputs:opacity = 0.5
        float inputs:opacityThreshold = 0.4
        token outputs:surface
    }
}"""
    metal, coloured = read_mesh_file(usd(text), with_materials=True)
    assert (metal.material.metallic, metal.material.opacity) == (1.0, 1.0)
    assert metal.material.base_color == pytest.approx((0.18,) * 3)
    assert isinstance(coloured.material.base_color, VertexColors)
    np.testing.assert_array_equal(coloured.mesh.colors, [[1, 0, 0]] * 3)
    for part, corner in ((coloured, [1, 0, 0]), (metal, [0, 0, 1])):
        a, b, c = part.mesh.vertices[part.mesh.faces[0]]
        assert np.cross(b - a, c - a)[1] > 0.0  # Left-handed: it faces the other way.
        assert corner in part.mesh.vertices.tolist()


def test_instances_are_where_their_instancer_puts_them(usd):
    path = usd(
        f"""def PointInstancer "many" {{
    double3 xformOp:translate = (0, 10, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    rel prototypes = </shape/quad>
    int[] protoIndices = [0, 0]
    point3f[] positions = [(1, 0, 0), (-4, 0, 2)]
}}
class "shape" {{
    def Mesh "quad" {{ {QUAD} }}
}}
def Mesh "nothing" {{
}}
def Scope "unseen" {{
    token visibility = "invisible"
    def Mesh "quad" {{ {QUAD} }}
}}"""
    )
    for with_materials in (True, False):
        found = [part.mesh.vertices for part in read_mesh_file(path, with_materials)]
        np.testing.assert_allclose(found, [CORNERS + [1, 10, 0], CORNERS + [-4, 10, 2]])


def test_a_camera_of_a_file_is_the_scenes(usd, tmp_path):
    path = usd(
        """def Camera "shot" {
    float focalLength = 20
    float horizontalAperture = 40
    float verticalAperture = 20
    double3 xformOp:translate.timeSamples = { 0: (0, 1.5, 0), 24: (1, 1.5, 0) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
}""",
        axis="Y",
    )
    scene = make_room(tmp_path)
    edit(scene, "[panorama]", "[sequence]\nframes = [1, 25]\n\n[panorama]")
    edit(
        scene, '[camera.view]\ntype = "perspective"\nwidth = 16\nheight = 9',
        f'[camera.view]\nfile = "{path.name}"\nanimation = "timeline"\nwidth = 16',
    )  # fmt: skip
    view = SceneFrames(scene).scene(13).cameras["view"]
    np.testing.assert_allclose(view.position, [0.5, 0.0, 1.5], atol=1e-6)
    np.testing.assert_allclose(view.rotation, np.eye(3), atol=1e-6)  # It looks along -z, which is our y.
    assert (view.camera.fov, view.camera.height) == (pytest.approx(90.0), 8)
    with pytest.raises(InputError, match=r"has no camera 'other'; it has '/shot'"):
        read_camera(path, "other", None, 0.0, False)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("not a layer {", "is not a readable USD file: line 7"),
        ("def \udcff", "is not a readable USD file"),
        ('def Sphere "ball" {}', "/ball is a Sphere; only meshes are read"),
        ('def "x" (references = @nowhere.usda@) {}', "refers to the layer .*nowhere.usda, which does not exist"),
        (f'def Mesh "quad" {{ {QUAD.replace("2, 3]", "2, 9]")} }}', "/quad: a face names point 9, but there are 4"),
        (f'def Mesh "quad" {{ {QUAD.replace("[4]", "[3]")} }}', "/quad: its faceVertexCounts add up to 3"),
        (
            f'def Mesh "quad" {{ {QUAD}texCoord2f[] primvars:st = [(0, 0)] (interpolation = "vertex")\n}}',
            "/quad: primvars:st has 1 values, but its interpolation, vertex, needs 4",
        ),
        (MATERIALS.format(quad=QUAD), "refers to the image colours.png, which does not exist"),
    ],
)
def test_what_is_wrong_is_said_with_its_place(usd, text, words):
    with pytest.raises(InputError, match=words):
        read_mesh_file(usd(text), with_materials=True)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('def BasisCurves "hair" {}', "points, curves and volumes are left out, the first is /hair"),
        ('def SphereLight "lamp" {}', "its lights are left out, the first is /lamp"),
        (
            f'def Mesh "panel" (prepend apiSchemas = ["MeshLightAPI"]) {{ {QUAD} }}',
            "its lights are left out, the first is /panel",
        ),
        (f'def Mesh "cage" {{ {CAGE} }}', "/cage is a subdivision surface"),
    ],
)
def test_what_is_left_out_is_named(usd, text, words):
    with pytest.warns(InputWarning, match=words):
        read_mesh_file(usd(f'{text}\ndef Mesh "quad" {{ {QUAD} }}'), with_materials=True)


def test_an_animation_that_is_not_there_is_named(usd):
    moving = AnimatedMesh(usd(f'def Mesh "quad" {{ {QUAD} }}'), with_materials=True)
    for name, words in (
        ("Walk", "one, its time line, which is called 'timeline'"),
        ("timeline", "nothing in it changes"),
    ):
        with pytest.raises(InputError, match=words):
            moving.parts(name, 0.0, False)


def test_an_object_of_a_scene_moves(usd, tmp_path):
    usd(
        f"""def Mesh "quad" {{ {QUAD}
    double3 xformOp:translate.timeSamples = {{ 0: (0, 0, 0), 24: (0, 0, 1) }}
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}"""
    )
    scene = make_room(tmp_path)
    edit(scene, "[panorama]", "[sequence]\nframes = [1, 25]\n\n[panorama]")
    edit(
        scene, 'shape = "sphere"\ncenter = [0.5, 1.0, 0.3]\nradius = 0.3', 'mesh = "thing.usda"\nanimation = "timeline"'
    )
    for frame, height in ((1, 0.0), (13, 0.5), (25, 1.0)):
        geometry = load_scene(scene, frame=frame).synthetic[0].parts[0].geometry
        np.testing.assert_allclose(geometry.vertices, CORNERS + [0, 0, height], atol=1e-6)
    assert not isinstance(load_scene(scene).synthetic[0].parts[0].material, Texture)
